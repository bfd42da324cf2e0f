"""Several vehicles in one simulator, seen from the network only; one of them drives."""

import contextlib
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import Client, Launch, Process, Streams, start_service

STILL = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0, "action": "fly", "mode": "manual"}
MULE = "mule"


@pytest.fixture(scope="module")
def sim(launch: Launch, client: Client, others: list[Client]) -> Process:
    process = start_service(
        launch,
        client,
        "sim",
        *("--vehicles", f"tum,ardrone,{MULE}=rover"),
        *("--world", "empty", "--renderer", "none", "--command-noise", "0"),
    )
    for other in others:
        other.wait_alive("sim")
    return process


@pytest.fixture(scope="module")
def others(client: Client, port: int, vehicle: str) -> Iterator[list[Client]]:
    """The second vehicle, whose name counts on from the first's, and the rover."""
    number = int(vehicle.removeprefix("test"))
    clients = [Client(port, f"test{number + 1}"), Client(port, MULE)]
    yield clients
    for each in clients:
        each.close()


@contextlib.contextmanager
def steering(client: Client, **fields: Any) -> Iterator[None]:
    streams = Streams(client)
    streams.add("command", 50.0, lambda _t: {**STILL, **fields})
    yield
    streams.close()


def reset(client: Client, position: list[float], **more: Any) -> dict[str, Any]:
    granted, status = client.ask("sim/reset", {"position": position, **more})
    assert granted, status
    return status


def place(client: Client) -> list[float]:
    position: list[float] = client.next("truth")["position"]
    return position


def test_each_answers_under_its_own_name(
    sim: Process, client: Client, others: list[Client]
) -> None:
    plants = []
    for each in (client, *others):
        assert "sim" in each.alive()
        health = each.next("health/sim", lambda h: "3 vehicles" in h["detail"])
        assert health["rates"] == {"command": 0.0}
        for topic in ("imu", "truth", "altimeter"):
            each.next(topic)
        plants.append(each.next("vehicle")["plant"])
        assert "track" in each.ask("sim/worlds", {})[1]["worlds"]
    assert plants == ["tum", "ardrone", "rover"]
    places = [place(each) for each in (client, *others)]
    assert math.dist(places[0], places[1]) > 0.8 < math.dist(places[1], places[2])


def test_a_command_moves_only_whom_it_is_for(
    sim: Process, client: Client, others: list[Client]
) -> None:
    reset(client, [0.0, 0.0, 0.0])
    reset(others[0], [0.0, 4.0, 2.0])
    reset(others[1], [0.0, 8.0, 0.0], yaw=0.0)
    before = [place(client), place(others[1])]
    with steering(others[0], vx=1.0):
        others[0].next("truth", lambda p: p["velocity"][0] > 0.5, 15.0)
    after = [place(client), place(others[1])]
    assert after == [pytest.approx(each, abs=0.02) for each in before]


def test_they_collide_and_say_so(sim: Process, client: Client, others: list[Client]) -> None:
    reset(client, [0.0, 0.0, 1.5], yaw=0.0)
    assert reset(others[0], [1.2, 0.0, 1.5])["collisions"] == 0
    # The second one is pushed by the first: both have touched something.
    hit = threading.Thread(
        target=others[0].next, args=("vehicle", lambda v: v["collisions"] > 0, 20.0)
    )
    hit.start()
    with steering(client, vx=1.0):
        client.next("vehicle", lambda v: v["collisions"] > 0, 20.0)
        hit.join()
    assert others[0].next("vehicle")["collisions"] > 0


def test_a_reset_of_one_leaves_the_others_where_they_are(
    sim: Process, client: Client, others: list[Client]
) -> None:
    reset(others[0], [5.0, 5.0, 0.0])
    reset(others[1], [-5.0, 5.0, 0.0])
    before = place(others[1])
    status = reset(client, [3.0, -3.0, 1.0])
    assert status["state"] == "flying"
    assert place(others[1]) == pytest.approx(before, abs=0.01)
    refused, error = client.ask("sim/reset", {"position": [-5.0, 5.0, 0.1]})
    assert not refused
    assert error["field"] == "position"
    assert "free" in error["error"]
    # A world is everybody's.
    assert client.ask("sim/reset", {"world": "pole"})[1]["world"] == "pole"
    assert others[1].next("vehicle")["world"] == "pole"
    assert client.ask("sim/reset", {"world": "empty"})[1]["world"] == "empty"


def test_the_rover_drives_a_square_by_sticks_through_the_autopilot(
    sim: Process, port: int, others: list[Client], tmp_path: Path
) -> None:
    rover = others[1]
    reset(rover, [0.0, 20.0, 0.0], yaw=0.0)
    autopilot = Process(port, MULE, "autopilot", [], tmp_path / "autopilot.log")
    sticks = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0}
    streams = Streams(rover)
    try:
        rover.wait_alive("autopilot")
        streams.add("stick", 50.0, lambda _t: dict(sticks))
        rover.next("autopilot", lambda a: a["mode"] == "hover")
        yaw = 0.0
        for _ in range(4):
            begin = place(rover)
            hold(rover, sticks, "vx", lambda p, b=begin: math.dist(p["position"], b) > 0.7)
            rover.next("truth", lambda p: math.hypot(*p["velocity"]) < 0.05)
            yaw += math.pi / 2.0
            hold(rover, sticks, "wz", lambda p, y=yaw: math.cos(yaw_of(p) - y) > 0.96)
            rover.next("truth", lambda p: abs(p["angular_velocity"][2]) < 0.05)
        end = rover.next("truth")
        assert math.dist(end["position"][:2], (0.0, 20.0)) < 0.6
        assert end["position"][2] == pytest.approx(0.125, abs=0.01)
        ok, answer = rover.ask("autopilot/decide", {"action": "takeoff", "nonce": 1})
        assert ok
        assert (answer["ok"], answer["reason"]) == (False, "flying")
        assert rover.ask("autopilot/decide", {"action": "emergency", "nonce": 2})[1]["ok"]
        rover.next("vehicle", lambda v: v["state"] in ("emergency", "landed"))
    finally:
        streams.close()
        assert autopilot.stop() == 0


def hold(
    rover: Client, sticks: dict[str, float], axis: str, done: Callable[[dict[str, Any]], bool]
) -> None:
    """Hold a stick until it is done; on a busy machine it may be lost and has to be let go."""
    for _ in range(8):
        sticks[axis] = 0.8
        try:
            rover.next("truth", done, 3.0)
            return
        except AssertionError:
            pass
        finally:
            sticks[axis] = 0.0
        time.sleep(0.3)
    raise AssertionError(f"{axis} does not do it")


def yaw_of(pose: dict[str, Any]) -> float:
    x, y, z, w = pose["orientation"]
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.parametrize(("vehicles", "named"), [("0", "1 to 16"), ("tum,zeppelin", "rover")])
def test_wrong_vehicles_end_it_with_one_line_that_names_them(vehicles: str, named: str) -> None:
    command = [str(Path(sys.executable).with_name("autocomplete")), "run", "sim"]
    done = subprocess.run(
        [*command, "--vehicles", vehicles], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 2
    assert "vehicles" in done.stderr
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
