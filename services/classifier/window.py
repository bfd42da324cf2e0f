"""The sliding window of sticks: back to the start of the motion, in one frame, at one rate."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_S
from common.messages import Stick
from common.sticks import DEAD_BAND
from common.topics import TOPICS

Array = NDArray[np.float64]

MODEL_RATE_HZ = 50.0
"""Sticks are brought to this rate before the model sees them."""
WINDOW_SAMPLES = 200
WINDOW_S = WINDOW_SAMPLES / MODEL_RATE_HZ
"""The thesis' 200 samples, as time: a pad at 100 Hz sends 400 in it."""
REST_S = 0.3
"""Neutral for this long ends a motion; shorter pauses are hesitations."""
GAP_S = TOPICS["stick"].max_age_s
"""A stick is worthless after this long, so what came before a longer gap is another motion."""
MAX_RATE_HZ = 1000.0


@dataclass(frozen=True)
class Motion:
    """The sticks of the motion that goes on, oldest first.

    Attributes:
        stamps_ns: (N,) the operator's clock, strictly rising.
        sticks: (N, 4) vx vy vz wz as fractions of full stick, heading frame.
    """

    stamps_ns: NDArray[np.int64]
    sticks: Array

    @property
    def duration_s(self) -> float:
        """From the first stick to the last."""
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) / NS_PER_S


def _pushes(stick: Stick) -> bool:
    """Whether a stick moves the vehicle anywhere; turning on the spot does not."""
    return max(abs(stick.vx), abs(stick.vy), abs(stick.vz)) > DEAD_BAND


class StickWindow:
    """Collects sticks; gives those of the last `WINDOW_S` that belong to the current motion."""

    def __init__(self) -> None:
        self._rows: deque[tuple[int, float, float, float, float]] = deque(
            maxlen=int(WINDOW_S * MAX_RATE_HZ)
        )
        self._newest_ns: int | None = None
        self._pushed_ns: int | None = None

    @property
    def newest_ns(self) -> int | None:
        """The stamp of the newest stick, or None if there was none."""
        return self._newest_ns

    def add(self, stick: Stick) -> None:
        """Take a stick. A long gap, or a clock set back, begins a new window."""
        if self._newest_ns is not None:
            elapsed_ns = stick.stamp - self._newest_ns
            if -GAP_S * NS_PER_S <= elapsed_ns <= 0:
                return  # late or doubled by the network
            if not 0 < elapsed_ns <= GAP_S * NS_PER_S:
                self._rows.clear()
                self._pushed_ns = None
        self._newest_ns = stick.stamp
        if _pushes(stick):
            self._pushed_ns = stick.stamp
        elif self._pushed_ns is None or stick.stamp - self._pushed_ns >= REST_S * NS_PER_S:
            self._rows.clear()
            self._pushed_ns = None
            return
        self._rows.append((stick.stamp, stick.vx, stick.vy, stick.vz, stick.wz))
        while stick.stamp - self._rows[0][0] > WINDOW_S * NS_PER_S:
            self._rows.popleft()

    def motion(self) -> Motion | None:
        """The current motion, or None at rest (turning on the spot is rest)."""
        if self._pushed_ns is None or not self._rows:
            return None
        # Neutral sticks at the end are no part of the shape yet.
        rows = [row for row in self._rows if row[0] <= self._pushed_ns]
        if not rows:
            return None
        return Motion(
            np.array([row[0] for row in rows], dtype=np.int64),
            np.array([row[1:] for row in rows], dtype=np.float64),
        )


def in_start_frame(times_s: Array, sticks: Array, full_stick_yaw_radps: float) -> Array:
    """Sticks turned into the frame of the heading at the first one.

    An operator who flies a curve by forward and yaw holds the stick still; only in a frame that
    does not turn with the vehicle is that an arc.

    Args:
        times_s: (N,) of the sticks.
        sticks: (N, 4) vx vy vz wz in the heading frame.
        full_stick_yaw_radps: the yaw rate of full stick.

    Returns:
        (N, 3) vx vy vz.
    """
    steps_s = np.diff(times_s, prepend=times_s[:1])
    # The stick is held until the next one comes, so a step turns by the stick at its beginning.
    held = np.concatenate([[0.0], sticks[:-1, 3]])
    yaw = full_stick_yaw_radps * np.cumsum(held * steps_s)
    c, s = np.cos(yaw), np.sin(yaw)
    vx, vy = sticks[:, 0], sticks[:, 1]
    return np.stack([c * vx - s * vy, s * vx + c * vy, sticks[:, 2]], axis=1)


def at_rate(times_s: Array, values: Array, rate_hz: float = MODEL_RATE_HZ) -> Array:
    """Values (N, k) at strictly rising times, interpolated to a constant rate up to the last."""
    duration_s = float(times_s[-1] - times_s[0])
    count = math.floor(duration_s * rate_hz + 1e-6) + 1
    grid_s = times_s[-1] - np.arange(count - 1, -1, -1) / rate_hz
    return np.stack([np.interp(grid_s, times_s, values[:, k]) for k in range(values.shape[1])], 1)


def for_model(times_s: Array, sticks: Array, full_stick_yaw_radps: float) -> NDArray[np.float32]:
    """What the model is given of sticks (N, 4): (M, 3) at `MODEL_RATE_HZ`, the newest at most 4 s.

    Training uses it too, so that the model learns what it will be shown.
    """
    recent = times_s >= times_s[-1] - WINDOW_S
    times_s, sticks = times_s[recent], sticks[recent]
    straight = at_rate(times_s, in_start_frame(times_s, sticks, full_stick_yaw_radps))
    return np.ascontiguousarray(straight[-WINDOW_SAMPLES:], dtype=np.float32)
