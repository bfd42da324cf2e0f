"""A whole system on this machine: a router and the services, each a process of its own."""

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from common.clock import SystemClock, nanoseconds, sleep
from common.topics import DEFAULT_VEHICLE

ROUTER_PORT = 7447
CONSOLE_PORT = 8080
STOP_TIMEOUT_S = 6.0
LOG_TAIL_LINES = 8


class SystemFailedError(Exception):
    """A process of the system ended by itself; the text says which, and the end of its log."""


def is_free(port: int) -> bool:
    """Whether nobody listens on a TCP port of this machine."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def free_port() -> int:
    """A TCP port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class System:
    """The processes of a running system.

    Attributes:
        endpoint: where its router listens.
        vehicle: the vehicle's name.
        logs: a folder with one log a process.
    """

    endpoint: str
    vehicle: str
    logs: Path
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, name: str, *arguments: str) -> None:
        """Start `autocomplete ARGUMENTS` as the process `name`."""
        with (self.logs / f"{name}.log").open("wb") as sink:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "cli.main", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                # Ctrl-C reaches this process alone, which then stops the others in order.
                start_new_session=True,
                env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )

    def start_service(self, service: str, settings: Mapping[str, str], *more: str) -> None:
        """Start a service of this system with some of its configuration set."""
        flags = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
        where = ["--vehicle", self.vehicle, "--connect", self.endpoint]
        self.start(service, "run", service, *where, *flags, *more)

    def check(self) -> None:
        """See that every process runs.

        Raises:
            SystemFailedError: if one has ended.
        """
        for name, process in self.processes.items():
            code = process.poll()
            if code is not None:
                log = self.logs / f"{name}.log"
                tail = log.read_text(errors="replace").splitlines()[-LOG_TAIL_LINES:]
                raise SystemFailedError(
                    "\n".join([f"{name} ended with code {code} ({log})", *tail])
                )

    def stop(self) -> None:
        """Stop every process, the router last; kill what does not stop in time."""
        for process in self.processes.values():
            if process is not self.processes.get("router") and process.poll() is None:
                process.terminate()
        clock = SystemClock()
        deadline_ns = clock.monotonic_ns() + nanoseconds(STOP_TIMEOUT_S)
        for name in sorted(self.processes, key=lambda name: name == "router"):
            process = self.processes[name]
            if name == "router":
                process.terminate()
            while process.poll() is None and clock.monotonic_ns() < deadline_ns:
                sleep(0.02)
            if process.poll() is None:
                process.kill()
                process.wait()


@contextlib.contextmanager
def running(
    services: Sequence[str],
    settings: Mapping[str, Mapping[str, str]],
    vehicle: str = DEFAULT_VEHICLE,
    config_file: Path | None = None,
) -> Iterator[System]:
    """A router and services, stopped on leaving.

    Args:
        services: which services to start.
        settings: configuration by service and field, over that of the file.
        vehicle: the vehicle's name.
        config_file: a TOML file with a table a service.
    """
    port = ROUTER_PORT if is_free(ROUTER_PORT) else free_port()
    logs = Path(tempfile.mkdtemp(prefix="autocomplete-"))
    system = System(f"tcp/127.0.0.1:{port}", vehicle, logs)
    more = ["--config", str(config_file)] if config_file else []
    try:
        system.start("router", "router", "--listen", system.endpoint)
        for service in services:
            system.start_service(service, settings.get(service, {}), *more)
        yield system
    finally:
        system.stop()


def wait_alive(
    system: System, alive: set[str], wanted: Sequence[str], stop: threading.Event, timeout_s: float
) -> None:
    """Wait until all wanted services are in `alive`, which somebody else fills.

    Raises:
        SystemFailedError: if a process ends, or time runs out.
    """
    clock = SystemClock()
    deadline_ns = clock.monotonic_ns() + nanoseconds(timeout_s)
    while not set(wanted) <= alive and not stop.is_set():
        system.check()
        if clock.monotonic_ns() > deadline_ns:
            missing = ", ".join(sorted(set(wanted) - alive))
            raise SystemFailedError(f"not alive after {timeout_s:.0f} s: {missing} ({system.logs})")
        sleep(0.05)
