"""The simulator, seen from the network only."""

import math
import struct
import subprocess
import sys
import time
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

STREAMS = {
    "imu": ("Imu", 200.0),
    "truth": ("Pose", 100.0),
    "altimeter": ("Range", 25.0),
    "camera/front": ("Image", 30.0),
    "camera/down": ("Image", 60.0),
}
STILL = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0, "action": "fly", "mode": "manual"}


@pytest.fixture(scope="module")
def sim(launch: Launch, client: Client) -> Process:
    process = start_service(launch, client, "sim", "--seed", "3")
    client.next("camera/front", timeout_s=30.0)
    return process


@pytest.fixture
def aloft(sim: Process, client: Client) -> dict[str, Any]:
    """A vehicle in the air at a known place of the empty world."""
    granted, status = client.ask(
        "sim/reset", {"world": "empty", "position": [1.0, 2.0, 1.5], "yaw": 0.5, "seed": 1}
    )
    assert granted, status
    return status


def steer(streams: Streams, **fields: Any) -> None:
    streams.add("command", 50.0, lambda _t: {**STILL, **fields})


def jpeg_size(data: bytes) -> tuple[int, int]:
    """Width and height in a JPEG's frame header."""
    assert data[:2] == b"\xff\xd8"
    at = 2
    while data[at + 1] not in (0xC0, 0xC1, 0xC2):
        at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0]
    height, width = struct.unpack(">HH", data[at + 5 : at + 9])
    return width, height


def test_streams_are_messages_of_the_contract_at_its_rates(sim: Process, client: Client) -> None:
    streams = {topic: client.collect(topic) for topic in STREAMS}
    time.sleep(0.2)
    begun = {topic: len(collected) for topic, collected in streams.items()}
    time.sleep(3.0)
    for topic, (message, rate_hz) in STREAMS.items():
        collected = streams[topic][begun[topic] :]
        assert set(streams[topic].encodings) == {f"application/msgpack;{message}/1"}
        sequence = [each["seq"] for each in collected]
        assert sequence == sorted(set(sequence))
        span_s = (collected[-1]["stamp"] - collected[0]["stamp"]) / 1e9
        share = (len(collected) - 1) / span_s / rate_hz
        # Pictures are dropped on a busy machine, samples of other sensors are not.
        assert share == pytest.approx(1.0, abs=0.02) or ("camera" in topic and share > 0.3)


def test_sensors_of_a_vehicle_that_stands_still(sim: Process, client: Client) -> None:
    client.ask("sim/reset", {"world": "track", "position": [0.0, 0.0, 0.0], "yaw": 0.0})
    time.sleep(0.5)
    imu = client.next("imu")
    assert imu["linear_acceleration"][2] == pytest.approx(9.81, abs=2.0)
    assert len(imu["angular_velocity"]) == len(imu["magnetic_field"]) == 3
    altimeter = client.next("altimeter")
    assert altimeter["range"] == pytest.approx(0.055, abs=0.05)
    assert (altimeter["min"], altimeter["max"]) == (0.01, 3.0)
    truth = client.next("truth")
    assert truth["position"] == pytest.approx([0.0, 0.0, 0.055], abs=0.01)
    assert truth["orientation"] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=0.01)
    assert truth["source"] == "truth"
    status = client.next("vehicle")
    assert (status["state"], status["world"], status["plant"]) == ("landed", "track", "tum")
    assert (status["collisions"], status["battery"]) == (0, 1.0)


def test_pictures_are_jpeg_of_the_size_and_lens_they_state(
    aloft: dict[str, Any], client: Client
) -> None:
    for topic, size, view_rad in (
        ("camera/front", (640, 360), math.radians(81.0)),
        ("camera/down", (320, 240), math.radians(53.13)),
    ):
        picture = client.next(topic)
        assert picture["format"] == "jpeg"
        assert (picture["width"], picture["height"]) == size == jpeg_size(picture["data"])
        focal = size[0] / 2.0 / math.tan(view_rad / 2.0)
        assert picture["intrinsics"] == pytest.approx(
            [focal, focal, size[0] / 2.0, size[1] / 2.0], rel=1e-3
        )
        assert picture["distortion"] == [0.0] * 4
        assert picture["capture"] == picture["stamp"]
        assert len(picture["data"]) > 3000


def test_take_off_flight_and_landing_by_commands(
    sim: Process, client: Client, streams: Streams
) -> None:
    client.ask("sim/reset", {"world": "empty", "position": [0.0, 0.0, 0.0], "yaw": 0.0})
    steer(streams, action="takeoff")
    client.next("vehicle", lambda v: v["state"] == "taking_off")
    client.next("vehicle", lambda v: v["state"] == "flying")
    streams.close()
    steer(streams, vx=0.5)
    client.next("truth", lambda p: p["velocity"][0] > 0.4)
    streams.close()
    # Silence: it hovers by itself.
    client.next("truth", lambda p: abs(p["velocity"][0]) < 0.15)
    steer(streams, action="land")
    client.next("vehicle", lambda v: v["state"] == "landing")
    client.next("vehicle", lambda v: v["state"] == "landed")
    assert client.next("truth")["position"][2] < 0.1


def test_sticks_mean_speed_in_the_heading_frame(
    aloft: dict[str, Any], client: Client, streams: Streams
) -> None:
    assert aloft["state"] == "flying"
    steer(streams, vx=0.5, vy=0.5)
    pose = client.next("truth", lambda p: math.hypot(*p["velocity"][:2]) > 0.6)
    heading = math.atan2(pose["velocity"][1], pose["velocity"][0])
    assert heading == pytest.approx(0.5 + math.pi / 4.0, abs=0.3)


def test_emergency_drops_it(aloft: dict[str, Any], client: Client, streams: Streams) -> None:
    steer(streams, action="emergency")
    client.next("vehicle", lambda v: v["state"] == "emergency")
    client.next("truth", lambda p: p["position"][2] < 0.2)


def test_a_crash_into_a_fence_is_counted(sim: Process, client: Client, streams: Streams) -> None:
    client.ask("sim/reset", {"world": "track", "position": [3.0, 0.8, 1.0], "yaw": 0.0})
    steer(streams, vy=1.0)
    assert client.next("vehicle", lambda v: v["collisions"] > 0)["collisions"] == 1


def test_bad_commands_are_dropped_and_counted(aloft: dict[str, Any], client: Client) -> None:
    assert_bad_input_is_dropped_and_counted(client, "sim", "command", "Command")
    assert client.next("vehicle")["state"] == "flying"
    assert all(abs(v) < 0.3 for v in client.next("truth")["velocity"])


def test_worlds_are_named(sim: Process, client: Client) -> None:
    for request in ({}, {"unknown": 1}):
        granted, reply = client.ask("sim/worlds", request)
        assert granted
        assert {"empty", "track"} <= set(reply["worlds"])


def test_reset_starts_anew_in_place_and_soon(sim: Process, client: Client) -> None:
    took_s = []
    for world in ("track", "empty", "track"):
        begin_s = time.monotonic()
        granted, status = client.ask(
            "sim/reset", {"world": world, "position": [2.0, 0.0, 1.0], "yaw": 1.0, "seed": 9}
        )
        took_s.append(time.monotonic() - begin_s)
        assert granted
        assert (status["world"], status["state"], status["collisions"]) == (world, "flying", 0)
        pose = client.next("truth", lambda p: math.dist(p["position"], (2.0, 0.0, 1.0)) < 0.1)
        assert 2.0 * math.asin(pose["orientation"][2]) == pytest.approx(1.0, abs=0.1)
    assert min(took_s) < 0.5


@pytest.mark.parametrize(
    ("request_", "field", "allowed"),
    [
        ({"world": "nowhere"}, "world", "track"),
        ({"plant": "zeppelin"}, "plant", "ardrone"),
        ({"position": [0.0, 0.0, -5.0]}, "position", "0..100"),
        ({"position": [4.5, 4.2, 0.5], "world": "track"}, "position", "free"),
        ({"position": [0.0, 0.0]}, "position", ""),
        ({"position": [0.0, 0.0, float("nan")]}, "position", ""),
        ({"yaw": float("inf")}, "yaw", ""),
        ({"yaw": "north"}, "yaw", ""),
        ({"seed": -1}, "seed", ""),
        ({"world": 7}, "world", ""),
        (b"", None, ""),
        (b"\xc1" * 1000, None, ""),
        ([1, 2, 3], None, ""),
    ],
)
def test_a_bad_reset_is_refused_with_the_field_and_what_is_allowed(
    aloft: dict[str, Any], client: Client, request_: Any, field: str | None, allowed: str
) -> None:
    granted, error = client.ask("sim/reset", request_)
    assert not granted
    assert error.get("field") == field
    assert allowed in error["error"]
    assert client.next("vehicle")["world"] == "empty"
    assert client.next("truth")["position"][2] > 1.0


def test_unknown_fields_are_ignored(
    aloft: dict[str, Any], client: Client, streams: Streams
) -> None:
    granted, _ = client.ask("sim/reset", {"flavour": "new", "seed": 2})
    assert granted
    good = {k: v for k, v in GOOD["Command"].items() if k not in ("stamp", "seq")}
    streams.add("command", 50.0, lambda _t: {**good, "vx": 0.6, "more": {"deep": [1]}})
    client.next("truth", lambda p: math.hypot(*p["velocity"][:2]) > 0.4)


def test_health_names_the_renderer_and_the_real_time_factor(sim: Process, client: Client) -> None:
    health = client.next("health/sim")
    assert health["service"] == "sim"
    assert health["state"] in ("ok", "degraded")
    assert "moderngl" in health["detail"] or "TinyRenderer" in health["detail"]
    assert "real-time factor" in health["detail"]
    assert set(health["rates"]) == set(health["rejected"]) == {"command"}
    assert 0.0 <= health["latency_p50"] <= health["latency_p99"]
    assert client.collect("health/sim").encodings[-1] == "application/msgpack;Health/1"


def test_it_is_alive_until_it_is_stopped(launch: Launch, client: Client, sim: Process) -> None:
    assert "sim" in client.alive()
    assert sim.stop() == 0
    time.sleep(0.3)
    assert "sim" not in client.alive()


def test_it_starts_before_its_router(tmp_path: Path) -> None:
    assert_starts_before_its_router("sim", "--renderer", "none", tmp_path=tmp_path)


def test_it_stops_without_a_router(tmp_path: Path) -> None:
    assert_stops_without_a_router("sim", tmp_path=tmp_path)


@pytest.mark.parametrize(
    ("flags", "named"),
    [(["--plant", "zeppelin"], "plant"), (["--world", "nowhere"], "world")],
)
def test_a_wrong_flag_ends_it_with_one_line_that_names_it(flags: list[str], named: str) -> None:
    command = [str(Path(sys.executable).with_name("autocomplete")), "run", "sim", *flags]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 2
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
