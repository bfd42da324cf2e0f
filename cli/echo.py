"""`autocomplete echo TOPIC`: a topic's messages as they come, a JSON object a line."""

import argparse
import json
import queue
import sys
from typing import Any

import msgspec

from cli import options as opts
from cli.link import alive_services, linked
from common import messages as m
from common.clock import SystemClock, nanoseconds
from common.run import stop_on_signals
from common.topics import TOPICS, Topic, key_of

POLL_S = 0.2
SILENT_S = 3.0
"""After so long without a message, whoever waits for the first one is told why it may not come."""
BEHIND = 1000
"""Messages that wait at most for a slow terminal."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("topic", metavar="TOPIC", type=_topic, help=", ".join(TOPICS))
    opts.add_network(parser)
    parser.add_argument("--count", metavar="N", type=opts.positive, help="end after N messages")
    opts.add_examples(
        parser,
        "autocomplete echo stick",
        "autocomplete echo suggestion --count 1",
        "autocomplete echo pose | jq -c .position",
        "autocomplete echo health/localizer",
    )
    parser.set_defaults(action=_run)


def _topic(text: str) -> str:
    if text not in TOPICS:
        raise argparse.ArgumentTypeError(f"no topic {text!r}; there are {', '.join(TOPICS)}")
    return text


def summary(message: m.Message) -> dict[str, Any]:
    """A message as JSON can hold it and a terminal can show it."""
    fields = msgspec.structs.asdict(message)
    return {
        name: f"<{len(value)} bytes>" if isinstance(value, bytes) else value
        for name, value in fields.items()
        if value is not None
    }


def silence(topic: Topic, vehicle: str, is_alive: bool) -> str:
    """Why nothing comes, in a line; `is_alive` says so of the topic's publisher."""
    key = key_of(vehicle, topic.name)
    if is_alive:
        return f"{key}: nothing yet; {topic.publisher} runs and has sent none"
    return (
        f"{key}: nothing yet; no {topic.publisher} of {vehicle} runs"
        " ('autocomplete doctor' tells what does, --vehicle names another one)"
    )


def _run(options: argparse.Namespace) -> int:
    topic = TOPICS[options.topic]
    arrived: queue.Queue[bytes] = queue.Queue(BEHIND)

    def receive(payload: bytes) -> None:
        if not arrived.full():
            arrived.put_nowait(payload)

    with linked(options) as bus:
        stop = stop_on_signals()
        bus.subscribe(key_of(options.vehicle, topic.name), receive, video=topic.is_video)
        alive = alive_services(bus, options.vehicle)
        clock = SystemClock()
        told_at_ns = clock.monotonic_ns() + nanoseconds(SILENT_S)
        shown, is_told = 0, False
        while not stop.is_set() and shown != options.count:
            try:
                payload = arrived.get(timeout=POLL_S)
            except queue.Empty:
                if not is_told and clock.monotonic_ns() > told_at_ns:
                    sys.stderr.write(
                        silence(topic, options.vehicle, topic.publisher in alive) + "\n"
                    )
                    is_told = True
                continue
            is_told = True
            try:
                message = m.decode(payload, topic.message)
            except m.InvalidPayloadError as error:
                sys.stderr.write(f"invalid payload of {len(payload)} bytes: {error}\n")
                continue
            print(json.dumps(summary(message)), flush=True)
            shown += 1
    return 0
