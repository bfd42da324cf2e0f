"""Which readings of the altimeter to believe, and how high the floor below is.

A reading far from what is expected is an outlier (tum_ardrone ignores jumps above 0.15 m). When
such readings keep coming and agree with one another, the vehicle is over another floor: the world
height goes on, the floor's changes.
"""

import math

_SIGMAS = 4.0
_FLOOR_AFTER = 8
"""Readings in a row that make a new floor: 0.3 s at 25 Hz."""


class AltimeterGate:
    """Decides on each reading.

    Args:
        noise_m: one reading's sigma.
        jump_m: a difference that is never taken for noise, unless the height itself is unsure.
    """

    def __init__(self, noise_m: float, jump_m: float) -> None:
        self._noise_m = noise_m
        self._jump_m = jump_m
        self._refused: list[float] = []
        self.floor_m = 0.0

    @property
    def in_doubt(self) -> bool:
        """Whether the floor may just have changed: the last reading was refused."""
        return bool(self._refused)

    def judge(self, height_m: float, expected_m: float, sigma_m: float) -> float | None:
        """Measured minus expected height in m, or None if the reading is not to be believed.

        Args:
            height_m: above the floor, as measured.
            expected_m: above the world's z = 0, as the filter has it.
            sigma_m: how well the filter knows it.
        """
        residual = height_m - (expected_m - self.floor_m)
        gate = max(self._jump_m, _SIGMAS * math.hypot(self._noise_m, sigma_m))
        if abs(residual) <= gate:
            self._refused.clear()
            return residual
        if self._refused and abs(residual - self._refused[-1]) > self._jump_m:
            self._refused.clear()
        self._refused.append(residual)
        if len(self._refused) < _FLOOR_AFTER:
            return None
        floor = self.floor_m - sum(self._refused) / len(self._refused)
        self._refused.clear()
        # Back over the ground the vehicle started from, its height is known, not estimated.
        self.floor_m = 0.0 if abs(floor) <= self._jump_m else floor
        return None
