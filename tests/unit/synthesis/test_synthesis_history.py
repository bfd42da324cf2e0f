"""The history: points equally spaced along the way, whatever the speed."""

import numpy as np
import pytest
from synthesis_truth import POSE_RATE_HZ, S, pose, poses

from services.synthesis.history import CELL_M, History

END_NS = 10 * S


def history_of(stamped):
    history = History()
    for message, arrival_ns in stamped:
        history.add(message, arrival_ns)
    return history


def test_slow_parts_do_not_weigh_more():
    # From rest with the lag of the velocity loop, 0.4 s.
    def where(t):
        return np.array([t - 0.4 * (1.0 - np.exp(-t / 0.4)), 0.0, 1.0])

    track = history_of(poses(where, 3.0)).track(0, END_NS)
    spacing = np.diff(track.points_m[:, 0])
    assert len(track.points_m) == pytest.approx((3.0 - 0.4) / CELL_M, abs=2)
    assert np.all(np.abs(spacing[1:-1] - CELL_M) < 0.5 * CELL_M)
    assert track.speed_mps == pytest.approx(1.0, abs=0.05)


def test_noise_of_a_hover_is_hardly_a_way():
    rng = np.random.default_rng(1)
    track = history_of(
        poses(lambda t: np.array([0.0, 0.0, 1.0]) + rng.normal(0.0, 0.005, 3), 4.0)
    ).track(0, END_NS)
    assert len(track.points_m) * CELL_M < 0.25


def test_noise_of_poses_does_not_lengthen_the_way():
    rng = np.random.default_rng(2)
    track = history_of(
        poses(lambda t: np.array([t, 0.0, 1.0]) + rng.normal(0.0, 0.01, 3), 3.0)
    ).track(0, END_NS)
    assert len(track.points_m) * CELL_M == pytest.approx(3.0, abs=0.2)


def test_only_the_window_counts():
    stamped = poses(lambda t: np.array([t, 0.0, 1.0]), 5.0)
    track = history_of(stamped).track(stamped[-1][1] - 2 * S, stamped[-1][1])
    assert track.points_m[0, 0] == pytest.approx(3.0, abs=0.05)
    assert track.here_m == pytest.approx([5.0, 0.0, 1.0])


def test_old_poses_are_forgotten():
    track = history_of(poses(lambda t: np.array([t, 0.0, 1.0]), 45.0)).track(0, 100 * S)
    assert track.points_m[0, 0] == pytest.approx(5.0, abs=0.05)


@pytest.mark.parametrize("kind", ["jump", "gap", "lost"])
def test_what_was_before_a_break_is_forgotten(kind):
    history = history_of(poses(lambda t: np.array([t, 0.0, 1.0]), 2.0))
    shift = np.array([5.0 if kind == "jump" else 0.0, 0.0, 0.0])
    pause_ns = S if kind == "gap" else 0
    if kind == "lost":
        history.add(pose([2.0, 0.0, 1.0], status="lost"), 3 * S + S // 100)
    for i in range(100):
        where = np.array([2.0 + (i + 2) / POSE_RATE_HZ, 0.0, 1.0]) + shift
        history.add(pose(where), 3 * S + pause_ns + (i + 2) * S // 100)
    track = history.track(0, END_NS)
    assert track.points_m[0] == pytest.approx(np.array([2.02, 0.0, 1.0]) + shift, abs=0.05)


def test_no_poses_are_no_track():
    assert History().track(0, END_NS) is None
    assert history_of([(pose([0.0, 0.0, 1.0]), S)]).track(0, END_NS) is None


def test_poses_that_arrive_together_are_no_trouble():
    stamped = [(message, S) for message, _ in poses(lambda t: np.array([t, 0.0, 1.0]), 1.0)]
    track = history_of(stamped).track(0, END_NS)
    assert np.all(np.isfinite(track.points_m))


def held(t):
    """Corrections to and fro within about 0.3 m."""
    return np.array([0.3 * np.sin(1.1 * t), 0.25 * np.cos(0.7 * t), 1.0])


@pytest.mark.parametrize("before_s", [4.0, 12.0])
def test_corrections_about_a_place_leave_the_vehicle_held_there(before_s):
    stamped = poses(held, before_s + 3.0)
    assert history_of(stamped).is_held(stamped[-1][1] - 3 * S, stamped[-1][1])


def test_a_motion_that_leads_away_is_free_as_soon_as_it_is_out_of_the_place():
    def where(t):
        return held(t) if t < 8.0 else held(8.0) + np.array([0.8 * (t - 8.0), 0.0, 0.0])

    begin_ns, free_after_s = 9 * S, []
    for after_s in np.arange(0.1, 2.0, 0.1):
        stamped = poses(where, 8.0 + after_s)
        if not history_of(stamped).is_held(begin_ns, stamped[-1][1]):
            free_after_s.append(after_s)
    assert 0.3 < min(free_after_s) < 1.1
    assert len(free_after_s) == round((2.0 - min(free_after_s)) / 0.1), "once free, always free"


def test_a_motion_from_standing_still_is_free_at_once():
    def where(t):
        return np.array([max(0.0, 0.8 * (t - 5.0)), 0.0, 1.0])

    stamped = poses(where, 5.3)
    assert not history_of(stamped).is_held(6 * S, stamped[-1][1])


@pytest.mark.parametrize("radius_m", [0.3, 0.7])
def test_a_vehicle_that_circles_is_not_held(radius_m):
    def where(t):
        return np.array([radius_m * np.cos(t / radius_m), radius_m * np.sin(t / radius_m), 1.0])

    stamped = poses(where, 14.0)
    assert not history_of(stamped).is_held(stamped[-1][1] - 4 * S, stamped[-1][1])


@pytest.mark.parametrize("speed_mps", [0.2, 0.4, 1.0])
def test_a_vehicle_on_its_way_is_not_held(speed_mps):
    stamped = poses(lambda t: np.array([speed_mps * t, 0.0, 1.0]), 9.0)
    assert not history_of(stamped).is_held(stamped[-1][1] - 2 * S, stamped[-1][1])


def test_nobody_knows_of_a_place_before_the_first_poses():
    stamped = poses(held, 3.0)
    assert not history_of(stamped).is_held(2 * S, stamped[-1][1])
    assert not History().is_held(0, S)
