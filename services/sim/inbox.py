"""Commands that wait for their step, oldest first: where there are too many, sticks go first."""

from collections import deque

from common import messages as m

_WORTH: tuple[m.CommandAction, ...] = ("fly", "takeoff", "land", "emergency")
"""What may be dropped before what."""


class Inbox:
    """What one vehicle was told and has not done yet.

    Args:
        depth: commands kept at most.
    """

    def __init__(self, depth: int) -> None:
        self._depth = depth
        self._waiting: deque[tuple[m.Command, int]] = deque()
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, command: m.Command, arrival_ns: int) -> None:
        """Have a command wait.

        Of too many the oldest sticks are dropped; of nothing but actions a take-off before a
        landing, and an emergency last.
        """
        waiting = self._waiting
        waiting.append((command, arrival_ns))
        if len(waiting) > self._depth:
            actions = [kept.action for kept, _ in waiting]
            least = min(actions, key=_WORTH.index)
            del waiting[actions.index(least)]
            self.dropped += 1

    def next(self) -> m.Command:
        """The oldest command.

        Raises:
            IndexError: if none waits.
        """
        return self._waiting.popleft()[0]

    def newest(self, since_ns: int) -> m.Command | None:
        """The oldest action that arrived since then, or else the newest sticks."""
        waiting = self._waiting
        while waiting:
            command, arrival_ns = waiting.popleft()
            is_outdone = command.action == "fly" and waiting
            if arrival_ns >= since_ns and not is_outdone:
                return command
        return None

    def clear(self) -> None:
        """Forget all."""
        self._waiting.clear()
