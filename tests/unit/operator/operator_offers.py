"""Suggestions as a good, and as a wrong, recogniser would make them."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
from operator_flight import Flight

from common.messages import Suggestion

SPACING_M = 0.1


def suggestion_of(
    number: int, primitive: str, points: np.ndarray, closed: bool, speed: float = 0.85
) -> Suggestion:
    return Suggestion(
        stamp=0,
        seq=0,
        id=number,
        primitive=primitive,
        params={},
        path=[tuple(float(v) for v in point) for point in points],
        closed=closed,
        speed=speed,
        fit_rms=0.02,
        confidence=0.9,
        heading_sector=0,
    )


def line_from(x: float, y: float, z: float, heading: float, length_m: float = 20.0) -> np.ndarray:
    along = np.arange(0.0, length_m + 1e-9, SPACING_M)
    return np.stack(
        [
            x + along * math.cos(heading),
            y + along * math.sin(heading),
            np.full_like(along, z),
            np.full_like(along, heading),
        ],
        axis=1,
    )


def circle_from(
    x: float, y: float, z: float, heading: float, radius_m: float, side: float = 1.0
) -> np.ndarray:
    """A full circle, tangent to the heading; `side` +1 turns left."""
    turned = np.arange(0.0, 2.0 * math.pi, SPACING_M / radius_m)
    yaw = heading + side * turned
    return np.stack(
        [
            x + side * radius_m * (np.sin(yaw) - math.sin(heading)),
            y - side * radius_m * (np.cos(yaw) - math.cos(heading)),
            np.full_like(turned, z),
            yaw,
        ],
        axis=1,
    )


class GoodOffers:
    """What the operator is flying, fitted with small errors, in a world shifted by drift."""

    def __init__(self, seed: int, drift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self._rng = np.random.default_rng(seed)
        self._numbers: Iterator[int] = itertools.count(1)
        self._drift_m = drift_m

    def __call__(self, flight: Flight) -> Suggestion | None:
        vehicle = flight.vehicle
        if vehicle.state != "flying" or np.linalg.norm(vehicle.velocity_mps) < 0.4:
            return None
        heading = math.atan2(vehicle.velocity_mps[1], vehicle.velocity_mps[0])
        heading += self._rng.normal() * math.radians(2.0)
        x, y, z = (
            a + b
            for a, b in zip((vehicle.x_m, vehicle.y_m, vehicle.z_m), self._drift_m, strict=True)
        )
        if abs(vehicle.yaw_rate_radps) < 0.1:
            return suggestion_of(next(self._numbers), "line", line_from(x, y, z, heading), False)
        radius_m = 4.0 * (1.0 + 0.05 * self._rng.normal())
        side = math.copysign(1.0, vehicle.yaw_rate_radps)
        points = circle_from(x, y, z, heading, radius_m, side)
        return suggestion_of(next(self._numbers), "arc", points, True)
