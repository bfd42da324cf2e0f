"""`autocomplete demo`: everything on this machine, flown by a simulated operator."""

import argparse
import json
import sys
import threading

from rich.console import Console
from rich.live import Live
from rich.table import Table

import worlds
from cli import launch
from cli import options as opts
from common.bus import Bus
from common.clock import SystemClock, nanoseconds, sleep
from common.messages import Health
from common.node import Node
from common.run import stop_on_signals
from common.topics import SERVICES, alive_key_of
from common.zenoh_bus import open_bus
from studies.mission import Figures, MissionRecord

WORLD = "track"
START_TIMEOUT_S = 60.0
MISSION_TIMEOUT_S = 240.0
MISSION_DONE = "mission done"
"""The scripted operator's health says so when it has landed."""
TRUTH_DEPTH = 256


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--once", action="store_true", help="end after one lap, print its figures")
    parser.add_argument("--json", action="store_true", help="print the figures as one JSON object")
    parser.add_argument("--seed", type=int, default=0, help="of the operator's hand and eyes (0)")
    parser.add_argument("--record", action="store_true", help="also record to an MCAP file")
    opts.add_local_system(parser)
    parser.epilog = (
        "Example: 'autocomplete demo', then open http://localhost:8080;"
        " 'autocomplete demo --once --json' for the figures of one lap."
    )
    parser.set_defaults(action=_run)


class Observer:
    """Watches a mission on the bus: its figures, its services, whether its operator is done."""

    def __init__(self, bus: Bus, vehicle: str) -> None:
        self.record = MissionRecord(worlds.load(WORLD).ideal_path_m)
        self.alive: set[str] = set()
        self.operator_says = ""
        self.node = Node(bus, vehicle, "observer")
        self.node.on("truth", self.record.on_truth, depth=TRUTH_DEPTH)
        self.node.on("suggestion", self.record.on_suggestion)
        self.node.on("autopilot", self.record.on_autopilot)
        self.node.on("vehicle", self.record.on_vehicle)
        self.node.on("camera/front", self.record.on_front, depth=8)
        self.node.on("health/operator", self._on_operator)
        bus.watch(alive_key_of(vehicle, "*"), self._on_alive)

    def _on_alive(self, key: str, alive: bool) -> None:
        service = key.rsplit("/", 1)[1]
        if alive:
            self.alive.add(service)
        else:
            self.alive.discard(service)

    def _on_operator(self, health: Health, arrival_ns: int) -> None:
        self.operator_says = health.detail

    @property
    def done(self) -> bool:
        """Whether the operator has ended the mission."""
        return self.operator_says.startswith(MISSION_DONE)


def _status(observer: Observer, console_port: int) -> Table:
    record = observer.record
    table = Table.grid(padding=(0, 2))
    table.add_row("console", f"http://localhost:{console_port}")
    table.add_row("services", f"{len(observer.alive)} alive: {', '.join(sorted(observer.alive))}")
    table.add_row("mode", record.mode)
    table.add_row("laps", f"{record.laps:.2f}")
    counts = f"{record.suggestions} drawn, {record.accepted} accepted"
    table.add_row("suggestions", f"{counts}, {record.takeovers} taken over")
    table.add_row("collisions", str(record.collisions))
    table.add_row("operator", observer.operator_says)
    return table


def _fly(observer: Observer, system: launch.System, stop: threading.Event, once: bool) -> bool:
    """Watch until the mission is done, time runs out or `stop`; whether it was done."""
    clock = SystemClock()
    deadline_ns = clock.monotonic_ns() + nanoseconds(MISSION_TIMEOUT_S)
    while not stop.is_set():
        observer.node.spin()
        system.check()
        if once and observer.done:
            return True
        if once and clock.monotonic_ns() > deadline_ns:
            return False
        sleep(0.02)
    return False


def _run(options: argparse.Namespace) -> int:
    stop = stop_on_signals()
    console = Console(stderr=True)
    services = [name for name in SERVICES if name != "recorder" or options.record]
    settings = {
        "sim": {"world": WORLD},
        "overlay": {"console_port": str(options.console_port)},
        "operator": {
            "source": "scripted",
            "laps": "1" if options.once else "0",
            "seed": str(options.seed),
        },
    }
    opts.require_free_console_port(options.console_port)
    try:
        with launch.running(services, settings, options.vehicle, options.config) as system:
            bus = open_bus(stop, system.endpoint)
            if bus is None:
                return 0
            observer = Observer(bus, options.vehicle)
            try:
                with console.status("starting the services"):
                    launch.wait_alive(system, observer.alive, services, stop, START_TIMEOUT_S)
                with Live(
                    get_renderable=lambda: _status(observer, options.console_port),
                    console=console,
                    refresh_per_second=4,
                    transient=True,
                ):
                    done = _fly(observer, system, stop, options.once)
            finally:
                observer.node.close()
    except launch.SystemFailedError as error:
        sys.stderr.write(f"autocomplete demo: {error}\n")
        return 1
    if not options.once:
        return 0
    figures = observer.record.figures()
    _print_figures(figures, options.json, console)
    if not done:
        sys.stderr.write(
            f"autocomplete demo: the mission did not end within {MISSION_TIMEOUT_S:.0f} s:"
            f" {observer.operator_says} (logs in {system.logs})\n"
        )
    return 0 if done and figures.laps >= 1 else 1


def _print_figures(figures: Figures, as_json: bool, console: Console) -> None:
    if as_json:
        print(json.dumps(figures.as_dict()))
        return
    table = Table("figure", "value")
    for name, value in figures.as_dict().items():
        table.add_row(name, str(value))
    Console().print(table)
