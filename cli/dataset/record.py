"""`autocomplete dataset record`: labelled primitives while somebody performs them."""

import argparse
import queue
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from cli import options as opts
from cli.dataset import shared
from cli.extras import needing
from cli.link import linked
from cli.progress import counted
from common import messages as m
from common.clock import SystemClock, nanoseconds
from common.run import stop_on_signals
from common.topics import key_of
from training.labels import CLASSES

if TYPE_CHECKING:
    from training.dataset.collection import Event
    from training.dataset.primitive import Primitive

POLL_S = 0.2
SILENT_S = 3.0
BEHIND = 4096
"""Sticks that wait at most while a set is written."""

HOW = """\
Perform the primitive with the sticks, then press a face button of the pad
(triangle, circle, cross, square; Y, B, A, X), or E in the console. Rest before
and after it is cut off. The button pressed again before the sticks move takes
the last one back. Each one is saved at once: Ctrl-C ends, and the same --out
goes on."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--label", choices=CLASSES, required=True, help="what is performed")
    parser.add_argument(
        "--count", metavar="N", type=opts.positive, default=10, help="how many to collect (10)"
    )
    shared.add_people(parser, "who performs", required=True)
    parser.add_argument(
        "--out",
        metavar="FILE.npz",
        type=shared.set_file,
        help="a set, new or to go on with (recordings/<operator>.npz)",
    )
    opts.add_network(parser)
    opts.add_examples(
        parser,
        "autocomplete up    (in another terminal)",
        "autocomplete dataset record --label arc --count 10 --operator ana",
        "autocomplete dataset record --label none --operator ana    (hover, correct, turn)",
    )
    parser.description = HOW
    parser.set_defaults(action=_run)


class _Set:
    """The file that grows.

    Raises:
        OSError: if it is there and is no set, or there is no place for it.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        from training.dataset.store import open_set, require_place

        self.path = options.out or Path("recordings") / f"{options.operator}.npz"
        self.taken = 0
        self._label = options.label
        self._primitives: list[Primitive] = []
        before: dict[str, str] = {}
        if self.path.exists():
            stored = open_set(self.path)
            self._primitives, before = stored.primitives(), stored.provenance
        self._provenance = shared.made(before, options)
        # Before anybody performs for nothing.
        require_place(self.path)

    def take(self, event: "Event") -> str:
        """Do what a press of the button asks for; what to tell the person."""
        from training.dataset.check import check

        if event.verdict == "refused":
            return f"[yellow]not taken[/]: {event.reason}"
        if event.primitive is not None:
            self._primitives.append(event.primitive)
            self.taken += 1
            text = f"{self._label} of {event.primitive.duration_s:.1f} s"
            faults = escape("; ".join(finding.text for finding in check([event.primitive])))
            text += f", [yellow]{faults}[/]" if faults else ""
        else:
            self._primitives.pop()
            self.taken -= 1
            text = "[yellow]the last one is taken back[/]"
        self._save()
        return f"{text}    {self.counts()}"

    def counts(self) -> str:
        """How many of each class there are."""
        labels = [p.label for p in self._primitives]
        return "  ".join(f"{label} {labels.count(label)}" for label in CLASSES)

    def _save(self) -> None:
        from training.dataset.store import save

        save(self.path, self._primitives, self._provenance)


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.collection import Collection
    collected = _Set(options)
    collection = Collection(
        options.label, options.operator, options.family, f"record {options.vehicle}"
    )
    console = Console(stderr=True)
    clock = SystemClock()
    arrived: queue.Queue[bytes] = queue.Queue(BEHIND)

    def receive(payload: bytes) -> None:
        if not arrived.full():
            arrived.put_nowait(payload)

    with linked(options) as bus, counted(console) as progress:
        stop = stop_on_signals()
        bus.subscribe(key_of(options.vehicle, "stick"), receive)
        console.print(HOW, highlight=False)
        task = progress.add_task(options.label, total=options.count)
        heard_ns = clock.monotonic_ns()
        while not stop.is_set() and collected.taken < options.count:
            try:
                stick = m.decode(arrived.get(timeout=POLL_S), m.Stick)
            except (queue.Empty, m.InvalidPayloadError):
                if clock.monotonic_ns() - heard_ns > nanoseconds(SILENT_S):
                    console.print(
                        f"[yellow]no sticks of {options.vehicle}[/]:"
                        " is 'autocomplete up' or 'autocomplete run operator' running?"
                    )
                    heard_ns = clock.monotonic_ns()
                continue
            heard_ns = clock.monotonic_ns()
            event = collection.add(stick)
            if event is not None:
                console.print(collected.take(event), highlight=False)
                progress.update(task, completed=collected.taken)
    print(f"{collected.path}: {collected.taken} more, {collected.counts()}")
    return 0
