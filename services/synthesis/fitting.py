"""From points to a shape that may be flown, or to the reason why none may."""

import math

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.history import CELL_M
from services.synthesis.primitives.shape import Shape, UnfitError

PARTS = (1.0, 0.75, 0.5, 0.35)
"""Shares of the window's way, newest part, that are tried: a motion may begin as another one."""
CORRELATION_M = 0.5
"""A hand and an estimator err smoothly: points closer than this do not err independently."""
MIN_ERROR_M = 0.005
"""No estimate is trusted to be better than this, however well few points fit."""
CONSISTENT_SIGMAS = 3.0


def newest_motion(primitive: type[Shape], points_m: Array, here_m: Array, config: Config) -> Shape:
    """The shape of what the vehicle is doing now, from as much of the way as is part of it.

    A window may begin with another motion. So parts of it are tried, the newest first, and the
    longest is taken whose estimate agrees with those of all shorter ones within their errors
    (Lepski's rule).

    Args:
        primitive: the shape to be fitted.
        points_m: (N, 3), `CELL_M` apart, oldest first.
        here_m: where the vehicle is (3,).
        config: the limits.

    Raises:
        UnfitError: if no part makes a shape that may be flown.
    """
    parts = [points_m[-round(share * len(points_m)) :] for share in PARTS]
    parts = [points for points in parts if len(points) * CELL_M >= config.min_extent_m]
    if not primitive.steady:
        return _longest_acceptable(primitive, parts, here_m, config)
    chosen: list[Shape] = []
    unfit = UnfitError("the way is too short")
    for points in reversed(parts):
        try:
            shape = fit(primitive, points, here_m)
        except UnfitError as error:
            unfit = error
            continue
        if not all(_agree(shape, shorter) for shorter in chosen):
            break
        chosen.append(shape)
    if not chosen:
        raise unfit
    check(chosen[-1], config, inflation(chosen[-1]))
    return chosen[-1]


def fit(primitive: type[Shape], points_m: Array, here_m: Array) -> Shape:
    """The shape that fits points (N, 3), whether it may be flown or not.

    Raises:
        UnfitError: if they determine none.
    """
    if len(points_m) < primitive.min_points:
        raise UnfitError(f"{len(points_m)} points are too few; {primitive.min_points} are needed")
    try:
        return primitive.fit(points_m, here_m)
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError):
        raise UnfitError("the points do not determine it") from None


def check(shape: Shape, config: Config, inflation: float) -> None:
    """Raise UnfitError if a shape may not be flown; its errors are `inflation` times larger."""
    quality = shape.quality
    if quality.extent_m < config.min_extent_m:
        raise UnfitError(f"only {quality.extent_m:.2f} m of it were flown")
    shape.check(config)
    if quality.rms_m > shape.rms_limit_m:
        raise UnfitError(
            f"it fits to {quality.rms_m:.2f} m only, {shape.rms_limit_m:.2f} m are allowed"
        )
    doubt = quality.doubt * inflation
    if not doubt <= config.max_doubt:
        raise UnfitError(f"it is known to {doubt:.0%} only, {config.max_doubt:.0%} are allowed")


def inflation(shape: Shape) -> float:
    """How much larger errors are than those of points that err independently."""
    quality = shape.quality
    independent = max(quality.extent_m / CORRELATION_M, 2.0)
    floor = max(1.0, MIN_ERROR_M / max(quality.rms_m, 1e-9))
    return floor * math.sqrt(max(quality.count / independent, 1.0))


def trust(shape: Shape, config: Config, inflation: float) -> float:
    """How good a fit is, from 1 for exact to 0.25 for just acceptable."""
    misfit = min(shape.quality.rms_m / shape.rms_limit_m, 1.0)
    doubt = min(shape.quality.doubt * inflation / config.max_doubt, 1.0)
    return (1.0 - 0.5 * misfit) * (1.0 - 0.5 * doubt)


def _longest_acceptable(
    primitive: type[Shape], parts: list[Array], here_m: Array, config: Config
) -> Shape:
    """The shape of the longest part that makes one that may be flown, or the longest's reason."""
    first: UnfitError | None = None
    for points in parts:
        try:
            shape = fit(primitive, points, here_m)
            check(shape, config, inflation(shape))
        except UnfitError as error:
            first = first or error
            continue
        return shape
    raise first or UnfitError("the way is too short")


def _agree(shape: Shape, other: Shape) -> bool:
    """Whether two parts of the way have the same estimate within their errors."""
    spread = math.hypot(
        shape.quality.estimate_std * inflation(shape),
        other.quality.estimate_std * inflation(other),
    )
    difference = shape.quality.estimate - other.quality.estimate
    if math.isfinite(shape.estimate_period):
        difference = math.remainder(difference, shape.estimate_period)
    return abs(difference) <= CONSISTENT_SIGMAS * spread
