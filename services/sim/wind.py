"""Wind: a steady part and Dryden gusts, as MIL-F-8785C has them for low altitudes.

The intensities and lengths of gusts grow with the steady wind and the height. Turbulence is frozen
into the air, so a vehicle meets it at its speed through that air.
"""

import math

import numpy as np

from services.sim.body import Vector3

STEP_S = 0.02
"""Gusts change over a second or more; they are redrawn at 50 Hz."""
_FEET = 1.0 / 0.3048
_LOWEST_M = 3.048
"""The model begins at 10 ft."""
_SLOWEST_MPS = 0.5
_BLOCK = 512


class Wind:
    """The air's velocity where the vehicle is.

    Args:
        generator: of the gusts.
        mean_mps: the steady wind, 6 m above ground.
        from_deg: where it blows from, clockwise from north (+y).
        gusts: whether it gusts.
    """

    def __init__(
        self, generator: np.random.Generator, mean_mps: float, from_deg: float, gusts: bool
    ) -> None:
        bearing = math.radians(from_deg)
        self._east, self._north = -math.sin(bearing), -math.cos(bearing)
        self._mean_mps = mean_mps
        self._gusts = gusts
        self._generator = generator
        self._noise: list[list[float]] = []
        # A chain of two first-order filters each across and up, one along the wind.
        self._along = 0.0
        self._across = self._up = (0.0, 0.0)

    def step(self, position_m: Vector3, velocity_mps: Vector3) -> Vector3:
        """The velocity of the air, world, for the next STEP_S."""
        mean = self._mean_mps
        if not self._gusts:
            return (mean * self._east, mean * self._north, 0.0)
        if not self._noise:
            self._noise = self._generator.standard_normal((_BLOCK, 3)).tolist()
        one, two, three = self._noise.pop()
        airspeed = max(
            _SLOWEST_MPS,
            math.hypot(mean * self._east - velocity_mps[0], mean * self._north - velocity_mps[1]),
        )
        sigma_mps, along_m, up_m = gusts_at(position_m[2], mean)
        keep = math.exp(-STEP_S * airspeed / along_m)
        self._along = keep * self._along + math.sqrt(1.0 - keep * keep) * one
        self._across = _filtered(self._across, two, keep)
        self._up = _filtered(self._up, three, math.exp(-STEP_S * airspeed / up_m))
        along = mean + sigma_mps[0] * self._along
        across = sigma_mps[1] * _shaped(self._across)
        return (
            along * self._east - across * self._north,
            along * self._north + across * self._east,
            sigma_mps[2] * _shaped(self._up),
        )


def gusts_at(height_m: float, mean_mps: float) -> tuple[Vector3, float, float]:
    """Standard deviations along, across and up in m/s; lengths level and up in m."""
    height_ft = max(height_m, _LOWEST_M) * _FEET
    thinning = 0.177 + 0.000823 * height_ft
    up_mps = 0.1 * mean_mps
    level_mps = up_mps / thinning**0.4
    return (
        (level_mps, level_mps, up_mps),
        height_ft / thinning**1.2 / _FEET,
        height_ft / _FEET,
    )


def _filtered(pair: tuple[float, float], white: float, keep: float) -> tuple[float, float]:
    """Two equal lags in a row, driven so that the first has variance 1 (the second then 1/2)."""
    first = keep * pair[0] + math.sqrt(1.0 - keep * keep) * white
    return first, keep * pair[1] + (1.0 - keep) * pair[0]


def _shaped(pair: tuple[float, float]) -> float:
    """(1 + sqrt(3) T s) / (1 + T s)^2 by partial fractions; variance 1."""
    root = math.sqrt(3.0)
    return (root * pair[0] + (1.0 - root) * pair[1]) / math.sqrt(2.0)
