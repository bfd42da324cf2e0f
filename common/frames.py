"""Frames and angles: world ENU, body FLU, heading (body without roll and pitch), optical.

Quaternions are [x, y, z, w], body to world, as in scipy.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def yaw_of(orientation: Sequence[float]) -> float:
    """Yaw in rad of a body-to-world quaternion [x, y, z, w], counter-clockwise about z up."""
    x, y, z, w = orientation
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> tuple[float, ...]:
    """The body-to-world quaternion [x, y, z, w] of intrinsic yaw, then pitch, then roll."""
    x, y, z, w = Rotation.from_euler("ZYX", [yaw_rad, pitch_rad, roll_rad]).as_quat()
    return float(x), float(y), float(z), float(w)


def rotation_of(orientation: Sequence[float]) -> Array:
    """The 3x3 matrix that turns body vectors into world vectors."""
    # By hand, since it is asked for with every picture: scipy's way takes 60 us.
    x, y, z, w = orientation
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    )


def heading_to_world(vx: float, vy: float, yaw_rad: float) -> tuple[float, float]:
    """A horizontal vector of the heading frame (forward, left) in the world (east, north)."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return cos * vx - sin * vy, sin * vx + cos * vy


def world_to_heading(vx: float, vy: float, yaw_rad: float) -> tuple[float, float]:
    """A horizontal vector of the world (east, north) in the heading frame (forward, left)."""
    return heading_to_world(vx, vy, -yaw_rad)
