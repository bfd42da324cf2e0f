"""Does what is drawn fit the lane?"""

import math

import numpy as np
import pytest
from operator_offers import circle_from, line_from, suggestion_of

from services.operator.eyes import Sight
from services.operator.judgement import Drawing, ahead_of, compare, drawing_of

LANE_ALONG_M = np.arange(-1.0, 12.0, 0.2)
LANE_M = np.stack([LANE_ALONG_M, np.zeros_like(LANE_ALONG_M)], axis=1)
SIGHT = Sight(
    np.array([0.0, 0.0, 1.0]), 0.0, np.zeros(2), np.array([], dtype=np.intp), np.empty((0, 2))
)


def drawn(points: np.ndarray, closed: bool = False) -> Drawing:
    return drawing_of(suggestion_of(1, "line", points, closed), SIGHT, 0)


def test_a_drawing_is_seen_from_the_vehicle_wherever_the_localizer_believes_it_is() -> None:
    here = drawn(line_from(0.0, 0.0, 1.0, 0.3))
    drifted = drawn(line_from(7.0, -3.0, 1.4, 0.3))
    np.testing.assert_allclose(here.points_m, drifted.points_m, atol=1e-12)


def test_a_line_at_an_angle_leaves_the_lane_by_its_sine() -> None:
    ahead = ahead_of(drawn(line_from(0.0, 0.0, 1.0, math.radians(10.0))), SIGHT.position_m, 5.0)
    fit = compare(ahead, LANE_ALONG_M, LANE_M, 1.0)
    assert fit.aside_m == pytest.approx(5.0 * math.sin(math.radians(10.0)), abs=0.03)
    assert fit.gain_m == pytest.approx(5.0 * math.cos(math.radians(10.0)), abs=0.3)
    assert fit.looked_m == pytest.approx(5.0, abs=0.11)
    assert fit.height_m == pytest.approx(0.0)


def test_a_line_backwards_gains_nothing() -> None:
    back = line_from(0.0, 0.0, 1.0, math.pi)
    fit = compare(ahead_of(drawn(back), SIGHT.position_m, 0.9), LANE_ALONG_M, LANE_M, 1.0)
    assert fit.aside_m < 0.1
    assert fit.gain_m < 0.0


def test_a_closed_drawing_goes_on_beyond_its_last_point() -> None:
    circle = drawn(circle_from(0.0, 0.0, 1.0, 0.0, 2.0), closed=True)
    almost_round = circle.points_m[-5]
    assert len(ahead_of(circle, almost_round, 5.0)) > 40


def test_the_height_counts() -> None:
    fit = compare(drawn(line_from(0.0, 0.0, 1.0, 0.0)).points_m[:40], LANE_ALONG_M, LANE_M, 1.8)
    assert fit.height_m == pytest.approx(0.8)
