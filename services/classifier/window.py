"""The sliding window of sticks: back to the start of the motion, at the model's rate.

Each stick is brought to the model's rate as it comes, so that asking for the window costs nothing:
at T = 0.1 s that is 5 rows an intent instead of 400.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import nanoseconds
from common.messages import Stick
from common.sticks import DEAD_BAND
from common.topics import TOPICS

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]

MODEL_RATE_HZ = 50.0
"""Sticks are brought to this rate before the model sees them."""
WINDOW_SAMPLES = 400
WINDOW_S = WINDOW_SAMPLES / MODEL_RATE_HZ
"""The longest primitive that the thesis keeps has 400 samples (at 45 Hz). Its network sees 200, so
that a third of its data is cut; of a slow sine those 4 s hold no inflection."""
REST_S = 0.3
"""Neutral for this long ends a motion; shorter pauses are hesitations."""
GAP_S = TOPICS["stick"].max_age_s
"""A stick is worthless after this long, so what came before a longer gap is another motion."""

_STEP_NS = nanoseconds(1.0 / MODEL_RATE_HZ)
_REST_NS = nanoseconds(REST_S)
_GAP_NS = nanoseconds(GAP_S)
_CAPACITY = 5 * WINDOW_SAMPLES
_KEPT = WINDOW_SAMPLES + math.ceil((REST_S + GAP_S) * MODEL_RATE_HZ)
"""Rows that a window may still need: its own and the neutral ones after them."""

Row = tuple[float, float, float, float]


@dataclass(frozen=True)
class Motion:
    """The motion that goes on, the newest `WINDOW_S` of it.

    Attributes:
        sticks: (N, 4) vx vy vz wz as fractions of full stick, heading frame, at `MODEL_RATE_HZ`.
        start_ns: when the first row was, on the operator's clock.
        end_ns: the stamp of the newest stick that pushes.
        sources: how many sticks the rows were made of.
    """

    sticks: Array32
    start_ns: int
    end_ns: int
    sources: int


class StickWindow:
    """Collects sticks; gives those of the last `WINDOW_S` that belong to the current motion.

    Row k of a motion is the stick k / `MODEL_RATE_HZ` after the first push, interpolated between
    the sticks before and after it: the same as `at_rate` of all of them.
    """

    def __init__(self) -> None:
        self._rows = np.zeros((_CAPACITY, 4), dtype=np.float32)
        self._sources = np.zeros(_CAPACITY, dtype=np.int64)
        self._newest_ns: int | None = None
        self._astray_ns: int | None = None
        self._previous: Row = (0.0, 0.0, 0.0, 0.0)
        self._pushed_ns: int | None = None
        self._origin_ns = 0
        self._dropped = 0
        self._filled = self._end = 0
        self._taken = self._end_taken = 1

    @property
    def newest_ns(self) -> int | None:
        """The stamp of the newest stick, or None if there was none."""
        return self._newest_ns

    def add(self, stick: Stick) -> bool:
        """Take a stick; whether it was of use.

        One that is late or doubled is not. A long gap begins a new window, and so does a clock that
        was set back: a second stick must confirm it, since one may be a straggler.
        """
        if self._newest_ns is not None:
            elapsed_ns = stick.stamp - self._newest_ns
            if elapsed_ns < -_GAP_NS and not self._follows_astray(stick.stamp):
                self._astray_ns = stick.stamp
                return False
            if -_GAP_NS <= elapsed_ns <= 0:
                return False
            if not 0 < elapsed_ns <= _GAP_NS:
                self._pushed_ns = None
        self._astray_ns = None
        previous_ns, self._newest_ns = self._newest_ns, stick.stamp
        row = (stick.vx, stick.vy, stick.vz, stick.wz)
        pushes = max(abs(stick.vx), abs(stick.vy), abs(stick.vz)) > DEAD_BAND
        if self._pushed_ns is None or previous_ns is None:
            if pushes:
                self._begin(stick.stamp, row)
        elif pushes or stick.stamp - self._pushed_ns < _REST_NS:
            self._fill(previous_ns, stick.stamp, row)
        else:
            self._pushed_ns = None
        self._previous = row
        if pushes:
            self._pushed_ns = stick.stamp
            self._end, self._end_taken = self._filled, self._taken
        return True

    def motion(self) -> Motion | None:
        """The current motion, or None at rest (turning on the spot is rest).

        Neutral sticks at its end are no part of the shape yet.
        Its sticks are a view that is good until the next `add`.
        """
        if self._pushed_ns is None:
            return None
        first = max(0, self._end - WINDOW_SAMPLES)
        return Motion(
            self._rows[first : self._end],
            self._origin_ns + (self._dropped + first) * _STEP_NS,
            self._pushed_ns,
            # The stick at or before the first row is one of those it is made of.
            self._end_taken - int(self._sources[first]) + 1,
        )

    def _follows_astray(self, stamp_ns: int) -> bool:
        return self._astray_ns is not None and 0 < stamp_ns - self._astray_ns <= _GAP_NS

    def _begin(self, stamp_ns: int, row: Row) -> None:
        self._origin_ns = stamp_ns
        self._dropped = 0
        self._filled = self._end = 0
        self._taken = self._end_taken = 1
        self._append(row)

    def _fill(self, previous_ns: int, stamp_ns: int, row: Row) -> None:
        """Add the rows from after the previous stick to this one."""
        next_ns = self._origin_ns + (self._dropped + self._filled) * _STEP_NS
        (a, b, c, d), (e, f, g, h) = self._previous, row
        while next_ns < stamp_ns:
            share = (next_ns - previous_ns) / (stamp_ns - previous_ns)
            self._append(
                (a + share * (e - a), b + share * (f - b), c + share * (g - c), d + share * (h - d))
            )
            next_ns += _STEP_NS
        self._taken += 1
        if next_ns == stamp_ns:
            self._append(row)

    def _append(self, row: Row) -> None:
        if self._filled == _CAPACITY:
            drop = _CAPACITY - _KEPT
            self._rows[:_KEPT] = self._rows[drop:]
            self._sources[:_KEPT] = self._sources[drop:]
            self._dropped += drop
            self._filled -= drop
            self._end -= drop
        self._rows[self._filled] = row
        self._sources[self._filled] = self._taken
        self._filled += 1


def newest_motion(sticks: Array | Array32, rate_hz: float) -> slice:
    """Where the newest motion is in sticks (N, 3 or 4) at a constant rate: what flight would see.

    From its first push to its last; empty if there is none.
    """
    pushes = np.flatnonzero((np.abs(sticks[:, :3]) > DEAD_BAND).any(axis=1))
    if len(pushes) == 0:
        return slice(0, 0)
    pauses = np.flatnonzero(np.diff(pushes) > REST_S * rate_hz)
    begin = pushes[pauses[-1] + 1] if len(pauses) else pushes[0]
    return slice(int(begin), int(pushes[-1]) + 1)


def at_rate(times_s: Array, values: Array, rate_hz: float = MODEL_RATE_HZ) -> Array:
    """Values (N, k) at strictly rising times, interpolated to a constant rate from the first on."""
    duration_s = float(times_s[-1] - times_s[0])
    count = math.floor(duration_s * rate_hz + 1e-6) + 1
    grid_s = times_s[0] + np.arange(count) / rate_hz
    return np.stack([np.interp(grid_s, times_s, values[:, k]) for k in range(values.shape[1])], 1)
