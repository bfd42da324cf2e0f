import numpy as np
import pytest
from scipy.spatial.distance import directed_hausdorff

from studies.metrics import LapCounter, hausdorff_m, path_length_m, resample


def circle(radius_m: float, turns: float, points: int = 400) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi * turns, points)
    return np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle)], axis=1)


def test_length_of_a_circle_is_its_circumference() -> None:
    assert path_length_m(circle(2.0, 1.0)) == pytest.approx(4.0 * np.pi, rel=1e-3)


def test_concentric_circles_are_apart_by_the_difference_of_their_radii() -> None:
    assert hausdorff_m(circle(2.0, 1.0), circle(2.5, 1.0)) == pytest.approx(0.5, abs=1e-3)


def test_hausdorff_agrees_with_scipy_and_counts_what_was_not_flown() -> None:
    half, whole = circle(2.0, 0.5), circle(2.0, 1.0)
    dense_half, dense_whole = resample(half), resample(whole)
    oracle = max(
        directed_hausdorff(dense_half, dense_whole)[0],
        directed_hausdorff(dense_whole, dense_half)[0],
    )
    assert hausdorff_m(half, whole) == pytest.approx(oracle)
    assert hausdorff_m(half, whole) > 1.5


@pytest.mark.parametrize("turns", [1.0, 2.5, -1.0])
def test_laps_are_counted_with_their_sense(turns: float) -> None:
    counter = LapCounter(circle(8.0, 1.0))
    for x, y in circle(8.3, turns, 2000):
        counter.add(x, y)
    assert counter.laps == pytest.approx(turns, abs=0.02)


def test_a_short_cut_makes_no_lap() -> None:
    counter = LapCounter(circle(8.0, 1.0))
    for x in np.linspace(8.0, -8.0, 500):
        counter.add(float(x), 0.0)
    for x in np.linspace(-8.0, 8.0, 500):
        counter.add(float(x), 0.0)
    assert abs(counter.laps) < 0.3
