"""A simulated person's thumbs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.sticks import DEAD_BAND
from services.operator.hands import RESOLUTION, Hands
from services.operator.sources import NEUTRAL, Deflection

STEP_S = 0.02

axis = st.floats(-1.0, 1.0)
wanted = st.one_of(st.none(), st.builds(Deflection, axis, axis, axis, axis))


def hands(seed: int = 1, tremor: float = 0.015) -> Hands:
    return Hands(tremor, np.random.default_rng(seed))


@given(st.lists(wanted, max_size=60), st.integers(0, 99))
def test_sticks_stay_in_range_and_on_the_steps_of_a_stick(
    wishes: list[Deflection | None], seed: int
) -> None:
    thumbs = hands(seed, 0.1)
    for wish in wishes:
        sticks = thumbs.step(wish, STEP_S)
        for value in (sticks.vx, sticks.vy, sticks.vz, sticks.wz):
            assert -1.0 <= value <= 1.0
            assert value / RESOLUTION == pytest.approx(round(value / RESOLUTION), abs=1e-9)
            assert value == 0.0 or abs(value) > DEAD_BAND


@given(st.lists(wanted, max_size=60), st.integers(0, 99))
def test_sticks_that_are_let_go_are_neutral_within_a_tenth_of_a_second(
    wishes: list[Deflection | None], seed: int
) -> None:
    thumbs = hands(seed)
    for wish in wishes:
        thumbs.step(wish, STEP_S)
    for _ in range(5):
        sticks = thumbs.step(None, STEP_S)
    assert sticks == NEUTRAL


def test_a_held_stick_is_steady_but_not_dead() -> None:
    thumbs = hands()
    values = [thumbs.step(Deflection(vx=0.85, wz=0.2), STEP_S).vx for _ in range(500)][50:]
    assert np.mean(values) == pytest.approx(0.85, abs=0.01)
    assert 0.005 < np.std(values) < 0.03


def test_a_wish_that_hardly_changes_does_not_move_a_thumb() -> None:
    thumbs = hands(tremor=0.0)
    for _ in range(100):
        thumbs.step(Deflection(vx=0.8), STEP_S)
    before = thumbs.step(Deflection(vx=0.8), STEP_S)
    for _ in range(100):
        after = thumbs.step(Deflection(vx=0.815), STEP_S)
    assert before == after


def test_the_same_seed_is_the_same_hand() -> None:
    one, two, other = hands(5), hands(5), hands(6)
    wish = Deflection(0.5, 0.1, 0.2, -0.4)
    assert [one.step(wish, STEP_S) for _ in range(99)] == [
        two.step(wish, STEP_S) for _ in range(99)
    ]
    assert one.step(wish, STEP_S) != other.step(wish, STEP_S)
