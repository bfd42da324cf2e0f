"""The AR.Drone's two cameras: where they sit in the body, their lenses, and projection.

Optical frame: z forward, x right, y down. Pictures are pinhole unless a distortion is given.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.frames import Array

NEAR_M = 0.05
"""Points nearer to the picture plane than this are not projected."""


@dataclass(frozen=True)
class Mount:
    """A camera's place in the body.

    Attributes:
        position_m: the optical centre in body coordinates.
        body_from_optical: 3x3, columns are the optical x, y, z axes in body coordinates.
    """

    position_m: tuple[float, float, float]
    body_from_optical: tuple[
        tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]
    ]


FRONT = Mount((0.21, 0.0, 0.0), ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""Looks along body x; picture right is body right, picture down is body down."""

DOWN = Mount((0.0, 0.0, -0.03), ((0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
"""Looks along body -z; the top of the picture is body forward."""


@dataclass(frozen=True)
class Lens:
    """A picture's size and its pinhole: fx fy cx cy in pixels, k1 k2 p1 p2 as in OpenCV."""

    width: int
    height: int
    intrinsics: tuple[float, float, float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @classmethod
    def of_view(cls, width: int, height: int, horizontal_rad: float) -> "Lens":
        """A pinhole with square pixels and a given horizontal field of view."""
        focal = width / 2.0 / math.tan(horizontal_rad / 2.0)
        return cls(width, height, (focal, focal, width / 2.0, height / 2.0))


def to_optical(points_m: Array, position_m: Array, body_to_world: Array, mount: Mount) -> Array:
    """World points (N, 3) in the optical frame of a camera on a body at a pose, (N, 3) in m."""
    body = (points_m - position_m) @ body_to_world - np.asarray(mount.position_m)
    return np.asarray(body @ np.asarray(mount.body_from_optical), dtype=np.float64)


def project(points_m: Array, lens: Lens) -> tuple[Array, NDArray[np.bool_]]:
    """Optical points (N, 3) as pixels (N, 2), and which of them lie in front of the camera.

    Distortion is OpenCV's plumb-bob model (k1 k2 p1 p2).
    """
    in_front = points_m[:, 2] > NEAR_M
    depth = np.where(in_front, points_m[:, 2], 1.0)
    x, y = points_m[:, 0] / depth, points_m[:, 1] / depth
    k1, k2, p1, p2 = lens.distortion
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2 * r2
    fx, fy, cx, cy = lens.intrinsics
    u = fx * (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)) + cx
    v = fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y) + cy
    return np.stack([u, v], axis=1), in_front
