"""A straight line in space, in any direction, vertical too.

Thesis 3.2.1 regresses y on x, which can express neither a vertical line nor motion towards -x, and
cuts the angle to four directions, which loses forward from backward (errata 3 and 4). Here the
direction is that of total least squares, signed by the motion.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
)

AHEAD_M = 20.0
HALF_SECTOR_RAD = math.pi / 8.0
"""A line's direction is told by eight sectors; its error is judged as a share of half a one."""
LEVEL_CLIMB_RAD = math.radians(2.5)
"""Climbs up to this are not meant: a stick inside the dead band gives 1.4 degrees at full speed."""
VERTICAL_CLIMB_RAD = math.radians(87.5)
"""Above this it is a straight climb."""
LEVEL_SHARE = 0.2
"""Level part of a direction below which a heading is not meant: 78 degrees up."""
RMS_SHARE = 0.1
"""Of its length: a line flown by hand wobbles by a few hundredths."""
MAX_BEND = 0.08
"""Sagitta as a share of the length above which points are a curve: a turn of 36 degrees."""


@dataclass(frozen=True)
class Line(Shape):
    """A point on the line beside the vehicle and the unit direction of travel.

    The `estimate` is the heading in rad.
    """

    name: ClassVar[str] = "line"
    figures: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "y": "m",
        "z": "m",
        "heading": "rad",
        "climb": "rad",
    }
    turns_vehicle: ClassVar[bool] = False
    min_points: ClassVar[int] = 3
    estimate_period: ClassVar[float] = 2.0 * math.pi

    anchor_m: Array
    direction: Array
    bend: float
    angle_std_rad: float
    anchor_std_m: float

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """Total least squares: the direction of largest variance."""
        centre = points_m.mean(axis=0)
        offsets = points_m - centre
        _, singular, axes = np.linalg.svd(offsets, full_matrices=False)
        if singular[0] <= 1e-9:
            raise UnfitError("all points are the same")
        along = offsets @ axes[0]
        # The sign of travel from all points: the ends alone may be noise.
        order = np.arange(len(points_m)) - (len(points_m) - 1) / 2.0
        sign = 1.0 if along @ order >= 0.0 else -1.0
        direction = sign * axes[0]
        count = len(points_m)
        sideways = offsets - np.outer(along, axes[0])
        squares = float(np.sum(sideways**2))
        extent = float(np.ptp(along))
        # Two coordinates sideways share the residual; errors of a slope: sigma / |along|.
        sigma = math.sqrt(squares / 2.0 / max(count - 2, 1))
        angle_std = sigma / float(singular[0])
        level = math.hypot(direction[0], direction[1])
        reach = float((start_m - centre) @ direction)
        return cls(
            quality=Quality(
                rms_m=math.sqrt(squares / count),
                extent_m=extent,
                count=count,
                estimate=math.atan2(direction[1], direction[0]),
                estimate_std=angle_std / max(level, 1e-3),
                doubt=angle_std / HALF_SECTOR_RAD,
            ),
            anchor_m=centre + direction * reach,
            direction=direction,
            bend=_sagitta(sideways, along) / extent,
            angle_std_rad=angle_std,
            anchor_std_m=math.hypot(sigma / math.sqrt(count), angle_std * reach),
        )

    @property
    def params(self) -> dict[str, float]:
        """A point on the line, heading of travel and climb, in rad."""
        x, y, z = (float(v) for v in self.anchor_m)
        dx, dy, dz = (float(v) for v in self.direction)
        climb = math.atan2(dz, math.hypot(dx, dy))
        return {"x": x, "y": y, "z": z, "heading": math.atan2(dy, dx), "climb": climb}

    @property
    def stds(self) -> dict[str, float]:
        """Of the anchor sideways, and of the two angles; a vertical line's heading is unknown."""
        level = math.hypot(self.direction[0], self.direction[1])
        heading = min(self.angle_std_rad / max(level, 1e-9), math.pi)
        return {
            **{
                name: self.anchor_std_m * math.sqrt(max(0.0, 1.0 - float(part) ** 2))
                for name, part in zip("xyz", self.direction, strict=True)
            },
            "heading": heading,
            "climb": self.angle_std_rad,
        }

    @property
    def tolerances(self) -> dict[str, float]:
        """Half a sector to either side; where it lies is where the vehicle is."""
        steep = math.hypot(self.direction[0], self.direction[1]) < LEVEL_SHARE
        return {"heading": math.pi if steep else HALF_SECTOR_RAD, "climb": HALF_SECTOR_RAD}

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any direction; `extent` in m."""
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        points = rng.uniform(-10.0, 10.0, 3) + np.outer(np.linspace(0.0, extent, count), direction)
        (x, y, z), (dx, dy, dz) = points[-1], direction
        heading, climb = math.atan2(dy, dx), math.atan2(dz, math.hypot(dx, dy))
        return Example(points, {"x": x, "y": y, "z": z, "heading": heading, "climb": climb})

    @property
    def rms_limit_m(self) -> float:
        """A share of the length."""
        return RMS_SHARE * self.quality.extent_m

    def check(self, config: Config) -> None:
        """Refuse points that bend."""
        if self.bend > MAX_BEND:
            raise UnfitError(f"the path bends by {self.bend:.0%} of its length")

    def as_meant(self) -> "Line":
        """Level or vertical, if it is nearly so: over 20 m a drift would add up."""
        dx, dy, dz = (float(v) for v in self.direction)
        level = math.hypot(dx, dy)
        climb = math.atan2(abs(dz), level)
        if climb < LEVEL_CLIMB_RAD:
            return replace(self, direction=np.array([dx / level, dy / level, 0.0]))
        if climb > VERTICAL_CLIMB_RAD:
            return replace(self, direction=np.array([0.0, 0.0, math.copysign(1.0, dz)]))
        return self

    def ahead(self) -> Array:
        """The next 20 m."""
        along = np.linspace(0.0, AHEAD_M, round(AHEAD_M / STEP_M) + 1)
        return np.asarray(self.anchor_m + np.outer(along, self.direction))


def _sagitta(sideways: Array, along: Array) -> float:
    """How far the best parabola through points leaves its chord, in m."""
    half = float(np.ptp(along)) / 2.0
    middle = float(along.max()) - half
    scaled = (along - middle) / half
    square = scaled**2 - np.mean(scaled**2)
    linear = scaled - np.mean(scaled)
    square = square - linear * float(square @ linear) / float(linear @ linear)
    power = float(square @ square)
    if power < 1e-9:
        return 0.0
    return float(np.linalg.norm(square @ sideways)) / power
