"""Paths: they start at the vehicle and go over to the shape without a step or a kink."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_truth import arc_points, helix_points, sine_points

from services.synthesis.continuation import Vehicle, blend, continue_from, heading_sector
from services.synthesis.primitives import PRIMITIVES
from services.synthesis.primitives.line import Line
from services.synthesis.primitives.shape import UnfitError

along = np.linspace(0.0, 3.0, 90)
MOTIONS = {
    "line": np.column_stack([along, 0.5 * along, 1.0 + 0.2 * along]),
    "arc": arc_points(1.0, 2.0, 1.0, 2.0, 0.5, -2.0),
    "helix": helix_points(1.5, 0.5, 5.0, 0.8),
    "sine": sine_points(0.4, 2.5, 2.0, 1.0, 1.7),
}
offsets = st.tuples(*[st.floats(-0.25, 0.25)] * 3)


@settings(max_examples=120, deadline=None)
@given(name=st.sampled_from(list(PRIMITIVES)), offset=offsets, yaw=st.floats(-math.pi, math.pi))
def test_a_path_starts_at_the_vehicle_and_has_no_step_and_no_kink(name, offset, yaw):
    points = MOTIONS[name]
    here = points[-1] + np.array(offset)
    shape = PRIMITIVES[name].fit(points, here)
    path = continue_from(shape, Vehicle(here, yaw))
    assert path.shape[1] == 4
    assert np.allclose(path[0, :3], here)
    steps = np.diff(path[:, :3], axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert lengths.min() > 0.0
    assert lengths.max() < 0.2
    turns = np.sum(steps[1:] * steps[:-1], axis=1) / (lengths[1:] * lengths[:-1])
    # The wave's own crests turn by 14 degrees a step.
    assert turns.min() > math.cos(math.radians(20.0))
    assert np.all(np.abs(path[:, 3]) <= math.pi)
    # The direction at once is the shape's.
    first = shape.ahead()[1] - shape.ahead()[0]
    assert steps[0] @ first / lengths[0] / np.linalg.norm(first) > math.cos(math.radians(5.0))
    if shape.closed:
        assert np.array_equal(path[0], path[-1])
        seam = steps[0] @ steps[-1] / lengths[0] / lengths[-1]
        assert seam > math.cos(math.radians(10.0))


@settings(max_examples=100, deadline=None)
@given(name=st.sampled_from(["arc", "helix", "sine"]), offset=offsets)
def test_yaw_is_along_the_tangent_of_curves(name, offset):
    here = MOTIONS[name][-1] + np.array(offset)
    path = continue_from(PRIMITIVES[name].fit(MOTIONS[name], here), Vehicle(here, 0.3))
    chord = path[2:, :2] - path[:-2, :2]
    off = np.arctan2(chord[:, 1], chord[:, 0]) - path[1:-1, 3]
    assert np.abs(np.angle(np.exp(1j * off))).max() < math.radians(3.0)


def test_the_offset_is_gone_after_the_blend():
    ahead = np.column_stack([np.linspace(0.0, 20.0, 201), np.zeros(201), np.ones(201)])
    path = blend(ahead, np.array([0.0, 0.2, 1.0]), closed=False)
    assert np.allclose(path[20:], ahead[20:])
    assert path[0] == pytest.approx([0.0, 0.2, 1.0])


def test_a_vehicle_that_left_the_shape_gets_no_path():
    ahead = np.column_stack([np.linspace(0.0, 20.0, 201), np.zeros(201), np.ones(201)])
    with pytest.raises(UnfitError, match="away"):
        blend(ahead, np.array([0.0, 0.8, 1.0]), closed=False)


@pytest.mark.parametrize("sector", range(8))
@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.0])
def test_the_sector_is_counted_from_the_body_counter_clockwise(sector, yaw):
    for within in (-20.0, 0.0, 20.0):
        heading = yaw + sector * math.pi / 4.0 + math.radians(within)
        path = np.array([[0.0, 0.0, 1.0], [math.cos(heading), math.sin(heading), 1.0]])
        assert heading_sector(path, yaw) == sector


def line_path(direction, yaw):
    points = np.outer(along, direction) + np.array([0.0, 0.0, 2.0])
    return continue_from(Line.fit(points, points[-1]), Vehicle(points[-1], yaw))


def test_a_line_flown_backward_goes_on_backward():
    assert np.allclose(line_path([-1.0, 0.0, 0.0], yaw=0.1)[:, 3], 0.1)


def test_a_line_flown_forward_turns_the_vehicle_along_it():
    assert np.allclose(line_path([0.6, 0.8, 0.0], yaw=0.8)[:, 3], math.atan2(0.8, 0.6))


def test_a_vertical_line_keeps_the_yaw():
    assert np.allclose(line_path([0.0, 0.0, 1.0], yaw=-1.2)[:, 3], -1.2)


@settings(max_examples=120, deadline=None)
@given(
    name=st.sampled_from(list(PRIMITIVES)),
    offset=offsets,
    turn=st.floats(-0.6, 0.6),
    speed=st.floats(0.3, 2.0),
)
def test_a_path_leaves_in_the_direction_of_travel(name, offset, turn, speed):
    here = MOTIONS[name][-1] + np.array(offset)
    shape = PRIMITIVES[name].fit(MOTIONS[name], here)
    ahead = shape.ahead()
    dx, dy, dz = ahead[1] - ahead[0]
    cos, sin = math.cos(turn), math.sin(turn)
    travel = np.array([cos * dx - sin * dy, sin * dx + cos * dy, dz])
    travel /= np.linalg.norm(travel)
    path = continue_from(shape, Vehicle(here, 0.0, speed * travel))[:, :3]
    assert np.allclose(path[0], here)
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert steps[0] @ travel / lengths[0] > math.cos(math.radians(6.0))
    bends = np.sum(steps[1:] * steps[:-1], axis=1) / (lengths[1:] * lengths[:-1])
    assert bends.min() > math.cos(math.radians(20.0))
    # Later it is the shape's.
    half = len(path) // 2
    assert np.allclose(path[half], ahead[half], atol=0.3)


def test_a_vehicle_that_flies_off_the_shape_gets_no_path():
    line = Line.fit(MOTIONS["line"], MOTIONS["line"][-1])
    with pytest.raises(UnfitError, match="degrees off"):
        continue_from(line, Vehicle(line.anchor_m, 0.0, np.array([-0.5, 1.0, 0.0])))


def test_a_vehicle_that_hardly_moves_has_no_direction_to_keep():
    line = Line.fit(MOTIONS["line"], MOTIONS["line"][-1])
    slow = Vehicle(line.anchor_m, 0.0, np.array([-0.1, 0.1, 0.0]))
    assert np.array_equal(continue_from(line, slow), continue_from(line, Vehicle(slow.here_m, 0.0)))
