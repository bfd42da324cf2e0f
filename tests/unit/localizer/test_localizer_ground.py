"""The flow's geometry: signs, de-rotation, outliers, derivatives."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localizer_flight import LENS, image_of, see_floor
from scipy.spatial.transform import Rotation

from common.camera import DOWN, project, to_optical
from services.localizer.filter import (
    KEY_POSITION,
    KEY_ROTATION,
    POSITION,
    ROTATION,
    VELOCITY,
)
from services.localizer.flow import Key, Picture
from services.localizer.ground import View, displacement
from services.localizer.rotation import rotation_by

HEIGHT_M = 1.0
PIXEL_M = HEIGHT_M / LENS.intrinsics[0]


def picture_of(position_m, rotation):
    return Picture(image_of(see_floor(np.asarray(position_m, float), rotation), 0))


def flow_between(key_pose, true_pose, believed_pose):
    """What pictures from two poses say, while the filter believes in another second pose."""
    key, now = Key(picture_of(*key_pose), 60), picture_of(*true_pose)
    then = View.of_body(np.asarray(key_pose[0], float), key_pose[1], 0.0)
    view = View.of_body(np.asarray(believed_pose[0], float), believed_pose[1], 0.0)
    offsets, _ = then.to_floor(key.rays)
    expected = now.pixels(view.of_floor(then.centre_m + offsets))
    found, ok = key.follow(now, expected)
    return displacement(
        then, key.rays[ok], view, now.rays(found[ok]), 0.0, PIXEL_M
    ), found - key.corners


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi])
@pytest.mark.parametrize("way", [(0.06, 0.0), (-0.06, 0.0), (0.0, 0.06), (0.0, -0.06)])
def test_flow_of_a_known_way_is_that_way_in_the_world(way, yaw):
    level = Rotation.from_euler("Z", yaw).as_matrix()
    start, end = (0.0, 0.0, HEIGHT_M), (*way, HEIGHT_M)
    seen, _ = flow_between((start, level), (end, level), (start, level))
    assert seen is not None
    np.testing.assert_allclose(seen.residual_m, way, atol=0.1 * PIXEL_M)


@pytest.mark.parametrize(
    ("body_way", "pixel_way"),
    [
        ((0.06, 0.0), (0, +1)),
        ((-0.06, 0.0), (0, -1)),
        ((0.0, 0.06), (+1, 0)),
        ((0.0, -0.06), (-1, 0)),
    ],
)
def test_the_floor_runs_backwards_through_the_picture(body_way, pixel_way):
    level = np.eye(3)
    start, end = (0.0, 0.0, HEIGHT_M), (*body_way, HEIGHT_M)
    _, moved = flow_between((start, level), (end, level), (end, level))
    np.testing.assert_allclose(
        np.median(moved, axis=0), np.array(pixel_way) * 0.06 / PIXEL_M, rtol=0.05, atol=0.3
    )


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("turn", [-0.06, 0.06])
def test_turning_on_the_spot_is_no_way(axis, turn):
    place = (0.0, 0.0, HEIGHT_M)
    turned = Rotation.from_euler(axis, turn).as_matrix()
    seen, moved = flow_between((place, np.eye(3)), (place, turned), (place, turned))
    assert np.linalg.norm(moved, axis=1).max() > 5.0
    assert seen is not None
    np.testing.assert_allclose(seen.residual_m, 0.0, atol=0.2 * PIXEL_M)


def test_climbing_is_no_way():
    low, high = (0.0, 0.0, HEIGHT_M), (0.0, 0.0, 1.08 * HEIGHT_M)
    seen, _ = flow_between((low, np.eye(3)), (high, np.eye(3)), (high, np.eye(3)))
    assert seen is not None
    np.testing.assert_allclose(seen.residual_m, 0.0, atol=0.2 * PIXEL_M)


def test_a_third_of_false_spots_changes_nothing():
    rng = np.random.default_rng(1)
    view = View.of_body(np.array([0.0, 0.0, HEIGHT_M]), np.eye(3), 0.0)
    rays = np.column_stack([rng.uniform(-0.4, 0.4, (60, 2)), np.ones(60)])
    spoilt = rays.copy()
    spoilt[::3, :2] += rng.uniform(0.1, 0.5, (20, 2))
    seen = displacement(view, rays, view, spoilt, 0.0, PIXEL_M)
    assert seen is not None
    assert seen.inliers == 40
    np.testing.assert_allclose(seen.residual_m, 0.0, atol=1e-9)


def test_spots_that_agree_on_nothing_are_refused():
    rng = np.random.default_rng(1)
    view = View.of_body(np.array([0.0, 0.0, HEIGHT_M]), np.eye(3), 0.0)
    rays = np.column_stack([rng.uniform(-0.4, 0.4, (8, 2)), np.ones(8)])
    assert displacement(view, rays, view, rays, 0.0, PIXEL_M) is None


small = st.floats(-0.15, 0.15)


@settings(max_examples=30, deadline=None)
@given(
    tilt=st.tuples(small, small, st.floats(-3.0, 3.0)),
    height=st.floats(0.3, 3.0),
    distortion=st.sampled_from([(0.0,) * 4, (-0.3, 0.1, 0.001, -0.001)]),
)
def test_rays_to_the_floor_agree_with_the_projection_of_the_cameras(tilt, height, distortion):
    lens = dataclasses.replace(LENS, distortion=distortion)
    position = np.array([1.0, -2.0, height])
    rotation = Rotation.from_euler("XYZ", tilt).as_matrix()
    picture = Picture(image_of(np.zeros((LENS.height, LENS.width), np.uint8), 0, lens))
    pixels = np.array([[20.0, 30.0], [160.0, 120.0], [300.0, 50.0]])
    view = View.of_body(position, rotation, 0.0)
    offsets, hits = view.to_floor(picture.rays(pixels))
    spots = view.centre_m + offsets
    assert hits.all()
    np.testing.assert_allclose(spots[:, 2], 0.0, atol=1e-9)
    back, _ = project(to_optical(spots, position, rotation, DOWN), lens)
    np.testing.assert_allclose(back, pixels, atol=1e-6)
    np.testing.assert_allclose(picture.pixels(view.of_floor(spots)), pixels, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    tilt=st.tuples(small, small, small),
    key_tilt=st.tuples(small, small, small),
    way=st.tuples(small, small, small),
)
def test_derivatives_are_those_of_the_geometry(tilt, key_tilt, way):
    rng = np.random.default_rng(2)
    rays = np.column_stack([rng.uniform(-0.4, 0.4, (30, 2)), np.ones(30)])
    key_place, place = np.array([0.0, 0.0, HEIGHT_M]), np.array([*way[:2], HEIGHT_M + way[2]])
    key_turn, turn = (Rotation.from_euler("XYZ", t).as_matrix() for t in (key_tilt, tilt))

    def miss(error):
        """Minus the residual, when truth is the belief and this error."""
        then = View.of_body(
            key_place + error[KEY_POSITION], rotation_by(error[KEY_ROTATION]) @ key_turn, 0.0
        )
        now = View.of_body(
            place + error[POSITION] - 0.02 * error[VELOCITY],
            rotation_by(error[ROTATION]) @ turn,
            0.0,
        )
        # Every spot is its own, so that none is an outlier.
        seen = displacement(then, rays, now, rays, 0.02, 10.0)
        assert seen is not None
        return -seen.residual_m, seen.jacobian

    still = np.zeros(21)
    _, jacobian = miss(still)
    step = 1e-6
    for index in (0, 1, 2, 3, 4, 6, 7, 8, 15, 16, 17, 18, 19, 20):
        error = still.copy()
        error[index] = step
        numeric = (miss(error)[0] - miss(-error)[0]) / (2 * step)
        # The camera's 3 cm below the body's middle are left out of the turn's derivative.
        np.testing.assert_allclose(jacobian[:, index], numeric, atol=0.035)
