"""The classifier as a black box: sticks in, intents out."""

import contextlib
import itertools
import math
import random
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import onnx
import pytest
from conftest import (
    Client,
    Launch,
    Process,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    free_port,
    start_service,
)
from payloads import assert_bad_input_is_dropped_and_counted

PRIMITIVES = {"line", "arc", "sine", "helix"}
PERIOD_S = 0.1
STICK_HZ = 50.0
WINDOW_S = 8.0
UNSET = "unset"


Make = Callable[[float], dict[str, Any]]
_tests = itertools.count(1)


def stick(vx: float = 0.0, vy: float = 0.0, vz: float = 0.0, wz: float = 0.0) -> dict[str, Any]:
    return {"vx": vx, "vy": vy, "vz": vz, "wz": wz}


def line(_t: float) -> dict[str, Any]:
    return stick(vx=0.7, vy=0.2)


def arc(t: float) -> dict[str, Any]:
    return stick(vx=0.7 * math.cos(1.2 * t), vy=0.7 * math.sin(1.2 * t))


def steered_arc(_t: float) -> dict[str, Any]:
    """A circle of 1.6 m radius flown with a stick that stands still."""
    return stick(vx=0.8, wz=0.5)


def sine(t: float) -> dict[str, Any]:
    return stick(vx=0.5, vy=0.5 * math.cos(2.0 * math.pi * t / 2.2))


def helix(t: float) -> dict[str, Any]:
    return {**arc(t), "vz": 0.5}


def rest(_t: float) -> dict[str, Any]:
    return stick()


@pytest.fixture(scope="module")
def unset(router: Any, port: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """A classifier of another vehicle with nothing set."""
    process = Process(port, UNSET, "classifier", [], tmp_path_factory.mktemp("unset") / "log")
    yield process
    if process.popen.poll() is None:
        process.popen.kill()


@pytest.fixture(scope="module")
def service(launch: Launch, client: Client, unset: Process) -> Process:
    return start_service(launch, client, "classifier", "--period-s", str(PERIOD_S))


class Hand:
    """Sends sticks that are stamped `rate_hz` apart faster than that: the window goes by stamps."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.now_ns = time.time_ns()

    def move(self, make: Make, seconds: float, rate_hz: float = STICK_HZ) -> dict[str, Any]:
        """Perform for that long on the hand's own clock; the first intent after it."""
        for tick in range(round(seconds * rate_hz)):
            self.now_ns += round(1e9 / rate_hz)
            self._client.publish("stick", {"stamp": self.now_ns, **make(tick / rate_hz)})
            time.sleep(0.001)
        return self._client.next("intent", lambda i: i["window_end"] == self.now_ns)


@pytest.fixture
def hand(service: Process, client: Client) -> Hand:
    hand = Hand(client)
    # As much before the first stick as ends every motion of an earlier test.
    hand.now_ns += 20_000_000_000 * next(_tests)
    return hand


@pytest.mark.parametrize(
    ("make", "label", "after_s"),
    [
        (line, "line", 2.0),
        (arc, "arc", 2.6),
        (steered_arc, "arc", 2.6),
        (sine, "sine", 3.4),
        (helix, "helix", 2.6),
    ],
    ids=["line", "arc", "steered arc", "sine", "helix"],
)
def test_what_the_sticks_draw_is_named(hand: Hand, make: Make, label: str, after_s: float) -> None:
    intent = hand.move(make, after_s)
    assert intent["label"] == label, intent
    # That a primitive is meant at all, times that it is this one.
    assert 0.0 < intent["confidence"] <= max(intent["probabilities"].values()) + 1e-6
    assert intent["probabilities"][label] == max(intent["probabilities"].values())


def test_an_intent_is_as_the_contract_says(
    service: Process, streams: Streams, client: Client
) -> None:
    time.sleep(0.3)
    intents = client.collect("intent")
    begin_ns = time.time_ns() + 20_000_000_000 * next(_tests)
    streams.add("stick", STICK_HZ, lambda t: {"stamp": begin_ns + int(t * 1e9), **line(t)})
    time.sleep(2.0)
    intent = client.next("intent")
    assert intent["label"] == "line"
    assert set(intent["probabilities"]) >= PRIMITIVES
    assert all(p >= 0.0 for p in intent["probabilities"].values())
    assert sum(intent["probabilities"].values()) == pytest.approx(1.0, abs=1e-3)
    assert abs(intent["window_start"] - begin_ns) < 0.2e9
    assert intent["stamp"] == intent["window_end"]
    seconds = (intent["window_end"] - intent["window_start"]) / 1e9
    assert seconds == pytest.approx(2.05, abs=0.25)
    assert intent["samples"] == pytest.approx(seconds * STICK_HZ, rel=0.15)
    name, _, digest = intent["model"].rpartition("-")
    assert name
    assert len(digest) == 8
    assert intents.encodings[-1] == "application/msgpack;Intent/1"
    seqs = [i["seq"] for i in intents]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))

    health = client.next("health/classifier")
    assert health["service"] == "classifier"
    assert health["state"] == "ok"
    assert "intent-" in health["detail"]
    assert health["rates"]["stick"] == pytest.approx(STICK_HZ, rel=0.15)
    assert 0.0 <= health["latency_p50"] <= health["latency_p99"] < 0.1
    assert client.collect("health/classifier").encodings[-1] == "application/msgpack;Health/1"

    streams.close()
    time.sleep(0.25)
    assert client.next("intent")["label"] == "none", "sticks that ceased mean nothing"


@pytest.mark.parametrize("rate_hz", [20.0, 100.0])
@pytest.mark.parametrize(("make", "label"), [(arc, "arc"), (helix, "helix")])
def test_a_bad_link_changes_no_name(
    hand: Hand, client: Client, make: Make, label: str, rate_hz: float
) -> None:
    """One stick in ten lost, 30 ms of jitter, some late and some doubled."""
    rng = random.Random(int(rate_hz))
    sent = []
    for tick in range(round(3.0 * rate_hz)):
        t = tick / rate_hz + rng.uniform(0.0, 0.03)
        arrival = tick / rate_hz + rng.uniform(0.0, 0.03)
        sent += [(arrival, t)] * rng.choices((0, 1, 2), (0.1, 0.85, 0.05))[0]
    begin_ns = hand.now_ns
    newest_ns = begin_ns + round(max(t for _, t in sent) * 1e9)
    for _, t in sorted(sent):
        client.publish("stick", {"stamp": begin_ns + round(t * 1e9), **make(t)})
        time.sleep(0.001)
    intent = client.next("intent", lambda i: i["window_end"] == newest_ns)
    assert intent["label"] == label, intent
    assert (intent["window_end"] - intent["window_start"]) / 1e9 == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 100.0])
def test_the_window_is_as_long_whatever_the_rate(hand: Hand, rate_hz: float) -> None:
    intent = hand.move(arc, WINDOW_S + 0.6, rate_hz)
    assert intent["label"] == "arc"
    assert WINDOW_S - 0.1 < (intent["window_end"] - intent["window_start"]) / 1e9 <= WINDOW_S
    assert intent["samples"] == pytest.approx(WINDOW_S * rate_hz, abs=2)


@pytest.mark.parametrize(
    "make",
    [rest, lambda _t: stick(wz=0.8), lambda t: stick(vx=0.04 * math.sin(9 * t))],
    ids=["rest", "turning on the spot", "within the dead band"],
)
def test_no_motion_is_no_primitive(hand: Hand, make: Make) -> None:
    intent = hand.move(make, 1.2)
    assert intent["label"] == "none"
    assert sum(intent["probabilities"].values()) == pytest.approx(1.0, abs=1e-3)


def test_a_motion_of_a_third_of_a_second_has_no_shape_yet(hand: Hand) -> None:
    intent = hand.move(line, 0.34)
    assert intent["label"] == "none"
    assert intent["confidence"] == 0.0


def test_a_pause_ends_the_motion(hand: Hand) -> None:
    hand.move(sine, 1.5)
    assert hand.move(rest, 0.4)["label"] == "none"
    intent = hand.move(line, 2.0)
    assert intent["label"] == "line"
    assert (intent["window_end"] - intent["window_start"]) / 1e9 < 2.1


def test_a_gap_ends_the_motion(hand: Hand) -> None:
    hand.move(sine, 1.5)
    hand.now_ns += 500_000_000
    intent = hand.move(line, 1.5)
    assert (intent["window_end"] - intent["window_start"]) / 1e9 < 1.6


def test_intents_come_once_a_period(service: Process, client: Client) -> None:
    intents = client.collect("intent")
    before = len(intents)
    time.sleep(1.0)
    assert len(intents) - before == pytest.approx(1.0 / PERIOD_S, abs=1)


def test_the_default_period_is_the_thesis_second(unset: Process, router: Any, port: int) -> None:
    client = Client(port, UNSET)
    with contextlib.closing(client):
        client.next("intent")
        arrivals = client.collect("intent").arrival_s
        client.next("intent")
        assert arrivals[-1] - arrivals[-2] == pytest.approx(1.0, abs=0.15)
    assert unset.stop() == 0


def test_given_samples_are_classified(service: Process, client: Client) -> None:
    for make, label in ((line, "line"), (arc, "arc"), (sine, "sine"), (helix, "helix")):
        for rate in (20.0, 50.0, 100.0):
            times = [n / rate for n in range(int(3.6 * rate))]
            samples = [[make(t)[axis] for axis in ("vx", "vy", "vz")] for t in times]
            good, intent = client.ask("classifier/classify", {"samples": samples, "rate": rate})
            assert good, intent
            assert intent["label"] == label, (rate, intent)
            assert intent["samples"] == len(samples)
    good, intent = client.ask(
        "classifier/classify", {"samples": [[0.0, 0.0, 0.0]] * 100, "rate": 50.0}
    )
    assert good
    assert intent["label"] == "none"
    good, intent = client.ask(
        "classifier/classify", {"samples": [[0.5, 0.0, 0.0]] * 10, "rate": 50.0}
    )
    assert good
    assert intent["label"] == "none"


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        ({"rate": 50.0}, "samples"),
        ({"samples": [[0.1, 0.0, 0.0]]}, "rate"),
        ({"samples": [], "rate": 50.0}, "samples"),
        ({"samples": [[0.1, 0.0]], "rate": 50.0}, "samples"),
        ({"samples": "line", "rate": 50.0}, "samples"),
        ({"samples": [[float("nan"), 0.0, 0.0]] * 60, "rate": 50.0}, None),
        ({"samples": [[3.0, 0.0, 0.0]] * 60, "rate": 50.0}, "samples"),
        ({"samples": [[0.5, 0.0, 0.0]] * 60, "rate": 0.0}, "rate"),
        ({"samples": [[0.5, 0.0, 0.0]] * 60, "rate": 19.0}, "rate"),
        ({"samples": [[0.5, 0.0, 0.0]] * 60, "rate": 101.0}, "rate"),
        ({"samples": [[0.5, 0.0, 0.0]] * 60, "rate": "fast"}, "rate"),
        ([1, 2], None),
        (b"\xc1 noise", None),
    ],
)
def test_a_bad_question_is_refused_with_its_field(
    service: Process, client: Client, request_: Any, field: str | None
) -> None:
    good, reply = client.ask("classifier/classify", request_)
    assert not good
    assert reply["error"]
    if field is not None:
        assert reply["field"] == field


def test_bad_sticks_are_dropped_and_counted(service: Process, client: Client) -> None:
    assert_bad_input_is_dropped_and_counted(client, "classifier", "stick", "Stick")


def test_it_starts_before_its_router(tmp_path: Path) -> None:
    assert_starts_before_its_router("classifier", tmp_path=tmp_path)


def test_it_stops_without_a_router(tmp_path: Path) -> None:
    assert_stops_without_a_router("classifier", tmp_path=tmp_path)


SHIPPED = Path(__file__).parents[2] / "models" / "intent.onnx"


def variant(path: Path, **metadata: str) -> Path:
    """The shipped model with other words in its metadata."""
    model = onnx.load(str(SHIPPED))
    given = {entry.key: entry.value for entry in model.metadata_props}
    onnx.helper.set_model_props(model, {**given, **metadata})
    onnx.save(model, str(path))
    return path


def put_in_place(path: Path, made: Path) -> None:
    """As the documentation says: write it beside the other, then rename."""
    made.replace(path)


def test_a_model_file_is_exchanged_while_it_runs(router: Any, port: int, tmp_path: Path) -> None:
    path = variant(tmp_path / "m.onnx", name="first")
    client = Client(port, "reload")
    process = Process(
        port,
        "reload",
        "classifier",
        ["--model", str(path), "--period-s", str(PERIOD_S)],
        tmp_path / "reload.log",
    )
    with contextlib.closing(client):
        try:
            client.wait_alive("classifier")
            intents = client.collect("intent")
            assert client.next("intent")["model"].startswith("first-")

            put_in_place(path, variant(tmp_path / "new", name="second"))
            client.next("intent", lambda i: i["model"].startswith("second-"))

            path.write_bytes(b"no model at all")
            health = client.next("health/classifier", lambda h: h["state"] == "degraded")
            assert "m.onnx" in health["detail"]
            assert "second-" in health["detail"]
            assert client.next("intent")["model"].startswith("second-")

            put_in_place(path, variant(tmp_path / "new", name="third", contract="intent-sticks/1"))
            client.next("health/classifier", lambda h: "intent-sticks/1" in h["detail"])
            assert client.next("intent")["model"].startswith("second-")

            put_in_place(path, variant(tmp_path / "new", name="fourth"))
            client.next("intent", lambda i: i["model"].startswith("fourth-"))
            health = client.next("health/classifier", lambda h: h["state"] == "ok")
            assert health["detail"].startswith("fourth-")

            seconds = intents.arrival_s[-1] - intents.arrival_s[0]
            assert len(intents) > 0.9 * seconds / PERIOD_S, "periods were missed"
            seqs = [i["seq"] for i in intents]
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
            assert process.stop() == 0
        finally:
            if process.popen.poll() is None:
                process.popen.kill()


@pytest.mark.parametrize(
    ("spoil", "reason", "with_router"),
    [
        (lambda path: None, "cannot be read", False),
        (lambda path: path.write_bytes(b"no model at all"), "no ONNX model", False),
        (lambda path: variant(path, contract="intent-sticks/1"), "intent-sticks/1", False),
        (lambda path: variant(path, contract="intent-sticks/1"), "intent-sticks/1", True),
    ],
    ids=["no file", "no model", "other contract", "other contract, with a router"],
)
def test_a_model_that_does_not_fit_is_refused_at_start_in_one_line(
    router: Any,
    port: int,
    tmp_path: Path,
    spoil: Callable[[Path], object],
    reason: str,
    with_router: bool,
) -> None:
    path = tmp_path / "other.onnx"
    spoil(path)
    ran = subprocess.run(
        [
            str(Path(sys.executable).with_name("autocomplete")),
            *("run", "classifier", "--model", str(path)),
            *("--connect", f"tcp/127.0.0.1:{port if with_router else free_port()}"),
            *("--vehicle", "refused"),
        ],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert ran.returncode == 1
    (error,) = (text for text in ran.stderr.splitlines() if "other.onnx" in text)
    assert reason in error
    assert "Traceback" not in ran.stderr


def test_a_period_out_of_range_is_wrong_usage(port: int) -> None:
    ran = subprocess.run(
        [
            str(Path(sys.executable).with_name("autocomplete")),
            *("run", "classifier", "--period-s", "5", "--connect", f"tcp/127.0.0.1:{port}"),
        ],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert ran.returncode == 2
    assert "period_s" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1


def test_it_ends_on_sigterm_with_0(service: Process, client: Client) -> None:
    assert "classifier" in client.alive()
    assert service.stop() == 0
