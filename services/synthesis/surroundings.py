"""Where a path may go: inside the geofence, between two heights, clear of the world's bodies.

Worlds are those of `worlds/`; what the vehicle itself meets on its way is nobody's knowledge here.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.plane import way_of
from services.synthesis.primitives.shape import UnfitError
from worlds import Body

MIN_PATH_M = 1.0
"""Less than this ahead of a wall is no way to go on."""
KINDS = ("box", "cylinder", "sphere")
SLACK_M = 0.01
"""A vehicle that is too near already may go on as near, not nearer."""


@dataclass(frozen=True)
class Way:
    """A path that may be flown.

    Attributes:
        path: (M, 4), x y z in m and yaw in rad.
        closed: whether its end joins its start.
        note: what it was shortened for, and what was not looked at; mostly empty.
    """

    path: Array
    closed: bool
    note: str = ""


class Surroundings:
    """The limits, and the bodies of one world.

    Args:
        config: the limits and the vehicle's clearance.
        bodies: what stands in the world; None where that is not known, which paths' notes say.
    """

    def __init__(self, config: Config, bodies: tuple[Body, ...] | None) -> None:
        self._config = config
        self._unknown = bodies is None
        bodies = bodies or ()
        self._clearance_m = config.half_width_m + config.margin_m
        self._names = [body.texture for body in bodies]
        self._centres = np.array([body.position_m for body in bodies]).reshape(-1, 3)
        self._halves = np.array([body.size_m for body in bodies]).reshape(-1, 3) / 2.0
        self._reach = np.linalg.norm(self._halves, axis=1)
        self._to_body = np.array(
            [Rotation.from_quat(body.orientation).as_matrix().T for body in bodies]
        ).reshape(-1, 3, 3)
        self._kinds = np.array([KINDS.index(body.shape) for body in bodies], dtype=int)

    def keep(self, path: Array, closed: bool, position_std_m: float = 0.0) -> Way:
        """As much of a path (M, 4) as may be flown.

        Args:
            path: from the vehicle on.
            closed: whether its end joins its start.
            position_std_m: how well the vehicle's place is known; where it is not, bodies cannot be
                told to be in the way, and the note says so.

        Raises:
            UnfitError: if too little is left to be worth flying.
        """
        points = path[:, :3]
        blind = bool(self._names) and position_std_m > self._config.max_position_std_m
        room, names = self._limits(points)
        if self._names and not blind:
            distances, index = self._distances(points)
            room = np.vstack([room, distances - self._clearance_m])
            names += [self._names[i] for i in index]
        # A vehicle that is out of bounds already may come back, but not go further.
        bad = room < np.where(room[:, :1] < 0.0, room[:, :1] - SLACK_M, 0.0)
        hits = np.flatnonzero(bad.any(axis=0))
        note = "walls not checked: what stands in this world is not known" if self._unknown else ""
        if blind:
            note = f"walls not checked: place known to {position_std_m:.1f} m only"
        if not hits.size:
            return Way(path, closed, note)
        first = int(hits[0])
        what = names[int(np.argmin(np.where(bad[:, first], room[:, first], np.inf)))]
        left_m = float(way_of(points[:first])[-1])
        if left_m < MIN_PATH_M:
            raise UnfitError(f"{what} {left_m:.1f} m ahead")
        cut = f"ends after {left_m:.1f} m: {what} ahead"
        return Way(path[:first], False, f"{cut}; {note}" if note else cut)

    def _limits(self, points_m: Array) -> tuple[Array, list[str]]:
        """Room (3, M) that is left to each limit, and the limits' names."""
        config = self._config
        away = np.hypot(points_m[:, 0], points_m[:, 1])
        room = np.stack(
            [
                config.fence_radius_m - away,
                points_m[:, 2] - config.min_height_m,
                config.max_height_m - points_m[:, 2],
            ]
        )
        return room, [
            "the geofence",
            f"the lowest height of {config.min_height_m:g} m",
            f"the greatest height of {config.max_height_m:g} m",
        ]

    def _distances(self, points_m: Array) -> tuple[Array, list[int]]:
        """Distances (K, M) to bodies that may be near, negative inside, and which these are."""
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        apart = np.maximum(low - self._centres, 0.0) + np.maximum(self._centres - high, 0.0)
        index = np.flatnonzero(np.linalg.norm(apart, axis=1) < self._reach + self._clearance_m)
        offsets = points_m[None] - self._centres[index, None]
        local = np.abs(np.einsum("bij,bmj->bmi", self._to_body[index], offsets))
        halves = self._halves[index, None]
        over = local - halves
        level = np.hypot(local[..., 0], local[..., 1]) - halves[..., 0]
        around = _outside(np.stack([level, over[..., 2]], axis=-1))
        ball = np.linalg.norm(local, axis=-1) - halves[..., 0]
        kinds = self._kinds[index, None]
        return np.choose(kinds, [_outside(over), around, ball]), index.tolist()


def _outside(over: Array) -> Array:
    """Signed distance (...) from how far points lie over a body's sides (..., K)."""
    beyond = np.linalg.norm(np.maximum(over, 0.0), axis=-1)
    return np.asarray(beyond + np.minimum(over.max(axis=-1), 0.0))
