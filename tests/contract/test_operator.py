"""The operator service, from outside."""

import contextlib
import itertools
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh
from conftest import (
    Client,
    Launch,
    Process,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    start_service,
)
from payloads import GOOD, assert_bad_input_is_dropped_and_counted

AXES = ("vx", "vy", "vz", "wz")
NEUTRAL = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0}


def deflection(message: dict[str, Any]) -> float:
    return max(abs(message[axis]) for axis in AXES)


def fresh(name: str, **changes: Any) -> dict[str, Any]:
    good = {k: v for k, v in GOOD[name].items() if k not in ("stamp", "seq")}
    return {**good, **changes}


# --- the browser's pad ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def console(launch: Launch, client: Client) -> Process:
    return start_service(launch, client, "operator", "--source", "console")


def test_sticks_are_sent_at_50_hz_in_order_and_neutral_when_nobody_holds_them(
    console: Process, client: Client
) -> None:
    sticks = client.collect("stick")
    client.next("stick")
    begin = len(sticks)
    time.sleep(1.5)
    part = sticks[begin:]
    arrivals = sticks.arrival_s[begin : begin + len(part)]
    rate_hz = (len(part) - 1) / (arrivals[-1] - arrivals[0])
    assert 47.0 < rate_hz < 53.0
    assert [m["seq"] for m in part] == list(range(part[0]["seq"], part[0]["seq"] + len(part)))
    assert all(a["stamp"] < b["stamp"] for a, b in itertools.pairwise(part))
    assert all(deflection(m) == 0.0 for m in part)
    assert set(sticks.encodings) == {"application/msgpack;Stick/1"}


def test_the_browsers_sticks_are_passed_on_and_never_old(
    console: Process, client: Client, streams: Streams
) -> None:
    streams.add(
        "console/stick",
        50.0,
        lambda t: {**NEUTRAL, "vx": 0.7 if t > 0.3 else 0.0, "buttons": ["a"]},
    )
    held = client.next("stick", lambda m: deflection(m) > 0.0)
    assert {axis: held[axis] for axis in AXES} == {**NEUTRAL, "vx": 0.7}
    assert held["buttons"] == ["a"]
    # A browser that is gone: neutral within its maximum age, and neutral it stays.
    streams.close()
    gone_s = time.monotonic()
    client.next("stick", lambda m: deflection(m) == 0.0)
    assert time.monotonic() - gone_s < 0.35
    # Back with the stick still held: it must pass through neutral first.
    time.sleep(0.2)
    streams.add("console/stick", 50.0, lambda t: {**NEUTRAL, "vy": 0.0 if 0.5 < t < 0.6 else -0.4})
    begin_s = time.monotonic()
    client.next("stick", lambda m: m["vy"] == -0.4)
    assert time.monotonic() - begin_s > 0.5


def test_health_says_who_flies(console: Process, client: Client) -> None:
    health = client.next("health/operator", lambda h: h["detail"] == "source console")
    assert health["service"] == "operator"
    assert health["state"] == "ok"
    assert set(health["rates"]) == {"console/stick"}
    assert 0.0 <= health["latency_p50"] <= health["latency_p99"] < 0.02
    assert "operator" in client.alive()


# --- a pad, a keyboard ----------------------------------------------------------------------------


@contextlib.contextmanager
def other(port: int, vehicle: str) -> Iterator[Client]:
    client = Client(port, vehicle)
    try:
        yield client
    finally:
        client.close()


def test_without_a_pad_sticks_are_neutral_and_health_says_so(
    router: zenoh.Session, port: int, launch: Launch
) -> None:
    with other(port, "pad") as pad, other(port, "auto") as auto:
        processes = [
            launch("operator", "--source", client.vehicle, "--vehicle", client.vehicle)
            for client in (pad, auto)
        ]
        for client, state, detail in (
            (pad, "degraded", "none is plugged in"),
            (auto, "ok", "source console"),
        ):
            client.wait_alive("operator")
            assert deflection(client.next("stick")) == 0.0
            health = client.next("health/operator")
            assert health["state"] == state
            assert detail in health["detail"]
        for process in processes:
            assert process.stop() == 0


REFUSED = (
    (("--source", "keyboard"), "needs a screen"),
    (("--source", "mind"), "source"),
    (("--laps", "-1"), "laps"),
    (("--pad", "wheel"), "pad"),
    (("--source", "scripted", "--world", "nowhere"), "world"),
    (("--source", "scripted", "--world", "empty"), "world"),
)


def test_what_cannot_be_had_is_refused_in_one_line_that_names_it(
    router: zenoh.Session, launch: Launch
) -> None:
    started = [(launch("operator", "--vehicle", "wrong", *flags), word) for flags, word in REFUSED]
    for process, word in started:
        assert process.popen.wait(20.0) in (1, 2)
        log = process.log.read_text()
        assert sum(word in line for line in log.splitlines()) == 1, log
        assert "Traceback" not in log


# --- the scripted operator ------------------------------------------------------------------------


class Field:
    """A vehicle that follows sticks at once, and an autopilot that answers after a while."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.x = self.y = self.z = self.yaw = 0.0
        self.state = "landed"
        self.mode = "manual"
        self.requests: list[tuple[dict[str, Any], float]] = []
        self.answer_after_s = 0.0
        self.lock = threading.Lock()
        self.sticks = client.collect("stick")
        self.queryable = client.session.declare_queryable(
            client.key("autopilot/decide"), self._decide
        )
        self.streams = Streams(client)
        self.streams.add("truth", 100.0, self._truth)
        self.streams.add(
            "vehicle", 10.0, lambda _: fresh("VehicleStatus", state=self.state, world="track")
        )
        self.streams.add("autopilot", 20.0, lambda _: fresh("AutopilotStatus", mode=self.mode))

    def _truth(self, _: float) -> dict[str, Any]:
        stick = self.sticks[-1] if self.sticks else {**NEUTRAL, "vx": 0.0}
        if self.state == "flying":
            self.x += 0.01 * stick["vx"]
            self.y += 0.01 * stick["vy"]
            self.z += 0.005 * stick["vz"]
        return fresh(
            "Pose",
            position=[self.x, self.y, self.z],
            velocity=[stick["vx"], stick["vy"], 0.5 * stick["vz"]],
        )

    def _decide(self, query: zenoh.Query) -> None:
        with query:
            request = msgpack.unpackb(query.payload.to_bytes())
            self.requests.append((request, deflection(self.sticks[-1])))
            time.sleep(self.answer_after_s)
            if request["action"] == "takeoff":
                self.state, self.z = "flying", 0.75
            elif request["action"] == "accept":
                self.mode = "engaged"
            reply = {"ok": True, "reason": "accepted", "mode": self.mode}
            query.reply(query.key_expr, msgpack.packb(reply))

    def wait_for(self, action: str, timeout_s: float = 15.0) -> tuple[dict[str, Any], float]:
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            for request, deflected in self.requests:
                if request["action"] == action:
                    return request, deflected
            time.sleep(0.02)
        raise AssertionError(f"nobody asked to {action} within {timeout_s} s")

    def close(self) -> None:
        self.streams.close()
        self.queryable.undeclare()


def test_the_scripted_operator_waits_takes_off_climbs_flies_and_accepts(
    router: zenoh.Session, port: int, launch: Launch
) -> None:
    with other(port, "script") as client:
        process = start_service(
            launch, client, "operator", "--source", "scripted", "--vehicle", "script"
        )
        health = client.next("health/operator")
        assert health["detail"].startswith("mission waiting (no vehicle, autopilot, truth)")
        assert set(health["rates"]) == {
            "console/stick",
            "truth",
            "autopilot",
            "suggestion",
            "vehicle",
        }

        with contextlib.closing(Field(client)) as field:
            field.answer_after_s = 0.6
            request, _ = field.wait_for("takeoff")
            assert isinstance(request["nonce"], int)
            # A slow answer must not stall the sticks.
            begin = len(field.sticks)
            time.sleep(0.5)
            assert len(field.sticks) - begin > 20
            field.answer_after_s = 0.0
            assert client.next("stick", lambda m: deflection(m) > 0.0)["vz"] > 0.0
            client.next("stick", lambda m: m["vx"] > 0.7)

            x, y, z = field.x, field.y, field.z
            path = [[x + 0.1 * i, y, z, 0.0] for i in range(200)]
            client.publish("suggestion", fresh("Suggestion", id=41, path=path))
            request, deflected = field.wait_for("accept", 5.0)
            assert request["suggestion"] == 41
            assert deflected == 0.0
            detail = client.next(
                "health/operator", lambda h: h["detail"].startswith("mission watching")
            )["detail"]
            assert "suggestions 1 accepted 1 takeovers 0" in detail
            assert all(deflection(m) == 0.0 for m in field.sticks[-5:])

            # A human at the console wins over the simulated one.
            with contextlib.closing(Streams(client)) as human:
                human.add("console/stick", 50.0, lambda t: {**NEUTRAL, "vy": 0.6 * (t > 0.1)})
                client.next("stick", lambda m: m["vy"] == 0.6)
        assert process.stop() == 0


def test_bad_input_on_any_topic_is_dropped_and_counted(
    router: zenoh.Session, port: int, launch: Launch
) -> None:
    with other(port, "bad") as client:
        process = start_service(
            launch, client, "operator", "--source", "scripted", "--vehicle", "bad"
        )
        client.collect("health/operator")
        with ThreadPoolExecutor(5) as pool:
            checks = [
                pool.submit(
                    assert_bad_input_is_dropped_and_counted, client, "operator", topic, message
                )
                for topic, message in (
                    ("console/stick", "Stick"),
                    ("truth", "Pose"),
                    ("autopilot", "AutopilotStatus"),
                    ("suggestion", "Suggestion"),
                    ("vehicle", "VehicleStatus"),
                )
            ]
        for check in checks:
            check.result()
        assert deflection(client.next("stick")) == 0.0
        assert process.stop() == 0


def test_it_starts_before_its_router_and_stops_without_one(tmp_path: Path) -> None:
    assert_starts_before_its_router("operator", "--source", "console", tmp_path=tmp_path)
    assert_stops_without_a_router("operator", "--source", "scripted", tmp_path=tmp_path)
