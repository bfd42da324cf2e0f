"""The bus over Zenoh: a client of one router, as measured to be safe (docs/network.md)."""

import json
import logging
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import zenoh

from common.bus import AliveCallback, PayloadCallback, QueryFailedError, Request
from common.network import DEFAULT_ENDPOINT, ENDPOINT_PATTERN
from common.topics import Delivery

LEASE_MS = 1000
"""A frozen process shows after one lease; at Zenoh's default of 10 s it takes 9.5 s."""

# DROP everywhere: under BLOCK one frozen reader stopped all others for 5 s. Events are small and
# on a queue of their own priority, so that they are dropped only on a link that is down.
_QOS: dict[Delivery, dict[str, Any]] = {
    Delivery.STREAM: {
        "priority": zenoh.Priority.DATA,
        "congestion_control": zenoh.CongestionControl.DROP,
    },
    Delivery.COMMAND: {
        "priority": zenoh.Priority.REAL_TIME,
        "congestion_control": zenoh.CongestionControl.DROP,
        "express": True,
    },
    # Not express: each express message takes a whole batch of the queue, and of bursts of 100 on a
    # busy machine 8.5 % were dropped; in batches none of 2000 were, for at most 1 ms more.
    Delivery.EVENT: {
        "priority": zenoh.Priority.INTERACTIVE_HIGH,
        "congestion_control": zenoh.CongestionControl.DROP,
    },
}
_VIDEO_QOS: dict[str, Any] = {
    "priority": zenoh.Priority.DATA_LOW,
    "congestion_control": zenoh.CongestionControl.DROP,
}
# Of answers too, which Zenoh sends as their questions came. About one time in a hundred a batch
# waits 1 ms for more to come. Unbatched, 100 askers at once get half of the answers a second.
_QUESTION_QOS: dict[str, Any] = {"priority": zenoh.Priority.INTERACTIVE_LOW, "express": True}

log = logging.getLogger(__name__)


def _base_config(file: Path | None) -> zenoh.Config:
    """Zenoh's defaults, or those of a file.

    Raises:
        ValueError: if the file is none of Zenoh's.
    """
    if file is None:
        return zenoh.Config()
    try:
        return zenoh.Config.from_file(str(file))
    except zenoh.ZError as error:
        # Line and column come first, the reason last; between them the source, drawn on lines.
        lines = str(error).split(" at /", 1)[0].strip().splitlines()
        reason = ": ".join(dict.fromkeys([lines[0].strip(" ->"), lines[-1].strip(" =")]))
        raise ValueError(f"{file}: no configuration of Zenoh (JSON5): {reason}") from None


def client_config(endpoint: str, config_file: Path | None = None) -> zenoh.Config:
    """The configuration of a service: a client of the router at `endpoint`.

    A file (JSON5, Zenoh's own format) adds what a site needs, certificates for instance.

    Raises:
        ValueError: if the endpoint is not one; Zenoh itself would try it for ever.
    """
    if not ENDPOINT_PATTERN.fullmatch(endpoint):
        raise ValueError(f"connect: {endpoint!r} is no endpoint; write for example tcp/HOST:7447")
    config = _base_config(config_file)
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("connect/timeout_ms", "-1")
    # A whole object: nested keys of an optional object are refused.
    retry = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5}
    config.insert_json5("connect/retry", json.dumps(retry))
    config.insert_json5("transport/link/tx/lease", str(LEASE_MS))
    config.insert_json5("transport/shared_memory/enabled", "false")
    return config


def router_config(listen: str, config_file: Path | None = None) -> zenoh.Config:
    """The configuration of an embedded router; endpoints in the file win over `listen`."""
    config = _base_config(config_file)
    config.insert_json5("mode", '"router"')
    if config_file is None or json.loads(config.get_json("listen/endpoints")) in (None, []):
        config.insert_json5("listen/endpoints", json.dumps([listen]))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("transport/link/tx/lease", str(LEASE_MS))
    return config


class _ZenohRequest:
    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.payload = query.payload.to_bytes() if query.payload is not None else b"\x80"

    def reply(self, payload: bytes, encoding: str) -> None:
        # A query that is kept costs the asker its whole timeout, so it is closed here.
        with self._query:
            self._query.reply(self._query.key_expr, payload, encoding=zenoh.Encoding(encoding))

    def refuse(self, payload: bytes, encoding: str) -> None:
        with self._query:
            self._query.reply_err(payload, encoding=zenoh.Encoding(encoding))


class ZenohBus:
    """One process' end of the network (see `common.bus.Bus`).

    Pictures travel on a second session, so that a full pipe of them delays nothing else.
    """

    def __init__(self, endpoint: str = DEFAULT_ENDPOINT, config_file: Path | None = None) -> None:
        """Link to the router at `endpoint`; waits until it is there."""
        self._config = partial(client_config, endpoint, config_file)
        self._session = zenoh.open(self._config())
        self._video_session: zenoh.Session | None = None
        self._kept: list[Any] = []

    def publication(
        self, key: str, delivery: Delivery, encoding: str, *, video: bool = False
    ) -> zenoh.Publisher:
        """Declare a key as published by this process."""
        publisher = self._session_for(video).declare_publisher(
            key,
            encoding=zenoh.Encoding(encoding),
            reliability=zenoh.Reliability.RELIABLE,
            **(_VIDEO_QOS if video else _QOS[delivery]),
        )
        self._kept.append(publisher)
        return publisher

    def subscribe(self, key: str, callback: PayloadCallback, *, video: bool = False) -> None:
        """Have `callback` called with each payload put on `key`."""
        subscriber = self._session_for(video).declare_subscriber(
            key, lambda sample: callback(sample.payload.to_bytes())
        )
        self._kept.append(subscriber)

    def serve(self, key: str, callback: Callable[[Request], None]) -> None:
        """Have `callback` called with each question asked on `key`."""
        self._kept.append(
            self._session.declare_queryable(key, lambda query: callback(_ZenohRequest(query)))
        )

    def ask(self, key: str, payload: bytes, encoding: str, timeout_s: float) -> bytes:
        """The first answer to a question.

        Raises:
            QueryFailedError: on a refusal, or when nobody answers in time.
        """
        try:
            replies = self._session.get(
                key,
                payload=payload,
                encoding=zenoh.Encoding(encoding),
                timeout=timeout_s,
                **_QUESTION_QOS,
            )
        except zenoh.ZError as error:
            # Asked on a thread of its own, while another one closes the session.
            raise QueryFailedError(f"{key} cannot be asked: {error}") from None
        for reply in replies:
            if reply.ok is not None:
                return bytes(reply.ok.payload.to_bytes())
            data = bytes(reply.err.payload.to_bytes()) if reply.err is not None else b""
            if data == b"Timeout":
                raise QueryFailedError(f"no answer on {key} within {timeout_s} s")
            raise QueryFailedError(f"{key} refused", data)
        raise QueryFailedError(f"nobody answers on {key}")

    def announce(self, key: str) -> None:
        """Hold a liveliness token until the bus is closed."""
        self._kept.append(self._session.liveliness().declare_token(key))

    def watch(self, key: str, callback: AliveCallback) -> None:
        """Have `callback` called for each token that is there, appears or goes."""
        self._kept.append(
            self._session.liveliness().declare_subscriber(
                key,
                lambda sample: callback(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            )
        )

    def linked(self) -> bool:
        """Whether the session has a router now."""
        return bool(self._session.info.routers_zid())

    def close(self) -> None:
        """Undeclare everything and leave."""
        for declared in self._kept:
            declared.undeclare()
        self._kept.clear()
        if self._video_session is not None:
            self._video_session.close()
        self._session.close()

    def _session_for(self, video: bool) -> zenoh.Session:
        if not video:
            return self._session
        if self._video_session is None:
            self._video_session = zenoh.open(self._config())
        return self._video_session


def open_bus(
    stop: threading.Event, endpoint: str = DEFAULT_ENDPOINT, config_file: Path | None = None
) -> ZenohBus | None:
    """A bus as soon as its router is there, or None if `stop` is set first.

    Zenoh's open cannot be interrupted while it retries, so it waits on a thread of its own.

    Raises:
        ValueError: if Zenoh refuses the endpoint or the configuration.
    """
    opened: list[ZenohBus] = []
    failed: list[Exception] = []
    done = threading.Event()

    def attempt() -> None:
        try:
            opened.append(ZenohBus(endpoint, config_file))
        except Exception as error:
            failed.append(error)
        finally:
            done.set()

    threading.Thread(target=attempt, name="zenoh-open", daemon=True).start()
    waited = False
    while not done.wait(0.05):
        if stop.is_set():
            return None
        if not waited:
            waited = True
            log.info("waiting for a router at %s", endpoint)
    if failed:
        raise ValueError(f"{failed[0]} (endpoint {endpoint})")
    return opened[0]
