"""Frames, angles, sticks and cameras, against scipy and OpenCV."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common import frames, sticks
from common.camera import DOWN, FRONT, Lens, Mount, project, to_optical
from common.clock import ManualClock, nanoseconds, seconds
from common.messages import Stick

angles = st.floats(-50.0, 50.0)
tilts = st.floats(-1.5, 1.5)


@given(angles)
def test_wrapping_keeps_the_direction(angle_rad: float) -> None:
    wrapped = frames.wrap_angle(angle_rad)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


@given(roll=tilts, pitch=tilts, yaw=st.floats(-3.1, 3.1))
def test_yaw_comes_back_from_the_quaternion(roll: float, pitch: float, yaw: float) -> None:
    quaternion = frames.quaternion_of(roll, pitch, yaw)
    assert math.hypot(*quaternion) == pytest.approx(1.0)
    assert frames.yaw_of(quaternion) == pytest.approx(yaw, abs=1e-6)
    assert frames.rotation_of(quaternion) == pytest.approx(
        Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    )


def test_rotations_have_the_frames_signs() -> None:
    left = frames.rotation_of(frames.quaternion_of(0, 0, math.pi / 2)) @ [1, 0, 0]
    assert left == pytest.approx([0, 1, 0]), "yaw is counter-clockwise"
    nose = frames.rotation_of(frames.quaternion_of(0, 0.1, 0)) @ [1, 0, 0]
    assert nose[2] < 0, "positive pitch is nose down"
    left_side = frames.rotation_of(frames.quaternion_of(0.1, 0, 0)) @ [0, 1, 0]
    assert left_side[2] > 0, "positive roll lifts the left side"


@given(x=st.floats(-9, 9), y=st.floats(-9, 9), yaw=angles)
def test_the_heading_frame_is_the_world_turned_by_yaw(x: float, y: float, yaw: float) -> None:
    world = frames.heading_to_world(x, y, yaw)
    assert frames.world_to_heading(*world, yaw) == pytest.approx((x, y), abs=1e-9)
    expected = Rotation.from_euler("z", yaw).apply([x, y, 0.0])
    assert world == pytest.approx(tuple(expected[:2]), abs=1e-9)


@pytest.mark.parametrize("mount", [FRONT, DOWN])
def test_mounts_are_rotations(mount: Mount) -> None:
    matrix = np.asarray(mount.body_from_optical)
    assert matrix @ matrix.T == pytest.approx(np.eye(3))
    assert np.linalg.det(matrix) == pytest.approx(1.0)


def pixel(point_m: list[float], mount: Mount, yaw: float = 0.0) -> tuple[float, float] | None:
    lens = Lens.of_view(640, 360, math.radians(81.0))
    world = np.asarray([point_m], dtype=float)
    turned = frames.rotation_of(frames.quaternion_of(0, 0, yaw))
    optical = to_optical(world, np.array([0.0, 0.0, 1.0]), turned, mount)
    pixels, in_front = project(optical, lens)
    return (float(pixels[0, 0]), float(pixels[0, 1])) if in_front[0] else None


def test_the_front_camera_sees_what_is_ahead() -> None:
    assert pixel([5.0, 0.0, 1.0], FRONT) == pytest.approx((320.0, 180.0))
    assert pixel([-5.0, 0.0, 1.0], FRONT) is None
    left_of = pixel([5.0, 1.0, 1.0], FRONT)
    above = pixel([5.0, 0.0, 2.0], FRONT)
    assert left_of is not None
    assert above is not None
    assert left_of[0] < 320.0
    assert above[1] < 180.0
    assert pixel([0.0, 5.0, 1.0], FRONT, yaw=math.pi / 2) == pytest.approx((320.0, 180.0))


def test_the_downward_camera_has_forward_at_its_top() -> None:
    assert pixel([0.0, 0.0, 0.0], DOWN) == pytest.approx((320.0, 180.0))
    ahead, left_of = pixel([0.2, 0.0, 0.0], DOWN), pixel([0.0, 0.2, 0.0], DOWN)
    assert ahead is not None
    assert left_of is not None
    assert ahead[1] < 180.0
    assert left_of[0] < 320.0
    assert pixel([0.0, 0.0, 3.0], DOWN) is None


def test_a_lens_of_a_view_spans_it() -> None:
    lens = Lens.of_view(640, 360, math.radians(81.0))
    assert lens.intrinsics[0] == pytest.approx(374.7, abs=0.1), "tum_simulator's camera"
    edge = math.tan(math.radians(40.5))
    pixels, _ = project(np.array([[edge, 0.0, 1.0]]), lens)
    assert pixels[0, 0] == pytest.approx(640.0)


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.5, 9)), min_size=1))
def test_projection_is_opencvs(points: list[tuple[float, float, float]]) -> None:
    # The real drone's lens, see ardrone_autonomy.
    lens = Lens(640, 360, (569.9, 568.0, 331.4, 135.9), (-0.527, 0.274, 0.001, -0.002))
    optical = np.asarray(points, dtype=float)
    fx, fy, cx, cy = lens.intrinsics
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    zero = np.zeros(3)
    expected, _ = cv2.projectPoints(optical, zero, zero, matrix, np.asarray(lens.distortion))
    pixels, in_front = project(optical, lens)
    assert in_front.all()
    assert pixels == pytest.approx(np.asarray(expected).reshape(-1, 2), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("axis", ["vx", "vy", "vz", "wz"])
def test_a_stick_within_the_dead_band_is_neutral(axis: str) -> None:
    def stick(value: float) -> Stick:
        rest = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0}
        return Stick(stamp=1, seq=0, **{**rest, axis: value})

    for sign in (-1, 1):
        assert sticks.is_neutral(stick(sign * sticks.DEAD_BAND))
        assert not sticks.is_neutral(stick(sign * (sticks.DEAD_BAND + 1e-6)))


def test_a_clock_moves_on_by_what_it_is_told_and_never_back() -> None:
    clock = ManualClock(5)
    clock.advance(1.5)
    assert clock.monotonic_ns() == clock.utc_ns() == 5 + 1_500_000_000
    with pytest.raises(ValueError, match="go back"):
        clock.advance(-0.1)


@given(st.integers(-(10**15), 10**15))
def test_seconds_and_nanoseconds_are_inverse(duration_ns: int) -> None:
    assert nanoseconds(seconds(duration_ns)) == pytest.approx(duration_ns, abs=1)
