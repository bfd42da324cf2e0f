"""The docs show the state machine that flies."""

from pathlib import Path

import pytest

from services.autopilot.arbitration import MODES, Event
from services.autopilot.diagram import markdown, put_into

PAGE = Path(__file__).parents[3] / "docs" / "autopilot.md"


def test_the_page_shows_the_code():
    text = PAGE.read_text()
    assert put_into(text) == text, "run `make docs`"


def test_every_mode_and_event_is_shown():
    shown = markdown()
    assert all(f"`{event.value}`" in shown for event in Event)
    assert all(f" {mode} -->" in shown for mode in MODES)
    assert "engaged --> manual: stick, cancelled" in shown


def test_a_page_without_marks_is_refused():
    with pytest.raises(ValueError, match="lacks"):
        put_into("nothing")
