"""A path as a row of arrows that lie along it, in true perspective (thesis, figure 4.3). Pure.

Arrows are flat chevrons of fixed size in metres, so that perspective alone makes them smaller and
the distance can be read from them; they fade towards the end of what is drawn.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.camera import FRONT, NEAR_M, Lens, project, to_optical
from common.frames import Array, rotation_of
from common.messages import Pose, Suggestion

FIRST_M = 1.2
"""The nearest arrow is this far ahead along the path: nearer ones are below the picture."""
SPACING_M = 0.7
LENGTH_M = 0.5
WIDTH_M = 0.4
NOTCH = 0.45
"""How deep the tail is cut, as a part of the length."""
FADED = 0.15
"""Opacity of the farthest arrow."""
SUBDIVISIONS = 4
"""Parts of each edge, so that lens distortion bends it."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """One arrow in the picture.

    Attributes:
        outline_px: (N, 2) corners in pixels.
        opacity: 0..1.
        distance_m: along the path from the vehicle.
    """

    outline_px: Array
    opacity: float
    distance_m: float


@dataclass(frozen=True, eq=False)
class Stretch:
    """The part of a path that is drawn.

    Attributes:
        points_m: (N, 3), from the point nearest to the vehicle onward.
        first_m: where along it the first arrow begins.
        spacing_m: from one arrow to the next.
    """

    points_m: Array
    first_m: float
    spacing_m: float


def ahead(suggestion: Suggestion, position_m: Array, length_m: float) -> Stretch:
    """The path from its point nearest to the vehicle onward, at most `length_m` of it.

    Nothing of a path that leads nowhere, or farther than numbers go. A closed path goes on from its
    end to its start. Arrows stand at fixed places of the path, so
    that they lie still in the world and the vehicle flies over them.
    """
    points_m = np.array([point[:3] for point in suggestion.path], dtype=np.float64)
    along_m = _along(points_m)
    lap_m = float(along_m[-1])
    if not 0.0 < lap_m < math.inf:
        return Stretch(points_m[:0], FIRST_M, SPACING_M)
    nearest = int(np.argmin(np.linalg.norm(points_m - position_m, axis=1)))
    spacing_m, flown_m = SPACING_M, float(along_m[nearest])
    onward_m = points_m[nearest:]
    if suggestion.closed:
        onward_m = np.concatenate([onward_m, points_m[: nearest + 1]])
        # A whole number of arrows fits into a lap, so that none moves when one begins.
        spacing_m = lap_m / max(1, round(lap_m / SPACING_M))
    first_m = math.ceil((flown_m + FIRST_M) / spacing_m) * spacing_m - flown_m
    return Stretch(onward_m[_along(onward_m) <= length_m], first_m, spacing_m)


def _along(points_m: Array) -> Array:
    steps_m = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def _chevrons(stretch: Stretch) -> tuple[Array, Array]:
    """Corners (K, 4, 3) of flat arrows along a stretch, and their distances (K,) along it."""
    points_m = stretch.points_m
    along_m = _along(points_m)
    tails_m = np.arange(stretch.first_m, along_m[-1] - LENGTH_M, stretch.spacing_m)
    if len(tails_m) == 0:
        return np.empty((0, 4, 3)), tails_m

    def at(distance_m: Array) -> Array:
        columns = [np.interp(distance_m, along_m, column) for column in points_m.T]
        return np.stack(columns, axis=1)

    tail, tip = at(tails_m), at(tails_m + LENGTH_M)
    forward = tip - tail
    # Across the path and level; a vertical path has no level side, so any does.
    side = np.stack([-forward[:, 1], forward[:, 0], np.zeros(len(forward))], axis=1)
    width = np.linalg.norm(side, axis=1, keepdims=True)
    side = np.where(width > 1e-6, side / np.maximum(width, 1e-6), [0.0, 1.0, 0.0])
    left, right = tail + side * WIDTH_M / 2.0, tail - side * WIDTH_M / 2.0
    return np.stack([tip, left, tail + NOTCH * forward, right], axis=1), tails_m


def _subdivided(corners_m: Array) -> Array:
    share = np.linspace(0.0, 1.0, SUBDIVISIONS, endpoint=False)[:, None]
    following = np.roll(corners_m, -1, axis=0)
    edges = corners_m[:, None] + share * (following - corners_m)[:, None]
    return np.asarray(edges.reshape(-1, 3), dtype=np.float64)


def arrows_of(
    suggestion: Suggestion, pose: Pose, lens: Lens, length_m: float, below_m: float
) -> list[Arrow]:
    """The arrows that are in the front picture, farthest first.

    Args:
        suggestion: whose path is drawn.
        pose: of the vehicle when the picture was taken.
        lens: of the front camera.
        length_m: how far along the path to draw.
        below_m: how far below the path the arrows lie.
    """
    position_m = np.asarray(pose.position, dtype=np.float64)
    stretch = ahead(suggestion, position_m, length_m)
    if len(stretch.points_m) < 2:
        return []
    corners_m, distances_m = _chevrons(stretch)
    corners_m = corners_m - np.array([0.0, 0.0, below_m])
    rotation = rotation_of(pose.orientation)
    arrows: list[Arrow] = []
    for corners, distance_m in zip(corners_m[::-1], distances_m[::-1], strict=True):
        optical = to_optical(_subdivided(corners), position_m, rotation, FRONT)
        if float(optical[:, 2].min()) <= NEAR_M or _folds(optical, lens):
            continue
        pixels, _ = project(optical, lens)
        if not _touches(pixels, lens):
            continue
        opacity = 1.0 - (1.0 - FADED) * float(distance_m) / length_m
        arrows.append(Arrow(pixels, opacity, float(distance_m)))
    return arrows


def _folds(optical_m: Array, lens: Lens) -> bool:
    """Whether a point is so far aside that the lens' polynomial bends it back into the picture."""
    k1, k2, _, _ = lens.distortion
    r2 = np.sum((optical_m[:, :2] / optical_m[:, 2:]) ** 2, axis=1)
    return bool((1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2 * r2).min() <= 0.0)


def _touches(pixels: NDArray[np.float64], lens: Lens) -> bool:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    inside = high[0] >= 0 and high[1] >= 0 and low[0] < lens.width and low[1] < lens.height
    # An arrow just before the lens would be drawn far beyond the picture's edges.
    return bool(inside and (high - low).max() < 4 * lens.width)
