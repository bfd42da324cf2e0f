"""What a service needs of a network: publish, subscribe, ask, answer, be seen alive.

Payloads are bytes and keys are whole keys; names, messages and freshness live in common/node.py.
Callbacks run on the network's threads, so they only put things in boxes.
"""

from collections.abc import Callable
from typing import Protocol

from common.topics import Delivery

PayloadCallback = Callable[[bytes], None]
AliveCallback = Callable[[str, bool], None]
"""Called with the key of a liveliness token and whether it appeared or went."""


class QueryFailedError(Exception):
    """A question got no good answer; `payload` is the server's reply-error, if there was one."""

    def __init__(self, reason: str, payload: bytes | None = None) -> None:
        super().__init__(reason)
        self.payload = payload


class Request(Protocol):
    """A question that waits for its answer; answer exactly once."""

    @property
    def payload(self) -> bytes:
        """The question."""
        ...

    def reply(self, payload: bytes, encoding: str) -> None:
        """Answer it."""
        ...

    def refuse(self, payload: bytes, encoding: str) -> None:
        """Answer that it is a bad one."""
        ...


class Publication(Protocol):
    """A key that this process publishes."""

    def put(self, payload: bytes) -> None:
        """Send one payload; never waits for a reader and never raises for a missing link."""
        ...


class Bus(Protocol):
    """A network that services meet on."""

    def publication(
        self, key: str, delivery: Delivery, encoding: str, *, video: bool = False
    ) -> Publication:
        """Declare a key as published by this process."""
        ...

    def subscribe(self, key: str, callback: PayloadCallback, *, video: bool = False) -> None:
        """Have `callback` called with each payload put on `key` (wildcards allowed)."""
        ...

    def serve(self, key: str, callback: Callable[[Request], None]) -> None:
        """Have `callback` called with each question asked on `key`."""
        ...

    def ask(self, key: str, payload: bytes, encoding: str, timeout_s: float) -> bytes:
        """The first answer to a question.

        Raises:
            QueryFailedError: on a refusal, or when nobody answers in time.
        """
        ...

    def announce(self, key: str) -> None:
        """Hold a liveliness token until the bus is closed."""
        ...

    def watch(self, key: str, callback: AliveCallback) -> None:
        """Have `callback` called for each token that is there, appears or goes."""
        ...

    def linked(self) -> bool:
        """Whether there is a link to the network now."""
        ...

    def close(self) -> None:
        """Undeclare everything and leave."""
        ...
