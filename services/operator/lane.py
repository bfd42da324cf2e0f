"""The lane as a simulated person remembers it: what was seen in the last seconds. Pure."""

import math
from dataclasses import dataclass

import numpy as np

from common.clock import nanoseconds
from common.frames import Array, wrap_angle
from services.operator.eyes import SIGHT_M, Sight
from services.operator.route import Route

MEMORY_S = 10.0
BACK_M = 4.0
"""How far behind the vehicle the remembered lane still matters."""


@dataclass(frozen=True)
class Place:
    """Where the vehicle is in the lane.

    Attributes:
        along_m: distance along the route, over all laps.
        left_m: of the midline.
        heading_rad: of the lane there, world frame.
    """

    along_m: float
    left_m: float
    heading_rad: float


class Lane:
    """The person's picture of the route, in the world frame as he sees it."""

    def __init__(self, route: Route) -> None:
        self._route = route
        self._points_m = np.full((len(route.points_m), 2), np.nan)
        self._seen_ns = np.full(len(route.points_m), np.iinfo(np.int64).min // 2)
        self.place = Place(0.0, 0.0, 0.0)

    def remember(self, sight: Sight, now_ns: int) -> bool:
        """Take in a look and find one's place anew; False while no lane is known."""
        self._points_m[sight.indices] = sight.points_m
        self._seen_ns[sight.indices] = now_ns
        along_m, points_m = self.known(now_ns, -BACK_M, SIGHT_M)
        if len(points_m) < 3:
            return False
        self.place = locate(sight.position_m[:2], along_m, points_m)
        return True

    def known(self, now_ns: int, from_m: float, to_m: float) -> tuple[Array, Array]:
        """The remembered lane between two distances from the place.

        Returns:
            (K,) distances along the route over all laps, and (K, 2) points.
        """
        route = self._route
        begin = math.floor((self.place.along_m + from_m) / route.step_m)
        end = math.ceil((self.place.along_m + to_m) / route.step_m) + 1
        count = len(route.points_m)
        if not route.is_closed:
            begin, end = max(begin, 0), min(end, count)
        numbers = np.arange(begin, max(end, begin))
        indices = numbers % count
        fresh = now_ns - self._seen_ns[indices] <= nanoseconds(MEMORY_S)
        along_m = np.asarray(numbers[fresh] * route.step_m, dtype=np.float64)
        return along_m, np.asarray(self._points_m[indices[fresh]])


def locate(position_m: Array, along_m: Array, points_m: Array) -> Place:
    """The place of a point beside a polyline of >= 2 points; beyond its ends it is prolonged."""
    nearest = int(np.argmin(np.linalg.norm(points_m - position_m, axis=1)))
    # The direction over some samples: looks of different moments do not join smoothly.
    before, after = max(nearest - 3, 0), min(nearest + 3, len(points_m) - 1)
    east_m, north_m = points_m[after] - points_m[before]
    heading_rad = math.atan2(north_m, east_m)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    dx, dy = position_m - points_m[nearest]
    return Place(
        along_m=float(along_m[nearest] + cos * dx + sin * dy),
        left_m=float(cos * dy - sin * dx),
        heading_rad=wrap_angle(heading_rad),
    )
