"""Rotations of the inner loop: scipy's take 10 to 40 us a call, these a few; scipy is their oracle.

The filter needs some 1500 of them a second, which with scipy's would be 4 % of a processor.
"""

import math

import numpy as np

from common.frames import Array

_ONE_AND_A_HALF = 1.5 * np.eye(3)


def cross_matrix(vector: Array) -> Array:
    """The 3x3 matrix that multiplies like `vector` x."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_by(vector_rad: Array) -> Array:
    """The 3x3 rotation by a rotation vector (Rodrigues)."""
    x, y, z = vector_rad.tolist()
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-8:
        # The series: at these angles exact to the last digit.
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = math.sqrt(angle2)
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
    bxy, bxz, byz = b * x * y, b * x * z, b * y * z
    return np.array(
        [
            [1.0 - b * (y * y + z * z), bxy - a * z, bxz + a * y],
            [bxy + a * z, 1.0 - b * (x * x + z * z), byz - a * x],
            [bxz - a * y, byz + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def orthonormal(rotation: Array) -> Array:
    """A rotation without the rounding errors of many products: one step of Newton's iteration."""
    return np.asarray(rotation @ (_ONE_AND_A_HALF - 0.5 * (rotation.T @ rotation)))


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """[x, y, z, w] with w >= 0 of a rotation matrix (Shepperd's choice of the largest part)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    squares = (1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i, 1.0 + a + e + i)
    largest = squares.index(max(squares))
    rows = (
        (squares[0], d + b, c + g, h - f),
        (d + b, squares[1], h + f, c - g),
        (c + g, h + f, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    )
    x, y, z, w = rows[largest]
    scale = math.copysign(1.0, w) / math.sqrt(x * x + y * y + z * z + w * w)
    return x * scale, y * scale, z * scale, w * scale
