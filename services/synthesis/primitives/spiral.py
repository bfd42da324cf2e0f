"""A level spiral: a circle whose radius grows, or shrinks, by the same length a turn."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.arc import angles_about, fit_circle, turns_of
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    MAX_STEPS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
    levenberg_marquardt,
)

TURNS = 3
MIN_SWEEP_RAD = 2.0 * math.pi
"""Within less than a turn a spiral is a circle that was not flown quite round."""
MIN_GROWTH_M = 0.2
"""Less than this a turn is a circle whose radius was not held."""
MIN_GROWTH_SIGMAS = 3.0
MIN_RADIUS_M = 0.4
"""A spiral inwards ends here."""
RMS_SHARE = 0.15
SAME_SHARE = 0.3
"""Spirals that differ by this share are the same to who flies them by hand."""


@dataclass(frozen=True)
class Spiral(Shape):
    """A centre, the radius beside the vehicle and its growth; the `estimate` is the growth."""

    name: ClassVar[str] = "spiral"
    figures: ClassVar[Mapping[str, str]] = {
        "cx": "m",
        "cy": "m",
        "z": "m",
        "radius": "m",
        "growth": "m a turn",
        "sweep": "rad",
    }
    min_points: ClassVar[int] = 8
    steady: ClassVar[bool] = False

    centre_m: Array
    radius_m: float
    growth_m: float
    sense: float
    height_m: float
    start_rad: float
    swept_rad: float
    errors: Mapping[str, float]

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """From the circle, by least squares of the distances along the radius."""
        xy = points_m[:, :2]
        circle = fit_circle(xy)
        scale = circle.sense / (2.0 * math.pi)

        def turned(centre: Array) -> Array:
            turns = scale * angles_about(centre, xy)
            return np.asarray(turns - turns[-1])

        def residuals(spiral: Array) -> Array:
            distance = np.linalg.norm(xy - spiral[:2], axis=1)
            return np.asarray(distance - spiral[2] - spiral[3] * turned(spiral[:2]))

        def jacobian(spiral: Array) -> Array:
            offset = (spiral[:2] - xy).T
            distance = np.maximum(np.hypot(*offset), 1e-9)
            turns = turns_of(spiral[:2], xy)
            slopes = np.empty((4, len(xy)))
            slopes[:2] = offset / distance - spiral[3] * scale * (turns - turns[:, -1:])
            slopes[2] = -1.0
            slopes[3] = -turned(spiral[:2])
            return slopes

        start = np.array([*circle.centre_m, circle.radius_m, 0.0])
        spiral, covariance, _ = levenberg_marquardt(residuals, jacobian, start)
        centre, growth = spiral[:2], float(spiral[3])
        off = residuals(spiral)
        angles = angles_about(centre, xy)
        newest = float(angles[-1])
        offset = start_m[:2] - centre
        start_rad = newest + math.remainder(
            math.atan2(offset[1], offset[0]) - newest, 2.0 * math.pi
        )
        radius = float(spiral[2]) + growth * scale * (start_rad - newest)
        heights = points_m[:, 2]
        cx_std, cy_std, radius_std, growth_std = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        swept = abs(newest - float(angles[0]))
        return cls(
            quality=Quality(
                rms_m=math.sqrt(float(np.mean(off**2) + np.var(heights))),
                extent_m=swept * float(np.mean(np.linalg.norm(xy - centre, axis=1))),
                count=len(xy),
                estimate=growth,
                estimate_std=float(growth_std),
                doubt=float(radius_std) / max(radius, 1e-9),
            ),
            centre_m=centre,
            radius_m=radius,
            growth_m=growth,
            sense=circle.sense,
            height_m=float(heights.mean()),
            start_rad=start_rad,
            swept_rad=swept,
            errors={
                "cx": float(cx_std),
                "cy": float(cy_std),
                "z": float(heights.std()) / math.sqrt(len(xy)),
                "radius": float(radius_std),
                "growth": float(growth_std),
            },
        )

    @property
    def params(self) -> dict[str, float]:
        """Centre, height, radius beside the vehicle, growth, and the sweep of the way ahead."""
        cx, cy = (float(v) for v in self.centre_m)
        return {
            "cx": cx,
            "cy": cy,
            "z": self.height_m,
            "radius": self.radius_m,
            "growth": self.growth_m,
            "sweep": self.sense * self._sweep_ahead_rad(),
        }

    @property
    def stds(self) -> dict[str, float]:
        """Of all but the sweep."""
        return dict(self.errors)

    @property
    def tolerances(self) -> dict[str, float]:
        """Shares of the size; the radius moves on, the sense does not turn round."""
        share = SAME_SHARE * self.radius_m
        growth = SAME_SHARE * abs(self.growth_m)
        return {"cx": share, "cy": share, "growth": growth, "sweep": 2.0 * TURNS * math.pi}

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Outwards or inwards, either way round; `extent` in rad."""
        cx, cy = (float(v) for v in rng.uniform(-10.0, 10.0, 2))
        sense, growth = float(rng.choice((-1.0, 1.0))), float(rng.uniform(0.4, 1.2))
        inner = float(rng.uniform(0.8, 2.0))
        outer = inner + growth * extent / (2.0 * math.pi)
        outwards = rng.random() < 0.5
        radii = np.linspace(*((inner, outer) if outwards else (outer, inner)), count)
        angles = rng.uniform(-math.pi, math.pi) + sense * np.linspace(0.0, extent, count)
        z = float(rng.uniform(1.0, 3.0))
        points = np.column_stack(
            [cx + radii * np.cos(angles), cy + radii * np.sin(angles), np.full(count, z)]
        )
        growth = growth if outwards else -growth
        radius = float(radii[-1])
        sweep = sense * _sweep_rad(radius, growth)
        return Example(
            points,
            {"cx": cx, "cy": cy, "z": z, "radius": radius, "growth": growth, "sweep": sweep},
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of the radius."""
        return RMS_SHARE * self.radius_m

    def check(self, config: Config) -> None:
        """Refuse what cannot be told from a circle."""
        if self.swept_rad < MIN_SWEEP_RAD:
            raise UnfitError(f"only {math.degrees(self.swept_rad):.0f} degrees of it were flown")
        if abs(self.growth_m) < max(MIN_GROWTH_M, MIN_GROWTH_SIGMAS * self.errors["growth"]):
            raise UnfitError(f"it grows by only {self.growth_m:.2f} m a turn", "arc")
        if not config.min_radius_m <= self.radius_m <= config.max_radius_m:
            raise UnfitError(
                f"its radius of {self.radius_m:.1f} m is not within"
                f" {config.min_radius_m:g} to {config.max_radius_m:g} m"
            )
        if self._sweep_ahead_rad() < math.pi / 2.0:
            raise UnfitError("it ends at its centre")

    def ahead(self) -> Array:
        """Three turns, or inwards as far as there is room."""
        sweep = self._sweep_ahead_rad()
        widest = max(self.radius_m, self.radius_m + self.growth_m * sweep / (2.0 * math.pi))
        steps = min(max(math.ceil(sweep * widest / STEP_M), 16), MAX_STEPS)
        turned = np.linspace(0.0, sweep, steps + 1)
        angles = self.start_rad + self.sense * turned
        radii = self.radius_m + self.growth_m * turned / (2.0 * math.pi)
        around = np.column_stack([np.cos(angles), np.sin(angles)])
        xy = self.centre_m + radii[:, None] * around
        return np.column_stack([xy, np.full(len(xy), self.height_m)])

    def _sweep_ahead_rad(self) -> float:
        return _sweep_rad(self.radius_m, self.growth_m)


def _sweep_rad(radius_m: float, growth_m: float) -> float:
    """How far a spiral goes on: three turns, or until it is too tight."""
    if growth_m >= 0.0:
        return TURNS * 2.0 * math.pi
    room_m = max(0.0, radius_m - MIN_RADIUS_M)
    return min(TURNS, room_m / -growth_m) * 2.0 * math.pi
