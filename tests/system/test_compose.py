"""`docker compose up` flies the mission: images built, healthy, seen at the console, recorded."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

pytestmark = [pytest.mark.slow, pytest.mark.timeout(2400)]

ROOT = Path(__file__).parents[2]
PROJECT = "autocomplete-test"
MISSION_TIMEOUT_S = 300.0
HEALTHY_TIMEOUT_S = 120.0
SERVICES = {
    "sim",
    "localizer",
    "classifier",
    "synthesis",
    "autopilot",
    "overlay",
    "operator",
    "recorder",
}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def output_of(*words: str) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()


def succeeds(*words: str) -> bool:
    with contextlib.suppress(OSError):
        return subprocess.run(words, capture_output=True, check=False).returncode == 0
    return False


class Compose:
    """One project of docker compose, by its plugin or by docker-compose."""

    def __init__(self, console_port: int) -> None:
        plugin = succeeds("docker", "compose", "version")
        self._words = ["docker", "compose"] if plugin else ["docker-compose"]
        self._words += ["--project-name", PROJECT]
        self._environment = {
            **os.environ,
            "AUTOCOMPLETE_CONSOLE_PORT": str(console_port),
            "AUTOCOMPLETE_OPERATOR_SOURCE": "scripted",
            "DOCKER_BUILDKIT": os.environ.get("DOCKER_BUILDKIT", "0"),
        }

    def __call__(self, *words: str) -> None:
        subprocess.run([*self._words, *words], cwd=ROOT, env=self._environment, check=True)

    def start(self, *words: str) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [*self._words, *words],
            cwd=ROOT,
            env=self._environment,
            text=True,
            stdout=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
        )

    def container(self, service: str) -> str:
        return subprocess.run(
            [*self._words, "ps", "-q", service],
            cwd=ROOT,
            env=self._environment,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.strip()

    def wait_for(self, topic: str, timeout_s: float, accept: Any) -> dict[str, Any]:
        """The first message on a topic that `accept` likes, echoed in a container."""
        echo = self.start("exec", "-T", "recorder", "autocomplete", "echo", topic)
        assert echo.stdout is not None
        deadline = time.monotonic() + timeout_s
        last: dict[str, Any] = {}
        try:
            for line in echo.stdout:
                last = json.loads(line)
                if accept(last):
                    return last
                if time.monotonic() > deadline:
                    break
        finally:
            echo.send_signal(signal.SIGTERM)
            echo.wait()
        raise AssertionError(f"no such message on {topic}; the last one was {last}")


@pytest.fixture
def console_port() -> int:
    return free_port()


@pytest.fixture
def compose(console_port: int) -> Iterator[Compose]:
    if shutil.which("docker") is None or not succeeds("docker", "info"):
        pytest.skip("no Docker engine here")
    compose = Compose(console_port)
    try:
        yield compose
    finally:
        compose("logs", "--tail", "15")
        compose("down", "--volumes", "--timeout", "10")


def wait_healthy(compose: Compose) -> None:
    deadline = time.monotonic() + HEALTHY_TIMEOUT_S
    states: dict[str, str] = {}
    while time.monotonic() < deadline:
        states = {
            service: output_of(
                "docker",
                "inspect",
                "--format",
                "{{.State.Health.Status}}",
                compose.container(service),
            )
            for service in SERVICES
        }
        if set(states.values()) == {"healthy"}:
            return
        time.sleep(2.0)
    raise AssertionError(f"not healthy after {HEALTHY_TIMEOUT_S} s: {states}")


def test_the_mission_is_flown_in_containers(
    compose: Compose, console_port: int, tmp_path: Path
) -> None:
    compose("build")
    compose("up", "-d")
    recorder = compose.container("recorder")
    health = compose.wait_for(
        "health/operator",
        MISSION_TIMEOUT_S,
        lambda health: health["detail"].startswith("mission done"),
    )
    assert health["state"] == "ok"
    vehicle = compose.wait_for("vehicle", 10.0, lambda _: True)
    assert vehicle["collisions"] == 0
    wait_healthy(compose)
    with urllib.request.urlopen(f"http://127.0.0.1:{console_port}/", timeout=10) as page:
        assert page.status == 200
        assert b"<html" in page.read().lower()
    for service in SERVICES:
        user = output_of("docker", "exec", compose.container(service), "id", "-un")
        assert user == "autocomplete", f"{service} runs as {user}"

    compose("stop", "recorder")
    subprocess.run(["docker", "cp", f"{recorder}:/recordings", str(tmp_path)], check=True)
    (recording,) = (tmp_path / "recordings").glob("*.mcap")
    with recording.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    counts = {
        summary.channels[channel].topic: count
        for channel, count in summary.statistics.channel_message_counts.items()
    }
    for topic in ("stick", "command", "pose", "truth", "suggestion", "intent", "overlay/front"):
        assert counts.get(topic, 0) > 0, topic
