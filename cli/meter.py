"""How often a topic's messages come, and how old the newest is."""

from collections import deque

from common.clock import nanoseconds, seconds

WINDOW_S = 2.0


class Meter:
    """Counts arrivals over a sliding window.

    Args:
        now_ns: when counting begins, on the monotonic clock.
    """

    def __init__(self, now_ns: int) -> None:
        self.count = 0
        self.size_bytes = 0
        self._begin_ns = now_ns
        self._arrivals: deque[tuple[int, int]] = deque()

    def add(self, size_bytes: int, now_ns: int) -> None:
        """A message of `size_bytes` has arrived."""
        self.count += 1
        self.size_bytes += size_bytes
        self._arrivals.append((now_ns, size_bytes))
        self._forget(now_ns)

    def rate_hz(self, now_ns: int) -> float:
        """Messages a second over the window, or since the beginning where that is later."""
        self._forget(now_ns)
        return len(self._arrivals) / self._span_s(now_ns)

    def bytes_per_s(self, now_ns: int) -> float:
        """Bytes a second over the same time."""
        self._forget(now_ns)
        return sum(size for _, size in self._arrivals) / self._span_s(now_ns)

    def age_s(self, now_ns: int) -> float | None:
        """Since the newest message in the window; None where there is none."""
        self._forget(now_ns)
        return seconds(now_ns - self._arrivals[-1][0]) if self._arrivals else None

    def _span_s(self, now_ns: int) -> float:
        return max(min(seconds(now_ns - self._begin_ns), WINDOW_S), 1e-3)

    def _forget(self, now_ns: int) -> None:
        horizon_ns = now_ns - nanoseconds(WINDOW_S)
        while self._arrivals and self._arrivals[0][0] < horizon_ns:
            self._arrivals.popleft()
