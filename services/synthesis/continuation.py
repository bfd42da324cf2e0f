"""From a shape to a path: it starts at the vehicle, and goes over to the shape."""

import math
from dataclasses import dataclass

import numpy as np

from common.frames import Array, wrap_angle
from services.synthesis.primitives.plane import way_of
from services.synthesis.primitives.shape import Shape, UnfitError

MAX_OFFSET_M = 0.5
"""A vehicle further than this from the shape has left it."""
MIN_BLEND_M = 1.0
BLEND_PER_OFFSET = 8.0
"""Blend length per offset: the path's direction is then within 13 degrees of the shape's."""
MIN_SPEED_MPS = 0.2
"""Slower than this the vehicle has no direction of travel that would be worth keeping."""
MAX_KINK_RAD = math.radians(45.0)
"""A vehicle that flies further off the shape's direction is doing something else."""
BLEND_PER_KINK_M = 8.0
"""Blend length per rad: the path's curvature then adds at most 0.5 1/m to the shape's."""
LEVEL_SHARE = 0.05
"""Share of a tangent that must be level for it to have a yaw: 3 degrees off vertical."""


@dataclass(frozen=True)
class Vehicle:
    """What the vehicle is doing where a path is to begin.

    Attributes:
        here_m: its position (3,).
        yaw_rad: its yaw, kept where a path has none or the shape does not turn the vehicle; None
            where it is not known.
        velocity_mps: (3,), world; None where it is not known.
    """

    here_m: Array
    yaw_rad: float | None
    velocity_mps: Array | None = None


def continue_from(shape: Shape, vehicle: Vehicle) -> Array:
    """The path (M, 4), x y z in m and yaw in rad, of a shape for a vehicle.

    Raises:
        UnfitError: if the vehicle is not beside the shape, or does not fly along it.
    """
    ahead = shape.ahead()
    points = blend(ahead, vehicle.here_m, shape.closed, _kink(ahead, vehicle.velocity_mps))
    if vehicle.yaw_rad is None:
        yaw = _yaws(points, shape.closed, 0.0)
    elif shape.turns_vehicle or heading_sector(ahead, vehicle.yaw_rad) == 0:
        yaw = _yaws(points, shape.closed, vehicle.yaw_rad)
    else:
        # Flown sideways or backward, a line goes on sideways or backward.
        yaw = np.full(len(points), wrap_angle(vehicle.yaw_rad))
    return np.column_stack([points, yaw])


def blend(ahead_m: Array, here_m: Array, closed: bool, kink: Array | None = None) -> Array:
    """Points (M, 3) that leave `here_m` and go over to a way (M, 3) that begins beside it.

    The offset, and the kink where the vehicle's direction is not quite the way's, fade by quintics
    whose slope and bend are zero at the end; on a closed way the offset grows back before the end.

    Args:
        ahead_m: the way.
        here_m: where the vehicle is (3,).
        closed: whether the way ends where it began.
        kink: the vehicle's direction of travel less the way's (3,), unit vectors both.

    Raises:
        UnfitError: if the vehicle is too far from the way.
    """
    offset = here_m - ahead_m[0]
    offset_m = float(np.linalg.norm(offset))
    if offset_m > MAX_OFFSET_M:
        raise UnfitError(f"the vehicle is {offset_m:.2f} m away from it")
    kink = np.zeros(3) if kink is None else kink
    way = way_of(ahead_m)
    length = max(
        MIN_BLEND_M, BLEND_PER_OFFSET * offset_m, BLEND_PER_KINK_M * float(np.linalg.norm(kink))
    )
    to_end = way[-1] - way
    if closed:
        length = min(length, float(way[-1]) / 2.0)
    path = ahead_m + np.outer(_fade(way / length), offset)
    path += length * np.outer(_bend(way / length), kink)
    if closed:
        path += np.outer(_fade(to_end / length), offset)
        path[-1] = here_m
    path[0] = here_m
    return np.asarray(path)


def _fade(t: Array) -> Array:
    """From 1 at 0 to 0 at 1 and beyond, without slope or bend at either end."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(1.0 - t**3 * (10.0 - 15.0 * t + 6.0 * t**2))


def _bend(t: Array) -> Array:
    """From 0 with slope 1 at 0 to 0 at 1 and beyond, without slope or bend there."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(t - t**3 * (6.0 - 8.0 * t + 3.0 * t**2))


def _kink(ahead_m: Array, velocity_mps: Array | None) -> Array:
    """The direction of travel less the way's (3,); none where the vehicle hardly moves.

    Raises:
        UnfitError: if they have too little in common.
    """
    speed_mps = 0.0 if velocity_mps is None else float(np.linalg.norm(velocity_mps))
    if velocity_mps is None or speed_mps < MIN_SPEED_MPS:
        return np.zeros(3)
    first = ahead_m[1] - ahead_m[0]
    tangent = first / float(np.linalg.norm(first))
    travel = velocity_mps / speed_mps
    angle = math.acos(min(1.0, float(tangent @ travel)))
    if angle > MAX_KINK_RAD:
        raise UnfitError(f"the vehicle flies {math.degrees(angle):.0f} degrees off its direction")
    return np.asarray(travel - tangent)


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
