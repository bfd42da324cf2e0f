"""An arc about a vertical axis that climbs or sinks (thesis 3.2.3).

The axis is kept vertical: a free one costs 24 % of pitch error at half a turn (references.md, 8).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.arc import (
    RMS_SHARE,
    Circle,
    angles_about,
    angles_ahead,
    example_circle,
    fit_circle,
    on_circle,
    turns_of,
)
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    Example,
    Quality,
    Shape,
    UnfitError,
    levenberg_marquardt,
)

TURNS = 3
MIN_PITCH_M = 0.1
"""Less than this a turn is an arc whose height was not held."""
MAX_SLOPE = 2.0
"""Climb per way flown level; steeper, the turn is lost in the drift of a climb."""
MIN_PITCH_SIGMAS = 3.0
SAME_PITCH_SHARE = 0.4
"""Pitches that differ by this share are the same to who flies them by hand."""


@dataclass(frozen=True)
class Helix(Shape):
    """A circle and a pitch in m a turn, + up; the `estimate` is the curvature, as an arc's."""

    name: ClassVar[str] = "helix"
    figures: ClassVar[Mapping[str, str]] = {
        "cx": "m",
        "cy": "m",
        "z": "m",
        "radius": "m",
        "sweep": "rad",
        "pitch": "m a turn",
    }
    min_points: ClassVar[int] = 5

    circle: Circle
    start_rad: float
    start_height_m: float
    start_height_std_m: float
    pitch_m: float
    pitch_std_m: float

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """The circle seen from above, the pitch by regression, then all five together."""
        circle = fit_circle(points_m[:, :2])
        if circle.swept_rad <= 1e-6:
            raise UnfitError("no part of a turn was flown")
        circle, height, pitch, covariance = _refined(circle, points_m)
        scale = circle.sense / (2.0 * math.pi)
        turned = scale * circle.angles_rad
        off = points_m[:, 2] - height - pitch * (turned - turned.mean())
        rms = math.sqrt(float(np.mean(circle.off_m**2) + np.mean(off**2)))
        start_rad = circle.angle_of(start_m[:2])
        since_mean = scale * start_rad - float(turned.mean())
        # How the height beside the vehicle follows each of the five parameters.
        turns = turns_of(circle.centre_m, points_m)
        at_start = turns_of(circle.centre_m, start_m[None])[:, 0] - turns.mean(axis=1)
        slopes = np.array([*(pitch * scale * at_start), 0.0, 1.0, since_mean])
        return cls(
            _climbing(circle.quality(rms), pitch, circle.radius_m),
            circle,
            start_rad,
            height + pitch * since_mean,
            math.sqrt(max(float(slopes @ covariance @ slopes), 0.0)),
            pitch,
            math.sqrt(max(float(covariance[4, 4]), 0.0)),
        )

    @property
    def params(self) -> dict[str, float]:
        """An arc's, with the height where the way ahead begins and its whole sweep; pitch."""
        return {
            **self.circle.params,
            "z": self.start_height_m,
            "sweep": self.circle.sense * TURNS * 2.0 * math.pi,
            "pitch": self.pitch_m,
        }

    @property
    def stds(self) -> dict[str, float]:
        """Of the circle, the height beside the vehicle and the pitch."""
        return {**self.circle.stds, "z": self.start_height_std_m, "pitch": self.pitch_std_m}

    @property
    def tolerances(self) -> dict[str, float]:
        """The circle's, and a share of the pitch."""
        pitch = max(SAME_PITCH_SHARE * abs(self.pitch_m), MIN_PITCH_M)
        return {**self.circle.tolerances, "pitch": pitch}

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any circle, up or down; `extent` in rad."""
        params, angles = example_circle(rng, extent, count)
        pitch = rng.choice((-1.0, 1.0)) * rng.uniform(0.3, 2.0)
        heights = rng.uniform(3.0, 6.0) + pitch * np.abs(angles - angles[0]) / (2.0 * math.pi)
        sweep = math.copysign(TURNS * 2.0 * math.pi, angles[-1] - angles[0])
        return Example(
            np.column_stack([on_circle(params, angles), heights]),
            {**params, "z": float(heights[-1]), "sweep": sweep, "pitch": pitch},
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of the radius."""
        return RMS_SHARE * self.circle.radius_m

    def check(self, config: Config) -> None:
        """Refuse what cannot be told from a level arc, or from a line."""
        self.circle.check(config)
        if abs(self.pitch_m) < max(MIN_PITCH_M, MIN_PITCH_SIGMAS * self.pitch_std_m):
            raise UnfitError(f"it climbs only {self.pitch_m:.2f} m a turn", "arc")
        if abs(self.pitch_m) > MAX_SLOPE * 2.0 * math.pi * self.circle.radius_m:
            raise UnfitError(f"it climbs {self.pitch_m:.1f} m a turn, too steeply to turn")

    def ahead(self) -> Array:
        """Three turns."""
        circle = self.circle
        half_turn_m = math.hypot(math.pi * circle.radius_m, self.pitch_m / 2.0)
        angles = angles_ahead(self.start_rad, circle.sense, half_turn_m, 2 * TURNS)
        xy = on_circle(circle.params, angles)
        turned = np.abs(angles - self.start_rad) / (2.0 * math.pi)
        return np.column_stack([xy, self.start_height_m + self.pitch_m * turned])


def _refined(circle: Circle, points_m: Array) -> tuple[Circle, float, float, Array]:
    """The circle, the mean height and the pitch by all coordinates, and the covariance (5, 5)."""
    x, y, z = points_m.T
    scale = circle.sense / (2.0 * math.pi)
    count = len(z)

    def residuals(helix: Array) -> Array:
        cx, cy, radius, height, pitch = helix
        turned = scale * angles_about(helix[:2], points_m[:, :2])
        climb = height + pitch * (turned - turned.mean())
        return np.concatenate([np.hypot(x - cx, y - cy) - radius, z - climb])

    def jacobian(helix: Array) -> Array:
        dx, dy = helix[0] - x, helix[1] - y
        distance = np.maximum(np.hypot(dx, dy), 1e-9)
        turned = scale * angles_about(helix[:2], points_m[:, :2])
        turns = turns_of(helix[:2], points_m)
        slopes = np.zeros((5, 2 * count))
        slopes[0, :count], slopes[1, :count] = dx / distance, dy / distance
        slopes[2, :count] = -1.0
        slopes[:2, count:] = -helix[4] * scale * (turns - turns.mean(axis=1, keepdims=True))
        slopes[3, count:] = -1.0
        slopes[4, count:] = turned.mean() - turned
        return slopes

    turned = scale * circle.angles_rad
    turned = turned - turned.mean()
    pitch = float(turned @ z) / float(turned @ turned)
    start = np.array([*circle.centre_m, circle.radius_m, z.mean(), pitch])
    helix, covariance, _ = levenberg_marquardt(residuals, jacobian, start)
    centre, radius = helix[:2], abs(float(helix[2]))
    errors = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    refined = Circle(
        centre,
        radius,
        errors[:2],
        float(errors[2]),
        angles_about(centre, points_m[:, :2]),
        np.hypot(x - centre[0], y - centre[1]) - radius,
    )
    return refined, float(helix[3]), float(helix[4]), covariance


def _climbing(level: Quality, pitch_m: float, radius_m: float) -> Quality:
    """The quality of a circle, its length that of the slope."""
    slope = pitch_m / (2.0 * math.pi * radius_m)
    return Quality(
        level.rms_m,
        level.extent_m * math.hypot(1.0, slope),
        level.count,
        level.estimate,
        level.estimate_std,
        level.doubt,
    )
