"""A straight line in space, in any direction, vertical too.

Thesis 3.2.1 regresses y on x, which can express neither a vertical line nor motion towards -x, and
cuts the angle to four directions, which loses forward from backward (errata 3 and 4). Here the
direction is that of total least squares, signed by the motion.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.shape import STEP_M, Quality, Shape, UnfitError

AHEAD_M = 20.0
HALF_SECTOR_RAD = math.pi / 8.0
"""A line's direction is told by eight sectors; its error is judged as a share of half a one."""
LEVEL_CLIMB_RAD = math.radians(5.0)
"""Climbs up to this are not meant: a stick inside the dead band gives 1.4 at full speed."""
VERTICAL_CLIMB_RAD = math.radians(80.0)
"""Above this it is a straight climb: hands off, a drone drifts by a tenth of its climbing speed."""
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
    turns_vehicle: ClassVar[bool] = False
    min_points: ClassVar[int] = 3
    estimate_period: ClassVar[float] = 2.0 * math.pi

    anchor_m: Array
    direction: Array
    bend: float

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
        return cls(
            quality=Quality(
                rms_m=math.sqrt(squares / count),
                extent_m=extent,
                count=count,
                estimate=math.atan2(direction[1], direction[0]),
                estimate_std=angle_std / max(level, 1e-3),
                doubt=angle_std / HALF_SECTOR_RAD,
            ),
            anchor_m=centre + direction * float((start_m - centre) @ direction),
            direction=direction,
            bend=_sagitta(sideways, along) / extent,
        )

    @property
    def params(self) -> dict[str, float]:
        """A point on the line, heading of travel and climb, in rad."""
        x, y, z = (float(v) for v in self.anchor_m)
        dx, dy, dz = (float(v) for v in self.direction)
        climb = math.atan2(dz, math.hypot(dx, dy))
        return {"x": x, "y": y, "z": z, "heading": math.atan2(dy, dx), "climb": climb}

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
