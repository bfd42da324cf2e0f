"""Simulated time follows the clock, catches up what it lost, and gives up only the longest lag."""

from common.clock import NS_PER_S
from services.sim.core import PHYSICS_HZ
from services.sim.pace import Pace

MS = 1_000_000


def test_steps_keep_up_with_the_clock_exactly() -> None:
    pace = Pace(17)
    steps = sum(pace.due(17 + tick * 5 * MS) for tick in range(1, 2001))
    assert steps == 10 * PHYSICS_HZ
    assert abs(pace.real_time_factor - 1.0) < 1e-3


def test_a_small_lag_is_caught_up_at_once() -> None:
    pace = Pace(0)
    assert pace.due(400 * MS) == 0.4 * PHYSICS_HZ


def test_a_longer_lag_is_caught_up_by_a_tenth() -> None:
    pace = Pace(0)
    assert pace.due(3 * NS_PER_S) == 0
    begin_ns = 3 * NS_PER_S
    steps = [pace.due(begin_ns + tick * 5 * MS) for tick in range(1, 35 * PHYSICS_HZ + 1)]
    assert max(steps) == 2
    assert sum(steps[: 10 * PHYSICS_HZ]) == 11 * PHYSICS_HZ
    # Then stamps are those of the clock again, and stay so.
    assert sum(steps[: 32 * PHYSICS_HZ]) == 35 * PHYSICS_HZ
    assert sum(steps) == 38 * PHYSICS_HZ


def test_the_longest_lag_is_given_up() -> None:
    pace = Pace(0)
    assert pace.due(3600 * NS_PER_S) == 0
    steps = sum(pace.due(3600 * NS_PER_S + tick * 5 * MS) for tick in range(1, PHYSICS_HZ + 1))
    assert steps == PHYSICS_HZ
    assert pace.real_time_factor == 1.0
