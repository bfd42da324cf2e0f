"""Keys as sticks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.config import ConfigError
from services.operator.keyboard import AXES, DECISIONS, FULL, Keyboard, Keys
from services.operator.sources import NEUTRAL

keys = st.sets(st.sampled_from([*AXES, *DECISIONS, "q", "space"]))


def test_a_held_key_deflects_its_axis_more_and_more() -> None:
    board = Keys()
    deflections = [board.step({"w"}, 0.02).sticks.vx for _ in range(30)]
    assert deflections == sorted(deflections)
    assert 0.05 < deflections[0] < 0.2
    assert deflections[-1] == FULL


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
