import math
from itertools import pairwise

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
    for_model,
    in_start_frame,
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
    assert motion_of(window).stamps_ns[0] == now
    assert len(motion_of(window).sticks) == 30


def test_a_short_pause_is_a_hesitation_and_a_long_one_ends_the_motion() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    now = push(window, now, 10)
    now = push(window, now, 20, vx=0.5)
    assert motion_of(window).stamps_ns[0] == 0
    now = push(window, now, 16)
    assert window.motion() is None
    push(window, now, 20, vy=0.5)
    assert motion_of(window).stamps_ns[0] == now


def test_neutral_sticks_at_the_end_are_no_part_of_the_shape() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    push(window, now, 5)
    assert motion_of(window).stamps_ns[-1] == now - STEP_NS


def test_turning_on_the_spot_is_rest() -> None:
    window = StickWindow()
    push(window, 0, 100, wz=1.0)
    assert window.motion() is None


@pytest.mark.parametrize("rate_hz", [20, 50, 100, 300])
def test_the_window_is_four_seconds_at_every_rate(rate_hz: int) -> None:
    window = StickWindow()
    push(window, 0, 6 * rate_hz, 1_000_000_000 // rate_hz, vx=0.5)
    assert motion_of(window).duration_s == pytest.approx(WINDOW_S, abs=1.01 / rate_hz)
    assert len(motion_of(window).sticks) == pytest.approx(WINDOW_S * rate_hz, abs=2)


def test_a_gap_begins_a_new_motion() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5)
    now += 250_000_000
    push(window, now, 10, vx=0.5)
    assert motion_of(window).stamps_ns[0] == now


def test_a_few_lost_sticks_change_nothing() -> None:
    window = StickWindow()
    now = push(window, 0, 50, vx=0.5) + 3 * STEP_NS
    push(window, now, 10, vx=0.5)
    assert motion_of(window).stamps_ns[0] == 0


def test_late_and_doubled_sticks_are_left_out() -> None:
    window = StickWindow()
    push(window, 0, 50, vx=0.5)
    window.add(stick(49 * STEP_NS, vx=-1.0))
    window.add(stick(45 * STEP_NS, vx=-1.0))
    assert (motion_of(window).sticks[:, 0] == 0.5).all()
    assert len(motion_of(window).sticks) == 50


def test_a_clock_set_back_begins_anew() -> None:
    window = StickWindow()
    push(window, 10**15, 50, vx=0.5)
    push(window, 10**9, 10, vy=0.5)
    assert motion_of(window).stamps_ns[0] == 10**9
    assert window.newest_ns == 10**9 + 9 * STEP_NS


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(-400_000_000, 400_000_000), axis, axis, axis, axis), max_size=150
    )
)
def test_whatever_comes_the_stamps_rise_and_span_at_most_the_window(rows: list) -> None:
    window = StickWindow()
    now = 10**12
    for step_ns, vx, vy, vz, wz in rows:
        now += step_ns
        window.add(stick(now, vx, vy, vz, wz))
        motion = window.motion()
        if motion is not None:
            assert motion.duration_s <= WINDOW_S
            assert all(a < b for a, b in pairwise(motion.stamps_ns.tolist()))
            assert np.abs(motion.sticks[-1, :3]).max() > 0.05


def test_forward_and_yaw_is_an_arc_in_the_start_frame() -> None:
    times_s = np.arange(0.0, 3.0, 0.02)
    sticks = np.tile([0.8, 0.0, 0.1, 0.5], (len(times_s), 1))
    turned = in_start_frame(times_s, sticks, 1.0)
    heading = np.unwrap(np.arctan2(turned[:, 1], turned[:, 0]))
    assert heading == pytest.approx(0.5 * times_s)
    assert np.hypot(turned[:, 0], turned[:, 1]) == pytest.approx(0.8)
    assert turned[:, 2] == pytest.approx(0.1)


@settings(max_examples=40, deadline=None)
@given(st.floats(-math.pi, math.pi), st.integers(0, 1000))
def test_turning_changes_no_speed(yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    times_s = np.cumsum(rng.uniform(0.005, 0.05, 100))
    sticks = rng.uniform(-1.0, 1.0, (100, 4))
    turned = in_start_frame(times_s, sticks, yaw)
    assert np.hypot(*turned[:, :2].T) == pytest.approx(np.hypot(*sticks[:, :2].T))
    assert turned[0] == pytest.approx(sticks[0, :3])


@pytest.mark.parametrize("rate_hz", [20.0, 33.3, 50.0, 100.0])
def test_the_model_sees_the_same_shape_at_every_rate(rate_hz: float) -> None:
    times_s = np.arange(0.0, 3.0 + 1e-9, 1.0 / rate_hz)
    sticks = np.stack(
        [np.cos(times_s), np.sin(times_s), 0.2 * times_s, np.zeros_like(times_s)], axis=1
    )
    seen = for_model(times_s, sticks, 1.0)
    assert len(seen) == pytest.approx(3.0 * 50.0 + 1, abs=2)
    grid_s = times_s[-1] - np.arange(len(seen) - 1, -1, -1) / 50.0
    # Between samples 1/20 s apart a chord leaves the circle by 0.3 %.
    assert seen[:, 0] == pytest.approx(np.cos(grid_s), abs=2e-3)
    assert seen[:, 2] == pytest.approx(0.2 * grid_s, abs=1e-5)


def test_the_model_is_given_at_most_its_window_and_the_newest() -> None:
    times_s = np.arange(0.0, 8.0, 0.01)
    sticks = np.zeros((len(times_s), 4))
    sticks[:, 0] = times_s / 8.0
    seen = for_model(times_s, sticks, 1.0)
    assert seen.shape == (WINDOW_SAMPLES, 3)
    assert seen.dtype == np.float32
    assert seen[-1, 0] == pytest.approx(times_s[-1] / 8.0)


def test_resampling_keeps_the_last_sample() -> None:
    times_s = np.array([0.0, 0.013, 0.041, 0.0555])
    values = np.array([[0.0], [1.0], [2.0], [3.0]])
    assert at_rate(times_s, values)[-1, 0] == 3.0
    assert len(at_rate(times_s, values)) == 3
