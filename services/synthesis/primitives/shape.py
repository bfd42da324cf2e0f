"""What every primitive offers: a fit to points, its honesty about it, and the way ahead."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from scipy.optimize import leastsq

from common.frames import Array
from services.synthesis.config import Config

STEP_M = 0.1
"""Spacing of the path ahead."""
MAX_STEPS = 4000
"""A Suggestion holds 4096 points; longer ways ahead get longer steps."""


EXAMPLE_POINTS = 90
"""Points of an example: 2 s of sticks at the thesis' 45 Hz."""


class UnfitError(Exception):
    """Points that a primitive cannot be fitted to, or a fit that says too little to be flown.

    Attributes:
        simpler: the primitive that the points are within their noise, if they are one.
    """

    def __init__(self, reason: str, simpler: str | None = None) -> None:
        super().__init__(reason)
        self.simpler = simpler


@dataclass(frozen=True)
class Quality:
    """How well a shape fits, and how well its points determine it.

    Attributes:
        rms_m: root mean square distance of the points from the shape.
        extent_m: length of the shape along the points.
        count: number of points.
        estimate: the number the shape stands or falls by, in the unit its module names.
        estimate_std: its standard error, if the points' errors are independent.
        doubt: standard error of the worst-known parameter, likewise, as a share of what matters.
    """

    rms_m: float
    extent_m: float
    count: int
    estimate: float
    estimate_std: float
    doubt: float


@dataclass(frozen=True)
class Example:
    """A motion whose shape is known.

    Attributes:
        points_m: (N, 3), on the shape, oldest first.
        params: the shape's parameters, for a vehicle at the last point.
    """

    points_m: Array
    params: dict[str, float]


@dataclass(frozen=True)
class Shape(ABC):
    """A fitted primitive, anchored where the vehicle is."""

    name: ClassVar[str]
    figures: ClassVar[Mapping[str, str]]
    """The parameters' names, as in the contract's Suggestion, and their units."""
    closed: ClassVar[bool] = False
    """Whether the way ahead ends where it began."""
    turns_vehicle: ClassVar[bool] = True
    """Whether the vehicle's yaw follows the tangent, as the thesis (3.2.2) has it for arcs."""
    min_points: ClassVar[int]
    steady: ClassVar[bool] = True
    """Whether any part of the shape has the whole's `estimate`, so that parts can be compared."""
    estimate_period: ClassVar[float] = math.inf
    """Estimates that differ by this are the same."""

    quality: Quality

    @classmethod
    @abstractmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """The shape that fits points (N, 3), oldest first, of a vehicle that is at `start_m` now.

        Raises:
            UnfitError: if the points determine no such shape.
        """

    @property
    @abstractmethod
    def params(self) -> dict[str, float]:
        """The parameters, named as in `figures`."""

    @property
    @abstractmethod
    def stds(self) -> dict[str, float]:
        """Standard errors of parameters by name, if the points' errors are independent.

        What the shape chooses for the way ahead, as the sweep of an arc, has none.
        """

    @property
    @abstractmethod
    def tolerances(self) -> dict[str, float]:
        """Differences of parameters that do not make it another meaning to a person."""

    @classmethod
    @abstractmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """A random motion of this shape for tests and figures; `extent` as its module says."""

    @property
    @abstractmethod
    def rms_limit_m(self) -> float:
        """The largest residual with which the shape may still be called one."""

    @abstractmethod
    def ahead(self) -> Array:
        """Points (M, 3) on the shape about `STEP_M` apart, from the one beside the vehicle on."""

    @abstractmethod
    def check(self, config: Config) -> None:
        """Raise UnfitError if this particular shape should not be flown."""

    def as_meant(self) -> "Shape":
        """The shape without what a hand on the sticks does not mean."""
        return self


def levenberg_marquardt(
    residuals: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Array,
    tolerance: float = 1e-7,
) -> tuple[Array, Array, float]:
    """Minimise a sum of squares by MINPACK's Levenberg-Marquardt.

    Args:
        residuals: of N points, for P parameters.
        jacobian: derivatives of the residuals, one row a parameter: (P, N).
        start: first guess (P,).
        tolerance: relative change of parameters and sum at which to stop.

    Returns:
        the parameters, their covariance (P, P) if the residuals are independent, and the
        residuals' standard deviation with its degrees of freedom counted.

    Raises:
        UnfitError: if the parameters are not determined.
    """
    solution, inverse, info, _, _ = leastsq(
        residuals,
        start,
        Dfun=jacobian,
        col_deriv=True,
        full_output=True,
        xtol=tolerance,
        ftol=tolerance,
        maxfev=60,
    )
    if inverse is None or not np.all(np.isfinite(solution)):
        raise UnfitError("the points do not determine it")
    freedom = max(info["fvec"].size - solution.size, 1)
    variance = float(info["fvec"] @ info["fvec"]) / freedom
    return solution, inverse * variance, variance**0.5
