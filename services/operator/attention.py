"""What is shown beside the picture reaches a person's mind late. Pure."""

from collections import deque
from typing import Generic, TypeVar

from common.clock import nanoseconds

T = TypeVar("T")


class Attention(Generic[T]):
    """Things of one kind on their way from the screen to his mind.

    Args:
        delay_s: how long each is on its way.

    Attributes:
        newest: when the newest that he has noticed was shown, in ns, and what it is.
    """

    def __init__(self, delay_s: float) -> None:
        self.newest: tuple[int, T] | None = None
        self._delay_ns = nanoseconds(delay_s)
        self._coming: deque[tuple[int, T]] = deque()

    def show(self, thing: T, arrival_ns: int) -> None:
        """Have it noticed later."""
        self._coming.append((arrival_ns, thing))

    def notice(self, now_ns: int) -> list[tuple[int, T]]:
        """What he notices now and has not before, oldest first, and when each was shown in ns."""
        noticed = []
        while self._coming and self._coming[0][0] <= now_ns - self._delay_ns:
            noticed.append(self._coming.popleft())
        if noticed:
            self.newest = noticed[-1]
        return noticed
