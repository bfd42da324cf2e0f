"""The heading by the magnetic field: only its direction on the horizontal counts."""

import math

import numpy as np

from common.frames import Array, wrap_angle
from services.localizer.filter import ROTATION, SIZE, ErrorStateFilter

GATE = 9.0
"""Of the squared Mahalanobis length: three sigmas."""
REFUSALS = 20
"""A compass that contradicts for a second is right: no disturbance flies along for so long."""
_STEEPEST = 6.0
"""A field that dips by more than 80 degrees says more of the tilt than of the heading."""


def north_error(field: Array) -> float | None:
    """How far a level field (3,) must be turned about z to point north, along world +y, in rad.

    None where it has no direction on the horizontal.
    """
    horizontal = math.hypot(field[0], field[1])
    if horizontal == 0.0 or abs(field[2]) > _STEEPEST * horizontal:
        return None
    return wrap_angle(math.pi / 2.0 - math.atan2(field[1], field[0]))


class Compass:
    """Corrects the heading.

    Args:
        noise_rad: of the heading by a mean field.
    """

    def __init__(self, noise_rad: float) -> None:
        self._noise = np.array([[noise_rad**2]])
        self._refused = 0

    def correct(self, state: ErrorStateFilter, field: Array) -> None:
        """Correct by a mean field (3,) that the filter's rotation has turned into the world."""
        error = north_error(field)
        if error is None:
            return
        jacobian = np.zeros((1, SIZE))
        # A tilt leaks the field's vertical part into the heading.
        jacobian[0, ROTATION] = (0.0, -field[2] / math.hypot(field[0], field[1]), 1.0)
        residual = np.array([error])
        if state.surprise(residual, jacobian, self._noise) < GATE:
            self._refused = 0
            state.correct(residual, jacobian, self._noise)
            return
        self._refused += 1
        if self._refused >= REFUSALS:
            state.loosen(0.0, abs(error))
