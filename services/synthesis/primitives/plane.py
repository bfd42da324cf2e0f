"""Points in a plane: about a turned axis, and along a way."""

import math

import numpy as np

from common.frames import Array


def turned(xy: Array, axis_rad: float) -> tuple[Array, Array]:
    """Coordinates of points (N, 2) along an axis and to the left of it."""
    cos, sin = math.cos(axis_rad), math.sin(axis_rad)
    return cos * xy[:, 0] + sin * xy[:, 1], cos * xy[:, 1] - sin * xy[:, 0]


def turned_back(along: Array, across: Array, axis_rad: float) -> Array:
    """The points (N, 2) with coordinates along an axis and to the left of it."""
    cos, sin = math.cos(axis_rad), math.sin(axis_rad)
    return np.column_stack([cos * along - sin * across, sin * along + cos * across])


def way_of(points: Array) -> Array:
    """Length (N,) of the way through points (N, K) up to each."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_ways(points: Array, ways_m: Array) -> Array:
    """Places (M, K) at lengths (M,) of the way through points (N, K)."""
    way = way_of(points)
    return np.column_stack([np.interp(ways_m, way, axis) for axis in points.T])
