"""One pair of hands at a time: the page that moves its sticks first holds the pad. Pure.

A page's sticks count once it has said that they are released: when it came, and again after a gap,
so that sticks still held when a link returns do nothing until they went through neutral.
"""

import threading
from typing import Literal

from common.clock import nanoseconds
from common.topics import TOPICS

STICK_MAX_AGE_NS = nanoseconds(TOPICS["console/stick"].max_age_s)
HOLD_NS = nanoseconds(1.0)
"""The pad is free this long after its holder let go."""
MARK_NS = nanoseconds(0.1)
"""How long a mark is held down: a few sticks may be lost."""

Sticks = tuple[float, float, float, float]
NEUTRAL: Sticks = (0.0, 0.0, 0.0, 0.0)

Standing = Literal["free", "yours", "busy", "stale"]
"""What the pad is to one page; `stale`: its sticks stopped coming and must be released first."""


class PadLease:
    """Whose sticks count, and what they are now.

    Pages speak on the console's thread and sticks are sent from the service's, hence the lock.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._centred: set[int] = set()
        self._stale: set[int] = set()
        self._holder: int | None = None
        self._sticks = NEUTRAL
        self._heard_ns = 0
        self._held = False
        self._neutral_owed = False
        self._mark_ns: int | None = None

    def move(self, client: int, sticks: Sticks, now_ns: int) -> bool:
        """Take a page's sticks; False if they do not count."""
        with self._lock:
            self._expire(now_ns)
            if self._holder not in (None, client) or client not in self._centred:
                return False
            self._holder, self._sticks, self._heard_ns = client, sticks, now_ns
            self._held = self._neutral_owed = True
            return True

    def release(self, client: int, now_ns: int) -> None:
        """The page's sticks are in their middle."""
        with self._lock:
            self._expire(now_ns)
            self._centred.add(client)
            self._stale.discard(client)
            if client == self._holder and self._held:
                self._held = False
                self._heard_ns = now_ns

    def mark(self, client: int, now_ns: int) -> None:
        """A page ends a primitive, unless another page flies."""
        with self._lock:
            self._expire(now_ns)
            if self._holder in (None, client):
                self._mark_ns = now_ns
                self._neutral_owed = True

    def is_marked(self, now_ns: int) -> bool:
        """Whether a primitive has ended just now."""
        with self._lock:
            return self._mark_is_held(now_ns)

    def leave(self, client: int, now_ns: int) -> None:
        """The page is gone."""
        self.release(client, now_ns)
        with self._lock:
            self._centred.discard(client)

    def standing(self, client: int, now_ns: int) -> Standing:
        """What the pad is to a page."""
        with self._lock:
            self._expire(now_ns)
            if client in self._stale:
                return "stale"
            if self._holder is None:
                return "free"
            return "yours" if self._holder == client else "busy"

    def due(self, now_ns: int) -> Sticks | None:
        """The sticks to publish now: those held, neutral once after them or a mark, then none."""
        with self._lock:
            self._expire(now_ns)
            if self._held:
                return self._sticks
            if self._mark_is_held(now_ns):
                return NEUTRAL
            if self._neutral_owed:
                self._neutral_owed = False
                return NEUTRAL
            return None

    def _mark_is_held(self, now_ns: int) -> bool:
        return self._mark_ns is not None and now_ns - self._mark_ns < MARK_NS

    def _expire(self, now_ns: int) -> None:
        silent_ns = now_ns - self._heard_ns
        if self._held and self._holder is not None and silent_ns > STICK_MAX_AGE_NS:
            self._held = False
            self._centred.discard(self._holder)
            self._stale.add(self._holder)
        if silent_ns > HOLD_NS:
            self._holder = None
