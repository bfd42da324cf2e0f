"""`make bench`: what the whole system keeps up with on this machine, as one table.

First the demo's mission flies with every service, recorder included, and what arrives is counted.
Then the bench takes the operator's place: each stick it sends carries a value of its own, so that
the command it becomes is known when it comes back through the router.
"""

import argparse
import json
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from cli import launch
from common import messages as m
from common.clock import SystemClock, nanoseconds, seconds, sleep
from common.node import Node
from common.topics import SERVICES, TOPICS, alive_key_of, key_of
from common.zenoh_bus import ZenohBus

WARM_UP_S = 10.0
START_TIMEOUT_S = 60.0
STICK_PERIOD_S = 0.02
NEUTRAL_STICKS = 400
"""Sent while the vehicle takes off: 8 s."""
COUNTED = ("camera/front", "camera/down", "overlay/front", "imu", "truth", "pose", "command")
TARGET_HZ = {"camera/front": 29.0, "camera/down": 55.0}
TARGET_REAL_TIME = 0.98
TARGET_STICK_TO_COMMAND_MS = 10.0


@dataclass(frozen=True)
class Row:
    """One figure, what it is measured against, and what it is to reach."""

    figure: str
    value: float
    baseline: float
    target: str = ""


class Meter:
    """Counts what arrives, and sees how simulated time goes against this machine's."""

    def __init__(self, endpoint: str, vehicle: str) -> None:
        bus = ZenohBus(endpoint)
        self.alive: set[str] = set()
        self.node = Node(bus, vehicle, "bench")
        self.clear()
        for topic in COUNTED:
            self.node.on(topic, self._counter(topic), depth=256)
        bus.watch(alive_key_of(vehicle, "*"), self._on_alive)

    def clear(self) -> None:
        """Begin to count anew."""
        self.counts = dict.fromkeys(COUNTED, 0)
        self.first_truth: tuple[int, int] | None = None
        self.last_truth: tuple[int, int] | None = None

    def spin_for(self, duration_s: float) -> None:
        """Take what arrives within a time."""
        clock = self.node.clock
        end_ns = clock.monotonic_ns() + nanoseconds(duration_s)
        while clock.monotonic_ns() < end_ns:
            self.node.spin()
            sleep(0.01)

    @property
    def real_time_factor(self) -> float:
        """Simulated time over this machine's, since `clear`."""
        if self.first_truth is None or self.last_truth is None:
            return 0.0
        simulated_ns = self.last_truth[0] - self.first_truth[0]
        return simulated_ns / max(1, self.last_truth[1] - self.first_truth[1])

    def _counter(self, topic: str) -> Callable[[m.Message, int], None]:
        def count(message: m.Message, arrival_ns: int) -> None:
            self.counts[topic] += 1
            if topic == "truth":
                self.last_truth = (message.stamp, arrival_ns)
                self.first_truth = self.first_truth or self.last_truth

        return count

    def _on_alive(self, key: str, alive: bool) -> None:
        (self.alive.add if alive else self.alive.discard)(key.rsplit("/", 1)[1])


def processor_s(process: psutil.Process) -> float:
    """Processor time that a process has used, in s."""
    times = process.cpu_times()
    return float(times.user + times.system)


def fly(system: launch.System, duration_s: float, progress: Progress) -> list[Row]:
    """The mission with everything running: real time, rates, processor."""
    meter = Meter(system.endpoint, system.vehicle)
    task = progress.add_task("mission, every service", total=duration_s)
    try:
        launch.wait_alive(system, meter.alive, SERVICES, threading.Event(), START_TIMEOUT_S)
        meter.spin_for(WARM_UP_S)
        processes = {n: psutil.Process(p.pid) for n, p in system.processes.items()}
        used_s = {name: processor_s(process) for name, process in processes.items()}
        meter.clear()
        clock = SystemClock()
        begin_ns = clock.monotonic_ns()
        while (elapsed_s := seconds(clock.monotonic_ns() - begin_ns)) < duration_s:
            meter.spin_for(0.2)
            progress.update(task, completed=elapsed_s)
            system.check()
        rows = [Row("real-time factor", meter.real_time_factor, 1.0, f">= {TARGET_REAL_TIME}")]
        for topic, count in meter.counts.items():
            target = f">= {TARGET_HZ[topic]:.0f}" if topic in TARGET_HZ else ""
            rows.append(
                Row(f"{topic} (Hz)", count / elapsed_s, TOPICS[topic].rate_hz or 1.0, target)
            )
        cores = float(psutil.cpu_count() or 1)
        shares = {
            name: (processor_s(process) - used_s[name]) / elapsed_s
            for name, process in processes.items()
        }
        rows += [Row(f"processor of {n} (cores)", share, cores) for n, share in shares.items()]
        rows.append(Row("processor of all (cores)", sum(shares.values()), cores))
        return rows
    finally:
        meter.node.close()


def time_sticks(system: launch.System, count: int, progress: Progress) -> list[Row]:
    """Stick to command through the router, with everything but the operator running."""
    bus = ZenohBus(system.endpoint)
    clock = SystemClock()
    sent_ns: dict[float, int] = {}
    taken_s: list[float] = []
    node = Node(bus, system.vehicle, "bench")

    def on_command(payload: bytes) -> None:
        arrival_ns = clock.monotonic_ns()
        vx = m.decode(payload, m.Command).vx
        if vx in sent_ns:
            taken_s.append(seconds(arrival_ns - sent_ns.pop(vx)))

    bus.subscribe(key_of(system.vehicle, "command"), on_command)
    node.publishes("stick")
    task = progress.add_task("stick to command", total=count)
    try:
        begin_ns = clock.monotonic_ns()
        for index in range(-NEUTRAL_STICKS, count):
            # Neutral first: sticks count only once they were seen neutral; then take off.
            vx = 0.0 if index < 0 else 0.1 + 0.1 * index / count
            if index == 50 - NEUTRAL_STICKS:
                node.ask("autopilot/decide", m.DecideRequest(action="takeoff", nonce=1))
            if index >= 0:
                sent_ns[vx] = clock.monotonic_ns()
            node.publish(
                "stick",
                m.Stick(
                    stamp=clock.utc_ns(), seq=0, vx=vx, vy=0, vz=0, wz=0.3 if index >= 0 else 0.0
                ),
            )
            progress.update(task, completed=index)
            due_ns = begin_ns + nanoseconds((index + NEUTRAL_STICKS + 1) * STICK_PERIOD_S)
            sleep(seconds(due_ns - clock.monotonic_ns()))
    finally:
        node.close()
    p50, p99 = np.percentile(taken_s, [50, 99]) * 1e3
    target = f"<= {TARGET_STICK_TO_COMMAND_MS:.0f}"
    return [
        Row("sticks answered by a command", len(taken_s), count),
        Row("stick to command p50 (ms)", float(p50), TARGET_STICK_TO_COMMAND_MS),
        Row("stick to command p99 (ms)", float(p99), TARGET_STICK_TO_COMMAND_MS, target),
    ]


def report(rows: list[Row], output: Path | None) -> None:
    """Print the rows as a table, and write them as JSON if a file is given."""
    table = Table("figure", "measured", "baseline", "ratio", "target")
    for row in rows:
        ratio = row.value / row.baseline
        table.add_row(
            row.figure, f"{row.value:.3f}", f"{row.baseline:g}", f"{ratio:.2f}", row.target
        )
    Console().print(table)
    if output:
        output.write_text(json.dumps([vars(row) for row in rows], indent=1))


def main() -> None:
    """Run the bench and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of mission (60)")
    parser.add_argument("--sticks", type=int, default=1000, help="to time (1000)")
    parser.add_argument("--output", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    settings = {
        "sim": {"world": "track"},
        "overlay": {"console_port": str(launch.free_port())},
        "operator": {"source": "scripted", "laps": "0"},
    }
    with Progress(console=Console(stderr=True)) as progress:
        with launch.running(SERVICES, settings) as system:
            rows = fly(system, options.seconds, progress)
        others = [service for service in SERVICES if service != "operator"]
        with launch.running(others, settings) as system:
            meter = Meter(system.endpoint, system.vehicle)
            launch.wait_alive(system, meter.alive, others, threading.Event(), START_TIMEOUT_S)
            meter.node.close()
            rows += time_sticks(system, options.sticks, progress)
    report(rows, options.output)


if __name__ == "__main__":
    main()
