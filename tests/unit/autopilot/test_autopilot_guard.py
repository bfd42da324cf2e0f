"""What leaves the autopilot is finite, within full stick, in order, and from a live sender."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.messages import Command, FlightMode
from services.autopilot.control import Sticks
from services.autopilot.guard import Guard

SLEW_PS = 5.0
anything = st.floats(allow_nan=True, allow_infinity=True)


def axes_of(command: Command) -> tuple[float, float, float, float]:
    return command.vx, command.vy, command.vz, command.wz


def sent(
    guard: Guard,
    *axes: float,
    mode: FlightMode = "manual",
    stamp: int = 0,
    now_s: float = 0.0,
    live: bool = True,
) -> Command:
    return guard.command(Sticks(*axes), "fly", mode, stamp, now_ns=round(now_s * 1e9), live=live)


@given(
    st.lists(st.tuples(anything, anything, anything, anything, st.integers(0, 2**62)), max_size=9),
    st.sampled_from(["manual", "engaged", "hover"]),
)
def test_whatever_comes_in_what_goes_out_is_a_command_in_order(rows, mode):
    guard = Guard(SLEW_PS)
    stamps = []
    for *axes, stamp in rows:
        command = sent(guard, *axes, mode=mode, stamp=stamp)
        stamps.append(command.stamp)
        out = axes_of(command)
        assert all(abs(axis) <= 1.0 for axis in out)
        if not all(map(math.isfinite, axes)):
            assert out == (0.0, 0.0, 0.0, 0.0)
        elif mode == "manual":
            assert out == tuple(max(-1.0, min(1.0, axis)) for axis in axes)
    assert stamps == sorted(stamps)


def test_a_good_command_is_not_touched_and_a_repair_is_counted():
    guard = Guard(SLEW_PS)
    command = sent(guard, 0.1, -0.2, 0.3, -1.0, stamp=5)
    assert axes_of(command) == (0.1, -0.2, 0.3, -1.0)
    assert guard.repaired == 0
    sent(guard, 1.5, 0.0, 0.0, 0.0, stamp=6)
    sent(guard, 0.0, 0.0, 0.0, 0.0, stamp=4)
    assert guard.repaired == 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_half_a_command_is_no_command(bad):
    command = Guard(SLEW_PS).command(
        Sticks(0.5, bad, 0.5, 0.5), "land", "hover", 0, now_ns=0, live=True
    )
    assert axes_of(command) == (0.0, 0.0, 0.0, 0.0)
    assert command.action == "land"


@pytest.mark.parametrize("mode", ["manual", "engaged", "hover"])
def test_without_a_live_sender_nothing_moves(mode):
    guard = Guard(SLEW_PS)
    sent(guard, 0.5, 0.5, 0.5, 0.5, mode=mode)
    command = sent(guard, 0.5, 0.5, 0.5, 0.5, mode=mode, now_s=0.02, live=False)
    assert axes_of(command) == (0.0, 0.0, 0.0, 0.0)
    assert guard.repaired == 1


@given(st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 4), min_size=2, max_size=20))
def test_the_autopilots_own_sticks_move_gradually(rows):
    guard = Guard(SLEW_PS)
    commands = [
        sent(guard, *axes, mode="engaged", now_s=0.02 * tick) for tick, axes in enumerate(rows)
    ]
    for before, after in pairwise(commands[1:]):
        if any(axes_of(after)):
            steps = [abs(b - a) for a, b in zip(axes_of(before), axes_of(after), strict=True)]
            assert max(steps) <= SLEW_PS * 0.02 + 1e-9


def test_the_humans_sticks_and_a_return_to_neutral_are_not_slowed():
    guard = Guard(SLEW_PS)
    for tick in range(20):
        sent(guard, 1.0, 1.0, 0.0, 0.0, mode="engaged", now_s=0.02 * tick)
    taken_over = sent(guard, -1.0, 0.0, 1.0, -1.0, mode="manual", now_s=0.381)
    assert axes_of(taken_over) == (-1.0, 0.0, 1.0, -1.0)
    stopped = sent(guard, 0.0, 0.0, 0.0, 0.0, mode="hover", now_s=0.382)
    assert axes_of(stopped) == (0.0, 0.0, 0.0, 0.0)
