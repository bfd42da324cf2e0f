"""What a simulated person can and cannot see."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from operator_flight import Flight
from scipy.spatial.transform import Rotation

import worlds
from common.frames import quaternion_of
from common.messages import Pose
from services.operator.eyes import SIGHT_M, Eyes
from services.operator.person import Person, Phase
from services.operator.route import Route, route_of

TRACK = route_of(worlds.load("track"))
HALF_WIDTH = math.tan(math.radians(81.0 / 2.0))
HALF_HEIGHT = HALF_WIDTH * 360.0 / 640.0
CAMERA_FORWARD_M = 0.21


def pose_at(
    x: float, y: float, z: float, yaw: float, pitch: float = 0.0, roll: float = 0.0
) -> Pose:
    return Pose(
        stamp=0,
        seq=0,
        position=(x, y, z),
        orientation=quaternion_of(roll, pitch, yaw),
        velocity=(0.0, 0.0, 0.0),
        angular_velocity=(0.0, 0.0, 0.0),
        covariance=(0.0,) * 6,
        status="ok",
        source="test",
    )


@settings(max_examples=200, deadline=None)
@given(
    st.floats(-10.0, 25.0),
    st.floats(-6.0, 14.0),
    st.floats(0.1, 3.0),
    st.floats(-math.pi, math.pi),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(0.0, 120.0),
)
def test_nothing_outside_the_picture_is_seen(
    x: float, y: float, z: float, yaw: float, pitch: float, roll: float, along_m: float
) -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    pose = pose_at(x, y, z, yaw, pitch, roll)
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    for index in eyes.in_view(pose, along_m):
        mark = np.array([*TRACK.points_m[index, :2], 0.0])
        forward, left, up = turn.inv().apply(mark - [x, y, z]) - [CAMERA_FORWARD_M, 0.0, 0.0]
        assert forward > 0.0
        assert abs(left / forward) <= HALF_WIDTH + 1e-9
        assert abs(up / forward) <= HALF_HEIGHT + 1e-9
        assert math.hypot(forward, left, up) <= SIGHT_M


def test_the_lane_ahead_is_seen_from_where_the_picture_begins() -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    indices = eyes.in_view(pose_at(2.0, 0.0, 1.0, 0.0), 2.0)
    xs = TRACK.points_m[indices, 0]
    assert xs.min() == pytest.approx(2.0 + CAMERA_FORWARD_M + 1.0 / HALF_HEIGHT, abs=0.25)
    assert xs.max() > 12.0


def test_looking_away_from_the_lane_shows_nothing_of_it() -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    assert len(eyes.in_view(pose_at(2.0, 0.0, 1.0, -math.pi / 2.0), 2.0)) == 0


def test_a_look_shows_the_picture_of_one_delay_ago() -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    assert eyes.look(0, 0.0) is None
    for tick in range(100):
        eyes.truth(pose_at(0.05 * tick, 0.0, 1.0, 0.0), tick * 10_000_000)
    sight = eyes.look(990_000_000, 0.0)
    assert sight is not None
    assert sight.position_m[0] == pytest.approx(0.05 * 74, abs=0.2)


def test_a_picture_that_stands_still_is_not_seen_any_more() -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    eyes.truth(pose_at(0.0, 0.0, 1.0, 0.0), 0)
    assert eyes.look(300_000_000, 0.0) is not None
    assert eyes.look(1_000_000_000, 0.0) is None


def test_seen_places_are_wrong_by_little_and_not_by_nothing() -> None:
    eyes = Eyes(TRACK, 0.25, np.random.default_rng(1))
    errors = []
    for tick in range(4000):
        now_ns = tick * 100_000_000
        eyes.truth(pose_at(2.0, 0.0, 1.0, 0.0), now_ns)
        sight = eyes.look(now_ns, 2.0)
        if sight is not None:
            errors.append(sight.position_m[:2] - [2.0, 0.0])
    assert np.std(errors, axis=0) == pytest.approx([0.05, 0.05], rel=0.2)


def moved_behind(route: Route, from_m: float) -> Route:
    """The same route with everything from a distance on somewhere else."""
    points_m = route.points_m.copy()
    points_m[round(from_m / route.step_m) :, 1] += 3.0
    return replace(route, points_m=points_m)


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_out_of_sight_changes_nothing(seed: int) -> None:
    here = Flight(TRACK, Person(seed=seed))
    elsewhere = Flight(moved_behind(TRACK, 22.0), Person(seed=seed))
    here.run(60.0, lambda flight: flight.vehicle.x_m > 9.0)
    elsewhere.run(60.0, lambda flight: flight.vehicle.x_m > 9.0)
    assert here.pilot.progress.phase is Phase.STEERING
    assert here.sticks == elsewhere.sticks
