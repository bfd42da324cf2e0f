"""The autopilot as the contract has it: sticks, decisions, a path flown, take-over, losses."""

import itertools
import math
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
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

NEUTRAL = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0}
nonces = itertools.count(int(time.time()))
ids = itertools.count(1)


@pytest.fixture(scope="module")
def autopilot(launch: Launch, client: Client) -> Process:
    for topic in ("command", "autopilot", "health/autopilot"):
        client.collect(topic)
    return start_service(launch, client, "autopilot")


def velocity(command: dict[str, Any]) -> tuple[float, float, float, float]:
    return command["vx"], command["vy"], command["vz"], command["wz"]


class Drone:
    """Moves as it is commanded, half a second late, and tells where it is."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.commands = client.collect("command")
        self.place = [0.0, 0.0, 1.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.yaw = 0.0
        self.state = "flying"
        self.battery = 0.9
        self.stick = dict(NEUTRAL)
        self.sees = self.holds_pad = True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fly, daemon=True)
        self._thread.start()

    def _fly(self) -> None:
        begin, ticks = time.monotonic(), 0
        while not self._stop.is_set():
            self._move(0.02)
            if self.sees:
                self.client.publish("pose", self.pose())
            if self.holds_pad:
                self.client.publish("stick", self.stick)
            if ticks % 5 == 0:
                self.client.publish("vehicle", self.status())
            ticks += 1
            self._stop.wait(max(0.0, begin + 0.02 * ticks - time.monotonic()))

    def _move(self, dt: float) -> None:
        command = self.commands[-1] if self.commands else NEUTRAL
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        goals = (
            cos * command["vx"] - sin * command["vy"],
            sin * command["vx"] + cos * command["vy"],
            0.5 * command["vz"],
        )
        for axis, goal in enumerate(goals):
            self.velocity[axis] += dt / 0.4 * (goal - self.velocity[axis])
            self.place[axis] += dt * self.velocity[axis]
        self.yaw += dt * command["wz"]

    def pose(self) -> dict[str, Any]:
        message = {
            **GOOD["Pose"],
            "position": list(self.place),
            "velocity": list(self.velocity),
            "orientation": [0.0, 0.0, math.sin(self.yaw / 2), math.cos(self.yaw / 2)],
        }
        return {k: v for k, v in message.items() if k not in ("stamp", "seq")}

    def status(self) -> dict[str, Any]:
        message = {**GOOD["VehicleStatus"], "state": self.state, "battery": self.battery}
        return {k: v for k, v in message.items() if k not in ("stamp", "seq")}

    def line(self, length_m: float = 30.0, **more: Any) -> dict[str, Any]:
        """A suggestion along the nose from where it is."""
        x, y, z = self.place
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        path = [
            [x + 0.1 * i * cos, y + 0.1 * i * sin, z, self.yaw] for i in range(int(length_m * 10))
        ]
        return self._suggestion(path, **more)

    def circle(self, radius_m: float) -> dict[str, Any]:
        """A closed one, to the left from where it is, the nose kept where it points."""
        x, y, z = self.place
        path = []
        for i in range(40):
            angle = self.yaw + 2 * math.pi * i / 40
            east = radius_m * (math.sin(angle) - math.sin(self.yaw))
            north = radius_m * (math.cos(self.yaw) - math.cos(angle))
            path.append([x + east, y + north, z, math.remainder(self.yaw, 2 * math.pi)])
        return self._suggestion(path, closed=True)

    def _suggestion(self, path: list[list[float]], **more: Any) -> dict[str, Any]:
        message = {**GOOD["Suggestion"], "id": next(ids), "path": path, **more}
        return {k: v for k, v in message.items() if k not in ("stamp", "seq")}

    def suggest(self, suggestion: dict[str, Any]) -> int:
        self.client.publish("suggestion", suggestion)
        time.sleep(0.1)
        return int(suggestion["id"])

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


def decide(client: Client, action: str, **more: Any) -> dict[str, Any]:
    granted, reply = client.ask(
        "autopilot/decide", {"action": action, "nonce": next(nonces), **more}
    )
    assert granted, reply
    assert isinstance(reply["ok"], bool)
    return reply


@pytest.fixture
def drone(client: Client, autopilot: Process) -> Iterator[Drone]:
    """In the air, the pad in hand and neutral, the human in control."""
    drone = Drone(client)
    try:
        client.next("autopilot", lambda s: s["mode"] not in ("landed", "emergency"))
        time.sleep(0.15)
        assert decide(client, "cancel")["mode"] == "manual"
        yield drone
    finally:
        drone.close()


def engage(drone: Drone, suggestion: dict[str, Any]) -> int:
    number = drone.suggest(suggestion)
    reply = decide(drone.client, "accept", suggestion=number)
    assert reply == {"ok": True, "reason": "accepted", "mode": "engaged"}
    return number


class TestSticks:
    def test_in_manual_they_pass_through_at_once_and_unchanged(self, client, drone):
        commands = client.collect("command")
        sent: dict[float, float] = {}
        drone.holds_pad = False
        for i in range(60):
            value = 0.1 + i / 100
            sent[value] = time.monotonic()
            client.publish("stick", {"vx": value, "vy": -value, "vz": value / 2, "wz": -1.0})
            time.sleep(0.02)
        drone.holds_pad = True
        client.next("command", lambda c: velocity(c) == (0.0, 0.0, 0.0, 0.0))
        delays = []
        for command, arrival in zip(commands, commands.arrival_s, strict=False):
            if command["vx"] in sent:
                value = command["vx"]
                assert velocity(command) == (value, -value, value / 2, -1.0)
                assert (command["action"], command["mode"]) == ("fly", "manual")
                delays.append(arrival - sent.pop(value))
        assert not sent
        # The target of 10 ms is measured by `make bench`, not on a busy machine.
        assert sorted(delays)[len(delays) // 2] < 0.01

    def test_without_them_the_command_is_neutral_within_0_2_s(self, client, drone):
        drone.stick["vx"] = 0.5
        client.next("command", lambda c: c["vx"] == 0.5)
        drone.holds_pad = False
        begin = time.monotonic()
        command = client.next("command", lambda c: c["mode"] == "hover")
        assert velocity(command) == (0.0, 0.0, 0.0, 0.0)
        assert 0.15 < time.monotonic() - begin < 0.5
        assert client.next("autopilot")["reason"] == "stick_lost"

        # They return deflected: they count only after they were neutral.
        drone.holds_pad = True
        time.sleep(0.3)
        assert velocity(client.next("command")) == (0.0, 0.0, 0.0, 0.0)
        drone.stick["vx"] = 0.0
        time.sleep(0.1)
        drone.stick["vx"] = 0.5
        assert client.next("command", lambda c: c["vx"] == 0.5)["mode"] == "manual"


class TestDecide:
    def test_an_accepted_line_is_flown_to_its_end(self, client, drone):
        height = drone.place[2]
        suggestion = drone.line(1.2)
        engage(drone, suggestion)
        assert client.next("command")["mode"] == "engaged"
        status = client.next("autopilot", lambda s: s["progress"] > 0.4)
        assert (status["mode"], status["reason"]) == ("engaged", "accepted")
        assert status["suggestion"] == suggestion["id"]
        assert abs(status["cross_track"]) < 0.2
        status = client.next("autopilot", lambda s: s["mode"] != "engaged")
        assert (status["mode"], status["reason"], status["suggestion"]) == ("hover", "finished", 0)
        time.sleep(0.5)
        assert math.dist(drone.place, suggestion["path"][-1][:3]) < 0.3
        assert drone.place[2] == pytest.approx(height, abs=0.1)

    def test_a_closed_path_is_flown_again_until_any_stick_moves(self, client, drone):
        engage(drone, drone.circle(0.2))
        client.next("autopilot", lambda s: s["progress"] > 2.0 * math.pi * 0.2 * 1.05)
        drone.stick["wz"] = -0.06
        command = client.next("command", lambda c: c["mode"] != "engaged")
        assert (command["mode"], velocity(command)) == ("manual", (0.0, 0.0, 0.0, -0.06))
        assert client.next("autopilot")["reason"] == "stick"

    def test_cancel_gives_control_back(self, client, drone):
        engage(drone, drone.line())
        assert decide(client, "cancel") == {"ok": True, "reason": "cancelled", "mode": "manual"}
        assert velocity(client.next("command")) == (0.0, 0.0, 0.0, 0.0)

    def test_the_same_nonce_gets_the_same_answer_and_no_second_effect(self, client, drone):
        number = drone.suggest(drone.line())
        request = {"action": "accept", "nonce": next(nonces), "suggestion": number}
        first = client.ask("autopilot/decide", request)
        decide(client, "cancel")
        assert client.ask("autopilot/decide", request) == first
        assert first[1]["ok"]
        assert client.next("autopilot")["mode"] == "manual"

    def test_without_an_id_the_newest_is_accepted(self, client, drone):
        drone.suggest(drone.line())
        number = drone.suggest(drone.line())
        assert decide(client, "accept")["ok"]
        assert client.next("autopilot")["suggestion"] == number

    def test_what_cannot_be_accepted_is_refused_with_the_reason(self, client, drone):
        old = drone.suggest(drone.line())
        assert decide(client, "accept", suggestion=next(ids) + 1000) == {
            "ok": False,
            "reason": "unknown",
            "mode": "manual",
        }
        drone.stick["vy"] = 0.3
        time.sleep(0.1)
        assert decide(client, "accept", suggestion=old)["reason"] == "stick"
        drone.stick["vy"] = 0.0
        drone.sees = False
        time.sleep(0.3)
        assert decide(client, "accept", suggestion=old)["reason"] == "pose_lost"
        drone.sees = True
        drone.state = "landed"
        client.next("autopilot", lambda s: s["mode"] == "landed")
        number = drone.suggest(drone.line())
        reply = decide(client, "accept", suggestion=number)
        assert (reply["ok"], reply["reason"], reply["mode"]) == (False, "landed", "landed")

    def test_a_path_beyond_the_fence_and_one_on_a_low_battery_are_refused(self, client, drone):
        far = drone.line(5.0)
        far["path"][-1][0] += 150.0
        assert decide(client, "accept", suggestion=drone.suggest(far))["reason"] == "geofence"
        drone.battery = 0.15
        client.next("health/autopilot", lambda h: "battery 15%" in h["detail"])
        number = drone.suggest(drone.line())
        assert decide(client, "accept", suggestion=number)["reason"] == "battery_low"
        drone.battery = 0.04
        command = client.next("command", lambda c: c["action"] == "land")
        assert velocity(command) == (0.0, 0.0, 0.0, 0.0)
        drone.stick["vx"] = 0.5
        client.next("command", lambda c: (c["action"], c["vx"]) == ("fly", 0.5))

    def test_takeoff_land_and_emergency_reach_the_vehicle(self, client, drone):
        drone.state = "landed"
        client.next("autopilot", lambda s: s["mode"] == "landed")
        assert decide(client, "takeoff")["ok"]
        client.next("command", lambda c: c["action"] == "takeoff")
        drone.state = "flying"
        client.next("autopilot", lambda s: s["mode"] == "hover")
        assert client.next("command")["action"] == "fly"
        assert decide(client, "land")["ok"]
        client.next("command", lambda c: c["action"] == "land")
        drone.stick["vx"] = 0.5
        client.next("command", lambda c: c["action"] == "fly" and c["vx"] == 0.5)
        assert decide(client, "emergency") == {
            "ok": True,
            "reason": "emergency",
            "mode": "emergency",
        }
        assert client.next("command")["action"] == "emergency"
        assert velocity(client.next("command")) == (0.0, 0.0, 0.0, 0.0)
        drone.stick["vx"] = 0.0
        drone.state = "landed"
        time.sleep(0.2)
        assert client.next("autopilot")["mode"] == "emergency"
        assert decide(client, "takeoff")["ok"]
        client.next("command", lambda c: c["action"] == "takeoff")
        drone.state = "flying"
        client.next("autopilot", lambda s: s["mode"] == "hover")

    @pytest.mark.parametrize(
        ("request_", "field"),
        [
            ({"action": "accept"}, "nonce"),
            ({"nonce": 1}, "action"),
            ({"action": "dance", "nonce": 1}, "action"),
            ({"action": "accept", "nonce": "one"}, "nonce"),
            ({"action": "accept", "nonce": 1, "suggestion": -4}, "suggestion"),
            ({"action": "accept", "nonce": float("nan")}, "nonce"),
            ([1, 2, 3], None),
            (b"", None),
            (b"\xc1" * 1_000_000, None),
        ],
    )
    def test_a_bad_request_gets_an_error_that_names_the_field(
        self, client, autopilot, request_, field
    ):
        granted, reply = client.ask("autopilot/decide", request_)
        assert not granted
        assert reply["error"]
        assert reply.get("field") == field


class TestLosses:
    def test_without_a_pose_it_holds_and_then_hovers(self, client, drone):
        engage(drone, drone.line())
        client.next("command", lambda c: c["vx"] > 0.2)
        drone.sees = False
        begin = time.monotonic()
        client.next("command", lambda c: velocity(c) == (0.0, 0.0, 0.0, 0.0))
        assert time.monotonic() - begin < 0.4
        status = client.next("autopilot", lambda s: s["mode"] == "hover", timeout_s=1.0)
        assert status["reason"] == "pose_lost"
        drone.sees = True
        time.sleep(0.2)
        assert velocity(client.next("command")) == (0.0, 0.0, 0.0, 0.0)

    def test_without_sticks_it_hovers_and_after_5_s_it_lands(self, client, drone):
        old = engage(drone, drone.line())
        client.next("command", lambda c: c["vx"] > 0.2)
        drone.holds_pad = False
        begin = time.monotonic()
        status = client.next("autopilot", lambda s: s["mode"] == "hover", timeout_s=1.0)
        assert status["reason"] == "stick_lost"
        command = client.next("command", lambda c: c["action"] == "land", timeout_s=6.0)
        assert velocity(command) == (0.0, 0.0, 0.0, 0.0)
        assert 4.5 < time.monotonic() - begin < 6.0

        # Who comes back stops the landing; what was suggested before is stale by now.
        drone.holds_pad = True
        time.sleep(0.1)
        drone.stick["vz"] = 0.5
        client.next(
            "command", lambda c: (c["action"], c["mode"], c["vz"]) == ("fly", "manual", 0.5)
        )
        drone.stick["vz"] = 0.0
        time.sleep(0.1)
        reply = decide(client, "accept", suggestion=old)
        assert (reply["ok"], reply["reason"]) == (False, "stale")


def test_commands_and_status_come_at_their_rates_in_order(client, drone):
    decide(client, "land")
    commands, statuses = client.collect("command"), client.collect("autopilot")
    counts = []
    for _ in range(5):
        at = len(commands), len(statuses)
        time.sleep(1.0)
        counts.append((len(commands) - at[0], len(statuses) - at[1]))
        if counts[-1][0] >= 45 and counts[-1][1] >= 18:
            break
    # A busy machine may miss periods; they are never made up.
    assert counts[-1][0] >= 45, counts
    assert counts[-1][1] >= 18, counts
    assert all(many <= 55 and few <= 23 for many, few in counts), counts
    for topic, name in (("command", "Command"), ("autopilot", "AutopilotStatus")):
        collected = client.collect(topic)
        assert set(collected.encodings) == {f"application/msgpack;{name}/1"}
        assert [b["seq"] - a["seq"] for a, b in itertools.pairwise(collected)] == [1] * (
            len(collected) - 1
        )
        assert all(a["stamp"] <= b["stamp"] for a, b in itertools.pairwise(collected))
    decide(client, "cancel")


def test_bad_input_is_dropped_and_counted(client, autopilot):
    topics = {
        "stick": "Stick",
        "pose": "Pose",
        "suggestion": "Suggestion",
        "vehicle": "VehicleStatus",
    }
    with ThreadPoolExecutor() as pool:
        checks = [
            pool.submit(
                assert_bad_input_is_dropped_and_counted, client, "autopilot", topic, message
            )
            for topic, message in topics.items()
        ]
        for check in checks:
            check.result()


def test_health_tells_rates_and_what_is_missing(client, autopilot, streams: Streams):
    health = client.next("health/autopilot", lambda h: h["rates"]["stick"] == 0.0)
    assert health["service"] == "autopilot"
    assert health["state"] == "degraded"
    assert "no sticks" in health["detail"]
    streams.add("stick", 50.0, lambda _: NEUTRAL)
    health = client.next("health/autopilot", lambda h: h["rates"]["stick"] > 45.0)
    assert "no sticks" not in health["detail"]
    assert 0.0 < health["latency_p50"] <= health["latency_p99"] < 0.1
    assert set(health["rates"]) == set(health["rejected"])
    assert set(health["rates"]) == {"stick", "pose", "suggestion", "vehicle"}


def test_a_configuration_that_cannot_be_used_ends_it_with_2(launch):
    process = launch("autopilot", "--dead-band", "1.5")
    assert process.popen.wait(20.0) == 2
    assert "dead_band" in process.log.read_text()


def test_it_starts_before_its_router(tmp_path: Path):
    assert_starts_before_its_router("autopilot", tmp_path=tmp_path)


def test_it_stops_without_a_router(tmp_path: Path):
    assert_stops_without_a_router("autopilot", tmp_path=tmp_path)


def test_it_stops_on_sigterm(client, autopilot):
    assert autopilot.stop() == 0
    assert "autopilot" not in client.alive()
