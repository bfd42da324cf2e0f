"""An arc about a vertical axis that climbs or sinks (thesis 3.2.3).

The axis is kept vertical: a free one costs 24 % of pitch error at half a turn (references.md, 8).
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.arc import RMS_SHARE, Circle, angles_ahead, fit_circle
from services.synthesis.primitives.shape import Quality, Shape, UnfitError

TURNS = 3
MIN_PITCH_M = 0.1
"""Less than this a turn is an arc whose height was not held."""
MAX_SLOPE = 2.0
"""Climb per way flown level; steeper, the turn is lost in the drift of a climb."""
MIN_PITCH_SIGMAS = 3.0


@dataclass(frozen=True)
class Helix(Shape):
    """A circle and a pitch in m a turn, + up; the `estimate` is the curvature, as an arc's."""

    name: ClassVar[str] = "helix"
    min_points: ClassVar[int] = 5

    circle: Circle
    start_rad: float
    start_height_m: float
    pitch_m: float
    pitch_std_m: float

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """A circle seen from above, and the regression of height on the angle flown."""
        circle = fit_circle(points_m[:, :2])
        turned = circle.sense * circle.angles_rad / (2.0 * math.pi)
        heights = points_m[:, 2]
        turned_mean, height_mean = float(turned.mean()), float(heights.mean())
        centred = turned - turned_mean
        power = float(centred @ centred)
        if power <= 1e-12:
            raise UnfitError("no part of a turn was flown")
        pitch = float(centred @ heights) / power
        off = heights - height_mean - pitch * centred
        start_rad = circle.angle_of(start_m[:2])
        start_turned = circle.sense * start_rad / (2.0 * math.pi)
        rms = math.sqrt(float(np.mean(circle.off_m**2) + np.mean(off**2)))
        return cls(
            _climbing(circle.quality(rms), pitch, circle.radius_m),
            circle,
            start_rad,
            height_mean + pitch * (start_turned - turned_mean),
            pitch,
            math.sqrt(float(off @ off) / max(len(off) - 2, 1) / power),
        )

    @property
    def params(self) -> dict[str, float]:
        """An arc's, with the height where the way ahead begins and its whole sweep; pitch."""
        return {
            "cx": float(self.circle.centre_m[0]),
            "cy": float(self.circle.centre_m[1]),
            "z": self.start_height_m,
            "radius": self.circle.radius_m,
            "sweep": self.circle.sense * TURNS * 2.0 * math.pi,
            "pitch": self.pitch_m,
        }

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
        xy = circle.centre_m + circle.radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
        turned = np.abs(angles - self.start_rad) / (2.0 * math.pi)
        return np.column_stack([xy, self.start_height_m + self.pitch_m * turned])


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
