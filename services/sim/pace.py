"""How many steps are due: simulated time follows a real clock, and catches up what it lost."""

from collections import deque

from common.clock import NS_PER_S
from services.sim.core import PHYSICS_HZ

AT_ONCE_NS = NS_PER_S // 2
"""A lag up to this is caught up at once: nobody notices."""
IN_TIME_NS = 10 * NS_PER_S
"""A longer lag than this, such as a night of the laptop's, is given up: stamps stay behind."""
HURRY = 10
"""A lag between the two is caught up by one step in ten, so that sticks feel as they did."""
_WINDOW_NS = 5 * NS_PER_S


class Pace:
    """Counts the steps due by a monotonic clock."""

    def __init__(self, now_ns: int) -> None:
        self._begin_ns = self._last_ns = now_ns
        self._steps = 0
        self._behind_ns = 0
        self._history: deque[tuple[int, int]] = deque([(now_ns, 0)])

    def due(self, now_ns: int) -> int:
        """The steps to do now."""
        caught_up_ns = min(self._behind_ns, (now_ns - self._last_ns) // HURRY)
        self._behind_ns -= caught_up_ns
        self._begin_ns -= caught_up_ns
        self._last_ns = now_ns
        lag_ns = now_ns - self._begin_ns - self._steps * NS_PER_S // PHYSICS_HZ
        if lag_ns > AT_ONCE_NS:
            self._begin_ns += lag_ns
            if self._behind_ns + lag_ns <= IN_TIME_NS:
                self._behind_ns += lag_ns
            lag_ns = 0
        steps = lag_ns * PHYSICS_HZ // NS_PER_S
        self.note(now_ns, steps)
        return steps

    def note(self, now_ns: int, steps: int) -> None:
        """Count steps that are done whatever the clock says."""
        self._steps += steps
        self._history.append((now_ns, self._steps))
        while now_ns - self._history[0][0] > _WINDOW_NS:
            self._history.popleft()

    @property
    def real_time_factor(self) -> float:
        """Simulated over real time in the last 5 s."""
        (begin_ns, begin), (end_ns, end) = self._history[0], self._history[-1]
        if end_ns == begin_ns:
            return 1.0
        return (end - begin) * NS_PER_S / PHYSICS_HZ / (end_ns - begin_ns)
