"""What a pad sent over a while, as every reader gives it: sticks with times and held buttons."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_S, nanoseconds
from training.dataset.primitive import Array

EARLIEST_UTC_S = 1e9
"""September 2001; what is earlier is a clock of its own."""
LATE_S = 1.0
"""Rows may be late or doubled; a clock that goes back further was set back."""
BEYOND = 1e-6
"""Sticks may be beyond full by rounding."""


def utc_or_unknown(stamp_ns: int) -> int:
    """A stamp, or 0 if it is of another clock than UTC: simulated ones do not count from 1970."""
    return stamp_ns if stamp_ns > nanoseconds(EARLIEST_UTC_S) else 0


@dataclass(frozen=True)
class Problem:
    """Something of a file that cannot be used.

    Attributes:
        path: which file, "" where the text names it.
        where: which row, document or cell of it.
        text: what is wrong and what to do.
    """

    path: str
    where: str
    text: str

    def __str__(self) -> str:
        return ": ".join(part for part in (self.path, self.where, self.text) if part)


@dataclass(frozen=True, eq=False)
class Track:
    """Sticks as they were sent.

    Attributes:
        times_s: (N,) strictly rising, on the file's clock.
        sticks: (N, 4) vx vy vz wz as fractions of full stick.
        held: (N,) the face buttons held at each sample.
    """

    times_s: Array
    sticks: Array
    held: tuple[tuple[str, ...], ...]

    def utc_ns(self, row: int) -> int:
        """When a sample was sent, 0 if unknown."""
        return utc_or_unknown(round(self.times_s[row] * NS_PER_S))


class TrackBuilder:
    """Takes a file's rows one by one; bad ones become problems, a clock set back a new track.

    Args:
        path: the file, for the problems.
    """

    def __init__(self, path: str) -> None:
        self.problems: list[Problem] = []
        self._path = path
        self._tracks: list[Track] = []
        self._times_s: list[float] = []
        self._sticks: list[Sequence[float]] = []
        self._held: list[tuple[str, ...]] = []

    def reject(self, where: str, text: str) -> None:
        """Note a row that cannot be used."""
        self.problems.append(Problem(self._path, where, text))

    def add(
        self, where: str, time_s: float, sticks: Sequence[float], held: tuple[str, ...]
    ) -> None:
        """Take a row, or note what is wrong with it."""
        if not math.isfinite(time_s) or not all(map(math.isfinite, sticks)):
            self.reject(where, "a time or stick is not finite; the row is left out")
            return
        worst = max(sticks, key=abs)
        if abs(worst) > 1.0 + BEYOND:
            self.reject(where, f"a stick of {worst:g} is beyond [-1, 1]; the row is left out")
            return
        if self._times_s and time_s <= self._times_s[-1]:
            before = f"time {time_s:.3f} s is not after {self._times_s[-1]:.3f} s"
            if time_s > self._times_s[-1] - LATE_S:
                self.reject(where, f"{before}; the row is left out")
                return
            self.reject(where, f"{before}; taken as the beginning of another recording")
            self._close()
        self._times_s.append(time_s)
        self._sticks.append(sticks)
        self._held.append(held)

    def tracks(self) -> list[Track]:
        """What was taken so far."""
        self._close()
        return self._tracks

    def _close(self) -> None:
        if self._times_s:
            self._tracks.append(
                Track(
                    np.array(self._times_s),
                    np.clip(np.array(self._sticks, dtype=np.float64), -1.0, 1.0),
                    tuple(self._held),
                )
            )
        self._times_s, self._sticks, self._held = [], [], []
