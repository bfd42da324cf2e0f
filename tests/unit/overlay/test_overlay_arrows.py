"""Arrows lie along the path, where a camera would see them."""

import math

import cv2
import numpy as np
import overlay_scenes as scenes
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.camera import FRONT, Lens, project, to_optical
from common.frames import quaternion_of, rotation_of
from services.overlay.arrows import FIRST_M, LENGTH_M, SPACING_M, WIDTH_M, ahead, arrows_of

REACH_M = 15.0
BELOW_M = 0.3
MIDDLE_X = scenes.LENS.width / 2.0


def drawn(points_m, *, closed=False, pose=None, lens=scenes.LENS, below_m=BELOW_M):
    suggestion = scenes.suggestion(points_m, closed=closed)
    return arrows_of(suggestion, pose or scenes.pose(), lens, REACH_M, below_m)


angles = st.floats(-0.6, 0.6)


@given(
    position_m=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    turned=st.tuples(angles, angles, st.floats(-math.pi, math.pi)),
    distortion=st.tuples(*[st.floats(-0.1, 0.1)] * 2, *[st.floats(-0.01, 0.01)] * 2),
)
def test_points_are_where_opencv_projects_them(position_m, turned, distortion):
    lens = Lens(640, 360, (430.0, 428.0, 321.0, 178.0), distortion)
    rotation = rotation_of(quaternion_of(*turned))
    rng = np.random.default_rng(1)
    optical_m = rng.uniform([-2.0, -1.0, 0.5], [2.0, 1.0, 9.0], size=(20, 3))
    body_m = optical_m @ np.asarray(FRONT.body_from_optical).T + np.asarray(FRONT.position_m)
    world_m = body_m @ rotation.T + np.asarray(position_m)

    ours, in_front = project(to_optical(world_m, np.asarray(position_m), rotation, FRONT), lens)

    optical_from_world = (rotation @ np.asarray(FRONT.body_from_optical)).T
    camera_m = np.asarray(position_m) + rotation @ np.asarray(FRONT.position_m)
    fx, fy, cx, cy = lens.intrinsics
    theirs, _ = cv2.projectPoints(
        world_m,
        cv2.Rodrigues(optical_from_world)[0],
        -optical_from_world @ camera_m,
        np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        np.array(distortion),
    )
    assert in_front.all()
    np.testing.assert_allclose(ours, theirs[:, 0], atol=1e-4)


def test_an_arrow_straight_ahead_has_its_size_in_metres():
    arrows = drawn(scenes.line())
    nearest = arrows[-1]
    focal_px, _, cx, cy = scenes.LENS.intrinsics
    tail_depth_m = nearest.distance_m - FRONT.position_m[0]
    left, top = nearest.outline_px.min(axis=0)
    right, bottom = nearest.outline_px.max(axis=0)
    assert right - left == pytest.approx(focal_px * WIDTH_M / tail_depth_m, abs=0.5)
    assert (left + right) / 2.0 == pytest.approx(cx, abs=0.5)
    assert bottom == pytest.approx(cy + focal_px * BELOW_M / tail_depth_m, abs=0.5)
    assert top == pytest.approx(cy + focal_px * BELOW_M / (tail_depth_m + LENGTH_M), abs=0.5)


def test_arrows_get_smaller_and_fainter_with_distance_and_farthest_come_first():
    arrows = drawn(scenes.line())
    assert len(arrows) == pytest.approx((REACH_M - LENGTH_M - FIRST_M) / SPACING_M, abs=1)
    distances = [each.distance_m for each in arrows]
    widths = [np.ptp(each.outline_px[:, 0]) for each in arrows]
    opacities = [each.opacity for each in arrows]
    assert distances == sorted(distances, reverse=True)
    assert widths == sorted(widths)
    assert opacities == sorted(opacities)
    assert 0.0 < opacities[0] < opacities[-1] <= 1.0


@given(radius_m=st.floats(1.5, 4.0))
def test_arrows_of_a_left_circle_lie_left_and_of_a_right_one_right(radius_m):
    for left in (True, False):
        arrows = drawn(scenes.circle(radius_m, left=left), closed=True)
        assert arrows
        for arrow in arrows[:-1]:
            middle = arrow.outline_px[:, 0].mean()
            assert middle < MIDDLE_X if left else middle > MIDDLE_X


def test_left_and_right_are_mirror_images():
    left = drawn(scenes.circle(3.0, left=True))
    right = drawn(scenes.circle(3.0, left=False))
    for ours, theirs in zip(left, right, strict=True):
        mirrored = 2.0 * MIDDLE_X - theirs.outline_px[:, 0]
        assert np.sort(mirrored) == pytest.approx(np.sort(ours.outline_px[:, 0]))


def test_arrows_of_a_climbing_helix_rise_above_those_of_a_sinking_one():
    def heights(pitch_m):
        points_m = scenes.circle(4.0, left=True, turns=3, pitch_m=pitch_m)
        return {round(a.distance_m, 2): a.outline_px[:, 1].mean() for a in drawn(points_m)}

    up, level, down = heights(4.0), heights(0.0), heights(-4.0)
    common = up.keys() & level.keys() & down.keys()
    assert len(common) >= 3
    assert all(up[each] < level[each] < down[each] for each in common)


def test_nothing_is_drawn_of_a_path_behind_the_camera():
    assert drawn([(-0.1 * i, 0.0, 1.0) for i in range(100)]) == []
    half_turned = scenes.pose(angles=(0.0, 0.0, math.pi))
    assert drawn(scenes.line(), pose=half_turned) == []


def test_nothing_is_drawn_of_a_path_that_is_shorter_than_an_arrow():
    assert drawn(scenes.line(0.5)) == []
    assert drawn([(0.0, 0.0, 1.0), (0.0, 0.0, 1.0)]) == []


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("reach_m", [0.0, 1e-300, 1e300])
def test_nothing_is_drawn_of_a_path_without_a_length_that_can_be_told(reach_m, closed):
    assert drawn(np.array([[0.0, 0.0, 1.0], [reach_m, 0.0, 1.0]]), closed=closed) == []


def test_a_vertical_path_has_arrows_too():
    points_m = [(3.0, 0.0, 0.1 * i) for i in range(30)]
    for arrow in drawn(points_m, pose=scenes.pose(z=0.5)):
        assert np.isfinite(arrow.outline_px).all()


def test_a_picture_that_rolls_turns_the_arrows_with_it():
    arrows = drawn(scenes.line(), pose=scenes.pose(angles=(0.3, 0.0, 0.0)))
    # Rolled to the right, the body's underside points left: the ground is seen on the right.
    far, near = arrows[0].outline_px.mean(axis=0), arrows[-1].outline_px.mean(axis=0)
    turned = math.atan2(near[0] - far[0], near[1] - far[1])
    assert turned == pytest.approx(0.3, abs=0.02)


def test_the_lens_does_not_bend_far_points_back_into_the_picture():
    fisheye = Lens(640, 360, scenes.LENS.intrinsics, (-0.5, 0.0, 0.0, 0.0))
    aside = [(1.0, 0.1 * i, 1.0) for i in range(10, 200)]
    assert drawn(aside, pose=scenes.pose(y=2.0), lens=fisheye) == []


def test_the_path_goes_on_from_the_point_nearest_to_the_vehicle():
    onward_m = ahead(scenes.suggestion(scenes.line()), np.array([5.02, 0.4, 1.0]), 3.0).points_m
    assert onward_m[0] == pytest.approx([5.0, 0.0, 1.0])
    assert onward_m[-1] == pytest.approx([8.0, 0.0, 1.0], abs=0.11)


def test_a_closed_path_goes_on_at_its_start_and_an_open_one_ends():
    points_m = scenes.circle(2.0, left=True)
    near_the_end_m = points_m[-5]
    once = ahead(scenes.suggestion(points_m), near_the_end_m, REACH_M).points_m
    again = ahead(scenes.suggestion(points_m, closed=True), near_the_end_m, REACH_M).points_m
    assert len(once) == 5
    assert len(again) == len(points_m) + 1
    steps_m = np.linalg.norm(np.diff(again, axis=0), axis=1)
    assert steps_m.max() < 0.2


@pytest.mark.parametrize("closed", [False, True])
def test_arrows_lie_still_in_the_world_while_the_vehicle_flies_over_them(closed):
    points_m = scenes.circle(4.0, left=True)
    suggestion = scenes.suggestion(points_m, closed=closed)

    def places_m(index: int) -> list[float]:
        stretch = ahead(suggestion, np.array(points_m[index]), REACH_M)
        along_m = np.linalg.norm(np.diff(points_m[: index + 1], axis=0), axis=1).sum()
        return [along_m + stretch.first_m, stretch.spacing_m]

    begin_m, spacing_m = places_m(0)
    for index in range(1, 60):
        there_m, _ = places_m(index)
        steps = (there_m - begin_m) / spacing_m
        assert steps == pytest.approx(round(steps), abs=1e-6)
