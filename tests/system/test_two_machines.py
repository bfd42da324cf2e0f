"""Robot side and display side on two machines, a router on a third: network namespaces.

Everything is started and watched by the command line inside the namespaces, as on real machines.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

COMMAND = str(Path(sys.executable).with_name("autocomplete"))
VEHICLE = "split"
SUBNET = "10.213.77"
ROUTER = f"tcp/{SUBNET}.1:7447"
MACHINES = {"router": 1, "robot": 2, "display": 3}
ROBOT_SIDE = ("sim", "localizer", "autopilot", "classifier", "synthesis")
FLIGHT_TIMEOUT_S = 120.0


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


def namespace(machine: str) -> str:
    return f"ac{os.getpid()}{machine}"


@pytest.fixture
def machines() -> Iterator[None]:
    """Three namespaces on one bridge, which lies in the router's."""
    made: list[str] = []
    try:
        try:
            for machine in MACHINES:
                ip("netns", "add", namespace(machine))
                made.append(namespace(machine))
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no network namespaces here: {error}")
        hub = namespace("router")
        ip("-n", hub, "link", "add", "bridge0", "type", "bridge")
        ip("-n", hub, "addr", "add", f"{SUBNET}.1/24", "dev", "bridge0")
        for machine, number in MACHINES.items():
            ip("-n", namespace(machine), "link", "set", "lo", "up")
            if machine == "router":
                continue
            # Both ends are made inside namespaces, so that nothing appears on this machine.
            there = namespace(machine)
            ip("-n", hub, "link", "add", machine, "type", "veth", "peer", "eth0", "netns", there)
            ip("-n", hub, "link", "set", machine, "master", "bridge0", "up")
            ip("-n", there, "addr", "add", f"{SUBNET}.{number}/24", "dev", "eth0")
            ip("-n", there, "link", "set", "eth0", "up")
        ip("-n", hub, "link", "set", "bridge0", "up")
        yield
    finally:
        for name in made:
            ip("netns", "delete", name)


class Machine:
    """Runs commands in one namespace and ends them all."""

    def __init__(self, name: str, logs: Path) -> None:
        self.name = name
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def _words(self, *words: str) -> list[str]:
        return ["ip", "netns", "exec", namespace(self.name), COMMAND, *words]

    def start(self, label: str, *words: str) -> None:
        with (self._logs / f"{label}.log").open("wb") as sink:
            self._processes[label] = subprocess.Popen(
                self._words(*words),
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                env={**os.environ, "OMP_NUM_THREADS": "1", "SDL_VIDEODRIVER": "dummy"},
            )

    def start_service(self, service: str, *flags: str) -> None:
        self.start(service, "run", service, "--connect", ROUTER, "--vehicle", VEHICLE, *flags)

    def ask(self, *words: str) -> str:
        network = ("--connect", ROUTER, "--vehicle", VEHICLE)
        return subprocess.run(
            self._words(*words, *network), check=True, capture_output=True, text=True, timeout=30
        ).stdout

    def wait_for(self, topic: str, accept: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first message on a topic that `accept` likes, as this machine sees it."""
        words = self._words("echo", topic, "--connect", ROUTER, "--vehicle", VEHICLE)
        last: dict[str, Any] = {}
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as echo:
            assert echo.stdout is not None
            deadline = time.monotonic() + FLIGHT_TIMEOUT_S
            try:
                for line in echo.stdout:
                    last = json.loads(line)
                    if accept(last):
                        return last
                    if time.monotonic() > deadline:
                        break
                    self.check()
            finally:
                echo.send_signal(signal.SIGTERM)
        raise AssertionError(f"no such message on {topic}; the last one was {last}\n{self.tails()}")

    def check(self) -> None:
        for label, process in self._processes.items():
            assert process.poll() is None, f"{label} ended\n{self.tails()}"

    def tails(self) -> str:
        return "\n".join(
            f"{path.name}: {path.read_text()[-400:]}" for path in sorted(self._logs.iterdir())
        )

    def close(self) -> None:
        for process in self._processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        codes = {label: process.wait(10.0) for label, process in self._processes.items()}
        assert set(codes.values()) <= {0}, codes


def test_robot_side_and_display_side_fly_together(machines: None, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        router, robot, display = (
            stack.enter_context(contextlib.closing(Machine(name, tmp_path))) for name in MACHINES
        )
        router.start("router", "router", "--listen", ROUTER)
        for service in ROBOT_SIDE:
            robot.start_service(service)
        display.start_service("overlay")
        display.start_service("operator", "--source", "scripted", "--world", "track")

        display.wait_for("vehicle", lambda vehicle: vehicle["state"] == "flying")
        engaged = display.wait_for("autopilot", lambda status: status["mode"] == "engaged")
        assert engaged["suggestion"] > 0
        assert engaged["reason"] == "accepted"
        flown = display.wait_for("autopilot", lambda status: status["progress"] > 1.0)
        assert flown["suggestion"] >= engaged["suggestion"]
        vehicle = display.wait_for("vehicle", lambda _: True)
        assert vehicle["collisions"] == 0

        snapshot = json.loads(display.ask("topics", "--json"))
        assert set(snapshot["alive"]) == {*ROBOT_SIDE, "overlay", "operator"}
        counts = {row["topic"]: row["count"] for row in snapshot["topics"]}
        for topic in ("camera/front", "overlay/front", "pose", "stick", "command", "truth"):
            assert counts[topic] > 0, topic
        for machine in (router, robot, display):
            machine.check()
