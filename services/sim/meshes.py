"""Meshes as triangles, (N, k) in single precision.

A vertex of a body is its position, normal, uv, and which of the body's sides u and v measure, so
that a texture keeps its size in metres on bodies of any size.
"""

import math

import numpy as np

from common.frames import Array
from worlds import Strip


def box() -> Array:
    """A box of size 1."""
    vertices = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            up = np.asarray((0.0, 0.0, 1.0)) if axis < 2 else np.asarray((0.0, 1.0, 0.0))
            across = np.cross(up, normal)
            quad = [
                (*(normal * 0.5 + across * (u - 0.5) + up * (v - 0.5)), *normal, u, v, *across, *up)
                for u, v in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
            ]
            vertices += [quad[index] for index in (0, 1, 2, 0, 2, 3)]
    return np.asarray(vertices, "f4")


def cylinder(sides: int, radius: float = 0.5) -> Array:
    """A cylinder of size 1, if the corners of its sides are as far out as that."""
    vertices = []
    round_side = (math.pi, 0.0, 0.0)
    up = (0.0, 0.0, 1.0)
    flat = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    def rim(step: int, z: float, v: float) -> tuple[float, ...]:
        angle = 2.0 * math.pi * step / sides
        x, y = math.cos(angle), math.sin(angle)
        across = (step / sides, v, *round_side, *up)
        return (radius * x, radius * y, z, x, y, 0.0, *across)

    def lid(x: float, y: float, z: float) -> tuple[float, ...]:
        return (x, y, z, 0.0, 0.0, 2.0 * z, x + 0.5, y + 0.5, *flat[0], *flat[1])

    for step in range(sides):
        a, b = rim(step, -0.5, 0.0), rim(step + 1, -0.5, 0.0)
        c, d = rim(step + 1, 0.5, 1.0), rim(step, 0.5, 1.0)
        vertices += [a, b, c, a, c, d]
        vertices += [lid(0.0, 0.0, 0.5), lid(d[0], d[1], 0.5), lid(c[0], c[1], 0.5)]
        vertices += [lid(0.0, 0.0, -0.5), lid(b[0], b[1], -0.5), lid(a[0], a[1], -0.5)]
    return np.asarray(vertices, "f4")


def sphere(rings: int, radius: float = 0.5) -> Array:
    """A sphere of size 1, if its corners are as far out as that."""
    sides = 2 * rings

    def point(ring: int, side: int) -> tuple[float, ...]:
        rise = math.pi * (ring / rings - 0.5)
        turn = 2.0 * math.pi * side / sides
        x, y = math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn)
        z = math.sin(rise)
        uv = (side / sides, ring / rings)
        return (radius * x, radius * y, radius * z, x, y, z, *uv, math.pi, 0.0, 0.0, 0.0, 0.0, 1.57)

    vertices = []
    for ring in range(rings):
        for side in range(sides):
            a, b = point(ring, side), point(ring, side + 1)
            c, d = point(ring + 1, side + 1), point(ring + 1, side)
            vertices += [a, b, c, a, c, d]
    return np.asarray(vertices, "f4")


def indexed(vertices: Array) -> tuple[Array, Array]:
    """Each vertex once, and which one each corner of a triangle is."""
    unlike, numbers = np.unique(vertices, axis=0, return_inverse=True)
    return unlike, numbers.astype("i4")


def ribbon(strip: Strip) -> tuple[Array, Array]:
    """A triangle strip along a line: points (2N, 2), and metres along and across (2N, 2)."""
    ahead = np.gradient(strip.points_m, axis=0)
    if np.allclose(strip.points_m[0], strip.points_m[-1]):
        ahead[0] = ahead[-1] = ahead[0] + ahead[-1]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) * (strip.width_m / 2.0)
    steps = np.linalg.norm(np.diff(strip.points_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    points = np.stack([strip.points_m + left, strip.points_m - left], axis=1).reshape(-1, 2)
    uv = np.empty_like(points)
    uv[0::2] = np.stack([along, np.full_like(along, strip.width_m)], axis=1)
    uv[1::2] = np.stack([along, np.zeros_like(along)], axis=1)
    return points, uv
