"""A link's delay: what goes in at one step comes out a fixed number of steps later."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Delay(Generic[T]):
    """A line of things on their way.

    Args:
        steps: how long each is on its way.
        nothing: makes what comes out until then.
    """

    def __init__(self, steps: int, nothing: Callable[[], T]) -> None:
        self._line: deque[T] = deque(nothing() for _ in range(steps))

    def step(self, item: T) -> T:
        """Put in what begins its way now; returns what arrives now."""
        self._line.append(item)
        return self._line.popleft()
