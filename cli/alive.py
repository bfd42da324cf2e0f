"""`autocomplete alive SERVICE`: whether a service runs, by its exit code; for health checks."""

import argparse
import queue

from cli import options as opts
from cli.link import linked
from common import messages as m
from common.clock import SystemClock, nanoseconds, seconds
from common.topics import SERVICES, TOPICS, key_of


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("service", metavar="SERVICE", choices=SERVICES, help=", ".join(SERVICES))
    opts.add_network(parser)
    opts.add_examples(
        parser, "autocomplete alive localizer", "until autocomplete alive sim; do sleep 1; done"
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    # A frozen process holds its token for seconds: only a message shows that it works.
    topic = TOPICS[f"health/{options.service}"]
    arrived: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    clock = SystemClock()
    with linked(options) as bus:
        bus.subscribe(key_of(options.vehicle, topic.name), arrived.put)
        deadline_ns = clock.monotonic_ns() + nanoseconds(topic.max_age_s)
        while (left_s := seconds(deadline_ns - clock.monotonic_ns())) > 0:
            try:
                health = m.decode(arrived.get(timeout=left_s), m.Health)
            except (queue.Empty, m.InvalidPayloadError):
                continue
            print(f"{options.service}: {health.state} {health.detail}".rstrip())
            return 1 if health.state == "failed" else 0
    raise OSError(f"{options.service} of {options.vehicle} is silent for {topic.max_age_s:g} s")
