"""What leaves the autopilot is finite, within full stick, in order."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.autopilot.follower import Sticks
from services.autopilot.guard import Guard

anything = st.floats(allow_nan=True, allow_infinity=True)


@given(
    st.lists(st.tuples(anything, anything, anything, anything, st.integers(0, 2**62)), max_size=9)
)
def test_whatever_comes_in_what_goes_out_is_a_command_in_order(rows):
    guard = Guard()
    stamps = []
    for *axes, stamp in rows:
        command = guard.command(Sticks(*axes), "fly", "engaged", stamp)
        stamps.append(command.stamp)
        out = (command.vx, command.vy, command.vz, command.wz)
        assert all(abs(axis) <= 1.0 for axis in out)
        if all(map(math.isfinite, axes)):
            assert out == tuple(max(-1.0, min(1.0, axis)) for axis in axes)
        else:
            assert out == (0.0, 0.0, 0.0, 0.0)
    assert stamps == sorted(stamps)


def test_a_good_command_is_not_touched_and_a_repair_is_counted():
    guard = Guard()
    command = guard.command(Sticks(0.1, -0.2, 0.3, -1.0), "fly", "manual", 5)
    assert (command.vx, command.vy, command.vz, command.wz) == (0.1, -0.2, 0.3, -1.0)
    assert guard.repaired == 0
    guard.command(Sticks(1.5, 0.0, 0.0, 0.0), "fly", "manual", 6)
    guard.command(Sticks(0.0, 0.0, 0.0, 0.0), "fly", "manual", 4)
    assert guard.repaired == 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_half_a_command_is_no_command(bad):
    command = Guard().command(Sticks(0.5, bad, 0.5, 0.5), "land", "hover", 0)
    assert (command.vx, command.vy, command.vz, command.wz) == (0.0, 0.0, 0.0, 0.0)
    assert command.action == "land"
