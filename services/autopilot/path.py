"""The geometry of an accepted path: resampled evenly, with tangents, yaw and curvature."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from common.frames import Array
from common.messages import PathPoint

SPACING_M = 0.05
SMOOTHING_M = 0.25
"""Tangents and curvature are averaged over this length: paths come as polylines."""
MIN_LENGTH_M = 0.1
MAX_LENGTH_M = 2000.0
START_SEARCH_M = 6.0
"""The first point is looked for here first: a path starts at the vehicle and may cross itself."""
SEARCH_AHEAD_M = 1.0


class BadPathError(ValueError):
    """A path that cannot be flown; the text is the reason that `accept` is refused for."""


@dataclass(frozen=True)
class PathState:
    """One place on a path: position, unit tangent, its change a metre, yaw and its change."""

    position_m: tuple[float, float, float]
    tangent: tuple[float, float, float]
    curvature_1pm: tuple[float, float, float]
    yaw_rad: float
    yaw_rate_radpm: float


class Path:
    """A path as a function of the distance along it, in m from its first point.

    Args:
        points: x, y, z in m and yaw in rad, world frame.
        closed: whether the end joins the start; distances then go on past the length.

    Raises:
        BadPathError: if it is too short or too long.
    """

    def __init__(self, points: Sequence[PathPoint], closed: bool) -> None:
        raw = np.asarray(points, dtype=np.float64)
        if closed:
            raw = np.vstack([raw, raw[:1]])
        raw[:, 3] = np.unwrap(np.remainder(raw[:, 3], 2.0 * math.pi))
        steps = np.linalg.norm(np.diff(raw[:, :3], axis=0), axis=1)
        raw = raw[np.concatenate([[True], steps > 1e-6])]
        along = np.concatenate([[0.0], np.cumsum(steps[steps > 1e-6])])
        length = float(along[-1])
        if not MIN_LENGTH_M <= length <= MAX_LENGTH_M:
            raise BadPathError("bad_path")
        # A closed path may end a whole turn of yaw from where it began.
        self._yaw_turn_rad = float(raw[-1, 3] - raw[0, 3]) if closed else 0.0
        self.closed = closed
        self.length_m = length
        count = max(2, round(length / SPACING_M))
        self.spacing_m = length / count
        even = np.linspace(0.0, length, count + 1)
        samples = np.column_stack([np.interp(even, along, raw[:, i]) for i in range(4)])
        self._points: Array = samples[:, :3]
        self._yaws_rad: Array = samples[:, 3]
        self._tangents = self._smooth_tangents()
        self.yaw_rates_radpm = self._smooth(np.diff(self._yaws_rad)[:, None] / self.spacing_m)[:, 0]
        """Change of the yaw a metre at the samples, (N,)."""
        self.curvatures_1pm = self._smooth(np.diff(self._tangents, axis=0) / self.spacing_m)
        """Curvature vectors at the samples, towards the inside of the turn, (N, 3)."""
        # As lists: single places are asked for 250 times a second, where numpy is slow.
        self._rows: list[list[float]] = np.column_stack(
            [
                self._points,
                self._tangents,
                self.curvatures_1pm,
                self._yaws_rad,
                self.yaw_rates_radpm,
            ]
        ).tolist()

    @property
    def points_m(self) -> Array:
        """The samples (N, 3), SPACING_M apart or slightly more or less; the last ends the path."""
        return self._points

    @property
    def tangents(self) -> Array:
        """Unit tangents at the samples, (N, 3)."""
        return self._tangents

    def at(self, distance_m: float) -> PathState:
        """The path at a distance; open paths end where they end."""
        if self.closed:
            laps, within = divmod(distance_m, self.length_m)
        else:
            laps, within = 0.0, min(max(distance_m, 0.0), self.length_m)
        position = within / self.spacing_m
        low = min(int(position), len(self._rows) - 2)
        share = position - low
        keep = 1.0 - share
        x, y, z, tx, ty, tz, cx, cy, cz, yaw, turn = (
            one * keep + other * share
            for one, other in zip(self._rows[low], self._rows[low + 1], strict=True)
        )
        norm = math.sqrt(tx * tx + ty * ty + tz * tz) or 1.0
        return PathState(
            (x, y, z),
            (tx / norm, ty / norm, tz / norm),
            (cx, cy, cz),
            yaw + laps * self._yaw_turn_rad,
            turn,
        )

    def nearest_start_m(self, position_m: Sequence[float], limit_m: float) -> float:
        """The distance along the path of the point to start at, for a vehicle at a position.

        It is the nearest one of the first few metres if that is within `limit_m`, else of all.
        """
        gaps = np.linalg.norm(self._points - np.asarray(position_m), axis=1)
        first = gaps[: int(START_SEARCH_M / self.spacing_m) + 1]
        index = int(np.argmin(first if first.min() <= limit_m else gaps))
        return self._refined(index * self.spacing_m, position_m)

    def advanced_m(self, distance_m: float, position_m: Sequence[float]) -> float:
        """The distance of the nearest point a little ahead of `distance_m`; never goes back."""
        rows, count = self._rows, len(self._rows) - 1
        low = math.floor(distance_m / self.spacing_m)
        end = low + int(SEARCH_AHEAD_M / self.spacing_m) + 1
        ahead = range(low, end if self.closed else min(end, count + 1))
        if not ahead:
            return distance_m
        px, py, pz = position_m
        best, least = low, math.inf
        for index in ahead:
            x, y, z, *_ = rows[index % count] if self.closed else rows[index]
            square = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
            if square < least:
                best, least = index, square
        return max(distance_m, self._refined(best * self.spacing_m, position_m))

    def _refined(self, distance_m: float, position_m: Sequence[float]) -> float:
        here = self.at(distance_m)
        offset = sum(
            t * (p - q) for t, p, q in zip(here.tangent, position_m, here.position_m, strict=True)
        )
        offset = min(max(offset, -self.spacing_m), self.spacing_m)
        if self.closed:
            return distance_m + offset
        return min(max(distance_m + offset, 0.0), self.length_m)

    def _smooth_tangents(self) -> Array:
        chords = np.diff(self._points, axis=0) / self.spacing_m
        tangents = self._smooth(chords)
        norms = np.linalg.norm(tangents, axis=1, keepdims=True)
        return np.asarray(tangents / np.where(norms > 1e-9, norms, 1.0), dtype=np.float64)

    def _smooth(self, of_segments: Array) -> Array:
        """Averages of segments' values, (N - 1, k), at the N samples."""
        first, last = (-1, 0) if self.closed else (0, -1)
        padded = np.vstack([of_segments[first], of_segments, of_segments[last]])
        at_samples = (padded[:-1] + padded[1:]) / 2.0
        width = max(1, round(SMOOTHING_M / self.spacing_m))
        if not self.closed:
            return np.asarray(uniform_filter1d(at_samples, width, axis=0, mode="nearest"))
        smooth = uniform_filter1d(at_samples[:-1], width, axis=0, mode="wrap")
        return np.vstack([smooth, smooth[:1]])
