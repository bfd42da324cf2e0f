"""A whole system on this machine: a router and the services, each a process of its own."""

import argparse
import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console

from common import config
from common.clock import SystemClock, nanoseconds, sleep
from common.network import DEFAULT_ENDPOINT, ROUTER_PORT
from common.run import ENDS_WITH_STDIN, config_type_of
from common.topics import DEFAULT_VEHICLE, SERVICES

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 6.0


Settings = Mapping[str, Mapping[str, Any]]
"""Configuration by service and field, over that of a file; None leaves a field to it."""


class SystemFailedError(OSError):
    """The system did not do its work; one line, with where its logs are."""


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
        logs: a folder with one log a process; removed on a clean end.
        configs: what its services run with, by service.
    """

    endpoint: str
    vehicle: str
    logs: Path
    configs: Mapping[str, Any]
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, name: str, *arguments: str) -> None:
        """Start `autocomplete ARGUMENTS` as the process `name`."""
        with (self.logs / f"{name}.log").open("wb") as sink:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "cli.main", *arguments],
                # Never written to: it closes when this process ends, and its reader ends too.
                stdin=subprocess.PIPE,
                stdout=sink,
                stderr=subprocess.STDOUT,
                # Ctrl-C reaches this process alone, which then stops the others in order.
                start_new_session=True,
                env={
                    **os.environ,
                    ENDS_WITH_STDIN: "1",
                    "OMP_NUM_THREADS": "1",
                    "OPENBLAS_NUM_THREADS": "1",
                },
            )

    def start_service(self, service: str, settings: Mapping[str, Any], *more: str) -> None:
        """Start a service of this system with some of its configuration set."""
        flags = [
            f"--{name.replace('_', '-')}={value}"
            for name, value in settings.items()
            if value is not None
        ]
        where = ["--vehicle", self.vehicle, "--connect", self.endpoint]
        self.start(service, "run", service, *where, *flags, *more)

    @property
    def console(self) -> str:
        """Where the console's page is."""
        port = self.configs["overlay"].console_port
        return f"http://localhost:{port}" if port else "switched off"

    def check(self) -> None:
        """See that every process runs.

        Raises:
            SystemFailedError: if one has ended.
        """
        for name, process in self.processes.items():
            code = process.poll()
            if code is not None:
                log = self.logs / f"{name}.log"
                said = last_words(log.read_text(errors="replace"))
                raise SystemFailedError(f"{name} ended with code {code}: {said} ({log})")

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
            if process.stdin is not None:
                process.stdin.close()


def last_words(log: str) -> str:
    """What the last line of a process' log says to a person."""
    line = next((line.strip() for line in reversed(log.splitlines()) if line.strip()), "no word")
    try:
        entry = json.loads(line)
        fault = entry.get("exception", "").splitlines()[-1:]
        return ": ".join([entry["message"], *fault])
    except (ValueError, TypeError, KeyError, AttributeError):
        return line.removeprefix("autocomplete run: ")


@contextlib.contextmanager
def running(
    services: Sequence[str],
    settings: Settings,
    vehicle: str = DEFAULT_VEHICLE,
    config_file: Path | None = None,
) -> Iterator[System]:
    """A router and services, stopped on leaving; their logs stay if one leaves by an exception.

    Args:
        services: which services to start.
        settings: configuration by service and field, over that of the file.
        vehicle: the vehicle's name.
        config_file: a TOML file with a table a service.

    Raises:
        ConfigError: if a service's configuration cannot be used; nothing was started.
        ValueError: if the console's port is taken.
    """
    configs = {
        service: config.load(
            config_type_of(service), service, config_file, flags=settings.get(service)
        )
        for service in services
    }
    console_port = configs["overlay"].console_port if "overlay" in configs else 0
    if console_port and not is_free(console_port):
        raise ValueError(
            f"--console-port: port {console_port} is taken; name another, for example 8090"
        )
    port = ROUTER_PORT if is_free(ROUTER_PORT) else free_port()
    logs = Path(tempfile.mkdtemp(prefix="autocomplete-"))
    system = System(f"tcp/127.0.0.1:{port}", vehicle, logs, configs)
    more = ["--config", str(config_file)] if config_file else []
    try:
        system.start("router", "router", "--listen", system.endpoint)
        for service in services:
            system.start_service(service, settings.get(service, {}), *more)
        yield system
    finally:
        system.stop()
    shutil.rmtree(logs, ignore_errors=True)


def running_as_asked(
    options: argparse.Namespace, settings: Settings
) -> contextlib.AbstractContextManager[System]:
    """All services as the options of `cli.options.add_local_system` ask for them."""
    return running(
        [name for name in SERVICES if name != "recorder" or options.record],
        {"overlay": {"console_port": options.console_port}, **settings},
        options.vehicle,
        options.config,
    )


def say_where(system: System) -> None:
    """Tell a person where to find what has been started."""
    console = Console(stderr=True, highlight=False)
    console.print(f"console    {system.console}")
    console.print(f"router     {system.endpoint}")
    if system.endpoint != DEFAULT_ENDPOINT:
        console.print(
            f"           port {ROUTER_PORT} is taken: --connect {system.endpoint} leads here"
        )
    if "recorder" in system.configs:
        console.print(f"recording  into {Path(system.configs['recorder'].folder).resolve()}")
    console.print(f"logs       {system.logs}")
    console.print("Ctrl-C stops everything.")


def wait_alive(
    system: System,
    alive: set[str],
    wanted: Sequence[str],
    stop: threading.Event,
    timeout_s: float = START_TIMEOUT_S,
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
