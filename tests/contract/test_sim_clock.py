"""The simulator in lock-step, seen from the network only: it waits for commands, and loses none."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from conftest import Client, Launch, Process, start_service

STILL = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0, "action": "fly", "mode": "manual"}
STEPS_A_COMMAND = 4
"""20 ms of the IMU's 200 Hz."""
MULE = "locked-mule"


@pytest.fixture(scope="module")
def sim(launch: Launch, client: Client) -> Process:
    flags = ("--clock", "lockstep", "--renderer", "none", "--vehicles", f"tum,{MULE}=rover")
    return start_service(launch, client, "sim", *flags)


@pytest.fixture(scope="module")
def mule(sim: Process, client: Client, port: int) -> Iterator[Client]:
    with contextlib.closing(Client(port, MULE)) as other:
        other.wait_alive("sim")
        yield other


def drive(client: Client, mule: Client, commands: int) -> list[dict[str, Any]]:
    """What the IMU says in so many commands, each sent when the one before is done."""
    imu = client.collect("imu")
    begin = len(imu)
    for count in range(commands):
        client.publish("command", {**STILL, "vx": 0.4})
        mule.publish("command", {**STILL, "vx": 0.5})
        wait_for(lambda count=count: len(imu) == begin + (count + 1) * STEPS_A_COMMAND)
    return list(imu[begin:])


def wait_for(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10.0
    while not done():
        assert time.monotonic() < deadline, "it stands still"
        time.sleep(0.001)


def test_it_waits_for_the_command_of_each(sim: Process, client: Client, mule: Client) -> None:
    imu = client.collect("imu")
    time.sleep(0.5)
    assert imu == []
    client.publish("command", STILL)
    health = client.next("health/sim", lambda h: MULE in h["detail"])
    assert f"waiting for a command of {MULE}" in health["detail"]
    assert imu == []
    mule.publish("command", STILL)
    wait_for(lambda: len(imu) == STEPS_A_COMMAND)
    time.sleep(0.3)
    assert len(imu) == STEPS_A_COMMAND
    assert [each["stamp"] for each in imu] == [5_000_000 * step for step in range(1, 5)]


def test_a_seed_is_the_same_flight_again(sim: Process, client: Client, mule: Client) -> None:
    flights = []
    for seed in (7, 7, 8):
        place = {"world": "empty", "position": [0.0, 0.0, 1.0], "yaw": 0.0, "seed": seed}
        granted, status = client.ask("sim/reset", place)
        assert granted, status
        begin_ns = status["stamp"]
        said = drive(client, mule, 25)
        for each in said:
            each["stamp"] -= begin_ns
            del each["seq"]
        flights.append(said)
        drive(client, mule, 3)
    assert flights[0] == flights[1] != flights[2]


def test_no_action_is_lost_while_another_vehicle_is_silent(
    sim: Process, client: Client, mule: Client
) -> None:
    assert client.ask("sim/reset", {"world": "empty", "position": [0.0, 0.0, 0.0]})[0]
    states, imu = client.collect("vehicle"), client.collect("imu")
    begin, end = len(states), len(imu) + 61 * STEPS_A_COMMAND
    # Simulated time stands still meanwhile, so none is too old.
    client.publish("command", {**STILL, "action": "takeoff"})
    for _ in range(60):
        client.publish("command", STILL)
        time.sleep(0.01)
    for _ in range(61):
        mule.publish("command", STILL)
        time.sleep(0.002)
    wait_for(lambda: len(imu) == end)
    assert "taking_off" in {each["state"] for each in states[begin:]}
