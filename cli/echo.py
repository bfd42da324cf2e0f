"""`autocomplete echo TOPIC`: a topic's messages as they come, a JSON object a line."""

import argparse
import json
import queue
import sys
from typing import Any

import msgspec

from cli import options as opts
from cli.link import linked
from common import messages as m
from common.run import stop_on_signals
from common.topics import TOPICS, key_of

POLL_S = 0.2
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


def _run(options: argparse.Namespace) -> int:
    topic = TOPICS[options.topic]
    arrived: queue.Queue[bytes] = queue.Queue(BEHIND)

    def receive(payload: bytes) -> None:
        if not arrived.full():
            arrived.put_nowait(payload)

    with linked(options) as bus:
        stop = stop_on_signals()
        bus.subscribe(key_of(options.vehicle, topic.name), receive, video=topic.is_video)
        shown = 0
        while not stop.is_set() and shown != options.count:
            try:
                payload = arrived.get(timeout=POLL_S)
            except queue.Empty:
                continue
            try:
                message = m.decode(payload, topic.message)
            except m.InvalidPayloadError as error:
                sys.stderr.write(f"invalid payload of {len(payload)} bytes: {error}\n")
                continue
            print(json.dumps(summary(message)), flush=True)
            shown += 1
    return 0
