"""The plan: a route of primitives, as the operator was briefed on it. Pure."""

import math
from dataclasses import dataclass

import numpy as np

from common.frames import Array
from worlds import World

STEP_M = 0.2
"""Between the points that a person tells apart on the ground."""


@dataclass(frozen=True)
class Leg:
    """One primitive of the route, from and to its distances along it."""

    primitive: str
    begin_m: float
    end_m: float


@dataclass(frozen=True, eq=False)
class Route:
    """What is to be flown.

    Attributes:
        world: where.
        points_m: (N, 3), evenly spaced by `step_m`; a closed route's end is not its start again.
        step_m: about STEP_M.
        length_m: once along it.
        is_closed: whether its end joins its start.
        legs: its primitives in order.
        is_on_ground: whether it is seen as a lane on the ground, not as marks in the air.
    """

    world: str
    points_m: Array
    step_m: float
    length_m: float
    is_closed: bool
    legs: tuple[Leg, ...]
    is_on_ground: bool

    def index_of(self, along_m: float) -> int:
        """The point nearest to a distance along the route, counted over all laps."""
        index = round(along_m / self.step_m)
        if self.is_closed:
            return index % len(self.points_m)
        return min(max(index, 0), len(self.points_m) - 1)

    def leg_at(self, along_m: float) -> tuple[Leg, float]:
        """The primitive at a distance (over all laps), and how far it goes on from there."""
        within_m = along_m % self.length_m if self.is_closed else along_m
        for leg in self.legs:
            if within_m < leg.end_m:
                return leg, leg.end_m - within_m
        return self.legs[-1], 0.0


def route_of(world: World) -> Route:
    """The route that a world's ideal path is.

    Raises:
        ValueError: if the world has none.
    """
    if not world.segments:
        raise ValueError(f"world {world.name!r} has no ideal path to fly")
    legs: list[Leg] = []
    for segment in world.segments:
        begin_m = legs[-1].end_m if legs else 0.0
        legs.append(Leg(segment.primitive, begin_m, begin_m + segment.length_m))
    path_m = world.ideal_path_m
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_m, axis=0), axis=1))])
    # Chords are shorter than the arcs they stand for: distances are those of the segments.
    along_m *= legs[-1].end_m / along_m[-1]
    count = math.ceil(legs[-1].end_m / STEP_M)
    wanted_m = np.linspace(0.0, legs[-1].end_m, count + 1)
    points_m = np.stack([np.interp(wanted_m, along_m, path_m[:, axis]) for axis in range(3)], 1)
    return Route(
        world=world.name,
        points_m=points_m[:-1] if world.closed else points_m,
        step_m=legs[-1].end_m / count,
        length_m=legs[-1].end_m,
        is_closed=world.closed,
        legs=tuple(legs),
        is_on_ground=world.width_m is not None,
    )
