"""A level lawnmower: parallel legs of one length, one beside the other, joined by half circles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.plane import at_ways, turned, way_of
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    MAX_STEPS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
)

LEGS_AHEAD = 4
MIN_LEGS = 3
"""Two legs have one turn: that tells neither where legs end at the other side, nor their spacing
twice."""
CHORD_M = 0.3
"""Directions are those of chords of this length: shorter ones are noise."""
RETREAT = 0.3
"""Going back by this share of the extent begins a new leg."""
MIDDLE = 0.6
"""Middle share of a leg that is straight; the rest may be turn."""
MIN_SPACING_M = 0.3
RMS_SHARE = 0.25
SAME_HEADING_RAD = math.radians(15.0)
SAME_SHARE = 0.3
"""Lawns that differ by this share are the same to who mows them by hand."""


@dataclass(frozen=True)
class Zigzag(Shape):
    """The leg being flown and the way to the next; the `estimate` is the spacing.

    A spacing is + if the next leg lies to the left of this one.
    """

    name: ClassVar[str] = "zigzag"
    figures: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "y": "m",
        "z": "m",
        "heading": "rad",
        "length": "m",
        "spacing": "m",
        "left": "m",
    }
    min_points: ClassVar[int] = 24
    steady: ClassVar[bool] = False

    anchor_m: Array
    heading_rad: float
    length_m: float
    spacing_m: float
    left_m: float
    legs: int
    errors: Mapping[str, float]

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """Directions give the legs' axis, reversals the legs, a regression their spacing."""
        xy = points_m[:, :2] - points_m[:, :2].mean(axis=0)
        axis_rad = _axis(xy)
        for _ in range(2):
            along, across = turned(xy, axis_rad)
            ends = _reversals(along)
            if len(ends) < MIN_LEGS - 1:
                raise UnfitError(f"it turns back only {len(ends)} times")
            leg_of = np.searchsorted(ends, np.arange(len(along)), side="right")
            straight = _straight(along, ends)
            legs, rows = leg_of[straight], along[straight]
            basis = np.column_stack([np.ones(len(rows)), legs - legs.mean(), rows])
            weights, *_ = np.linalg.lstsq(basis, across[straight], rcond=None)
            axis_rad += math.atan(float(weights[2]))
        off = across[straight] - basis @ weights
        sigma = math.sqrt(float(off @ off) / max(len(off) - 3, 1))
        inverse = np.linalg.pinv(basis.T @ basis)
        spread = sigma * np.sqrt(np.maximum(inverse.diagonal(), 0.0))

        tops, bottoms = _sides(along, ends)
        top, bottom = float(np.mean(tops)), float(np.mean(bottoms))
        scatter = np.concatenate([tops - top, bottoms - bottom])
        reach = math.sqrt(float(scatter @ scatter) / max(len(scatter) - 2, 1))
        reach_std = max(reach, sigma) * math.sqrt(1.0 / len(tops) + 1.0 / len(bottoms))
        way = 1.0 if along[-1] > along[ends[-1]] else -1.0
        last = len(ends)
        start_along, _ = turned(start_m[None, :2] - points_m[:, :2].mean(axis=0), axis_rad)
        beside = float(weights[0] + weights[1] * (last - legs.mean()))
        here = float(start_along[0])
        cos, sin = math.cos(axis_rad), math.sin(axis_rad)
        heights = points_m[:, 2]
        mean = points_m[:, :2].mean(axis=0)
        spacing = way * float(weights[1])
        rms = math.sqrt(float(np.mean(off**2) + np.mean(scatter**2) + np.var(heights)))
        heading = axis_rad if way > 0.0 else axis_rad + math.pi
        return cls(
            quality=Quality(
                rms_m=rms,
                extent_m=float(np.sum(np.abs(np.diff(along)))),
                count=len(xy),
                estimate=spacing,
                estimate_std=float(spread[1]),
                doubt=max(float(spread[1]) / max(abs(spacing), 1e-9), reach_std / (top - bottom)),
            ),
            anchor_m=np.array(
                [
                    mean[0] + cos * here - sin * beside,
                    mean[1] + sin * here + cos * beside,
                    float(heights.mean()),
                ]
            ),
            heading_rad=math.remainder(heading, 2.0 * math.pi),
            length_m=top - bottom,
            spacing_m=spacing,
            left_m=(top - here) if way > 0.0 else (here - bottom),
            legs=last + 1,
            errors={
                "heading": float(spread[2]),
                "length": reach_std,
                "spacing": float(spread[1]),
                "left": reach_std,
                "z": float(heights.std()) / math.sqrt(len(heights)),
            },
        )

    @property
    def params(self) -> dict[str, float]:
        """The place on this leg, its heading, the legs' length and spacing, what is left of it."""
        x, y, z = (float(v) for v in self.anchor_m)
        return {
            "x": x,
            "y": y,
            "z": z,
            "heading": self.heading_rad,
            "length": self.length_m,
            "spacing": self.spacing_m,
            "left": self.left_m,
        }

    @property
    def stds(self) -> dict[str, float]:
        """Of all but the place."""
        return dict(self.errors)

    @property
    def tolerances(self) -> dict[str, float]:
        """The sizes only: heading and side of the next leg turn round at the end of each."""
        return {"length": SAME_SHARE * self.length_m}

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any lawn; `extent` in legs."""
        length, spacing = float(rng.uniform(4.0, 8.0)), float(rng.uniform(0.8, 1.6))
        spacing *= float(rng.choice((-1.0, 1.0)))
        heading = float(rng.uniform(-math.pi, math.pi))
        x, y = (float(v) for v in rng.uniform(-10.0, 10.0, 2))
        z = float(rng.uniform(1.0, 3.0))
        way = _mown(np.zeros(2), heading, length, spacing, length, math.ceil(extent) + 1)
        lap_m = length - abs(spacing) + math.pi * abs(spacing) / 2.0
        points = at_ways(way, np.linspace(0.0, extent * lap_m, count))
        whole = math.floor(extent)
        turned = heading + math.pi * (whole % 2)
        along = (points[-1] - points[0]) @ np.array([math.cos(turned), math.sin(turned)])
        left = length - along if whole % 2 == 0 else -along
        xy = points + np.array([x, y])
        return Example(
            np.column_stack([xy, np.full(count, z)]),
            {
                "x": float(xy[-1, 0]),
                "y": float(xy[-1, 1]),
                "z": z,
                "heading": math.remainder(turned, 2.0 * math.pi),
                "length": length,
                "spacing": spacing * (1.0 if whole % 2 == 0 else -1.0),
                "left": float(left),
            },
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of the spacing."""
        return RMS_SHARE * abs(self.spacing_m)

    def check(self, config: Config) -> None:
        """Refuse legs that are too few, too near to one another, or too short to turn on."""
        if self.legs < MIN_LEGS:
            raise UnfitError(f"only {self.legs} legs of it were flown")
        if abs(self.spacing_m) < MIN_SPACING_M:
            raise UnfitError(f"its legs are only {abs(self.spacing_m):.2f} m apart")
        if self.length_m < 2.0 * abs(self.spacing_m):
            raise UnfitError(f"its legs are only {self.length_m:.1f} m long")

    def ahead(self) -> Array:
        """The rest of this leg and the next four."""
        xy = _mown(
            self.anchor_m[:2],
            self.heading_rad,
            self.length_m,
            self.spacing_m,
            self.left_m,
            LEGS_AHEAD,
        )
        way_m = float(way_of(xy)[-1])
        xy = at_ways(xy, np.linspace(0.0, way_m, min(max(round(way_m / STEP_M), 2), MAX_STEPS) + 1))
        return np.column_stack([xy, np.full(len(xy), self.anchor_m[2])])


def _axis(xy: Array) -> float:
    """The direction, forward or backward, that most of the way has, in rad."""
    steps = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    apart = max(1, round(CHORD_M / max(float(np.median(steps)), 1e-3)))
    chords = xy[apart:] - xy[:-apart]
    doubled = (chords[:, 0] + 1j * chords[:, 1]) ** 2
    return float(np.angle(np.sum(doubled / np.maximum(np.abs(doubled), 1e-12)))) / 2.0


def _reversals(along: Array) -> Array:
    """Indices at which a coordinate (N,) turns back by a share of its extent."""
    retreat = RETREAT * float(np.ptp(along))
    ends: list[int] = []
    high = low = 0
    way = 0
    for index, value in enumerate(along):
        if value > along[high]:
            high = index
        if value < along[low]:
            low = index
        if way >= 0 and along[high] - value > retreat:
            if way > 0:
                ends.append(high)
            way, low = -1, index
        elif way <= 0 and value - along[low] > retreat:
            if way < 0:
                ends.append(low)
            way, high = 1, index
    return np.array(ends, dtype=int)


def _straight(along: Array, ends: Array) -> Array:
    """Which points lie in the middle of the legs."""
    tops, bottoms = _sides(along, ends)
    middle = (float(np.mean(tops)) + float(np.mean(bottoms))) / 2.0
    half = MIDDLE * (float(np.mean(tops)) - float(np.mean(bottoms))) / 2.0
    return np.asarray(np.abs(along - middle) < half)


def _sides(along: Array, ends: Array) -> tuple[Array, Array]:
    """The reversals at the far and at the near side of the lawn, in m along the axis."""
    values = along[ends]
    first_is_top = bool(values[0] > values[1])
    return values[0 if first_is_top else 1 :: 2], values[1 if first_is_top else 0 :: 2]


def _mown(
    here_m: Array, heading_rad: float, length_m: float, spacing_m: float, left_m: float, legs: int
) -> Array:
    """Corners and half circles (N, 2) from a place on a leg through the next legs."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    forward, leftward = np.array([cos, sin]), np.array([-sin, cos])
    radius = abs(spacing_m) / 2.0
    turn = np.linspace(0.0, math.pi, 33)
    pieces = [here_m[None, :]]
    end = here_m + (left_m - radius) * forward
    for _ in range(legs):
        bulge = radius * np.outer(np.sin(turn), forward)
        pieces.append(end + bulge + spacing_m / 2.0 * np.outer(1.0 - np.cos(turn), leftward))
        begin = end + spacing_m * leftward
        forward = -forward
        end = begin + (length_m - 2.0 * radius) * forward
    pieces.append(end[None, :])
    way = np.vstack(pieces)
    if left_m < radius:
        # The vehicle is in the turn already: go on from where it is.
        ahead = (way[1:] - here_m) @ np.array([cos, sin]) >= 0.0
        way = np.vstack([here_m, way[1:][max(0, int(np.argmax(ahead))) :]])
    keep = np.concatenate([[True], np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9])
    return np.asarray(way[keep])
