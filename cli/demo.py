"""`autocomplete demo`: everything on this machine, flown by a simulated operator."""

import argparse
import json
import threading
from dataclasses import dataclass

from rich.console import Console
from rich.live import Live
from rich.table import Table

import worlds
from cli import launch
from cli import options as opts
from common import config
from common.bus import Bus
from common.clock import SystemClock, nanoseconds, sleep
from common.messages import Health
from common.node import Node
from common.run import stop_on_signals
from common.topics import alive_key_of
from common.zenoh_bus import open_bus
from services.operator.config import Config as OperatorConfig
from studies.mission import Figures, MissionRecord

WORLD = "track"
MISSION_TIMEOUT_S = 240.0
MISSION_DONE = "mission done"
"""The scripted operator's health says so when it has landed."""
TRUTH_DEPTH = 256


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--once", action="store_true", help="end after one lap, print its figures")
    parser.add_argument("--json", action="store_true", help="with --once: as one JSON object")
    parser.add_argument(
        "--seed", metavar="N", type=opts.seed, help="of the operator's hand and eyes (1)"
    )
    opts.add_local_system(parser)
    opts.add_examples(
        parser,
        "autocomplete demo                  # then open http://localhost:8080",
        "autocomplete demo --once --json    # the figures of one lap",
        "autocomplete demo --console-port 8090 --record",
    )
    parser.set_defaults(action=_run)


@dataclass(frozen=True)
class _Endless(OperatorConfig):
    """An operator who flies on, unless a file or the environment says when to land."""

    laps: int = 0


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


def _status(observer: Observer) -> Table:
    record = observer.record
    table = Table.grid(padding=(0, 2))
    table.add_row("services", f"{len(observer.alive)} alive: {', '.join(sorted(observer.alive))}")
    table.add_row("mode", record.mode)
    table.add_row("laps", f"{record.laps:.2f}")
    counts = f"{record.suggestions} drawn, {record.accepted} accepted"
    table.add_row("suggestions", f"{counts}, {record.takeovers} taken over")
    table.add_row("collisions", str(record.collisions))
    table.add_row("operator", observer.operator_says)
    return table


def _fly(observer: Observer, system: launch.System, stop: threading.Event, once: bool) -> bool:
    """Watch until the mission is done or `stop` is set; whether it was done.

    Raises:
        SystemFailedError: if a process ends, or time runs out.
    """
    clock = SystemClock()
    deadline_ns = clock.monotonic_ns() + nanoseconds(MISSION_TIMEOUT_S)
    while not stop.is_set():
        observer.node.spin()
        system.check()
        if once and observer.done:
            return True
        if once and clock.monotonic_ns() > deadline_ns:
            raise launch.SystemFailedError(
                f"the mission did not end within {MISSION_TIMEOUT_S:.0f} s:"
                f" {observer.operator_says} ({system.logs})"
            )
        sleep(0.02)
    return False


def _run(options: argparse.Namespace) -> int:
    if options.json and not options.once:
        raise ValueError("--json: the figures are those of one lap; add --once")
    stop = stop_on_signals()
    endless = config.load(_Endless, "operator", options.config)
    settings = {
        "sim": {"world": WORLD},
        "operator": {
            "source": "scripted",
            "world": WORLD,
            "laps": 1 if options.once else endless.laps,
            "seed": options.seed,
        },
    }
    with launch.running_as_asked(options, settings) as system:
        if not options.json:
            launch.say_where(system)
        bus = open_bus(stop, system.endpoint)
        figures = None if bus is None else _observe(bus, system, stop, options.once)
        if not options.once:
            return 0
        if figures is None:
            raise launch.SystemFailedError(f"interrupted before the lap's end ({system.logs})")
        _print_figures(figures, options.json)
        if figures.laps < 1:
            raise launch.SystemFailedError(f"no whole lap was flown ({system.logs})")
    return 0


def _observe(bus: Bus, system: launch.System, stop: threading.Event, once: bool) -> Figures | None:
    """A mission's figures once it is done, or None if `stop` is set first.

    Raises:
        SystemFailedError: if a process ends, or time runs out.
    """
    console = Console(stderr=True)
    observer = Observer(bus, system.vehicle)
    try:
        with console.status("starting the services"):
            launch.wait_alive(system, observer.alive, list(system.configs), stop)
        with Live(
            get_renderable=lambda: _status(observer),
            console=console,
            refresh_per_second=4,
            transient=True,
        ):
            return observer.record.figures() if _fly(observer, system, stop, once) else None
    finally:
        observer.node.close()


def _print_figures(figures: Figures, as_json: bool) -> None:
    if as_json:
        print(json.dumps(figures.as_dict()))
        return
    table = Table("figure", "value")
    for name, value in figures.as_dict().items():
        table.add_row(name, str(value))
    Console().print(table)
