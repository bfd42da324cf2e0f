"""The geometry of a flat floor seen from above: rays to floor points and back, displacements.

A pixel that shows the same spot of the floor in two pictures gives that spot twice, once from each
pose. Both must agree, so their difference is the error of the displacement between the poses;
tilt, turn and climb between the pictures are in the poses already ("de-rotation").
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.camera import DOWN
from common.frames import Array
from services.localizer.filter import (
    KEY_POSITION,
    KEY_ROTATION,
    POSITION,
    ROTATION,
    SIZE,
    VELOCITY,
)

_BODY_FROM_OPTICAL = np.array(DOWN.body_from_optical)
_MOUNT_M = np.array(DOWN.position_m)

STEEPEST = 0.3
"""Rays whose downward part is less than this meet the floor too far away to be of use."""
LEAST_HEIGHT_M = 0.1
"""Lower than this, the camera sees too little of the floor."""
MOST_OUTLIERS = 0.5
LEAST_POINTS = 10


@dataclass(frozen=True)
class View:
    """A downward camera at a pose over a floor of a known height.

    Attributes:
        centre_m: the optical centre in the world.
        height_m: of the centre above the floor.
        world_from_optical: 3x3.
    """

    centre_m: Array
    height_m: float
    world_from_optical: Array

    @classmethod
    def of_body(cls, position_m: Array, rotation: Array, floor_m: float) -> "View":
        """The view from a body at a pose."""
        centre = position_m + rotation @ _MOUNT_M
        return cls(centre, float(centre[2]) - floor_m, rotation @ _BODY_FROM_OPTICAL)

    def to_floor(self, rays: Array) -> tuple[Array, NDArray[np.bool_]]:
        """From the centre to the floor along optical rays (N, 3): offsets (N, 3), and which hit."""
        world = rays @ self.world_from_optical.T
        down = -world[:, 2] / np.linalg.norm(world, axis=1)
        hits = down > STEEPEST
        scale = np.where(hits, self.height_m / np.where(hits, -world[:, 2], 1.0), 0.0)
        return world * scale[:, None], hits

    def of_floor(self, spots_m: Array) -> Array:
        """Optical vectors (N, 3) to spots of the world (N, 3)."""
        return np.asarray((spots_m - self.centre_m) @ self.world_from_optical)


@dataclass(frozen=True)
class Displacement:
    """How far the floor seen twice disagrees, ready for the filter.

    Attributes:
        residual_m: (2,) what the horizontal displacement since the key lacks.
        jacobian: (2, 21).
        inliers: how many spots agree.
        spread_m: standard deviation of one inlying spot.
    """

    residual_m: Array
    jacobian: Array
    inliers: int
    spread_m: float


def displacement(
    key: View, key_rays: Array, now: View, now_rays: Array, age_s: float, tolerance_m: float
) -> Displacement | None:
    """Compare the floor's spots seen from two views.

    Args:
        key: the earlier view.
        key_rays: optical rays (N, 3) in it.
        now: the later view.
        now_rays: optical rays (N, 3) of the same spots in it.
        age_s: how far the later view lies behind the filter's newest state.
        tolerance_m: spots that differ by less from the median are never outliers.

    Returns:
        None if too few spots agree.
    """
    from_key, key_hits = key.to_floor(key_rays)
    from_now, now_hits = now.to_floor(now_rays)
    hits = key_hits & now_hits
    if np.count_nonzero(hits) < LEAST_POINTS:
        return None
    from_key, from_now = from_key[hits], from_now[hits]
    # Seen from the later pose the spot should be where it was seen from the earlier one.
    misses = ((key.centre_m + from_key) - (now.centre_m + from_now))[:, :2]
    off_x, off_y = (misses - _median(misses)).T
    deviations = np.hypot(off_x, off_y)
    # Thrice the sigma of a two-dimensional normal whose median deviation is this.
    inlying = deviations <= max(tolerance_m, 3.0 * float(_median(deviations)) / 1.177)
    count = int(np.count_nonzero(inlying))
    if count < max(LEAST_POINTS, MOST_OUTLIERS * len(misses)):
        return None
    misses, from_key, from_now = misses[inlying], from_key[inlying], from_now[inlying]
    jacobian = np.zeros((2, SIZE))
    by_place, by_turn = _sensitivity(from_now, now.height_m)
    jacobian[:, POSITION], jacobian[:, ROTATION] = by_place, by_turn
    jacobian[:, VELOCITY] = by_place * -age_s
    by_place, by_turn = _sensitivity(from_key, key.height_m)
    jacobian[:, KEY_POSITION], jacobian[:, KEY_ROTATION] = -by_place, -by_turn
    mean = misses.mean(axis=0)
    return Displacement(mean, jacobian, count, math.sqrt(np.mean((misses - mean) ** 2)))


def _median(values: Array) -> Array:
    """Of each column; for so few, numpy's own takes several times as long."""
    ordered, half = np.sort(values, axis=0), len(values) // 2
    middle = ordered[half] if len(values) % 2 else 0.5 * (ordered[half - 1] + ordered[half])
    return np.asarray(middle)


def _sensitivity(offsets_m: Array, height_m: float) -> tuple[Array, Array]:
    """How the mean floor point moves, (2, 3) by the camera's place and (2, 3) by a small turn.

    A turn by d moves the offset r by d x r, and the floor cuts the ray again at the old depth.
    """
    level = offsets_m[:, :2]
    mean_x, mean_y = level.mean(axis=0).tolist()
    (xx, cross), (_, yy) = (level.T @ level / (len(level) * height_m)).tolist()
    by_place = np.array([[1.0, 0.0, mean_x / height_m], [0.0, 1.0, mean_y / height_m]])
    by_turn = np.array([[cross, -height_m - xx, -mean_y], [height_m + yy, -cross, mean_x]])
    return by_place, by_turn
