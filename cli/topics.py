"""`autocomplete topics`: the contract's table, live."""

import argparse
import json
import threading
from typing import Any

from rich import box
from rich.console import Console
from rich.live import Live
from rich.table import Table

from cli import options as opts
from cli.link import linked
from cli.meter import WINDOW_S, Meter
from common.clock import SystemClock
from common.run import stop_on_signals
from common.topics import TOPICS, alive_key_of, key_of
from common.zenoh_bus import ZenohBus

REFRESH_S = 0.5
SLOW = 0.9
"""A topic below this part of its rate is shown as slow."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    opts.add_network(parser)
    parser.add_argument("--once", action="store_true", help=f"print {WINDOW_S:g} s of it and end")
    parser.add_argument("--json", action="store_true", help="as --once, as one JSON object")
    opts.add_examples(
        parser,
        "autocomplete topics",
        "autocomplete topics --once",
        "autocomplete topics --json | jq '.topics[] | select(.rate_hz < 20) | .topic'",
        "autocomplete topics --connect tcp/192.168.1.20:7447 --vehicle drone1",
    )
    parser.set_defaults(action=_run)


class Monitor:
    """Listens to every topic of one vehicle."""

    def __init__(self, bus: ZenohBus, vehicle: str) -> None:
        self._clock = SystemClock()
        self._vehicle = vehicle
        self._lock = threading.Lock()
        begin_ns = self._clock.monotonic_ns()
        self._meters = {name: Meter(begin_ns) for name in TOPICS}
        self._alive: set[str] = set()
        bus.watch(alive_key_of(vehicle, "*"), self._on_alive)
        for topic in TOPICS.values():
            self._listen(bus, topic.name, topic.is_video)

    def _listen(self, bus: ZenohBus, name: str, is_video: bool) -> None:
        def receive(payload: bytes) -> None:
            with self._lock:
                self._meters[name].add(len(payload), self._clock.monotonic_ns())

        bus.subscribe(key_of(self._vehicle, name), receive, video=is_video)

    def _on_alive(self, key: str, alive: bool) -> None:
        service = key.rsplit("/", 1)[1]
        with self._lock:
            (self._alive.add if alive else self._alive.discard)(service)

    def snapshot(self) -> dict[str, Any]:
        """What is known now, in the shape that --json prints."""
        now_ns = self._clock.monotonic_ns()
        with self._lock:
            return {
                "vehicle": self._vehicle,
                "alive": sorted(self._alive),
                "topics": [
                    {
                        "topic": topic.name,
                        "message": topic.message.__name__,
                        "publisher": topic.publisher,
                        "nominal_hz": topic.rate_hz,
                        "rate_hz": round(self._meters[topic.name].rate_hz(now_ns), 2),
                        "age_s": _rounded(self._meters[topic.name].age_s(now_ns)),
                        "max_age_s": topic.max_age_s,
                        "bytes_per_s": round(self._meters[topic.name].bytes_per_s(now_ns)),
                        "count": self._meters[topic.name].count,
                    }
                    for topic in TOPICS.values()
                ],
            }


def _rounded(age_s: float | None) -> float | None:
    return None if age_s is None else round(age_s, 3)


def table_of(snapshot: dict[str, Any]) -> Table:
    """A snapshot for people."""
    alive = ", ".join(snapshot["alive"]) or "nothing"
    title = f"{snapshot['vehicle']}: {alive} alive"
    # A terminal of 80 columns holds it, pictures at a megabyte a second and all.
    table = Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0)
    )
    for heading in ("topic", "message", "from"):
        table.add_column(heading, no_wrap=True)
    for heading in ("rate Hz", "of", "age s", "kB/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in snapshot["topics"]:
        nominal, age_s = row["nominal_hz"], row["age_s"]
        is_slow = nominal is not None and row["rate_hz"] < SLOW * nominal
        colour = "dim" if row["count"] == 0 else "yellow" if is_slow else "green"
        table.add_row(
            row["topic"],
            row["message"],
            row["publisher"],
            f"[{colour}]{row['rate_hz']:.1f}[/]",
            "" if nominal is None else f"{nominal:g}",
            "" if age_s is None else f"{age_s:.2f}",
            f"{row['bytes_per_s'] / 1e3:.1f}",
        )
    return table


def _run(options: argparse.Namespace) -> int:
    with linked(options) as bus:
        stop = stop_on_signals()
        monitor = Monitor(bus, options.vehicle)
        if options.once or options.json:
            stop.wait(WINDOW_S)
            snapshot = monitor.snapshot()
            if options.json:
                print(json.dumps(snapshot))
            else:
                Console().print(table_of(snapshot))
            return 0
        with Live(
            get_renderable=lambda: table_of(monitor.snapshot()),
            refresh_per_second=1 / REFRESH_S,
            screen=False,
        ):
            while not stop.wait(REFRESH_S):
                pass
    return 0
