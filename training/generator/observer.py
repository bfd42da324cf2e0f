"""The plain observer: whoever is asked for a shape does it again if the path flown is not one.

Real operators were asked for shapes that can be recognised, and could begin anew. The observer sees
a path only, no sticks, and knows what was asked. The rules leave the execution alone: a path that
wobbles is still a line, as long as it does not swing to both sides as a sine does.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from training.generator.hands import FULL_UP_MPS, FULL_YAW_RADPS
from training.generator.noise import STEP_S, Array

VEHICLE_S = 0.3
"""Sticks become a path through a vehicle with this time constant, when nobody has flown one."""
POINTS = 64
SMOOTHING_POINTS = 3.0
STRAIGHT_SHARE = 0.10
"""A line's largest distance from its chord, of the chord."""
SWING_RAD = math.radians(30.0)
"""Turning less than this to and fro is no swing."""
ARC_RAD = math.radians(60.0)
BACK_SHARE = 0.35
"""An arc turns back by at most this share of its turn; more makes it a sine."""
LEVEL_SLOPE, CLIMB_SLOPE = 0.10, 0.15
"""Change of height per horizontal way: a flat shape has at most the first, a helix the second."""
STEADY_SHARE = 0.3
"""A helix departs from its even climb by at most this share of it."""
SHORTEST_M = 0.25
"""A path of less than this is a hover."""

Mask = NDArray[np.bool_]


def flown_m(sticks: Array) -> Array:
    """Where (n, k, 3) sticks (n, k, 4) take a tum plant with one lag, in still air, from rest."""
    heading = np.cumsum(sticks[:, :, 3], axis=1) * STEP_S * FULL_YAW_RADPS
    cos, sin = np.cos(heading), np.sin(heading)
    vx, vy = sticks[:, :, 0], sticks[:, :, 1]
    wanted = np.stack(
        [cos * vx - sin * vy, sin * vx + cos * vy, FULL_UP_MPS * sticks[:, :, 2]], axis=2
    )
    keep = math.exp(-STEP_S / VEHICLE_S)
    speed = lfilter([1.0 - keep], [1.0, -keep], wanted, axis=1)
    return np.asarray(np.cumsum(speed, axis=1) * STEP_S)


def seen(where_m: Array, samples: NDArray[np.int64]) -> Array:
    """Paths (n, POINTS, 3), evenly spaced along their way, of places (n, k, 3) over time."""
    out = np.empty((len(where_m), POINTS, 3))
    for row, count in enumerate(samples):
        path = where_m[row, :count]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        at = np.linspace(0.0, way[-1], POINTS)
        for axis in range(3):
            out[row, :, axis] = np.interp(at, way, path[:, axis])
    return out


def _turns(flat: Array) -> tuple[Array, Array]:
    """The largest turn (n,) left and right anywhere along smoothed paths (n, k, 2)."""
    smooth = gaussian_filter1d(flat, SMOOTHING_POINTS, axis=1, mode="nearest")
    steps = np.diff(smooth, axis=1)[:, 2:-2]
    heading = np.unwrap(np.arctan2(steps[:, :, 1], steps[:, :, 0]), axis=1)
    left = (heading - np.minimum.accumulate(heading, axis=1)).max(axis=1)
    right = (np.maximum.accumulate(heading, axis=1) - heading).max(axis=1)
    return left, right


def looks_like(label: str, path_m: Array, vertical: Mask, plane_rad: Array) -> Mask:
    """Whether paths (n, k, 3) would be called by a primitive's name.

    Args:
        label: the primitive.
        path_m: what is seen.
        vertical: (n,) whether to look at a vertical plane.
        plane_rad: (n,) that plane's horizontal direction.
    """
    cos, sin = np.cos(plane_rad)[:, None], np.sin(plane_rad)[:, None]
    along = cos * path_m[:, :, 0] + sin * path_m[:, :, 1]
    beside = cos * path_m[:, :, 1] - sin * path_m[:, :, 0]
    up = path_m[:, :, 2]
    flat = np.stack([along, np.where(vertical[:, None], up, beside)], axis=2)
    out_of_plane = np.where(vertical[:, None], beside, up)
    way_m = np.linalg.norm(np.diff(path_m, axis=1), axis=2).sum(axis=1)
    flat_way_m = np.maximum(np.linalg.norm(np.diff(flat, axis=1), axis=2).sum(axis=1), 1e-6)
    far_enough = way_m > SHORTEST_M
    left, right = _turns(flat)
    most, least = np.maximum(left, right), np.minimum(left, right)
    if label == "line":
        away = path_m - path_m[:, :1]
        chord_m = np.maximum(np.linalg.norm(away[:, -1], axis=1), 1e-6)
        ahead = away[:, -1] / chord_m[:, None]
        off = away - (away @ ahead[:, :, None]) * ahead[:, None]
        off_m = np.linalg.norm(off, axis=2)
        return np.asarray(
            far_enough
            & (off_m.max(axis=1) < STRAIGHT_SHARE * chord_m)
            & (chord_m > 0.9 * way_m)
            & (least < SWING_RAD)
        )
    rise = np.abs(out_of_plane[:, -1] - out_of_plane[:, 0]) / flat_way_m
    if label == "sine":
        # It must get on while it swings: else it is a knot.
        ends_m = np.linalg.norm(flat[:, -1] - flat[:, 0], axis=1)
        return np.asarray(
            far_enough
            & (least > SWING_RAD)
            & (least > BACK_SHARE * most)
            & (most < math.radians(170.0))
            & (ends_m > 0.4 * flat_way_m)
            & (rise < LEVEL_SLOPE)
        )
    turned = (most > ARC_RAD) & (least < BACK_SHARE * most)
    if label == "arc":
        return np.asarray(far_enough & turned & (rise < LEVEL_SLOPE))
    even = up[:, :1] + (up[:, -1:] - up[:, :1]) * np.linspace(0.0, 1.0, up.shape[1])
    uneven = np.abs(up - even).max(axis=1) / np.maximum(np.abs(up[:, -1] - up[:, 0]), 1e-6)
    return np.asarray(far_enough & turned & (rise > CLIMB_SLOPE) & (uneven < STEADY_SHARE))
