"""What every bus does, over memory and over Zenoh: one suite, so that they stay alike."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
import zenoh

from common.bus import Bus, QueryFailedError, Request
from common.memory_bus import MemoryBus, MemoryNetwork
from common.topics import Delivery
from common.zenoh_bus import LEASE_MS, ZenohBus, client_config, open_bus, router_config

ENCODING = "application/msgpack;Test/1"
TIMEOUT_S = 5.0
HELLO = b"are you there?"
"""Put until it is heard; a late one may still be on its way and counts for nothing."""

Join = Callable[[], Bus]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def eventually(condition: Callable[[], bool], timeout_s: float = TIMEOUT_S) -> bool:
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config(where)):
        yield where


@pytest.fixture(params=["memory", "zenoh"])
def join(request: pytest.FixtureRequest) -> Iterator[Join]:
    """Gives buses that meet on one network; all are closed at the end."""
    joined: list[Bus] = []
    network = MemoryNetwork()
    where = request.getfixturevalue("endpoint") if request.param == "zenoh" else ""

    def one_more() -> Bus:
        bus: Bus = ZenohBus(where) if request.param == "zenoh" else MemoryBus(network)
        joined.append(bus)
        return bus

    yield one_more
    for bus in joined:
        bus.close()


def put_until_heard(bus: Bus, key: str, heard: Callable[[], bool]) -> None:
    """Put on a key until a reader hears it: a declaration takes a moment over a network."""
    publication = bus.publication(key, Delivery.EVENT, ENCODING)

    def heard_now() -> bool:
        publication.put(HELLO)
        return heard()

    assert eventually(heard_now)
    time.sleep(0.05)


def into(received: list[bytes], heard: threading.Event) -> Callable[[bytes], None]:
    """A reader that keeps what is put, and only notes the hellos."""

    def receive(payload: bytes) -> None:
        if payload == HELLO:
            heard.set()
        else:
            received.append(payload)

    return receive


def test_of_a_burst_of_events_every_one_arrives_in_order(join: Join) -> None:
    reader, writer = join(), join()
    received: list[bytes] = []
    heard = threading.Event()
    reader.subscribe("burst", into(received, heard))
    put_until_heard(writer, "burst", heard.is_set)
    publication = writer.publication("burst", Delivery.EVENT, ENCODING)
    sent = [b"%d" % i for i in range(100)]
    for payload in sent:
        publication.put(payload)
    assert eventually(lambda: len(received) >= len(sent))
    assert received == sent


@pytest.mark.parametrize("delivery", [Delivery.STREAM, Delivery.COMMAND])
def test_what_is_put_arrives_at_most_once_and_in_order(join: Join, delivery: Delivery) -> None:
    reader, writer = join(), join()
    received: list[bytes] = []
    key = f"order/{delivery.value}"
    heard = threading.Event()
    reader.subscribe(key, into(received, heard))
    put_until_heard(writer, key, heard.is_set)
    publication = writer.publication(key, delivery, ENCODING)
    for i in range(100):
        publication.put(b"%d" % i)
        time.sleep(0.002)
    # A busy machine may drop some; it must not repeat or reorder any.
    assert eventually(lambda: len(received) > 50)
    numbers = [int(payload) for payload in received]
    assert numbers == sorted(set(numbers))


def test_video_arrives_as_other_topics_do(join: Join) -> None:
    reader, writer = join(), join()
    received: list[bytes] = []
    reader.subscribe("video/front", received.append, video=True)
    publication = writer.publication("video/front", Delivery.STREAM, ENCODING, video=True)
    picture = bytes(100_000)

    def heard() -> bool:
        publication.put(picture)
        return bool(received)

    assert eventually(heard)
    assert received[0] == picture


def test_every_reader_of_a_key_hears_it(join: Join) -> None:
    first: list[bytes] = []
    second: list[bytes] = []
    join().subscribe("all/of/us", first.append)
    join().subscribe("all/of/us", second.append)
    put_until_heard(join(), "all/of/us", lambda: bool(first and second))


def test_a_star_covers_one_chunk_and_two_cover_any_number(join: Join) -> None:
    reader, writer = join(), join()
    one: list[bytes] = []
    many: list[bytes] = []
    heard_one, heard_many = threading.Event(), threading.Event()
    reader.subscribe("wild/*/pose", into(one, heard_one))
    reader.subscribe("wild/**", into(many, heard_many))
    put_until_heard(writer, "wild/a/pose", lambda: heard_one.is_set() and heard_many.is_set())
    for key in ("wild/b/pose", "wild/pose", "wild/a/b/pose", "wild/a/pose/x", "tame/a/pose"):
        writer.publication(key, Delivery.EVENT, ENCODING).put(key.encode())
    assert eventually(lambda: len(many) >= 4)
    time.sleep(0.1)
    assert one == [b"wild/b/pose"]
    assert sorted(many) == [b"wild/a/b/pose", b"wild/a/pose/x", b"wild/b/pose", b"wild/pose"]


def test_nothing_is_raised_when_nobody_listens(join: Join) -> None:
    join().publication("nobody/here", Delivery.STREAM, ENCODING).put(b"hello")


def ask_when_served(bus: Bus, key: str, payload: bytes, timeout_s: float = 2.0) -> bytes:
    """Ask until the server's declaration has come through."""
    for _ in range(100):
        try:
            return bus.ask(key, payload, ENCODING, timeout_s)
        except QueryFailedError as error:
            if "nobody answers" not in str(error):
                raise
            time.sleep(0.02)
    raise AssertionError(f"nobody serves {key}")


def test_a_question_gets_its_answer(join: Join) -> None:
    server, asker = join(), join()
    server.serve("ask/echo", lambda request: request.reply(request.payload[::-1], ENCODING))
    assert ask_when_served(asker, "ask/echo", b"abc") == b"cba"


def test_an_answer_may_come_from_another_thread(join: Join) -> None:
    server, asker = join(), join()

    def later(request: Request) -> None:
        threading.Timer(0.1, request.reply, (b"at last", ENCODING)).start()

    server.serve("ask/later", later)
    assert ask_when_served(asker, "ask/later", b"") == b"at last"


def test_questions_of_many_at_once_are_all_answered(join: Join) -> None:
    server, asker = join(), join()
    server.serve("ask/many", lambda request: request.reply(request.payload, ENCODING))
    ask_when_served(asker, "ask/many", b"")
    questions = [bytes([number]) * 10_000 for number in range(100)]
    with ThreadPoolExecutor(20) as askers:
        answers = askers.map(
            lambda question: asker.ask("ask/many", question, ENCODING, 5.0), questions
        )
        assert list(answers) == questions


def test_a_refusal_carries_its_payload(join: Join) -> None:
    server, asker = join(), join()
    server.serve("ask/no", lambda request: request.refuse(b"because", ENCODING))
    with pytest.raises(QueryFailedError) as refused:
        ask_when_served(asker, "ask/no", b"")
    assert refused.value.payload == b"because"


def test_a_server_that_is_silent_costs_the_timeout_and_no_more(join: Join) -> None:
    server, asker = join(), join()
    kept: list[Request] = []
    server.serve("ask/never", kept.append)
    begin = time.monotonic()
    with pytest.raises(QueryFailedError, match="no answer on ask/never") as failed:
        ask_when_served(asker, "ask/never", b"", timeout_s=0.3)
    assert failed.value.payload is None
    assert time.monotonic() - begin < 2.0


def test_nobody_answers_where_nobody_serves(join: Join) -> None:
    with pytest.raises(QueryFailedError) as failed:
        join().ask("ask/nobody", b"", ENCODING, 0.5)
    assert failed.value.payload is None


def test_a_token_is_seen_to_appear_and_to_go(join: Join) -> None:
    early, late, mortal = join(), join(), join()
    seen_early: list[tuple[str, bool]] = []
    seen_late: list[tuple[str, bool]] = []
    early.watch("alive/*", lambda key, alive: seen_early.append((key, alive)))
    mortal.announce("alive/sim")
    assert eventually(lambda: ("alive/sim", True) in seen_early)
    late.watch("alive/*", lambda key, alive: seen_late.append((key, alive)))
    assert eventually(lambda: ("alive/sim", True) in seen_late)
    mortal.close()
    assert eventually(lambda: seen_early[-1:] == seen_late[-1:] == [("alive/sim", False)])


def test_close_ends_subscriptions_and_service(join: Join) -> None:
    leaver, stayer = join(), join()
    received: list[bytes] = []
    leaver.subscribe("bye", received.append)
    leaver.serve("bye/ask", lambda request: request.reply(b"here", ENCODING))
    put_until_heard(stayer, "bye", lambda: bool(received))
    assert ask_when_served(stayer, "bye/ask", b"") == b"here"
    leaver.close()
    received.clear()
    stayer.publication("bye", Delivery.EVENT, ENCODING).put(b"too late")
    with pytest.raises(QueryFailedError):
        stayer.ask("bye/ask", b"", ENCODING, 0.5)
    time.sleep(0.1)
    assert received == []


def test_closing_twice_is_closing_once(join: Join) -> None:
    bus = join()
    bus.announce("twice/alive")
    bus.close()
    bus.close()


def test_a_question_on_a_closed_bus_has_no_answer(join: Join) -> None:
    bus = join()
    bus.close()
    with pytest.raises(QueryFailedError):
        bus.ask("anybody", b"x", ENCODING, 1.0)


def test_a_joined_bus_is_linked(join: Join) -> None:
    assert join().linked()


# --- Zenoh alone ---------------------------------------------------------------------------------


def read_back(config: zenoh.Config, key: str) -> object:
    return json.loads(config.get_json(key))


def test_the_clients_configuration_is_what_was_written() -> None:
    config = client_config("tcp/192.0.2.1:7447")
    assert read_back(config, "mode") == "client"
    assert read_back(config, "connect/endpoints") == ["tcp/192.0.2.1:7447"]
    assert read_back(config, "scouting/multicast/enabled") is False
    assert read_back(config, "connect/timeout_ms") == -1
    retry = read_back(config, "connect/retry")
    assert retry == {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5}
    assert read_back(config, "transport/link/tx/lease") == LEASE_MS
    assert read_back(config, "transport/shared_memory/enabled") is False


def test_the_routers_configuration_is_what_was_written() -> None:
    config = router_config("tcp/127.0.0.1:1")
    assert read_back(config, "mode") == "router"
    assert read_back(config, "listen/endpoints") == ["tcp/127.0.0.1:1"]
    assert read_back(config, "scouting/multicast/enabled") is False
    assert read_back(config, "transport/link/tx/lease") == LEASE_MS


@pytest.mark.parametrize("endpoint", ["", "127.0.0.1:7447", "tcp/", "http/host:1", "tcp/a b:1"])
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    with pytest.raises(ValueError, match="is no endpoint"):
        client_config(endpoint)


def test_waiting_for_a_router_ends_when_asked_to() -> None:
    stop = threading.Event()
    threading.Timer(0.3, stop.set).start()
    begin = time.monotonic()
    assert open_bus(stop, f"tcp/127.0.0.1:{free_port()}") is None
    assert time.monotonic() - begin < 2.0


def test_a_bus_finds_a_router_that_comes_later_and_one_that_comes_back() -> None:
    where = f"tcp/127.0.0.1:{free_port()}"
    opened: list[ZenohBus | None] = []
    waiter = threading.Thread(target=lambda: opened.append(open_bus(threading.Event(), where)))
    waiter.start()
    time.sleep(0.3)
    with zenoh.open(router_config(where)):
        waiter.join(TIMEOUT_S)
        bus = opened[0]
        assert bus is not None
        assert bus.linked()
        received: list[bytes] = []
        bus.subscribe("back", received.append)
    with contextlib.closing(bus):
        assert eventually(lambda: not bus.linked())
        with zenoh.open(router_config(where)):
            assert eventually(bus.linked, 10.0)
            put_until_heard(bus, "back", lambda: bool(received))
