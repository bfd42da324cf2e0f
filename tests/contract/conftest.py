"""Harness of the black-box contract tests: a real router, the real process, msgpack by hand.

Nothing here or in the tests imports the project: they know ../../docs/contract.md only.
"""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

START_TIMEOUT_S = 40.0


def free_port() -> int:
    """A TCP port of the loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def open_router(port: int) -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


class Collected(list[dict[str, Any]]):
    """Messages of one topic as they arrived, with their encodings and arrival times."""

    def __init__(self) -> None:
        super().__init__()
        self.encodings: list[str] = []
        self.arrival_s: list[float] = []


class Client:
    """Speaks the contract: msgpack maps on Zenoh keys of one vehicle."""

    def __init__(self, port: int, vehicle: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.vehicle = vehicle
        self._collected: dict[str, Collected] = {}
        self._kept: list[Any] = []
        self._seq: dict[str, int] = {}

    def key(self, name: str) -> str:
        return f"autocomplete/{self.vehicle}/{name}"

    def put(self, topic: str, payload: bytes) -> None:
        self.session.put(self.key(topic), payload)

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        """Put a message; a `seq` it lacks counts up, a `stamp` it lacks is now."""
        seq = self._seq.get(topic, 0)
        self._seq[topic] = seq + 1
        self.put(topic, msgpack.packb({"stamp": time.time_ns(), "seq": seq, **message}))

    def collect(self, topic: str) -> Collected:
        """Start (once) to collect a topic's messages; the same list goes on filling."""
        if topic not in self._collected:
            collected = self._collected[topic] = Collected()

            def receive(sample: zenoh.Sample) -> None:
                message = msgpack.unpackb(sample.payload.to_bytes())
                collected.arrival_s.append(time.monotonic())
                collected.encodings.append(str(sample.encoding))
                collected.append(message)

            self._kept.append(self.session.declare_subscriber(self.key(topic), receive))
        return self._collected[topic]

    def next(
        self,
        topic: str,
        accept: Callable[[dict[str, Any]], bool] = lambda _: True,
        timeout_s: float = 10.0,
    ) -> dict[str, Any]:
        """The next message on a topic, from now on, that `accept` likes."""
        collected = self.collect(topic)
        seen = len(collected)
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            while seen < len(collected):
                if accept(collected[seen]):
                    return collected[seen]
                seen += 1
            time.sleep(0.005)
        raise AssertionError(f"no such message on {topic} within {timeout_s} s")

    def ask(self, query: str, request: Any, timeout_s: float = 5.0) -> tuple[bool, dict[str, Any]]:
        """Ask a query; whether it was granted, and the map that came back. Bytes go as they are."""
        payload = request if isinstance(request, bytes) else msgpack.packb(request)
        for reply in self.session.get(self.key(query), payload=payload, timeout=timeout_s):
            if reply.ok is not None:
                return True, msgpack.unpackb(reply.ok.payload.to_bytes())
            return False, msgpack.unpackb(reply.err.payload.to_bytes())
        raise AssertionError(f"nobody answered {query}")

    def alive(self) -> set[str]:
        """The services of this vehicle that hold a liveliness token."""
        replies = self.session.liveliness().get(self.key("alive/*"), timeout=2.0)
        return {str(r.ok.key_expr).rsplit("/", 1)[1] for r in replies if r.ok is not None}

    def wait_alive(self, service: str, timeout_s: float = START_TIMEOUT_S) -> None:
        deadline = time.monotonic() + timeout_s
        while service not in self.alive():
            if time.monotonic() > deadline:
                raise AssertionError(f"{service} is not alive after {timeout_s} s")
            time.sleep(0.1)

    def close(self) -> None:
        self.session.close()


class Streams:
    """Publishes what `add` was given at fixed rates from a thread, until closed."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []

    def add(self, topic: str, rate_hz: float, make: Callable[[float], dict[str, Any]]) -> None:
        """`make(t_s)` gives the message at `t_s` since the stream began."""

        def publish() -> None:
            begin = time.monotonic()
            ticks = 0
            while not self._stop.is_set():
                self._client.publish(topic, make(time.monotonic() - begin))
                ticks += 1
                self._stop.wait(max(0.0, begin + ticks / rate_hz - time.monotonic()))

        thread = threading.Thread(target=publish, daemon=True)
        thread.start()
        self._threads.append(thread)

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self._threads.clear()
        self._stop = threading.Event()


class Process:
    """A running service, its log in a file."""

    def __init__(self, port: int, vehicle: str, service: str, flags: list[str], log: Path) -> None:
        self.log = log
        with log.open("w") as sink:
            self.popen = subprocess.Popen(
                [
                    str(Path(sys.executable).with_name("autocomplete")),
                    *("run", service, "--vehicle", vehicle),
                    *("--connect", f"tcp/127.0.0.1:{port}"),
                    *flags,
                ],
                stdout=sink,
                stderr=subprocess.STDOUT,
                env={**os.environ, "SDL_VIDEODRIVER": "dummy"},
            )

    def stop(self, timeout_s: float = 8.0) -> int:
        """SIGTERM, and the exit code."""
        self.popen.send_signal(signal.SIGTERM)
        return self.popen.wait(timeout_s)


@pytest.fixture(scope="module")
def port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def router(port: int) -> Iterator[zenoh.Session]:
    with open_router(port) as session:
        yield session


@pytest.fixture(scope="module")
def vehicle() -> str:
    return f"test{os.getpid()}"


@pytest.fixture(scope="module")
def client(router: zenoh.Session, port: int, vehicle: str) -> Iterator[Client]:
    client = Client(port, vehicle)
    yield client
    client.close()


@pytest.fixture
def streams(client: Client) -> Iterator[Streams]:
    streams = Streams(client)
    yield streams
    streams.close()


Launch = Callable[..., Process]


@pytest.fixture(scope="module")
def launch(port: int, vehicle: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launch]:
    """Starts services; all are stopped at the end, and one that has to be killed is an error."""
    folder = tmp_path_factory.mktemp("logs")
    started: list[Process] = []

    def start(service: str, *flags: str, to_port: int | None = None) -> Process:
        log = folder / f"{service}{len(started)}.log"
        process = Process(to_port or port, vehicle, service, list(flags), log)
        started.append(process)
        return process

    yield start
    killed = []
    for process in started:
        if process.popen.poll() is None:
            try:
                process.stop()
            except subprocess.TimeoutExpired:
                process.popen.kill()
                killed.append(process.log.read_text())
    assert not killed, f"had to be killed: {killed}"


def start_service(launch: Launch, client: Client, service: str, *flags: str) -> Process:
    """Start a service and wait until it is alive; its log is in the error if it never is."""
    process = launch(service, *flags)
    try:
        client.wait_alive(service)
    except AssertionError as error:
        raise AssertionError(f"{error}\n{process.log.read_text()}") from None
    return process


def assert_starts_before_its_router(service: str, *flags: str, tmp_path: Path) -> None:
    """A service that is started first appears as soon as its router does, and stops cleanly."""
    port = free_port()
    process = Process(port, "early", service, list(flags), tmp_path / "early.log")
    try:
        time.sleep(1.5)
        assert process.popen.poll() is None, process.log.read_text()
        with open_router(port):
            client = Client(port, "early")
            with contextlib.closing(client):
                client.wait_alive(service)
            assert process.stop() == 0, process.log.read_text()
    finally:
        if process.popen.poll() is None:
            process.popen.kill()


def assert_stops_without_a_router(service: str, *flags: str, tmp_path: Path) -> None:
    """SIGTERM ends a service that still waits for its router."""
    process = Process(free_port(), "lonely", service, list(flags), tmp_path / "lonely.log")
    try:
        time.sleep(2.5)
        assert process.stop() == 0, process.log.read_text()
    finally:
        if process.popen.poll() is None:
            process.popen.kill()
