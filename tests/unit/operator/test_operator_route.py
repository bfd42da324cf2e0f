"""The plan."""

import math

import numpy as np
import pytest

import worlds
from services.operator.route import route_of

TRACK = route_of(worlds.load("track"))


def test_the_tracks_route_is_two_straights_and_two_half_circles() -> None:
    assert [leg.primitive for leg in TRACK.legs] == ["line", "arc", "line", "arc"]
    assert TRACK.length_m == pytest.approx(2.0 * 15.0 + 2.0 * math.pi * 4.0)
    assert TRACK.is_closed
    assert TRACK.is_on_ground


def test_points_are_evenly_spaced_all_round() -> None:
    gaps_m = np.linalg.norm(np.diff(TRACK.points_m, axis=0, append=TRACK.points_m[:1]), axis=1)
    assert gaps_m.min() > 0.98 * TRACK.step_m
    assert gaps_m.max() < 1.02 * TRACK.step_m


@pytest.mark.parametrize("lap", [0, 1, 5])
def test_a_leg_is_found_by_the_distance_over_all_laps(lap: int) -> None:
    leg, left_m = TRACK.leg_at(lap * TRACK.length_m + 14.0)
    assert leg.primitive == "line"
    assert left_m == pytest.approx(1.0)
    leg, _ = TRACK.leg_at(lap * TRACK.length_m + 16.0)
    assert leg.primitive == "arc"


def test_a_world_without_a_path_is_no_plan() -> None:
    with pytest.raises(ValueError, match="empty"):
        route_of(worlds.load("empty"))
