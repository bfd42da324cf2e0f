"""Measures of a flown path against an ideal one (thesis, section 5.3)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

RESAMPLE_M = 0.05
"""Both paths are sampled this densely, so that a distance to samples is one to the curve."""


def path_length_m(points_m: Array) -> float:
    """Length of the polyline through points (N, D), in m."""
    if len(points_m) < 2:
        return 0.0
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=1).sum())


def resample(points_m: Array, step_m: float = RESAMPLE_M) -> Array:
    """The polyline through points (N, D) at equal steps of arc length, (M, D)."""
    steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] == 0.0:
        return points_m[:1]
    wanted = np.linspace(0.0, along[-1], max(2, int(np.ceil(along[-1] / step_m)) + 1))
    return np.stack([np.interp(wanted, along, column) for column in points_m.T], axis=1)


def hausdorff_m(flown_m: Array, ideal_m: Array) -> float:
    """Hausdorff distance of two paths (N, D) and (M, D), in m.

    The larger of: how far the flown path strays from the ideal one, and how far from the flown path
    lies a part of the ideal one.
    """
    flown, ideal = resample(flown_m), resample(ideal_m)
    strayed = cKDTree(ideal).query(flown)[0].max()
    missed = cKDTree(flown).query(ideal)[0].max()
    return float(max(strayed, missed))


class LapCounter:
    """Counts laps of a closed path by the arc length that a flight makes good along it.

    Only small steps count, so that a short cut across the middle is no progress.

    Args:
        ideal_m: the closed path, (N, >=2), evenly sampled; only x and y are used.
    """

    MAX_STEP_M = 2.0
    MAX_OFFSET_M = 3.0

    def __init__(self, ideal_m: Array) -> None:
        self._path = resample(ideal_m[:, :2])
        self._tree = cKDTree(self._path)
        self._length_m = path_length_m(self._path)
        self._last_m: float | None = None
        self.progress_m = 0.0

    def add(self, x_m: float, y_m: float) -> None:
        """Take one position of the flight."""
        offset_m, index = self._tree.query((x_m, y_m))
        if offset_m > self.MAX_OFFSET_M:
            return
        here_m = float(index) * self._length_m / (len(self._path) - 1)
        if self._last_m is not None:
            half = self._length_m / 2.0
            step_m = (here_m - self._last_m + half) % self._length_m - half
            if abs(step_m) > self.MAX_STEP_M:
                return
            self.progress_m += step_m
        self._last_m = here_m

    @property
    def laps(self) -> float:
        """Laps made good so far."""
        return self.progress_m / self._length_m
