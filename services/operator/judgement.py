"""Does what is drawn in the picture fit the lane ahead? Pure."""

from dataclasses import dataclass

import numpy as np

from common.frames import Array
from common.messages import Suggestion
from services.operator.eyes import Sight


@dataclass(frozen=True, eq=False)
class Drawing:
    """A suggestion as a person sees it: relative to the vehicle, not in the localizer's world.

    Attributes:
        suggestion: its id.
        primitive: the name beside it.
        points_m: (N, 3), where it seems to run.
        closed: whether it goes on from its end to its start.
        seen_ns: when it was seen.
    """

    suggestion: int
    primitive: str
    points_m: Array
    closed: bool
    seen_ns: int


@dataclass(frozen=True)
class Fit:
    """How the next metres of a drawing lie in the lane.

    Attributes:
        aside_m: the largest distance from the lane's midline.
        gain_m: how far along the lane they lead.
        looked_m: how many metres of drawing were compared.
        height_m: the largest distance from the height to be flown.
    """

    aside_m: float
    gain_m: float
    looked_m: float
    height_m: float


def drawing_of(suggestion: Suggestion, sight: Sight, now_ns: int) -> Drawing:
    """What a suggestion that has just been drawn looks like: its path starts at the vehicle."""
    points_m = np.array([point[:3] for point in suggestion.path])
    return Drawing(
        suggestion.id,
        suggestion.primitive,
        points_m - points_m[0] + sight.position_m,
        suggestion.closed,
        now_ns,
    )


def ahead_of(drawing: Drawing, position_m: Array, length_m: float) -> Array:
    """The next metres (K, 3) of a drawing from the point of it nearest to a position."""
    points_m = drawing.points_m
    nearest = int(np.argmin(np.linalg.norm(points_m[:, :2] - position_m[:2], axis=1)))
    onward_m = points_m[nearest:]
    if drawing.closed:
        onward_m = np.concatenate([onward_m, points_m[:nearest]])
    steps_m = np.linalg.norm(np.diff(onward_m, axis=0), axis=1)
    return onward_m[np.concatenate([[0.0], np.cumsum(steps_m)]) <= length_m]


def compare(drawn_m: Array, lane_along_m: Array, lane_m: Array, height_m: float) -> Fit:
    """Lay a stretch of a drawing (K, 3) beside the remembered lane (M, 2)."""
    gaps_m = np.linalg.norm(drawn_m[:, None, :2] - lane_m[None], axis=2)
    beside = np.argmin(gaps_m, axis=1)
    return Fit(
        aside_m=float(np.max(np.min(gaps_m, axis=1))),
        gain_m=float(lane_along_m[beside[-1]] - lane_along_m[beside[0]]),
        looked_m=float(np.sum(np.linalg.norm(np.diff(drawn_m, axis=0), axis=1))),
        height_m=float(np.max(np.abs(drawn_m[:, 2] - height_m))),
    )
