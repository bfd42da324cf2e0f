"""Lines: any direction, with the sign of travel and climb."""

import itertools
import math

import numpy as np
import pytest
from synthesis_truth import arc_points, noisy

from services.synthesis.config import Config
from services.synthesis.primitives.line import Line
from services.synthesis.primitives.shape import UnfitError

DIRECTIONS = [d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]


def line_points(direction, length_m=3.0, count=90):
    unit = np.array(direction) / np.linalg.norm(direction)
    return np.array([1.0, -2.0, 3.0]) + np.outer(np.linspace(0.0, length_m, count), unit), unit


def direction_of(params):
    level = math.cos(params["climb"])
    return np.array(
        [
            level * math.cos(params["heading"]),
            level * math.sin(params["heading"]),
            math.sin(params["climb"]),
        ]
    )


def angle_between(a, b):
    return math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_line_keeps_its_direction_in_all_26(direction):
    points, unit = line_points(direction)
    line = Line.fit(points, points[-1])
    line.check(Config())
    assert angle_between(direction_of(line.params), unit) < 1e-6
    assert line.quality.rms_m < 1e-9
    ahead = line.ahead()
    assert np.allclose(ahead[0], points[-1])
    assert np.allclose(ahead[-1], points[-1] + 20.0 * unit)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_error_of_a_noisy_line_is_as_large_as_it_says(direction):
    rng = np.random.default_rng(3)
    points, unit = line_points(direction)
    errors, claims = [], []
    for _ in range(60):
        line = Line.fit(noisy(points, 0.03, rng), points[-1])
        errors.append(angle_between(direction_of(line.params), unit))
        claims.append(line.quality.doubt * math.pi / 8.0)
    # Two components of error: their length is sqrt(2) larger in the mean of squares.
    ratio = np.sqrt(np.mean(np.square(errors))) / (math.sqrt(2.0) * np.mean(claims))
    assert 0.75 < ratio < 1.3


def test_total_least_squares_is_no_worse_than_an_oracle_that_knows_the_axis():
    rng = np.random.default_rng(4)
    points, _ = line_points((1.0, 0.0, 0.0))
    ours, oracle = [], []
    for _ in range(300):
        sample = noisy(points, 0.05, rng)
        ours.append(abs(Line.fit(sample, sample[-1]).params["heading"]))
        slope = np.polyfit(sample[:, 0], sample[:, 1], 1)[0]
        oracle.append(abs(math.atan(slope)))
    assert np.percentile(ours, 95) <= 1.05 * np.percentile(oracle, 95)


def test_points_that_bend_are_no_line():
    points = arc_points(0.0, 0.0, 1.0, 2.0, 0.0, math.radians(60.0))
    with pytest.raises(UnfitError, match="bends"):
        Line.fit(points, points[-1]).check(Config())


def test_one_place_is_no_line():
    points = np.ones((50, 3))
    with pytest.raises(UnfitError):
        Line.fit(points, points[-1])


@pytest.mark.parametrize(
    ("climb_deg", "meant_deg"),
    [(1.5, 0.0), (-2.4, 0.0), (3.0, 3.0), (20.0, 20.0), (88.0, 90.0), (-89.0, -90.0)],
)
def test_a_nearly_level_or_vertical_line_is_meant_to_be_one(climb_deg, meant_deg):
    climb = math.radians(climb_deg)
    points, _ = line_points((0.6 * math.cos(climb), 0.8 * math.cos(climb), math.sin(climb)))
    line = Line.fit(points, points[-1]).as_meant()
    assert math.degrees(line.params["climb"]) == pytest.approx(meant_deg, abs=1e-6)
    assert np.allclose(line.ahead()[0], points[-1])
    if abs(meant_deg) < 90.0:
        assert line.params["heading"] == pytest.approx(math.atan2(0.8, 0.6))
