"""Asks the autopilot without stalling the sticks: each question on a thread of its own."""

import logging
import secrets
import threading
from collections import deque
from dataclasses import dataclass

from common import messages as m
from common.bus import QueryFailedError
from common.node import Node, RefusedError

TIMEOUT_S = 1.0
TRIES = 2
"""The same nonce again has no second effect, so a lost answer may be asked for again."""
ANSWERS = 16
"""Kept for who wants to know; a person at a pad sees in the console what became of a button."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Answer:
    """What became of a decision."""

    action: m.DecideAction
    ok: bool
    reason: str


class Decisions:
    """Puts decisions to `autopilot/decide`; answers wait until the node's thread takes them.

    A thread a question, so that an emergency never waits behind a question nobody answers.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._answers: deque[Answer] = deque(maxlen=ANSWERS)

    def put(self, action: m.DecideAction, suggestion: int | None = None) -> None:
        """Ask; returns at once."""
        request = m.DecideRequest(action=action, nonce=secrets.randbits(62), suggestion=suggestion)
        threading.Thread(target=self._ask, args=(request,), daemon=True).start()

    def take(self) -> list[Answer]:
        """The answers that came since the last call."""
        return [self._answers.popleft() for _ in range(len(self._answers))]

    def _ask(self, request: m.DecideRequest) -> None:
        answer = Answer(request.action, False, "the autopilot does not answer")
        for _ in range(TRIES):
            try:
                reply = self._node.ask("autopilot/decide", request, TIMEOUT_S)
            except QueryFailedError:
                continue
            except (RefusedError, m.InvalidPayloadError) as error:
                answer = Answer(request.action, False, str(error))
                break
            assert isinstance(reply, m.DecideReply)
            answer = Answer(request.action, reply.ok, reply.reason)
            break
        log.info("%s: %s (%s)", answer.action, "granted" if answer.ok else "refused", answer.reason)
        self._answers.append(answer)
        self._node.wake()
