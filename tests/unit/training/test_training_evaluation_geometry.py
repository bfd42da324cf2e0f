"""Hand-made features see shapes, whichever way they are flown; distortions do what they say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from training.dataset.primitive import Primitive
from training.evaluation.distortions import DISTORTIONS, distorted
from training.evaluation.geometry import NAMES, features
from training.evaluation.thesis import machine_rows
from training.evaluation.views import in_start_frame, padded
from training.svm import machine
from training.windows import Windows

AT = {name: place for place, name in enumerate(NAMES)}


def shape(label: str, seconds: float = 4.0) -> np.ndarray:
    t = np.arange(0.0, seconds, 0.02)
    heading = {
        "line": np.full_like(t, 0.3),
        "arc": 1.2 * t,
        "helix": 1.2 * t,
        "sine": 0.9 * np.cos(2.0 * math.pi * t / 2.0),
    }[label]
    up = np.full_like(t, 0.5 if label == "helix" else 0.0)
    return np.stack([0.6 * np.cos(heading), 0.6 * np.sin(heading), up], axis=1)


def windows(sticks: np.ndarray, length: int) -> Windows:
    times_s = np.arange(sticks.shape[0], dtype=np.float32)[None] / np.float32(50.0)
    return Windows(
        sticks[None].astype(np.float32), times_s, np.array([length]), np.zeros(1, dtype=np.int64)
    )


def test_a_line_is_straight_an_arc_sweeps_a_sine_turns_back_and_a_helix_climbs() -> None:
    found = {label: features(shape(label)) for label in ("line", "arc", "sine", "helix")}
    assert found["line"][AT["straightness"]] == pytest.approx(1.0, abs=1e-3)
    assert found["line"][AT["inflections"]] == 0
    assert found["arc"][AT["circle_sweep"]] == pytest.approx(4.8, rel=0.05)
    assert found["arc"][AT["circle_residual"]] < 0.01
    assert found["arc"][AT["turn_one_way"]] == pytest.approx(1.0, abs=1e-3)
    assert found["sine"][AT["inflections"]] >= 3
    assert found["helix"][AT["climb_share"]] > 0.3
    assert found["arc"][AT["climb_share"]] == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(
    label=st.sampled_from(["line", "arc", "sine", "helix"]),
    angle=st.floats(-3.1, 3.1),
    mirrored=st.booleans(),
)
def test_turning_or_mirroring_a_motion_changes_no_feature(
    label: str, angle: float, mirrored: bool
) -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.02, (200, 3))
    sticks = shape(label) + noise
    c, s = math.cos(angle), math.sin(angle)
    turned = sticks @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    if mirrored:
        turned = turned * [1.0, -1.0, 1.0]
    before, after = features(sticks), features(turned)
    # The signs of principal axes are arbitrary, and so is that of their correlation.
    kept = [place for name, place in AT.items() if name != "velocity_correlation"]
    np.testing.assert_allclose(after[kept], before[kept], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("samples", [2, 20, 400])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_rest_and_short_windows_have_finite_features(samples: int, level: float) -> None:
    found = features(np.full((samples, 3), level))
    assert found.shape == (len(NAMES),)
    assert np.isfinite(found).all()


def test_forward_with_yaw_is_an_arc_in_the_frame_of_the_start() -> None:
    sticks = np.tile([0.5, 0.0, 0.0, 1.0], (101, 1))
    seen = in_start_frame(windows(sticks, 101), full_yaw_radps=0.5)
    assert math.atan2(seen[0, 100, 1], seen[0, 100, 0]) == pytest.approx(1.0, abs=1e-3)
    assert np.hypot(*seen[0, :, :2].T) == pytest.approx(np.full(101, 0.5), abs=1e-5)


def test_series_of_fixed_length_are_zero_after_a_windows_own() -> None:
    series = padded(windows(np.tile([0.5, 0.0, 0.2, 0.0], (120, 1)), 80), 1.0, 200, every=2)
    assert series.shape == (1, 3, 100)
    assert series[0, 0, :40] == pytest.approx(np.full(40, 0.5))
    assert not series[0, :, 40:].any()


def test_longer_windows_show_their_newest_samples() -> None:
    sticks = np.tile(np.linspace(0.0, 1.0, 120)[:, None], (1, 4))
    sticks[:, 3] = 0.0
    series = padded(windows(sticks, 110), 1.0, 50)
    assert series[0, 2] == pytest.approx(sticks[60:110, 2])


def drawn() -> Primitive:
    times_s = np.arange(300) / 47.0
    sticks = np.stack([np.sin(times_s + phase) for phase in range(4)], axis=1)
    return Primitive(times_s, sticks, "sine", "o", "f", "test")


@pytest.mark.parametrize("name", DISTORTIONS)
def test_distorted_sticks_begin_at_zero_with_rising_stamps(name: str) -> None:
    (changed,) = distorted([drawn()], name, 0)
    assert changed.times_s[0] == 0.0
    assert (np.diff(changed.times_s) > 0.0).all()
    assert len(changed.times_s) == len(changed.sticks)


def test_distortions_have_their_size() -> None:
    of = {name: distorted([drawn()] * 20, name, 0) for name in DISTORTIONS}
    assert of["20 Hz"][0].rate_hz == pytest.approx(20.0)
    assert of["100 Hz"][0].rate_hz == pytest.approx(100.0)
    kept = sum(len(one) for one in of["10 % lost"]) / (20 * 300)
    assert kept == pytest.approx(0.9, abs=0.01)
    assert np.abs(of["half-size sticks"][0].sticks).max() == pytest.approx(0.5, abs=1e-3)


def test_the_svm_sees_100_roll_and_100_pitch_samples() -> None:
    sticks = np.random.default_rng(0).uniform(-1.0, 1.0, (150, 4))
    sticks[:, 3] = 0.0
    (row,) = machine_rows(windows(sticks, 130), 1.0)
    assert row.shape == (200,)
    assert row[[0, 99, 100, 199]] == pytest.approx(sticks[[0, 129, 0, 129], [1, 1, 0, 0]])
    assert machine().named_steps["svc"].gamma == 0.001
