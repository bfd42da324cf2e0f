"""A level circle, flown on and on.

Taubin's algebraic fit starts Levenberg-Marquardt on the geometric distance (thesis 3.2.2). The
thesis' algorithm 1 makes half a circle of its 64 points and takes counter-clockwise for negative;
here 64 points are half a turn, a lap is 2 pi, and angles grow counter-clockwise (erratum 2).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
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

POINTS_PER_HALF_TURN = 64
RMS_SHARE = 0.15
"""Of the radius: noise of 5 % in each coordinate is 9 %."""
MIN_SAGITTA_SHARE = 1.5
"""Of the residual. 30 degrees at 5 % noise have 0.7 and no method finds their radius; 60 have 2.7
(references.md, 8)."""
SAME_SHARE = 0.25
"""Circles that differ by this share of the radius are the same to who flies them by hand."""
MIN_SWEEP_RAD = math.radians(20.0)
"""Less says too little about the centre."""
LINE_SWEEP_RAD = math.radians(10.0)
"""Less than this is a line that was not flown quite straight."""
_STRAIGHT_SWEEP_RAD = math.radians(5.0)
"""Below this the centre is so far away that only Taubin's curvature is of use."""


@dataclass(frozen=True)
class Circle:
    """A circle fitted in a plane, and what the points did around it.

    Attributes:
        centre_m: (2,).
        radius_m: its radius.
        centre_std_m: standard errors (2,) of the centre, if the points' errors are independent.
        radius_std_m: standard error of the radius, likewise.
        angles_rad: unwrapped angles (N,) of the points about the centre.
        off_m: signed distances (N,) of the points from the circle, + outside.
    """

    centre_m: Array
    radius_m: float
    centre_std_m: Array
    radius_std_m: float
    angles_rad: Array
    off_m: Array

    @property
    def sense(self) -> float:
        """+1 counter-clockwise, -1 clockwise."""
        return 1.0 if self.angles_rad[-1] >= self.angles_rad[0] else -1.0

    @property
    def swept_rad(self) -> float:
        """Angle between the first and the last point, without sign."""
        return abs(float(self.angles_rad[-1] - self.angles_rad[0]))

    def angle_of(self, point_m: Array) -> float:
        """The angle of a point (2,), in the turn of the newest point."""
        offset = point_m - self.centre_m
        newest = float(self.angles_rad[-1])
        angle = math.atan2(offset[1], offset[0])
        return newest + math.remainder(angle - newest, 2.0 * math.pi)

    def quality(self, rms_m: float) -> Quality:
        """Its quality, with the signed curvature in 1/m as the estimate."""
        return Quality(
            rms_m=rms_m,
            extent_m=self.swept_rad * self.radius_m,
            count=len(self.off_m),
            estimate=self.sense / self.radius_m,
            estimate_std=self.radius_std_m / self.radius_m**2,
            doubt=self.radius_std_m / self.radius_m,
        )

    @property
    def params(self) -> dict[str, float]:
        """Centre and radius."""
        cx, cy = (float(v) for v in self.centre_m)
        return {"cx": cx, "cy": cy, "radius": self.radius_m}

    @property
    def stds(self) -> dict[str, float]:
        """Of the centre and the radius."""
        cx, cy = (float(v) for v in self.centre_std_m)
        return {"cx": cx, "cy": cy, "radius": self.radius_std_m}

    @property
    def tolerances(self) -> dict[str, float]:
        """A share of the radius, and not the other way round."""
        share = SAME_SHARE * self.radius_m
        return {"cx": share, "cy": share, "radius": share, "sweep": math.pi}

    def check(self, config: Config) -> None:
        """Raise UnfitError where it is too wide, too tight, or cannot be told from a line."""
        rms_m = math.sqrt(float(np.mean(self.off_m**2)))
        half_rad = min(self.swept_rad / 2.0, math.pi)
        sagitta_m = self.radius_m * (1.0 - math.cos(half_rad))
        if self.swept_rad < MIN_SWEEP_RAD:
            raise UnfitError(
                f"only {math.degrees(self.swept_rad):.0f} degrees of it were flown",
                "line" if self.swept_rad < LINE_SWEEP_RAD else None,
            )
        if sagitta_m < MIN_SAGITTA_SHARE * rms_m:
            raise UnfitError("it cannot be told from a line within the noise", "line")
        if self.radius_m > config.max_radius_m:
            raise UnfitError(
                f"its radius of {self.radius_m:.1f} m is above {config.max_radius_m} m"
            )
        if self.radius_m < config.min_radius_m:
            raise UnfitError(
                f"its radius of {self.radius_m:.2f} m is below {config.min_radius_m} m"
            )


def taubin(points_m: Array) -> tuple[Array, float]:
    """The centre (2,) and radius of Taubin's circle through points (N, 2).

    G. Taubin, IEEE PAMI 13(11), 1991, by the singular values of the centred points.

    Raises:
        UnfitError: if the points lie on a line.
    """
    mean = points_m.mean(axis=0)
    centred = points_m - mean
    squares = np.sum(centred**2, axis=1)
    power = float(squares.mean())
    if power <= 1e-18:
        raise UnfitError("all points are the same")
    scale = 2.0 * math.sqrt(power)
    _, _, axes = np.linalg.svd(
        np.column_stack([(squares - power) / scale, centred]), full_matrices=False
    )
    quadratic = axes[2, 0] / scale
    if abs(quadratic) * math.sqrt(power) < 1e-9:
        raise UnfitError("the points lie on a line", "line")
    slopes = axes[2, 1:]
    radius = math.sqrt(float(slopes @ slopes) + 4.0 * quadratic**2 * power) / abs(quadratic) / 2.0
    return mean - slopes / (2.0 * quadratic), radius


def fit_circle(points_m: Array) -> Circle:
    """The circle of least squared distance from points (N, 2), oldest first.

    Raises:
        UnfitError: if the points lie on a line.
    """
    x, y = points_m.T

    def residuals(circle: Array) -> Array:
        return np.asarray(np.hypot(x - circle[0], y - circle[1]) - circle[2])

    def jacobian(circle: Array) -> Array:
        dx, dy = circle[0] - x, circle[1] - y
        distance = np.maximum(np.hypot(dx, dy), 1e-9)
        return np.stack([dx / distance, dy / distance, np.full_like(x, -1.0)])

    centre, radius = taubin(points_m)
    chord_m = float(np.ptp(points_m, axis=0).max())
    if chord_m / radius < _STRAIGHT_SWEEP_RAD:
        off = residuals(np.array([*centre, radius]))
        sigma = math.sqrt(float(off @ off) / max(len(x) - 3, 1))
        # The error of a parabola's curvature: sigma sqrt(720 / N) / length^2.
        radius_std = sigma * math.sqrt(720.0 / len(x)) / chord_m**2 * radius**2
        centre_std = np.full(2, radius_std)
    else:
        circle, covariance, _ = levenberg_marquardt(
            residuals, jacobian, np.array([*centre, radius])
        )
        centre, radius = circle[:2], abs(float(circle[2]))
        off = residuals(np.array([*centre, radius]))
        errors = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        centre_std, radius_std = errors[:2], float(errors[2])
    return Circle(centre, radius, centre_std, radius_std, angles_about(centre, points_m), off)


def angles_about(centre_m: Array, points_m: Array) -> Array:
    """Angles (N,) of points (N, 2) about a centre (2,), without jumps."""
    x, y = (points_m - centre_m).T
    return np.asarray(np.unwrap(np.arctan2(y, x)))


def turns_of(centre_m: Array, points_m: Array) -> Array:
    """How the angles of points (N, 2 or more) follow the centre's x and y, (2, N) in rad/m."""
    dx, dy = centre_m[:, None] - points_m[:, :2].T
    square = np.maximum(dx**2 + dy**2, 1e-18)
    return np.stack([-dy / square, dx / square])


def angles_ahead(start_rad: float, sense: float, half_turn_m: float, half_turns: int) -> Array:
    """Angles from a start on: 64 steps a half turn, more where that leaves steps over `STEP_M`."""
    steps = half_turns * max(POINTS_PER_HALF_TURN, math.ceil(half_turn_m / STEP_M))
    ways = np.linspace(0.0, half_turns * math.pi, min(steps, MAX_STEPS) + 1)
    return np.asarray(start_rad + sense * ways)


def example_circle(
    rng: np.random.Generator, sweep_rad: float, count: int
) -> tuple[dict[str, float], Array]:
    """A random circle's parameters, and angles (N,) in rad around it, either way."""
    cx, cy = rng.uniform(-10.0, 10.0, 2)
    radius = math.exp(rng.uniform(math.log(0.6), math.log(6.0)))
    begin, sense = rng.uniform(-math.pi, math.pi), rng.choice((-1.0, 1.0))
    angles = begin + sense * np.linspace(0.0, sweep_rad, count)
    return {"cx": cx, "cy": cy, "radius": radius}, angles


def on_circle(params: Mapping[str, float], angles_rad: Array) -> Array:
    """Points (N, 2) of a circle at angles (N,)."""
    around = np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
    return np.array([params["cx"], params["cy"]]) + params["radius"] * around


@dataclass(frozen=True)
class Arc(Shape):
    """A level circle; the `estimate` is its signed curvature in 1/m, + counter-clockwise."""

    name: ClassVar[str] = "arc"
    closed: ClassVar[bool] = True
    min_points: ClassVar[int] = 5

    figures: ClassVar[Mapping[str, str]] = {
        "cx": "m",
        "cy": "m",
        "z": "m",
        "radius": "m",
        "sweep": "rad",
    }

    circle: Circle
    height_m: float
    height_std_m: float
    start_rad: float

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """A circle in the horizontal plane of the points' mean height."""
        circle = fit_circle(points_m[:, :2])
        heights = points_m[:, 2]
        rms = math.sqrt(float(np.mean(circle.off_m**2) + np.var(heights)))
        return cls(
            circle.quality(rms),
            circle,
            float(heights.mean()),
            float(heights.std()) / math.sqrt(len(heights)),
            circle.angle_of(start_m[:2]),
        )

    @property
    def params(self) -> dict[str, float]:
        """Centre, height, radius, and the sweep of the way ahead: one lap, signed."""
        sweep = self.circle.sense * 2.0 * math.pi
        return {**self.circle.params, "z": self.height_m, "sweep": sweep}

    @property
    def stds(self) -> dict[str, float]:
        """Of the circle and its height."""
        return {**self.circle.stds, "z": self.height_std_m}

    @property
    def tolerances(self) -> dict[str, float]:
        """The circle's."""
        return self.circle.tolerances

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any circle, either way round; `extent` in rad."""
        params, angles = example_circle(rng, extent, count)
        z = rng.uniform(1.0, 3.0)
        points = np.column_stack([on_circle(params, angles), np.full(len(angles), z)])
        return Example(
            points,
            {**params, "z": z, "sweep": math.copysign(2.0 * math.pi, angles[-1] - angles[0])},
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of the radius."""
        return RMS_SHARE * self.circle.radius_m

    def check(self, config: Config) -> None:
        """Refuse what cannot be told from a line."""
        self.circle.check(config)

    def ahead(self) -> Array:
        """One lap, whose last point is its first."""
        circle = self.circle
        angles = angles_ahead(self.start_rad, circle.sense, math.pi * circle.radius_m, 2)
        xy = on_circle(circle.params, angles)
        xy[-1] = xy[0]
        return np.column_stack([xy, np.full(len(xy), self.height_m)])
