"""`autocomplete record`: what flies, into an MCAP file, from a terminal."""

import argparse
import queue
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

from cli import options as opts
from cli.extras import needing
from cli.link import linked
from cli.meter import Meter
from common import messages as m
from common.clock import SystemClock, nanoseconds, seconds
from common.run import stop_on_signals
from common.topics import TOPICS, key_of
from common.zenoh_bus import ZenohBus

POLL_S = 0.1
BEHIND = 4096
"""Payloads that wait at most for the disk: a few seconds of everything."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    opts.add_network(parser)
    parser.add_argument(
        "--output", metavar="FILE", type=Path, help="(recordings/<vehicle>-<UTC>.mcap)"
    )
    parser.add_argument("--seconds", metavar="N", type=opts.duration, help="end after N seconds")
    opts.add_examples(
        parser,
        "autocomplete record",
        "autocomplete record --output lap.mcap --seconds 60",
        "autocomplete record --connect tcp/192.168.1.20:7447",
    )
    parser.set_defaults(action=_run)


@dataclass(frozen=True)
class _Arrival:
    topic: str
    payload: bytes
    utc_ns: int


class _Inbox:
    """What arrived and waits for the disk; what finds no room is lost, and counted."""

    def __init__(self) -> None:
        self.waiting: queue.Queue[_Arrival] = queue.Queue(BEHIND)
        self.lost = 0

    def put(self, arrival: _Arrival) -> None:
        try:
            self.waiting.put_nowait(arrival)
        except queue.Full:
            self.lost += 1


def _listen(bus: ZenohBus, vehicle: str, inbox: _Inbox) -> None:
    clock = SystemClock()

    def subscribe(name: str, is_video: bool) -> None:
        def receive(payload: bytes) -> None:
            inbox.put(_Arrival(name, payload, clock.utc_ns()))

        bus.subscribe(key_of(vehicle, name), receive, video=is_video)

    for topic in TOPICS.values():
        if topic.recorded:
            subscribe(topic.name, topic.is_video)


def _run(options: argparse.Namespace) -> int:
    with needing("recorder"):
        from services.recorder.config import Config
        from services.recorder.recording import Recording, new_path, open_new
    clock = SystemClock()
    inbox = _Inbox()
    config = Config()
    with linked(options) as bus:
        stop = stop_on_signals()
        path = options.output or new_path(config, options.vehicle, clock.utc_ns())
        recording = Recording(open_new(path), options.vehicle, config)
        begin_ns = clock.monotonic_ns()
        meter = Meter(begin_ns)
        invalid = 0
        try:
            _listen(bus, options.vehicle, inbox)

            def line() -> Text:
                now_ns = clock.monotonic_ns()
                return Text(
                    f"{path}  {seconds(now_ns - begin_ns):.0f} s"
                    f"  {len(recording.messages)} topics"
                    f"  {sum(recording.messages.values())} messages"
                    f"  {meter.rate_hz(now_ns):.0f} Hz"
                    f"  {recording.size_bytes() / 1e6:.1f} MB"
                    + (f"  {invalid} invalid" if invalid else "")
                    + (f"  {inbox.lost} lost" if inbox.lost else "")
                )

            end_ns = None if options.seconds is None else begin_ns + nanoseconds(options.seconds)
            with Live(get_renderable=line, console=Console(stderr=True), refresh_per_second=2):
                while not stop.is_set() and (end_ns is None or clock.monotonic_ns() < end_ns):
                    try:
                        arrival = inbox.waiting.get(timeout=POLL_S)
                    except queue.Empty:
                        continue
                    try:
                        message = m.decode(arrival.payload, TOPICS[arrival.topic].message)
                    except m.InvalidPayloadError:
                        invalid += 1
                        continue
                    recording.write(arrival.topic, message, arrival.utc_ns)
                    meter.add(len(arrival.payload), clock.monotonic_ns())
        except OSError as error:
            recording.abandon()
            raise OSError(f"{path} takes no more: {error.strerror or error}") from None
        recording.close()
    print(path)
    return 0
