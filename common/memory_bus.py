"""A bus inside one process, for tests; one suite holds it and the Zenoh bus to the same."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from common.bus import AliveCallback, PayloadCallback, QueryFailedError, Request
from common.topics import Delivery


def _matches(expression: str, key: str) -> bool:
    """Whether a key expression (`*` one chunk, `**` any number) covers a key."""

    def covers(pattern: list[str], chunks: list[str]) -> bool:
        if not pattern:
            return not chunks
        if pattern[0] == "**":
            return any(covers(pattern[1:], chunks[i:]) for i in range(len(chunks) + 1))
        return bool(chunks) and pattern[0] in ("*", chunks[0]) and covers(pattern[1:], chunks[1:])

    return covers(expression.split("/"), key.split("/"))


@dataclass
class MemoryNetwork:
    """What several memory buses share; stands for the router."""

    subscribers: list[tuple["MemoryBus", str, PayloadCallback]] = field(default_factory=list)
    servers: list[tuple["MemoryBus", str, Callable[[Request], None]]] = field(default_factory=list)
    tokens: list[tuple["MemoryBus", str]] = field(default_factory=list)
    watchers: list[tuple["MemoryBus", str, AliveCallback]] = field(default_factory=list)


class _MemoryRequest:
    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.answer: bytes | None = None
        self.refusal: bytes | None = None
        self.done = threading.Event()

    def reply(self, payload: bytes, encoding: str) -> None:
        self.answer = payload
        self.done.set()

    def refuse(self, payload: bytes, encoding: str) -> None:
        self.refusal = payload
        self.done.set()


class _MemoryPublication:
    def __init__(self, network: MemoryNetwork, key: str) -> None:
        self._network = network
        self._key = key

    def put(self, payload: bytes) -> None:
        for _, expression, callback in tuple(self._network.subscribers):
            if _matches(expression, self._key):
                callback(payload)


class MemoryBus:
    """One process' end of a memory network (see `common.bus.Bus`)."""

    def __init__(self, network: MemoryNetwork) -> None:
        self._network = network

    def publication(
        self, key: str, delivery: Delivery, encoding: str, *, video: bool = False
    ) -> _MemoryPublication:
        """Declare a key as published by this process."""
        return _MemoryPublication(self._network, key)

    def subscribe(self, key: str, callback: PayloadCallback, *, video: bool = False) -> None:
        """Have `callback` called with each payload put on `key`."""
        self._network.subscribers.append((self, key, callback))

    def serve(self, key: str, callback: Callable[[Request], None]) -> None:
        """Have `callback` called with each question asked on `key`."""
        self._network.servers.append((self, key, callback))

    def ask(self, key: str, payload: bytes, encoding: str, timeout_s: float) -> bytes:
        """The first answer to a question.

        Raises:
            QueryFailedError: on a refusal, or when nobody answers in time.
        """
        for _, expression, callback in tuple(self._network.servers):
            if _matches(expression, key):
                request = _MemoryRequest(payload)
                callback(request)
                if not request.done.wait(timeout_s):
                    raise QueryFailedError(f"no answer on {key} within {timeout_s} s")
                if request.answer is None:
                    raise QueryFailedError(f"{key} refused", request.refusal)
                return request.answer
        raise QueryFailedError(f"nobody answers on {key}")

    def announce(self, key: str) -> None:
        """Hold a liveliness token until the bus is closed."""
        self._network.tokens.append((self, key))
        self._tell(key, True)

    def watch(self, key: str, callback: AliveCallback) -> None:
        """Have `callback` called for each token that is there, appears or goes."""
        self._network.watchers.append((self, key, callback))
        for _, token in self._network.tokens:
            if _matches(key, token):
                callback(token, True)

    def linked(self) -> bool:
        """A memory network is always there."""
        return True

    def close(self) -> None:
        """Undeclare everything and leave."""
        network = self._network
        gone = [key for bus, key in network.tokens if bus is self]
        network.subscribers[:] = [row for row in network.subscribers if row[0] is not self]
        network.servers[:] = [row for row in network.servers if row[0] is not self]
        network.watchers[:] = [row for row in network.watchers if row[0] is not self]
        network.tokens[:] = [row for row in network.tokens if row[0] is not self]
        for key in gone:
            self._tell(key, False)

    def _tell(self, key: str, alive: bool) -> None:
        for _, expression, callback in tuple(self._network.watchers):
            if _matches(expression, key):
                callback(key, alive)
