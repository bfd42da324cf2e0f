import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.messages import Stick
from services.classifier.window import (
    WINDOW_S,
    WINDOW_SAMPLES,
    Motion,
    StickWindow,
    at_rate,
    newest_motion,
)

STEP_NS = 20_000_000
axis = st.floats(-1.0, 1.0)


def stick(stamp_ns: int, vx: float = 0.0, vy: float = 0.0, vz: float = 0.0, wz: float = 0.0):
    return Stick(stamp=stamp_ns, seq=0, vx=vx, vy=vy, vz=vz, wz=wz)


def push(window: StickWindow, start_ns: int, count: int, step_ns: int = STEP_NS, **axes) -> int:
    """Add `count` equal sticks; the stamp that the next one would have."""
    for tick in range(count):
        window.add(stick(start_ns + tick * step_ns, **axes))
    return start_ns + count * step_ns


def motion_of(window: StickWindow) -> Motion:
    motion = window.motion()
    assert motion is not None
    return motion


def test_a_motion_begins_with_its_first_push() -> None:
    window = StickWindow()
    now = push(window, 0, 50)
    assert window.motion() is None
    push(window, now, 30, vx=0.5)
    assert motion_of(window).start_ns == now
    assert len(motion_of(window).sticks) == 30


def test_a_short_pause_is_a_hesitation_and_a_long_one_ends_the_motion() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    now = push(window, now, 10)
    now = push(window, now, 20, vx=0.5)
    assert motion_of(window).start_ns == 0
    now = push(window, now, 16)
    assert window.motion() is None
    push(window, now, 20, vy=0.5)
    assert motion_of(window).start_ns == now


def test_neutral_sticks_at_the_end_are_no_part_of_the_shape() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    push(window, now, 5)
    assert motion_of(window).end_ns == now - STEP_NS


def test_turning_on_the_spot_is_rest() -> None:
    window = StickWindow()
    push(window, 0, 100, wz=1.0)
    assert window.motion() is None


@pytest.mark.parametrize("rate_hz", [20, 50, 100, 300])
def test_the_window_is_as_long_at_every_rate(rate_hz: int) -> None:
    window = StickWindow()
    push(window, 0, round(WINDOW_S + 2) * rate_hz, 1_000_000_000 // rate_hz, vx=0.5)
    motion = motion_of(window)
    assert motion.sticks.shape == (WINDOW_SAMPLES, 4)
    assert motion.sticks.dtype == np.float32
    assert (motion.end_ns - motion.start_ns) / 1e9 == pytest.approx(WINDOW_S, abs=0.021)
    assert motion.sources == pytest.approx(WINDOW_S * rate_hz, abs=rate_hz * 0.02 + 1)


def test_a_gap_begins_a_new_motion() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    now += 250_000_000
    push(window, now, 10, vx=0.5)
    assert motion_of(window).start_ns == now


def test_a_few_lost_sticks_change_nothing() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5) + 3 * STEP_NS
    push(window, now, 10, vx=0.5)
    assert motion_of(window).start_ns == 0


def test_late_and_doubled_sticks_are_left_out() -> None:
    window = StickWindow()
    push(window, 0, 50, vx=0.5)
    window.add(stick(49 * STEP_NS, vx=-1.0))
    window.add(stick(45 * STEP_NS, vx=-1.0))
    assert (motion_of(window).sticks[:, 0] == 0.5).all()
    assert len(motion_of(window).sticks) == 50


def test_a_clock_set_back_begins_anew_once_a_second_stick_says_so() -> None:
    window = StickWindow()
    push(window, 10**15, 50, vx=0.5)
    push(window, 10**9, 10, vy=0.5)
    assert motion_of(window).start_ns == 10**9 + STEP_NS
    assert window.newest_ns == 10**9 + 9 * STEP_NS


def test_one_straggler_from_long_ago_ends_no_motion() -> None:
    window = StickWindow()
    now = push(window, 10**15, 50, vx=0.5)
    assert not window.add(stick(10**15 - 10**9, vx=0.5))
    push(window, now, 10, vx=0.5)
    assert not window.add(stick(10**15 - 10**8, vx=0.5)), "another, 0.9 s after the first"
    assert motion_of(window).start_ns == 10**15
    assert len(motion_of(window).sticks) == 60


def test_a_clock_set_on_by_an_hour_and_back_begins_anew_twice() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    push(window, now + 3600 * 10**9, 5, vx=0.5)
    assert motion_of(window).start_ns == now + 3600 * 10**9
    push(window, now, 30, vx=0.5)
    assert motion_of(window).start_ns == now + STEP_NS


def test_a_long_motion_goes_on_and_on() -> None:
    """A minute: the rows of long ago make room, and time stays right."""
    window = StickWindow()
    for tick in range(3000):
        window.add(stick(tick * STEP_NS, vx=0.5 + 0.1 * math.sin(0.01 * tick)))
        motion = motion_of(window)
        assert motion.end_ns == tick * STEP_NS
        assert motion.start_ns == max(0, tick - WINDOW_SAMPLES + 1) * STEP_NS
        assert motion.sources == len(motion.sticks) == min(tick + 1, WINDOW_SAMPLES)
    wanted = 0.5 + 0.1 * np.sin(0.01 * np.arange(3000 - WINDOW_SAMPLES, 3000))
    assert motion.sticks[:, 0] == pytest.approx(wanted, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(-400_000_000, 400_000_000), axis, axis, axis, axis), max_size=150
    )
)
def test_whatever_comes_the_window_is_finite_and_no_longer_than_it_may_be(rows: list) -> None:
    window = StickWindow()
    now = 10**12
    for step_ns, vx, vy, vz, wz in rows:
        now += step_ns
        window.add(stick(now, vx, vy, vz, wz))
        motion = window.motion()
        if motion is not None:
            assert 0 <= motion.end_ns - motion.start_ns <= WINDOW_S * 1e9
            assert 1 <= len(motion.sticks) <= WINDOW_SAMPLES
            assert 1 <= motion.sources <= len(rows)
            assert (np.abs(motion.sticks) <= 1.0).all()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(1_000, 200_000), st.floats(0.06, 1.0), axis, axis, axis),
        min_size=1,
        max_size=400,
    )
)
def test_row_by_row_gives_what_the_whole_at_once_gives(rows: list) -> None:
    """Training resamples whole recordings, flight each stick as it comes.

    Steps are of whole microseconds, since to `at_rate` what is 20 ns early is in time.
    """
    window = StickWindow()
    stamps_ns = 10**18 + np.cumsum([1_000 * row[0] for row in rows])
    sticks = np.array([row[1:] for row in rows])
    for stamp_ns, row in zip(stamps_ns.tolist(), sticks.tolist(), strict=True):
        window.add(stick(stamp_ns, *row))
    wanted = at_rate((stamps_ns - stamps_ns[0]) / 1e9, sticks)[-WINDOW_SAMPLES:]
    motion = motion_of(window)
    assert motion.sticks == pytest.approx(wanted, abs=1e-5)
    assert motion.end_ns == stamps_ns[-1]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=300))
def test_the_newest_motion_of_a_recording_is_that_of_the_window(pushes: list[bool]) -> None:
    window = StickWindow()
    newest = None
    for tick, pushed in enumerate(pushes):
        window.add(stick(tick * STEP_NS, vx=0.5 * pushed))
        newest = window.motion() or newest
    span = newest_motion(np.outer(pushes, [0.5, 0.0, 0.0]), 50.0)
    if newest is None:
        assert span.start == span.stop
    else:
        assert newest.end_ns == (span.stop - 1) * STEP_NS
        assert newest.start_ns == max(span.start, span.stop - WINDOW_SAMPLES) * STEP_NS


@pytest.mark.parametrize("rate_hz", [20.0, 33.3, 50.0, 100.0])
def test_the_model_sees_the_same_shape_at_every_rate(rate_hz: float) -> None:
    times_s = np.arange(0.0, 3.0 + 1e-9, 1.0 / rate_hz)
    sticks = np.stack(
        [np.cos(times_s), np.sin(times_s), 0.2 * times_s, np.zeros_like(times_s)], axis=1
    )
    seen = at_rate(times_s, sticks)
    assert len(seen) == pytest.approx(3.0 * 50.0 + 1, abs=2)
    grid_s = np.arange(len(seen)) / 50.0
    # Between samples 1/20 s apart a chord leaves the circle by 0.3 %.
    assert seen[:, 0] == pytest.approx(np.cos(grid_s), abs=2e-3)
    assert seen[:, 2] == pytest.approx(0.2 * grid_s, abs=1e-5)


def test_resampling_keeps_the_first_sample() -> None:
    times_s = np.array([0.0, 0.013, 0.041, 0.0555])
    values = np.array([[7.0], [1.0], [2.0], [3.0]])
    assert at_rate(times_s, values)[0, 0] == 7.0
    assert len(at_rate(times_s, values)) == 3
