"""A service's place on the network: topics in, topics out, timers, questions, health.

One thread, the one in `run`, calls the service's code: handlers need no locks and a core needs no
threads. The network's callbacks only put payloads in boxes. A stream's box holds the newest payload
only, so nothing queues; an event's box keeps order.
"""

import contextlib
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np

from common import messages as m
from common.bus import Bus, Publication, QueryFailedError, Request
from common.clock import Clock, SystemClock, nanoseconds, seconds
from common.config import choices_of
from common.log import RateLimited
from common.topics import QUERIES, TOPICS, Delivery, Query, Topic, alive_key_of, key_of
from common.version import VERSION

EVENT_DEPTH = 256
"""Events kept for a reader that is behind; beyond it the oldest go first."""
QUESTION_DEPTH = 64
HEALTH_PERIOD_S = 1.0
LATENCY_SAMPLES = 1000
ASK_TIMEOUT_S = 2.0

Handler = Callable[[Any, int], None]
"""Called with a valid message and the monotonic time of its arrival in ns."""

log = logging.getLogger(__name__)


class RefusedError(Exception):
    """A request cannot be granted: the reason, and the field that is to blame if there is one."""

    def __init__(self, error: str, field_name: str | None = None) -> None:
        super().__init__(error)
        self.field_name = field_name


@dataclass
class _Subscription:
    topic: Topic
    handler: Handler
    box: deque[tuple[bytes, int]]
    ages: bool
    received: int = 0
    """Counted up by the network's threads alone, so that no count is lost between threads."""
    told: int = 0
    """Of those received, how many are in the rates that `health` has told."""
    rejected: int = 0


@dataclass
class _Server:
    query: Query
    handler: Callable[[Any, int], m.Payload]
    box: deque[Request] = field(default_factory=lambda: deque(maxlen=QUESTION_DEPTH))


@dataclass
class _Timer:
    period_ns: int
    handler: Callable[[int], None]
    due_ns: int


class Node:
    """One service of one vehicle on a bus.

    Args:
        bus: the network.
        vehicle: the vehicle's name, part of every key.
        service: this service's name, one of `common.topics.SERVICES`.
        clock: the source of arrival times and stamps.
    """

    def __init__(self, bus: Bus, vehicle: str, service: str, clock: Clock | None = None) -> None:
        self.bus = bus
        self.vehicle = vehicle
        self.service = service
        self.clock: Clock = clock or SystemClock()
        self._subscriptions: dict[str, _Subscription] = {}
        self._servers: list[_Server] = []
        self._timers: list[_Timer] = []
        self._publications: dict[str, tuple[Publication, type[m.Message]]] = {}
        self._sequence: dict[str, int] = {}
        self._closers: list[Callable[[], None]] = []
        self._besides: list[Node] = []
        self._waiting: Node = self
        # Held while there is nothing to do: half of what a condition costs at each message.
        self._idle = threading.Lock()
        self._idle.acquire()
        self._latencies_s: deque[float] = deque(maxlen=LATENCY_SAMPLES)
        self._warn = RateLimited(log, self.clock)
        self._health_of_core: Callable[[], tuple[m.HealthState, str]] = lambda: ("ok", "")
        self._health_since_ns = self.clock.monotonic_ns()
        self._faults = 0

    def beside(self, vehicle: str) -> "Node":
        """The same service of another vehicle, run and closed by this node."""
        other = Node(self.bus, vehicle, self.service, self.clock)
        # One thread waits for all of them, and their main step is one.
        other._waiting, other._latencies_s = self, self._latencies_s
        self._besides.append(other)
        return other

    # --- what a service declares -----------------------------------------------------------------

    def on(
        self,
        topic_name: str,
        handler: Handler,
        *,
        depth: int | None = None,
        timed: bool = False,
        ages: bool = True,
    ) -> None:
        """Have `handler(message, arrival_ns)` called with what arrives on a topic.

        Args:
            topic_name: a row of the table.
            handler: called with valid messages only; invalid ones are dropped and counted.
            depth: how many payloads wait at most; by default 1 for streams and commands (the newest
                wins) and EVENT_DEPTH for events.
            timed: whether this is the service's main step, whose duration `health` reports.
            ages: whether a command that has waited beyond its age is dropped.
        """
        topic = TOPICS[topic_name]
        if depth is None:
            depth = EVENT_DEPTH if topic.delivery is Delivery.EVENT else 1
        handler = self._timed(handler) if timed else handler
        subscription = _Subscription(topic, handler, deque(maxlen=depth), ages)
        self._subscriptions[topic_name] = subscription

        def receive(payload: bytes) -> None:
            subscription.received += 1
            subscription.box.append((payload, self.clock.monotonic_ns()))
            self._notify()

        self.bus.subscribe(key_of(self.vehicle, topic_name), receive, video=topic.is_video)

    def answer(self, query_name: str, handler: Callable[[Any, int], m.Payload]) -> None:
        """Have `handler(request, now_ns)` answer a query; it raises `RefusedError` to refuse."""
        server = _Server(QUERIES[query_name], handler)
        self._servers.append(server)

        def receive(request: Request) -> None:
            server.box.append(request)
            self._notify()

        self.bus.serve(key_of(self.vehicle, query_name), receive)

    def every(
        self, period_s: float, handler: Callable[[int], None], *, timed: bool = False
    ) -> None:
        """Have `handler(now_ns)` called at a fixed rate; ticks that are missed are not made up."""
        period_ns = nanoseconds(period_s)
        due_ns = self.clock.monotonic_ns() + period_ns
        wrapped = self._timed_tick(handler) if timed else handler
        self._timers.append(_Timer(period_ns, wrapped, due_ns))

    def publishes(self, *topic_names: str) -> None:
        """Declare topics before their first message, so that readers find them at once."""
        for name in topic_names:
            topic = TOPICS[name]
            publication = self.bus.publication(
                key_of(self.vehicle, name),
                topic.delivery,
                m.encoding_of(topic.message),
                video=topic.is_video,
            )
            self._publications[name] = (publication, topic.message)
            self._sequence[name] = 0

    def reports(self, health: Callable[[], tuple[m.HealthState, str]]) -> None:
        """Have `health` name the state and detail that are published once a second."""
        self._health_of_core = health

    def on_close(self, closer: Callable[[], None]) -> None:
        """Have `closer` called when the node closes, last declared first."""
        self._closers.append(closer)

    # --- what a service does ---------------------------------------------------------------------

    def publish(self, topic_name: str, message: m.Message) -> None:
        """Send a message; `seq` is set here, whatever the message holds."""
        if topic_name not in self._publications:
            self.publishes(topic_name)
        publication, message_type = self._publications[topic_name]
        if type(message) is not message_type:
            raise TypeError(f"{topic_name} carries {message_type.__name__}, not {type(message)}")
        sequence = self._sequence[topic_name]
        self._sequence[topic_name] = sequence + 1
        publication.put(m.encode(msgspec.structs.replace(message, seq=sequence)))

    def ask(
        self, query_name: str, request: m.Payload, timeout_s: float = ASK_TIMEOUT_S
    ) -> m.Payload:
        """Ask a query of this vehicle's services, waiting for the answer.

        Raises:
            RefusedError: if the server refuses.
            QueryFailedError: if nobody answers in time.
            InvalidPayloadError: if the answer is none that the contract allows.
        """
        query = QUERIES[query_name]
        try:
            data = self.bus.ask(
                key_of(self.vehicle, query_name),
                m.encode(request),
                m.encoding_of(query.request),
                timeout_s,
            )
        except QueryFailedError as failure:
            if failure.payload is None:
                raise
            error = m.decode(failure.payload, m.QueryError)
            raise RefusedError(error.error, error.field) from None
        return m.decode(data, query.reply)

    # --- running ---------------------------------------------------------------------------------

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set (wake it with `wake`)."""
        for node in (self, *self._besides):
            node._appear()
        while not stop.is_set():
            self.spin()
            wait_s = seconds(self._next_due_ns() - self.clock.monotonic_ns())
            self._idle.acquire(timeout=min(max(wait_s, 0.0), HEALTH_PERIOD_S))

    def wake(self) -> None:
        """End the current wait of `run`; safe from any thread."""
        self._notify()

    def spin(self) -> None:
        """Handle everything that has arrived and every timer that is due, once."""
        for subscription in self._subscriptions.values():
            for _ in range(len(subscription.box)):
                payload, arrival_ns = subscription.box.popleft()
                self._deliver(subscription, payload, arrival_ns)
        for server in self._servers:
            while server.box:
                self._answer(server, server.box.popleft())
        for timer in tuple(self._timers):
            now_ns = self.clock.monotonic_ns()
            if now_ns >= timer.due_ns:
                missed = (now_ns - timer.due_ns) // timer.period_ns
                timer.due_ns += (missed + 1) * timer.period_ns
                timer.handler(now_ns)
        for node in self._besides:
            node.spin()

    def close(self) -> None:
        """Run the closers and leave the bus; a closer that fails keeps none from its turn."""
        with contextlib.ExitStack() as turns:
            turns.callback(self.bus.close)
            for node in (self, *reversed(self._besides)):
                for closer in node._closers:
                    turns.callback(closer)

    # --- inside ----------------------------------------------------------------------------------

    def _appear(self) -> None:
        self.bus.announce(alive_key_of(self.vehicle, self.service))
        self.every(HEALTH_PERIOD_S, self._publish_health)
        self.publishes(f"health/{self.service}")

    def _notify(self) -> None:
        # Already released: it has been woken and has not looked yet.
        with contextlib.suppress(RuntimeError):
            self._waiting._idle.release()

    def _next_due_ns(self) -> int:
        return min(timer.due_ns for node in (self, *self._besides) for timer in node._timers)

    def _deliver(self, subscription: _Subscription, payload: bytes, arrival_ns: int) -> None:
        topic = subscription.topic
        try:
            message = m.decode(payload, topic.message)
        except m.InvalidPayloadError as error:
            subscription.rejected += 1
            self._warn.warning(f"{topic.name}: invalid payload dropped: {error}")
            return
        if subscription.ages and topic.delivery is Delivery.COMMAND:
            # A process that stood still must not act on what was meant for the time before.
            age_s = seconds(self.clock.monotonic_ns() - arrival_ns)
            if age_s > topic.max_age_s:
                return
        try:
            subscription.handler(message, arrival_ns)
        except Exception as error:
            self._fault(topic.name, error)

    def _answer(self, server: _Server, request: Request) -> None:
        try:
            question = m.decode(request.payload, server.query.request)
            reply = m.encode(server.handler(question, self.clock.monotonic_ns()))
        except m.InvalidPayloadError as error:
            refusal = _refusal_of(str(error), server.query)
            request.refuse(m.encode(refusal), m.encoding_of(m.QueryError))
        except RefusedError as error:
            refusal = m.QueryError(error=str(error), field=error.field_name)
            request.refuse(m.encode(refusal), m.encoding_of(m.QueryError))
        except Exception as error:
            self._fault(server.query.name, error)
            refusal = m.QueryError(error=f"{self.service} could not handle this: {error}")
            request.refuse(m.encode(refusal), m.encoding_of(m.QueryError))
        else:
            request.reply(reply, m.encoding_of(server.query.reply))

    def _fault(self, name: str, error: Exception) -> None:
        """A message that was valid has hit a fault of ours: say so, and go on without it."""
        self._faults += 1
        log.debug("handling %s", name, exc_info=error)
        self._warn.warning(f"fault in {name}: {type(error).__name__}: {error}")

    def _timed(self, handler: Handler) -> Handler:
        def timed(message: Any, arrival_ns: int) -> None:
            begin_ns = self.clock.monotonic_ns()
            handler(message, arrival_ns)
            self._latencies_s.append(seconds(self.clock.monotonic_ns() - begin_ns))

        return timed

    def _timed_tick(self, handler: Callable[[int], None]) -> Callable[[int], None]:
        def timed(now_ns: int) -> None:
            handler(now_ns)
            self._latencies_s.append(seconds(self.clock.monotonic_ns() - now_ns))

        return timed

    def _publish_health(self, now_ns: int) -> None:
        elapsed_s = max(seconds(now_ns - self._health_since_ns), 1e-3)
        self._health_since_ns = now_ns
        rates: dict[str, float] = {}
        for name, subscription in self._subscriptions.items():
            received = subscription.received
            rates[name] = (received - subscription.told) / elapsed_s
            subscription.told = received
        state, detail = self._health_of_core()
        if self._faults:
            state = "failed" if state == "failed" else "degraded"
            detail = f"{detail}; {self._faults} messages could not be handled".removeprefix("; ")
        p50, p99 = _percentiles(self._latencies_s)
        self.publish(
            f"health/{self.service}",
            m.Health(
                stamp=self.clock.utc_ns(),
                seq=0,
                service=self.service,
                version=VERSION,
                state=state,
                detail=detail,
                rates=rates,
                rejected={name: s.rejected for name, s in self._subscriptions.items()},
                latency_p50=p50,
                latency_p99=p99,
            ),
        )


def _percentiles(samples: Iterable[float]) -> tuple[float, float]:
    values = np.fromiter(samples, dtype=float)
    if values.size == 0:
        return 0.0, 0.0
    p50, p99 = np.percentile(values, [50, 99])
    return float(p50), float(p99)


def _refusal_of(error: str, query: Query) -> m.QueryError:
    """What a request that cannot be decoded is answered: its field, and what that can be."""
    field_name = _field_in(error, query)
    choices = choices_of(query.request, field_name) if field_name else ()
    return m.QueryError(
        error=f"{error}; use {', '.join(choices)}" if choices else error, field=field_name
    )


def _field_in(error: str, query: Query) -> str | None:
    """The field of a request that a decoding error names, if it names one."""
    for opening, closings in (("`$.", ".[`"), ("field `", "`")):
        _, found, rest = error.partition(opening)
        if found:
            end = min((rest.find(c) for c in closings if c in rest), default=len(rest))
            return rest[:end]
    word = error.split(" ", 1)[0]
    return word if word in query.request.__struct_fields__ else None
