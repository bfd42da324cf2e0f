"""One pair of hands at a time: the page that moves its sticks first holds the pad. Pure."""

from common.clock import NS_PER_S

STICK_MAX_AGE_S = 0.2
"""A stick older than this is worthless."""
HOLD_S = 1.0
"""The pad is free this long after its holder let go."""

Sticks = tuple[float, float, float, float]
NEUTRAL: Sticks = (0.0, 0.0, 0.0, 0.0)


class PadLease:
    """Whose sticks count, and what they are now."""

    def __init__(self) -> None:
        self._holder: int | None = None
        self._sticks = NEUTRAL
        self._heard_ns = 0
        self._released = True
        self._neutral_owed = False

    def move(self, client: int, sticks: Sticks, now_ns: int) -> bool:
        """Take a page's sticks; False if another page holds the pad."""
        if self.holder(now_ns) not in (None, client):
            return False
        self._holder, self._sticks, self._heard_ns = client, sticks, now_ns
        self._released = False
        self._neutral_owed = True
        return True

    def release(self, client: int, now_ns: int) -> None:
        """The page let go, or left."""
        if client == self._holder and not self._released:
            self._released = True
            self._heard_ns = now_ns

    def holder(self, now_ns: int) -> int | None:
        """The page that holds the pad."""
        if self._holder is not None and now_ns - self._heard_ns > HOLD_S * NS_PER_S:
            self._holder = None
        return self._holder

    def due(self, now_ns: int) -> Sticks | None:
        """The sticks to publish now: those held, neutral once after them, then nothing."""
        fresh = now_ns - self._heard_ns <= STICK_MAX_AGE_S * NS_PER_S
        if not self._released and fresh:
            return self._sticks
        if self._neutral_owed:
            self._neutral_owed = False
            return NEUTRAL
        return None
