"""Paths end before what stands in their way, and say what that is."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.fence import Fence
from services.synthesis.config import Config
from services.synthesis.primitives.shape import UnfitError
from services.synthesis.surroundings import Surroundings
from worlds import Body

CONFIG = Config()
CLEARANCE_M = CONFIG.half_width_m + CONFIG.margin_m
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def body(shape="box", size=(1.0, 1.0, 2.0), at=(5.0, 0.0, 1.0), turn=UPRIGHT):
    return Body(shape, size, at, turn, "crate")


def straight(length_m=20.0, begin=(0.0, 0.0, 1.0), heading=0.0, climb_mpm=0.0):
    way = np.linspace(0.0, length_m, round(length_m / 0.1) + 1)
    x, y, z = begin
    return np.column_stack(
        [
            x + way * math.cos(heading),
            y + way * math.sin(heading),
            z + climb_mpm * way,
            np.full(len(way), heading),
        ]
    )


def circle(radius=3.0, centre=(0.0, 3.0)):
    angle = np.linspace(-math.pi / 2.0, 1.5 * math.pi, 200)
    xy = np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.column_stack([xy, np.ones(len(angle)), angle + math.pi / 2.0])


def test_a_free_path_is_left_as_it_is():
    path = circle()
    way = Surroundings(CONFIG, (body(at=(9.0, 9.0, 1.0)),)).keep(path, closed=True)
    assert way.path is path
    assert way.closed
    assert not way.note


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
def test_a_path_ends_before_a_body_and_names_it(shape):
    size = (2.0, 2.0, 2.0)
    way = Surroundings(CONFIG, (body(shape, size),)).keep(straight(), closed=False)
    assert way.path[-1, 0] == pytest.approx(4.0 - CLEARANCE_M, abs=0.11)
    assert "crate" in way.note
    assert "3.5 m" in way.note


def test_a_turned_body_is_met_where_it_is():
    half = math.pi / 8.0
    turned = body(size=(2.0, 2.0, 2.0), turn=(0.0, 0.0, math.sin(half), math.cos(half)))
    way = Surroundings(CONFIG, (turned,)).keep(straight(), closed=False)
    assert way.path[-1, 0] == pytest.approx(5.0 - math.sqrt(2.0) - CLEARANCE_M, abs=0.11)


def test_what_is_lower_than_the_path_is_not_in_its_way():
    low = body(size=(1.0, 1.0, 1.0), at=(5.0, 0.0, 0.5))
    over = straight(begin=(0.0, 0.0, 1.0 + CLEARANCE_M + 0.01))
    assert not Surroundings(CONFIG, (low,)).keep(over, closed=False).note
    assert Surroundings(CONFIG, (low,)).keep(straight(), closed=False).note


def test_a_circle_through_a_wall_is_no_longer_closed():
    wall = body(size=(20.0, 0.1, 2.0), at=(0.0, 4.0, 1.0))
    way = Surroundings(CONFIG, (wall,)).keep(circle(), closed=True)
    assert not way.closed
    assert way.path[:, 1].max() < 4.0 - 0.05 - CLEARANCE_M + 0.02


def test_a_wall_close_ahead_leaves_no_path():
    with pytest.raises(UnfitError, match=r"crate 0\.\d m ahead"):
        Surroundings(CONFIG, (body(at=(1.5, 0.0, 1.0)),)).keep(straight(), closed=False)


def test_a_vehicle_beside_a_wall_may_go_along_it_and_away_but_not_nearer():
    wall = body(size=(40.0, 0.1, 2.0), at=(0.0, 0.3, 1.0))
    near = Surroundings(CONFIG, (wall,))
    assert not near.keep(straight(), closed=False).note
    assert not near.keep(straight(heading=-0.5), closed=False).note
    with pytest.raises(UnfitError, match="crate"):
        near.keep(straight(heading=0.1), closed=False)


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        (straight(begin=(85.0, 0.0, 1.0)), "the geofence"),
        (straight(begin=(0.0, 0.0, 3.0), climb_mpm=-0.2), "the lowest height of 0.3 m"),
        (straight(begin=(0.0, 0.0, 8.0), climb_mpm=0.2), "the greatest height of 10 m"),
    ],
)
def test_a_path_ends_at_the_limits_and_names_them(path, reason):
    way = Surroundings(CONFIG, ()).keep(path, closed=False)
    assert reason in way.note
    assert len(way.path) > 100


@pytest.mark.parametrize("shift_m", np.arange(0.0, 0.1, 0.005))
@pytest.mark.parametrize("climb_mpm", [0.0, 1.0])
def test_what_is_left_of_a_path_at_a_limit_can_be_accepted(shift_m, climb_mpm):
    path = straight(begin=(95.0 + shift_m, 0.0, 5.0 + shift_m), climb_mpm=climb_mpm)
    way = Surroundings(CONFIG, ()).keep(path, closed=False)
    assert way.note
    assert Fence(AutopilotConfig()).holds(way.path[:, :3])


def test_a_path_in_a_world_that_is_not_known_says_so():
    way = Surroundings(CONFIG, None).keep(straight(), closed=False)
    assert len(way.path) == 201
    assert "not known" in way.note
    way = Surroundings(CONFIG, None).keep(straight(begin=(85.0, 0.0, 1.0)), closed=False)
    assert "the geofence" in way.note
    assert "not known" in way.note


def test_a_vehicle_out_of_bounds_may_come_back():
    back = straight(length_m=30.0, begin=(110.0, 0.0, 1.0), heading=math.pi)
    assert not Surroundings(CONFIG, ()).keep(back, closed=False).note
    with pytest.raises(UnfitError, match="geofence"):
        Surroundings(CONFIG, ()).keep(straight(begin=(110.0, 0.0, 1.0)), closed=False)


def test_bodies_are_not_looked_for_where_the_place_is_not_known_and_the_note_says_so():
    way = Surroundings(CONFIG, (body(),)).keep(straight(), closed=False, position_std_m=1.5)
    assert len(way.path) == 201
    assert "walls not checked" in way.note
    assert "crate" in Surroundings(CONFIG, (body(),)).keep(straight(), closed=False).note


@settings(max_examples=150, deadline=None)
@given(
    shape=st.sampled_from(["box", "cylinder", "sphere"]),
    at=st.tuples(st.floats(2.0, 12.0), st.floats(-3.0, 3.0), st.floats(0.0, 3.0)),
    side=st.floats(0.2, 3.0),
    yaw=st.floats(-3.0, 3.0),
    heading=st.floats(-0.5, 0.5),
)
def test_whatever_is_kept_keeps_clear(shape, at, side, yaw, heading):
    turn = (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))
    stands = body(shape, (side, side, 1.5 * side if shape != "sphere" else side), at, turn)
    path = straight(heading=heading)
    try:
        way = Surroundings(CONFIG, (stands,)).keep(path, closed=False)
    except UnfitError:
        return
    # The body's inside, sampled: no sample is nearer than the clearance, unless the start was.
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 9)] * 3), axis=-1).reshape(-1, 3)
    if shape != "box":
        grid = grid[np.hypot(grid[:, 0], grid[:, 1]) <= 0.5]
    if shape == "sphere":
        grid = grid[np.linalg.norm(grid, axis=1) <= 0.5]
    grid = grid * np.array(stands.size_m)
    cos, sin = math.cos(yaw), math.sin(yaw)
    inside = np.array(at) + grid @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    gaps = np.linalg.norm(way.path[:, None, :3] - inside[None], axis=2).min(axis=1)
    assert np.all(gaps >= min(CLEARANCE_M, float(gaps[0])) - 0.03)
