"""Simulated time follows the clock, catches up small lags, gives up long ones."""

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
    assert pace.slipped_ns == 0


def test_a_long_lag_is_given_up() -> None:
    pace = Pace(0)
    assert pace.due(3 * NS_PER_S) == 0
    assert pace.slipped_ns == 3 * NS_PER_S
    assert pace.due(3 * NS_PER_S + 15 * MS) == 3
    assert pace.real_time_factor < 0.01
