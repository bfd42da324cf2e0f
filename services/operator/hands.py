"""A simulated person's thumbs on the sticks. Pure."""

import math

import numpy as np

from common.sticks import DEAD_BAND
from services.operator.sources import NEUTRAL, Deflection

LAG_S = 0.12
"""Time constant of arm and thumb (neuromuscular lag; 0.1 to 0.2 s in manual control)."""
TREMOR_S = 0.08
"""Correlation time of the tremor."""
HOLD = 0.02
"""A thumb is held still until it should be elsewhere by more than this."""
SPRING_S = 0.08
"""How long the springs of a stick take to centre it once it is let go."""
RESOLUTION = 1.0 / 127.0
"""A stick reports in eight bits."""


class Hands:
    """Moves the sticks to where they are wanted, as well as a person can.

    Args:
        tremor: standard deviation, as a fraction of full stick.
        rng: of the tremor.
    """

    def __init__(self, tremor: float, rng: np.random.Generator) -> None:
        self._tremor = tremor
        self._rng = rng
        self._aim = np.zeros(4)
        self._thumbs = np.zeros(4)
        self._shake = np.zeros(4)

    def step(self, wanted: Deflection | None, elapsed_s: float) -> Deflection:
        """The sticks after `elapsed_s`; None lets go of them."""
        if wanted is None:
            self._aim[:] = 0.0
            self._thumbs *= 0.5 if elapsed_s < SPRING_S else 0.0
            self._thumbs[np.abs(self._thumbs) < 2.0 * DEAD_BAND] = 0.0
            self._shake[:] = 0.0
            return self._sticks(self._thumbs)
        aim = np.array([wanted.vx, wanted.vy, wanted.vz, wanted.wz])
        # Letting an axis rest is no fine adjustment.
        moved = (np.abs(aim - self._aim) > HOLD) | ((aim == 0.0) & (self._aim != 0.0))
        self._aim[moved] = aim[moved]
        self._thumbs += (1.0 - math.exp(-elapsed_s / LAG_S)) * (self._aim - self._thumbs)
        keep = math.exp(-elapsed_s / TREMOR_S)
        fresh = self._rng.normal(size=4) * self._tremor
        self._shake = keep * self._shake + math.sqrt(1.0 - keep * keep) * fresh
        return self._sticks(self._thumbs + self._shake)

    @staticmethod
    def _sticks(thumbs: np.ndarray) -> Deflection:
        sticks = np.clip(np.round(thumbs / RESOLUTION) * RESOLUTION, -1.0, 1.0)
        sticks[np.abs(sticks) <= DEAD_BAND] = 0.0
        return Deflection(*(float(axis) for axis in sticks)) if sticks.any() else NEUTRAL
