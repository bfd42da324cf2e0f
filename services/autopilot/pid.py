"""A PID on one or more axes."""

from collections.abc import Sequence
from dataclasses import dataclass

INTEGRAL_SHARE = 0.5
"""The integral part is limited to this share of the output's limit."""


@dataclass(frozen=True)
class Gains:
    """Output per error, per integral of error, per rate of error; and the output's limit."""

    p: float
    i: float
    d: float
    limit: float


class Pid:
    """A correction from an error and its rate, both given: nothing is differentiated here.

    Anti-windup: the integral is limited, and stands still while the output or the vehicle is
    saturated.
    """

    def __init__(self, gains: Gains, axes: int) -> None:
        self._gains = gains
        self._axes = axes
        self.reset()

    def reset(self) -> None:
        """Forget past errors."""
        self._integral = [0.0] * self._axes

    def correction(
        self, error: Sequence[float], rate: Sequence[float], dt_s: float, saturated: bool
    ) -> list[float]:
        """The output on each axis, its norm at most the limit."""
        gains = self._gains
        output = [
            gains.p * e + whole + gains.d * r
            for e, whole, r in zip(error, self._integral, rate, strict=True)
        ]
        limited = limit_norm(output, gains.limit)
        if not saturated and limited == output:
            grown = [w + gains.i * e * dt_s for w, e in zip(self._integral, error, strict=True)]
            self._integral = limit_norm(grown, INTEGRAL_SHARE * gains.limit)
        return limited


def limit_norm(vector: list[float], limit: float) -> list[float]:
    """The vector, shortened to `limit` if it is longer."""
    norm = sum(v * v for v in vector) ** 0.5
    return vector if norm <= limit else [v * limit / norm for v in vector]
