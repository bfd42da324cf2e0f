"""A service's node: boxes, sequence numbers, timers, questions, health; in memory and by hand."""

import logging
import threading
from typing import Any

import msgpack
import pytest

from common import messages as m
from common.bus import QueryFailedError
from common.clock import ManualClock
from common.memory_bus import MemoryBus, MemoryNetwork
from common.node import EVENT_DEPTH, Node, RefusedError
from common.topics import TOPICS, Delivery, key_of

VEHICLE = "unit"


class World:
    """Nodes on one memory network under one clock that is moved by hand."""

    def __init__(self) -> None:
        self.clock = ManualClock(10**18)
        self.network = MemoryNetwork()
        self.bus = MemoryBus(self.network)

    def node(self, service: str) -> Node:
        return Node(MemoryBus(self.network), VEHICLE, service, self.clock)

    def put(self, topic: str, payload: bytes) -> None:
        self.bus.publication(key_of(VEHICLE, topic), Delivery.EVENT, "").put(payload)

    def listen(self, topic: str) -> list[dict[str, Any]]:
        heard: list[dict[str, Any]] = []
        self.bus.subscribe(
            key_of(VEHICLE, topic), lambda payload: heard.append(msgpack.unpackb(payload))
        )
        return heard


@pytest.fixture
def world() -> World:
    return World()


def stick(seq: int = 0, **changes: Any) -> bytes:
    return msgpack.packb(
        {"stamp": 1, "seq": seq, "vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0} | changes
    )


def vehicle(seq: int = 0) -> bytes:
    return m.encode(
        m.VehicleStatus(
            stamp=1,
            seq=seq,
            state="flying",
            battery=1.0,
            world="track",
            plant="tum",
            collisions=0,
        )
    )


def health_of(world: World, node: Node) -> dict[str, Any]:
    heard = world.listen(f"health/{node.service}")
    node._publish_health(world.clock.monotonic_ns())
    return heard[-1]


def test_of_a_stream_the_newest_is_handled(world: World) -> None:
    node = world.node("autopilot")
    seen: list[int] = []
    node.on("stick", lambda message, _: seen.append(message.seq))
    for seq in range(5):
        world.put("stick", stick(seq))
    node.spin()
    node.spin()
    assert seen == [4]


def test_events_are_all_handled_in_order(world: World) -> None:
    node = world.node("autopilot")
    seen: list[int] = []
    node.on("vehicle", lambda message, _: seen.append(message.seq))
    for seq in range(50):
        world.put("vehicle", vehicle(seq))
    node.spin()
    assert seen == list(range(50))


def test_a_reader_far_behind_loses_the_oldest_events(world: World) -> None:
    node = world.node("autopilot")
    seen: list[int] = []
    node.on("vehicle", lambda message, _: seen.append(message.seq))
    for seq in range(EVENT_DEPTH + 10):
        world.put("vehicle", vehicle(seq))
    node.spin()
    assert seen == list(range(10, EVENT_DEPTH + 10))


def test_a_service_may_ask_for_a_longer_queue(world: World) -> None:
    node = world.node("classifier")
    seen: list[int] = []
    node.on("stick", lambda message, _: seen.append(message.seq), depth=3)
    for seq in range(5):
        world.put("stick", stick(seq))
    node.spin()
    assert seen == [2, 3, 4]


def test_a_handler_is_told_when_the_message_arrived(world: World) -> None:
    node = world.node("autopilot")
    arrivals_ns: list[int] = []
    node.on("stick", lambda _, arrival_ns: arrivals_ns.append(arrival_ns))
    arrived_ns = world.clock.monotonic_ns()
    world.put("stick", stick())
    world.clock.advance(0.1)
    node.spin()
    assert arrivals_ns == [arrived_ns]


def test_a_command_that_waited_too_long_is_not_acted_on(world: World) -> None:
    node = world.node("autopilot")
    seen: list[int] = []
    node.on("stick", lambda message, _: seen.append(message.seq))
    world.put("stick", stick())
    world.clock.advance(TOPICS["stick"].max_age_s + 0.01)
    node.spin()
    assert seen == []


def test_a_fault_in_handling_a_message_ends_nothing_and_is_told(world: World) -> None:
    node = world.node("autopilot")

    def fail(_message: m.Stick, _arrival_ns: int) -> None:
        raise ZeroDivisionError("a bug")

    node.on("stick", fail)
    world.put("stick", stick())
    node.spin()
    health = health_of(world, node)
    assert health["state"] == "degraded"
    assert "1 messages could not be handled" in health["detail"]


def test_invalid_payloads_are_dropped_counted_and_logged_once_a_second(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    node = world.node("autopilot")
    seen: list[int] = []
    node.on("stick", lambda message, _: seen.append(message.seq))
    with caplog.at_level(logging.WARNING):
        for payload in (b"", b"noise", stick(vx=2.0), stick(vx=float("nan"))):
            world.put("stick", payload)
            node.spin()
        assert len(caplog.records) == 1
        world.clock.advance(1.1)
        world.put("stick", b"again")
        node.spin()
    assert len(caplog.records) == 2
    assert "3 more" in caplog.text
    world.put("stick", stick(9))
    node.spin()
    assert seen == [9]
    assert health_of(world, node)["rejected"] == {"stick": 5}


def test_sequence_numbers_count_up_by_one_a_topic(world: World) -> None:
    node = world.node("sim")
    flying, range_ = world.listen("vehicle"), world.listen("altimeter")
    status = m.decode(vehicle(), m.VehicleStatus)
    for _ in range(3):
        node.publish("vehicle", status)
    node.publish("altimeter", m.Range(stamp=1, seq=99, range=1.0, min=0.0, max=3.0))
    assert [message["seq"] for message in flying] == [0, 1, 2]
    assert [message["seq"] for message in range_] == [0]


def test_a_topic_carries_its_own_message_only(world: World) -> None:
    with pytest.raises(TypeError, match="pose carries Pose"):
        world.node("localizer").publish("pose", m.decode(stick(), m.Stick))


def test_a_name_that_is_not_in_the_table_is_an_error(world: World) -> None:
    node = world.node("sim")
    with pytest.raises(KeyError):
        node.on("weather", lambda *_: None)
    with pytest.raises(KeyError):
        node.answer("sim/weather", lambda *_: m.WorldsReply(worlds=[]))


def test_a_timer_ticks_at_its_rate_and_makes_up_for_nothing(world: World) -> None:
    node = world.node("sim")
    ticks_ns: list[int] = []
    node.every(0.02, ticks_ns.append)
    begin_ns = world.clock.monotonic_ns()
    node.spin()
    assert ticks_ns == []
    for _ in range(10):
        world.clock.advance(0.01)
        node.spin()
    assert [(t - begin_ns) / 1e9 for t in ticks_ns] == [0.02, 0.04, 0.06, 0.08, 0.1]
    world.clock.advance(1.005)
    node.spin()
    node.spin()
    assert len(ticks_ns) == 6
    world.clock.advance(0.015)
    node.spin()
    assert len(ticks_ns) == 7, "the phase is kept after a gap"


def answered(world: World, node: Node, query: str, payload: bytes) -> dict[str, Any]:
    """The reply, or the refusal under `refused`, to a question while the node runs."""
    result: dict[str, Any] = {}

    def ask() -> None:
        try:
            result.update(msgpack.unpackb(world.bus.ask(key_of(VEHICLE, query), payload, "", 2.0)))
        except QueryFailedError as error:
            result["refused"] = msgpack.unpackb(error.payload or b"\xc0")

    asker = threading.Thread(target=ask)
    asker.start()
    while asker.is_alive():
        node.spin()
        asker.join(0.001)
    return result


def test_a_question_is_answered_refused_or_found_bad(world: World) -> None:
    node = world.node("autopilot")

    def decide(request: m.DecideRequest, _now_ns: int) -> m.DecideReply:
        if request.suggestion == 7:
            raise RefusedError("no such suggestion", "suggestion")
        return m.DecideReply(ok=True, reason="accepted", mode="engaged")

    node.answer("autopilot/decide", decide)
    good = {"action": "accept", "nonce": 1}
    ask = "autopilot/decide"
    assert answered(world, node, ask, msgpack.packb(good))["mode"] == "engaged"
    refused = answered(world, node, ask, msgpack.packb({**good, "suggestion": 7}))["refused"]
    assert refused == {"error": "no such suggestion", "field": "suggestion"}
    for bad, field in (
        ({"nonce": 1}, "action"),
        ({**good, "action": "jump"}, "action"),
        ({**good, "nonce": "x"}, "nonce"),
        ({**good, "suggestion": -1}, "suggestion"),
    ):
        refused = answered(world, node, ask, msgpack.packb(bad))["refused"]
        assert refused["field"] == field
        assert ("use accept, cancel, takeoff, land, emergency" in refused["error"]) == (
            field == "action"
        )
        assert refused["error"]
    assert answered(world, node, ask, b"\xff\x00noise")["refused"]["error"]


def test_an_answer_that_cannot_be_sent_is_a_refusal_and_ends_nothing(world: World) -> None:
    server, client = world.node("autopilot"), MemoryBus(world.network)
    server.answer(
        "autopilot/decide",
        lambda request, _: m.DecideReply(ok=True, reason=object(), mode="manual"),  # type: ignore[arg-type]
    )
    refusals: list[bytes | None] = []

    def ask() -> None:
        question = m.encode(m.DecideRequest(action="land", nonce=1))
        try:
            client.ask(key_of(VEHICLE, "autopilot/decide"), question, "", 5.0)
        except QueryFailedError as error:
            refusals.append(error.payload)

    asker = threading.Thread(target=ask)
    asker.start()
    while not server._servers[0].box:
        asker.join(0.01)
    server.spin()
    asker.join(5.0)
    assert "could not handle" in msgpack.unpackb(refusals[0] or b"")["error"]


def test_a_node_asks_another(world: World) -> None:
    sim, asker = world.node("sim"), world.node("operator")
    sim.answer("sim/worlds", lambda *_: m.WorldsReply(worlds=["track"]))
    sim.answer("sim/reset", lambda *_: (_ for _ in ()).throw(RefusedError("no", "world")))
    results: list[Any] = []

    def ask() -> None:
        results.append(asker.ask("sim/worlds", m.WorldsRequest()))
        try:
            asker.ask("sim/reset", m.ResetRequest())
        except RefusedError as refused:
            results.append((str(refused), refused.field_name))

    thread = threading.Thread(target=ask)
    thread.start()
    while thread.is_alive():
        sim.spin()
        thread.join(0.001)
    assert results == [m.WorldsReply(worlds=["track"]), ("no", "world")]


def test_asking_where_nobody_serves_says_so(world: World) -> None:
    with pytest.raises(QueryFailedError, match="nobody answers"):
        world.node("operator").ask("sim/worlds", m.WorldsRequest())


def test_health_tells_rates_latency_and_the_cores_state(world: World) -> None:
    node = world.node("classifier")
    node.on("stick", lambda *_: world.clock.advance(0.01), timed=True)
    node.reports(lambda: ("degraded", "no model"))
    begin_ns = world.clock.monotonic_ns()
    for _ in range(50):
        world.put("stick", stick())
        world.clock.advance(0.01)
        node.spin()
    elapsed_s = (world.clock.monotonic_ns() - begin_ns) / 1e9
    health = health_of(world, node)
    assert health["service"] == "classifier"
    assert (health["state"], health["detail"]) == ("degraded", "no model")
    assert health["rates"]["stick"] == pytest.approx(50 / elapsed_s)
    assert health["latency_p50"] == pytest.approx(0.01)
    assert health["latency_p99"] == pytest.approx(0.01)
    world.clock.advance(1.0)
    assert health_of(world, node)["rates"]["stick"] == 0.0, "a rate is that of the last period"


def test_run_announces_serves_and_ends_when_told(world: World) -> None:
    node = Node(MemoryBus(world.network), VEHICLE, "sim")
    alive: dict[str, bool] = {}
    world.bus.watch(key_of(VEHICLE, "alive/*"), lambda key, there: alive.update({key: there}))
    health = world.listen("health/sim")
    closed: list[str] = []
    node.on_close(lambda: closed.append("first declared"))
    node.on_close(lambda: closed.append("last declared"))
    stop = threading.Event()
    runner = threading.Thread(target=node.run, args=(stop,))
    runner.start()
    key = key_of(VEHICLE, "alive/sim")
    deadline = threading.Event()
    for _ in range(300):
        if health and alive.get(key):
            break
        deadline.wait(0.01)
    assert alive == {key: True}
    assert health[0]["seq"] == 0
    stop.set()
    node.wake()
    runner.join(1.0)
    assert not runner.is_alive()
    node.close()
    assert alive == {key: False}
    assert closed == ["last declared", "first declared"]


def test_a_closer_that_fails_keeps_nothing_open(world: World) -> None:
    node = world.node("sim")
    closed: list[str] = []
    node.on_close(lambda: closed.append("first declared"))
    node.on_close(lambda: {}["none"])
    node.beside("second").on_close(lambda: closed.append("beside"))
    node.bus.announce("a/token")
    alive: list[bool] = []
    world.bus.watch("a/token", lambda _, there: alive.append(there))
    with pytest.raises(KeyError):
        node.close()
    assert closed == ["beside", "first declared"]
    assert alive == [True, False]


def test_a_service_sleeps_until_something_comes(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = world.node("autopilot")
    heard = threading.Event()
    node.on("stick", lambda *_: heard.set())
    looks = 0
    spin = node.spin

    def look() -> None:
        nonlocal looks
        looks += 1
        spin()

    monkeypatch.setattr(node, "spin", look)
    stop = threading.Event()
    runner = threading.Thread(target=node.run, args=(stop,))
    runner.start()
    try:
        stop.wait(0.3)
        world.put("stick", stick())
        assert heard.wait(0.5), "the clock stands still, so only the stick can wake it"
    finally:
        stop.set()
        node.wake()
        runner.join(5.0)
    assert looks <= 3


def test_every_topic_of_the_table_can_be_read(world: World) -> None:
    node = world.node("recorder")
    for name in TOPICS:
        node.on(name, lambda *_: None)


def test_a_node_beside_another_has_its_own_keys_and_health_and_is_run_and_closed_with_it(
    world: World,
) -> None:
    first = world.node("sim")
    other = first.beside("second")
    heard: list[tuple[str, m.Message]] = []
    closed: list[str] = []
    for node in (first, other):
        node.on("command", lambda message, _ns, name=node.vehicle: heard.append((name, message)))
        node.on_close(lambda name=node.vehicle: closed.append(name))  # type: ignore[misc]
    alive: list[tuple[str, bool]] = []
    world.bus.watch("autocomplete/*/alive/*", lambda key, here: alive.append((key, here)))
    healths: list[str] = []
    for name in (VEHICLE, "second"):
        world.bus.subscribe(key_of(name, "health/sim"), lambda _, name=name: healths.append(name))
    stop = threading.Event()
    thread = threading.Thread(target=first.run, args=(stop,))
    thread.start()
    try:
        while len(alive) < 2:
            stop.wait(0.01)
        assert {key for key, _ in alive} == {
            f"autocomplete/{name}/alive/sim" for name in (VEHICLE, "second")
        }
    finally:
        stop.set()
        first.wake()
        thread.join(5.0)
    command = msgpack.packb(
        {
            **{"stamp": 1, "seq": 0, "vx": 0.5, "vy": 0.0, "vz": 0.0, "wz": 0.0},
            **{"action": "fly", "mode": "manual"},
        }
    )
    world.bus.publication(key_of("second", "command"), Delivery.COMMAND, "").put(command)
    world.clock.advance(0.1)
    first.spin()
    assert [name for name, _ in heard] == ["second"]
    world.clock.advance(1.0)
    first.spin()
    assert sorted(healths) == ["second", VEHICLE]
    first.close()
    assert closed == ["second", VEHICLE]
