"""The only place that reads a clock.

Ages and schedules use `monotonic_ns`; stamps use `utc_ns`. Stamps of two machines are never
subtracted from one another.
"""

import time
from typing import Protocol

NS_PER_S = 1_000_000_000


class Clock(Protocol):
    """A source of time: the machine's, or one that a test or a study moves on."""

    def monotonic_ns(self) -> int:
        """Nanoseconds that never go back."""
        ...

    def utc_ns(self) -> int:
        """Nanoseconds since 1970, or simulated time."""
        ...


class SystemClock:
    """The machine's clocks."""

    def monotonic_ns(self) -> int:
        """Nanoseconds that never go back."""
        return time.monotonic_ns()

    def utc_ns(self) -> int:
        """Nanoseconds since 1970."""
        return time.time_ns()


class ManualClock:
    """A clock that stands still until it is moved on."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def monotonic_ns(self) -> int:
        """The time it was moved to, in ns."""
        return self._now_ns

    def utc_ns(self) -> int:
        """The same time."""
        return self._now_ns

    def advance(self, seconds: float) -> None:
        """Move on by `seconds`.

        Raises:
            ValueError: if `seconds` is negative.
        """
        if seconds < 0:
            raise ValueError("a clock does not go back")
        self._now_ns += round(seconds * NS_PER_S)


def seconds(duration_ns: int) -> float:
    """Nanoseconds as seconds."""
    return duration_ns / NS_PER_S


def nanoseconds(duration_s: float) -> int:
    """Seconds as nanoseconds."""
    return round(duration_s * NS_PER_S)


def sleep(duration_s: float) -> None:
    """Wait, without using the processor."""
    if duration_s > 0:
        time.sleep(duration_s)
