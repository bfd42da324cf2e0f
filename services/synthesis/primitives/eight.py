"""A level figure of eight, flown on and on: a sin t along its axis, b sin 2t to the left of it.

Gerono's lemniscate, with a width of its own. Turned by half a turn it is the same way flown
backward, so the heading tells the direction of travel too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from scipy.ndimage import uniform_filter1d

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.plane import at_ways, turned_back, way_of
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    MAX_STEPS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
)

MIN_LAPS = 0.8
"""Less has not shown the size of both loops."""
MAX_POINTS = 120
"""More points of the way than this make the fit slow and no better."""
SMOOTH_POINTS = 5
"""Of the way, averaged for its direction."""
ITERATIONS = 25
CLOSE_M = 1e-4
"""Steps of the fit smaller than this end it."""
RMS_SHARE = 0.2
SAME_HEADING_RAD = math.radians(20.0)
SAME_SHARE = 0.25
"""Eights that differ by this share are the same to who flies them by hand."""
_PHASES = np.linspace(-math.pi, math.pi, 240, endpoint=False)
_AGAINST_M = 1e3
"""Added to the distance of places where the eight leads against the way the vehicle flew."""
_ASIDE_SHARE = 0.25
"""Of half the width, added where it leads at a right angle to it: both ways lead on from the
crossing, and the nearer one may be the wrong one by a hair."""


@dataclass(frozen=True)
class Eight(Shape):
    """A crossing, an axis, two half sizes and the place on it; the `estimate` is the length."""

    name: ClassVar[str] = "eight"
    figures: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "y": "m",
        "z": "m",
        "heading": "rad",
        "length": "m",
        "width": "m",
        "phase": "rad",
    }
    closed: ClassVar[bool] = True
    min_points: ClassVar[int] = 16
    steady: ClassVar[bool] = False

    eight: Array
    """x and y of the crossing, heading, half the length, half the width."""
    height_m: float
    phase_rad: float
    laps: float
    errors: Mapping[str, float]

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """Least squared distances to the nearest places that lead the way that was flown."""
        xy = points_m[:: math.ceil(len(points_m) / MAX_POINTS), :2]
        travel = np.gradient(uniform_filter1d(xy, SMOOTH_POINTS, axis=0, mode="nearest"), axis=0)
        centre = (xy.max(axis=0) + xy.min(axis=0)) / 2.0
        _, singular, axes = np.linalg.svd(xy - xy.mean(axis=0), full_matrices=False)
        if singular[1] <= 1e-9:
            raise UnfitError("the points lie on a line", "line")
        principal = math.atan2(axes[0, 1], axes[0, 0])
        best: tuple[float, Array] | None = None
        for turn in (0.0, math.pi, math.pi / 2.0, -math.pi / 2.0):
            cos, sin = math.cos(principal + turn), math.sin(principal + turn)
            offset = xy - xy.mean(axis=0)
            half_length = np.abs(offset @ np.array([cos, sin])).max()
            half_width = np.abs(offset @ np.array([-sin, cos])).max()
            for middle in (centre, xy.mean(axis=0)):
                start = np.array([*middle, principal + turn, half_length, half_width])
                phases = _nearest(start, xy, travel)
                off_m = float(np.mean(np.linalg.norm(xy - _on(start, phases), axis=1)))
                if best is None or off_m < best[0]:
                    best = off_m, start
        assert best is not None
        eight, covariance, off = _refined(best[1], xy, travel)
        tangent = _tangent(eight, _nearest(eight, xy, travel))
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        advance_m = float(np.sum(np.diff(xy, axis=0) * (tangent[1:] + tangent[:-1]) / 2.0))
        heights = points_m[:, 2]
        errors = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        names = ("x", "y", "heading", "length", "width")
        by_name = {
            name: float(error) * (2.0 if name in ("length", "width") else 1.0)
            for name, error in zip(names, errors, strict=True)
        }
        return cls(
            quality=Quality(
                rms_m=math.sqrt(float(np.mean(off**2) + np.var(heights))),
                extent_m=advance_m,
                count=len(xy),
                estimate=2.0 * float(eight[3]),
                estimate_std=by_name["length"],
                doubt=float(max(errors[3] / eight[3], errors[4] / eight[4])),
            ),
            eight=eight,
            height_m=float(heights.mean()),
            phase_rad=float(_nearest(eight, start_m[None, :2], travel[-1:])[0]),
            laps=advance_m / _lap_m(eight),
            errors={**by_name, "z": float(heights.std()) / math.sqrt(len(heights))},
        )

    @property
    def params(self) -> dict[str, float]:
        """The crossing, the axis, the whole sizes, and the vehicle's place: phase 0 crosses."""
        x, y, heading, half_length, half_width = (float(v) for v in self.eight)
        return {
            "x": x,
            "y": y,
            "z": self.height_m,
            "heading": math.remainder(heading, 2.0 * math.pi),
            "length": 2.0 * half_length,
            "width": 2.0 * half_width,
            "phase": self.phase_rad,
        }

    @property
    def stds(self) -> dict[str, float]:
        """Of all but the phase, which says where the vehicle is."""
        return dict(self.errors)

    @property
    def tolerances(self) -> dict[str, float]:
        """Shares of the size."""
        share = SAME_SHARE * 2.0 * float(self.eight[3])
        return {
            "x": share,
            "y": share,
            "heading": SAME_HEADING_RAD,
            "length": share,
            "width": SAME_SHARE * 2.0 * float(self.eight[4]),
        }

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any eight in any direction; `extent` in laps."""
        half_length = float(rng.uniform(1.5, 4.0))
        half_width = half_length * float(rng.uniform(0.35, 0.6))
        x, y = (float(v) for v in rng.uniform(-10.0, 10.0, 2))
        heading, begin = (float(v) for v in rng.uniform(-math.pi, math.pi, 2))
        z = float(rng.uniform(1.0, 3.0))
        phases = begin + np.linspace(0.0, 2.0 * math.pi * extent, count)
        points = _on(np.array([x, y, heading, half_length, half_width]), phases)
        return Example(
            np.column_stack([points, np.full(count, z)]),
            {
                "x": x,
                "y": y,
                "z": z,
                "heading": heading,
                "length": 2.0 * half_length,
                "width": 2.0 * half_width,
                "phase": math.remainder(float(phases[-1]), 2.0 * math.pi),
            },
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of half the width."""
        return RMS_SHARE * float(self.eight[4])

    def check(self, config: Config) -> None:
        """Refuse less than most of a lap, and loops too tight to fly."""
        if self.laps < MIN_LAPS:
            raise UnfitError(f"only {self.laps:.0%} of a lap was flown")
        if not config.min_radius_m <= float(self.eight[4]) <= config.max_radius_m:
            raise UnfitError(f"its width is {2.0 * self.eight[4]:.1f} m")
        if float(self.eight[3]) > 2.0 * config.max_radius_m:
            raise UnfitError(f"its length is {2.0 * self.eight[3]:.1f} m")

    def ahead(self) -> Array:
        """One lap, whose last point is its first."""
        dense = _on(self.eight, self.phase_rad + np.linspace(0.0, 2.0 * math.pi, 1025))
        lap_m = float(way_of(dense)[-1])
        count = min(max(round(lap_m / STEP_M), 128), MAX_STEPS)
        xy = at_ways(dense, np.linspace(0.0, lap_m, count + 1))
        xy[-1] = xy[0]
        return np.column_stack([xy, np.full(len(xy), self.height_m)])


def _on(eight: Array, phases: Array) -> Array:
    """Places (N, 2) on an eight."""
    along, across = eight[3] * np.sin(phases), eight[4] * np.sin(2.0 * phases)
    return eight[:2] + turned_back(along, across, float(eight[2]))


def _tangent(eight: Array, phases: Array) -> Array:
    """How these places follow the phase, (N, 2) in m/rad."""
    along, across = eight[3] * np.cos(phases), 2.0 * eight[4] * np.cos(2.0 * phases)
    return turned_back(along, across, float(eight[2]))


def _lap_m(eight: Array) -> float:
    """Length of a lap."""
    step = float(_PHASES[1] - _PHASES[0])
    return float(np.sum(np.linalg.norm(_tangent(eight, _PHASES), axis=1))) * step


def _nearest(eight: Array, xy: Array, travel: Array) -> Array:
    """Phases (N,) of the places nearest to points (N, 2) that lead the way of travel (N, 2)."""
    gaps = np.linalg.norm(xy[:, None] - _on(eight, _PHASES)[None], axis=2)
    ways = _tangent(eight, _PHASES)
    lengths = np.linalg.norm(travel, axis=1)[:, None] * np.linalg.norm(ways, axis=1)
    agree = travel @ ways.T / np.maximum(lengths, 1e-12)
    gaps += np.where(agree > 0.0, _ASIDE_SHARE * abs(eight[4]) * (1.0 - agree), _AGAINST_M)
    phases = _PHASES[np.argmin(gaps, axis=1)]
    tangent = _tangent(eight, phases)
    along = np.sum((xy - _on(eight, phases)) * tangent, axis=1) / np.sum(tangent**2, axis=1)
    step = _PHASES[1] - _PHASES[0]
    return np.asarray(phases + np.clip(along, -step, step))


def _refined(eight: Array, xy: Array, travel: Array) -> tuple[Array, Array, Array]:
    """Gauss-Newton on the distances to the nearest places: parameters, covariance, distances.

    Raises:
        UnfitError: if the parameters are not determined.
    """
    for _ in range(ITERATIONS):
        phases = _nearest(eight, xy, travel)
        tangent = _tangent(eight, phases)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        off = np.sum((xy - _on(eight, phases)) * normal, axis=1)
        cos, sin = math.cos(eight[2]), math.sin(eight[2])
        from_crossing = _on(eight, phases) - eight[:2]
        turned = np.column_stack([-from_crossing[:, 1], from_crossing[:, 0]])
        slopes = np.column_stack(
            [
                normal,
                np.sum(turned * normal, axis=1),
                np.sin(phases) * (normal @ np.array([cos, sin])),
                np.sin(2.0 * phases) * (normal @ np.array([-sin, cos])),
            ]
        )
        normal_matrix = slopes.T @ slopes
        try:
            step = np.linalg.solve(normal_matrix, slopes.T @ off)
        except np.linalg.LinAlgError:
            raise UnfitError("the points do not determine it") from None
        eight = eight + step
        if eight[3] <= 0.0 or eight[4] <= 0.0 or not np.all(np.isfinite(eight)):
            raise UnfitError("the points do not determine it")
        if np.abs(step).max() < CLOSE_M:
            break
    variance = float(off @ off) / max(len(off) - 5, 1)
    return eight, np.linalg.inv(normal_matrix) * variance, off
