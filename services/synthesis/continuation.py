"""From a shape to a path: it starts at the vehicle, and goes over to the shape."""

import math

import numpy as np

from common.frames import Array, wrap_angle
from services.synthesis.primitives.shape import Shape, UnfitError

MAX_OFFSET_M = 0.5
"""A vehicle further than this from the shape has left it."""
MIN_BLEND_M = 1.0
BLEND_PER_OFFSET = 8.0
"""Blend length per offset: the path's direction is then within 13 degrees of the shape's."""
MIN_PATH_M = 0.5
LEVEL_SHARE = 0.05
"""Share of a tangent that must be level for it to have a yaw: 3 degrees off vertical."""


def continue_from(
    shape: Shape, here_m: Array, yaw_rad: float | None, min_height_m: float | None = None
) -> list[tuple[float, float, float, float]]:
    """The path [x, y, z, yaw] of a shape for a vehicle.

    Args:
        shape: fitted, anchored beside the vehicle.
        here_m: where the vehicle is (3,); the path's first point.
        yaw_rad: the vehicle's yaw, kept where the path has none or the shape does not turn the
            vehicle; None means that the vehicle's yaw is not known.
        min_height_m: cut the path where it sinks below this height (and below the vehicle).

    Raises:
        UnfitError: if the vehicle is not beside the shape, or too little path is left.
    """
    points = blend(shape.ahead(), here_m, shape.closed)
    if yaw_rad is None:
        yaw = _yaws(points, shape.closed, 0.0)
    elif shape.turns_vehicle or heading_sector(points, yaw_rad) == 0:
        yaw = _yaws(points, shape.closed, yaw_rad)
    else:
        # Flown sideways or backward, a line goes on sideways or backward.
        yaw = np.full(len(points), wrap_angle(yaw_rad))
    if min_height_m is not None:
        low = np.flatnonzero(points[:, 2] < min(min_height_m, float(here_m[2])) - 1e-6)
        if low.size and not shape.closed:
            points, yaw = points[: low[0]], yaw[: low[0]]
            left_m = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
            if left_m < MIN_PATH_M:
                raise UnfitError(f"it goes below {min_height_m} m at once")
    return [
        (float(x), float(y), float(z), float(a)) for (x, y, z), a in zip(points, yaw, strict=True)
    ]


def blend(ahead_m: Array, here_m: Array, closed: bool) -> Array:
    """Points (M, 3) that leave `here_m` and go over to a way (M, 3) that begins beside it.

    The offset fades by a quintic whose slope and bend are zero at both ends; on a closed way it
    grows back before the end.

    Raises:
        UnfitError: if the vehicle is too far from the way.
    """
    offset = here_m - ahead_m[0]
    offset_m = float(np.linalg.norm(offset))
    if offset_m > MAX_OFFSET_M:
        raise UnfitError(f"the vehicle is {offset_m:.2f} m away from it")
    steps = np.linalg.norm(np.diff(ahead_m, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    length = max(MIN_BLEND_M, BLEND_PER_OFFSET * offset_m)
    if closed:
        length = min(length, float(way[-1]) / 2.0)
        way = np.minimum(way, way[-1] - way)
    t = np.clip(way / length, 0.0, 1.0)
    fade = 1.0 - t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    path = ahead_m + np.outer(fade, offset)
    path[0] = here_m
    if closed:
        path[-1] = here_m
    return np.asarray(path)


def heading_sector(points_m: Array, yaw_rad: float) -> int:
    """Which of eight 45-degree sectors about the body's x the path begins in, counter-clockwise.

    0 is forward, 2 left, 4 backward, 6 right; 0 as well where it begins straight up or down.
    """
    dx, dy, dz = points_m[1] - points_m[0]
    if math.hypot(dx, dy) < LEVEL_SHARE * math.hypot(dx, dy, dz):
        return 0
    return round((math.atan2(dy, dx) - yaw_rad) / (math.pi / 4.0)) % 8


def _yaws(points_m: Array, closed: bool, present_rad: float) -> Array:
    """Yaw (M,) along the tangent in [-pi, pi); where that is vertical, the present one."""
    if closed:
        ring = np.vstack([points_m[-2], points_m, points_m[1]])
        tangent = (ring[2:] - ring[:-2]) / 2.0
    else:
        tangent = np.gradient(points_m, axis=0)
    level = np.hypot(tangent[:, 0], tangent[:, 1])
    yaw = np.arctan2(tangent[:, 1], tangent[:, 0])
    yaw[level < LEVEL_SHARE * np.linalg.norm(tangent, axis=1)] = present_rad
    return np.asarray((yaw + math.pi) % (2.0 * math.pi) - math.pi)
