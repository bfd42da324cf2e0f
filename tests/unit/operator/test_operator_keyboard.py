"""Keys as sticks."""

import pygame
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.config import ConfigError
from services.operator import keyboard
from services.operator.keyboard import AXES, DECISIONS, FULL, Keyboard, Keys
from services.operator.sources import NEUTRAL

keys = st.sets(st.sampled_from([*AXES, *DECISIONS, "q", "space"]))


def test_a_held_key_deflects_its_axis_more_and_more() -> None:
    board = Keys()
    deflections = [board.step({"w"}, 0.02).sticks.vx for _ in range(30)]
    assert deflections == sorted(deflections)
    assert 0.05 < deflections[0] < 0.2
    assert deflections[-1] == FULL


def test_a_key_ends_a_primitive() -> None:
    board = Keys()
    assert board.step({"w", "e"}, 0.02).buttons == ("end",)
    assert board.step({"w"}, 0.02).buttons == ()


def test_opposite_keys_cancel_and_turning_round_starts_from_neutral() -> None:
    board = Keys()
    for _ in range(20):
        board.step({"left"}, 0.02)
    assert board.step({"left", "right"}, 0.02).sticks == NEUTRAL
    for _ in range(20):
        board.step({"left"}, 0.02)
    assert -0.2 < board.step({"right"}, 0.02).sticks.wz < 0.0


@given(st.lists(keys, max_size=20), keys)
def test_released_keys_are_neutral_at_once(before: list[set[str]], last: set[str]) -> None:
    board = Keys()
    for held in before:
        board.step(held, 0.02)
    sticks = board.step(last - AXES.keys(), 0.02).sticks
    assert sticks == NEUTRAL


@pytest.mark.parametrize("driver", ["dummy", "offscreen"])
def test_without_a_screen_the_keyboard_is_refused_in_one_line(
    driver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    with pytest.raises(ConfigError) as caught:
        Keyboard()
    assert "needs a screen" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_window_takes_keys_until_they_are_released_or_it_loses_the_focus(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # SDL's dummy driver opens a window that nobody sees; its events are posted by hand.
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(keyboard, "NO_SCREEN", set())
    window = Keyboard()
    try:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_w))
        assert window.poll(0.1).sticks.vx > 0.3
        assert window.poll(0.1).sticks.vx > 0.7
        pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_w))
        assert window.poll(0.1).sticks == NEUTRAL
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT))
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_RETURN))
        reading = window.poll(0.1)
        assert reading.sticks.wz > 0.3
        assert reading.decisions == {"accept"}
        pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
        assert window.poll(0.1).sticks == NEUTRAL
    finally:
        window.close()
