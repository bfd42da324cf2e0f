"""`autocomplete dataset import`: files of sticks into one set."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cli import options as opts
from cli.dataset import shared
from cli.extras import needing
from cli.progress import counted
from training.labels import CLASSES, PRIMITIVES

if TYPE_CHECKING:
    from training.dataset.lengths import Lengths, Limit
    from training.dataset.primitive import Primitive
    from training.dataset.reading import Reading, Rules

FORMATS = ("auto", "joy", "csv", "vectors", "mcap", "npz")
NOT_OF_FLIGHTS = ("label", "buttons", "axes", "rate", "idle")
"""Options that say what the sticks of a flight's suggestions say themselves."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("files", metavar="FILE", nargs="+", type=opts.existing_file)
    parser.add_argument(
        "--out", metavar="FILE.npz", type=shared.set_file, required=True, help="the set to write"
    )
    parser.add_argument(
        "--append", action="store_true", help="add to --out where it is there already"
    )
    parser.add_argument(
        "--sound", action="store_true", help="leave out what 'dataset check' would find fault with"
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default="auto",
        help="joy: rostopic echo of sensor_msgs/Joy; csv: secs,a,b,c,tri,cir,X,squ;"
        " vectors: cells [a, b, c], label last; mcap: of 'autocomplete record'; npz: a set (auto)",
    )
    shared.add_people(
        parser,
        "who performed (the file's name; name whoever is in several files, or 'split' takes each"
        " file for another person)",
        required=False,
    )
    labels = parser.add_argument_group("labels")
    labels.add_argument("--label", choices=CLASSES, help="of everything in the files")
    labels.add_argument(
        "--buttons",
        metavar="B=LABEL,...",
        type=_buttons,
        help="what the button that ended a primitive says of it"
        " (triangle=line,circle=arc,cross=sine,square=helix, and so on around other pads)",
    )
    labels.add_argument(
        "--classes",
        metavar="LABEL,...",
        type=_classes,
        default=PRIMITIVES,
        help=f"what the integers 0, 1, ... of vectors stand for ({','.join(PRIMITIVES)})",
    )
    labels.add_argument(
        "--from-flights",
        action="store_true",
        help="label the sticks of recorded flights by what became of their suggestions:"
        " accepted is the suggestion's primitive, taken back within 2 s is none",
    )
    labels.add_argument(
        "--ignored-is-none",
        action="store_true",
        help="with --from-flights: suggestions that nobody accepted are none as well",
    )
    cut = parser.add_argument_group("axes and cutting")
    cut.add_argument(
        "--axes",
        metavar="AXIS,...",
        type=_axes,
        help="the stick that each axis of the file is, of vx vy vz wz; _ skips one, -vz turns one"
        " around (joy: vy,vx,wz,vz; csv and vectors: vy,vx,vz; so on newer drivers vy,vx,wz)",
    )
    cut.add_argument("--rate", metavar="HZ", type=_rate, help="of vectors, which lack times (45)")
    cut.add_argument(
        "--segmentation",
        choices=("ours", "thesis"),
        default="ours",
        help="ours: cut at buttons and long rests; thesis: also wherever vx or vy is 0, runs of 90"
        " rows (ours)",
    )
    cut.add_argument(
        "--idle", metavar="S", type=opts.duration, help="a rest of S seconds ends a primitive (1)"
    )
    lengths = parser.add_argument_group("lengths, each as 45 (samples) or 1s (seconds)")
    lengths.add_argument(
        "--preset",
        choices=("ours", "thesis"),
        default="ours",
        help="ours: 1s to 20s, kept whole; thesis: 45 to 400, brought to 200, padded (ours)",
    )
    lengths.add_argument("--shortest", metavar="N", type=_limit, help="drop what is shorter")
    lengths.add_argument("--longest", metavar="N", type=_limit, help="drop what is longer")
    lengths.add_argument(
        "--length", metavar="SAMPLES", type=opts.positive, help="bring what is longer to so many"
    )
    lengths.add_argument(
        "--over",
        choices=("newest", "resample", "drop"),
        help="how: keep the newest samples, resample the whole, or drop it (newest)",
    )
    lengths.add_argument("--pad", action="store_true", help="pad what is shorter with zeros")
    opts.add_examples(
        parser,
        "autocomplete dataset import joy.yaml --out ana.npz --operator ana",
        "autocomplete dataset import arcs.csv --label arc --axes vy,vx,wz --out arcs.npz",
        "autocomplete dataset import vectors.csv --out thesis.npz --preset thesis",
        "autocomplete dataset import recordings/*.mcap --out flights.npz --from-flights"
        " --operator ana",
        "autocomplete dataset import ana.npz ben.npz --out all.npz",
    )
    parser.set_defaults(action=_run)


def _axes(text: str) -> str:
    from training.dataset.axes import parse_axes

    try:
        parse_axes(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def _limit(text: str) -> "Limit":
    from training.dataset.lengths import parse_limit

    try:
        return parse_limit(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _label(text: str) -> str:
    if text not in CLASSES:
        raise argparse.ArgumentTypeError(f"no label {text!r}; there are {', '.join(CLASSES)}")
    return text


def _buttons(text: str) -> dict[str, str]:
    buttons = {}
    for pair in text.split(","):
        button, equals, label = pair.partition("=")
        if not equals or not button.strip():
            raise argparse.ArgumentTypeError(f"{pair!r}: write BUTTON=LABEL, as in circle=arc")
        buttons[button.strip()] = _label(label.strip())
    return buttons


def _classes(text: str) -> tuple[str, ...]:
    return tuple(_label(label.strip()) for label in text.split(","))


def _rate(text: str) -> float:
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r}: use Hz, 1 to 1000")
    return rate_hz


def _lengths(options: argparse.Namespace) -> "Lengths":
    from training.dataset.lengths import PRESETS

    lengths = PRESETS[options.preset]
    if options.shortest is not None:
        lengths = replace(lengths, shortest=options.shortest)
    if options.longest is not None:
        lengths = replace(lengths, longest=options.longest)
    if options.length is not None:
        lengths = replace(lengths, length=options.length)
    if lengths.length is None and (options.over or options.pad):
        raise ValueError("--over and --pad need a --length to bring primitives to")
    if options.over is not None:
        lengths = replace(lengths, over=options.over)
    shortest, longest = lengths.shortest, lengths.longest
    if shortest.is_time == longest.is_time and shortest.amount > longest.amount:
        raise ValueError(f"--shortest {shortest} is more than --longest {longest}: nothing is left")
    return replace(lengths, padded=lengths.padded or options.pad)


def _rules(options: argparse.Namespace) -> "Rules":
    from training.dataset.reading import BUTTONS, Rules

    rules = Rules(
        axes=options.axes,
        operator=options.operator,
        family=options.family,
        label=options.label,
        buttons=options.buttons or BUTTONS,
        segmentation=options.segmentation,
        classes=options.classes,
        lengths=_lengths(options),
    )
    if options.idle is not None:
        rules = replace(rules, idle_s=options.idle)
    return rules if options.rate is None else replace(rules, rate_hz=options.rate)


def _require_flights(options: argparse.Namespace) -> None:
    """Refuse what would say nothing: labels, axes and cuts come from the flight itself."""
    given = [f"--{name}" for name in NOT_OF_FLIGHTS if getattr(options, name) is not None]
    if options.segmentation != "ours":
        given.append("--segmentation")
    if options.format not in ("auto", "mcap"):
        given.append("--format")
    if given:
        raise ValueError(
            f"{given[0]} says nothing of --from-flights, whose labels, axes and cuts are those of"
            " the suggestions; leave one of the two out"
        )


def _read(path: Path, options: argparse.Namespace, rules: "Rules", console: Console) -> "Reading":
    """What a file gives, or its one problem."""
    with needing("training"):
        from training.dataset.flights import read_flight
        from training.dataset.reading import Reading, at_lengths, operator_of, read_file
        from training.dataset.track import Problem
    try:
        if not options.from_flights:
            return read_file(path, rules, None if options.format == "auto" else options.format)
        found, fates, problems = read_flight(
            path,
            operator_of(path, rules),
            rules.family,
            ignored_is_none=options.ignored_is_none,
        )
    except OSError as error:
        return Reading([], [Problem("", "", str(error))])
    told = ", ".join(f"{count} {fate}" for fate, count in fates.items())
    text = f"{path.name}: suggestions: {told}"
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    return at_lengths(path, found, problems, rules.lengths)


def _sound(primitives: "list[Primitive]") -> "list[Primitive]":
    """Those that nothing is wrong with; what is wrong with the others is told."""
    from training.dataset.check import sound_of

    sound, findings = sound_of(primitives)
    faults = [(primitives[each.row].source, each.text) for each in findings if each.row is not None]
    shared.tell([f"{source}: {text}; left out" for source, text in faults])
    return sound


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.store import open_set, save
    if options.ignored_is_none and not options.from_flights:
        raise ValueError("--ignored-is-none goes with --from-flights")
    if options.from_flights:
        _require_flights(options)
    rules = _rules(options)
    primitives: list[Primitive] = []
    provenance: dict[str, str] = {}
    if options.out.exists():
        if not options.append:
            raise OSError(f"{options.out} is there already; choose another --out, or --append")
        before = open_set(options.out)
        provenance = before.provenance
        primitives = before.primitives()
    table = Table("file", *CLASSES, "problems", box=None, padding=(0, 2, 0, 0))
    console = Console(stderr=True)
    taken = 0
    with counted(console) as progress:
        for path in progress.track(options.files, description="reading"):
            reading = _read(path, options, rules, console)
            shared.tell(reading.problems)
            labels = [p.label for p in reading.primitives]
            counts = [str(labels.count(label)) for label in CLASSES]
            table.add_row(escape(path.name), *counts, str(len(reading.problems)))
            primitives += reading.primitives
            taken += len(labels)
            provenance = shared.joined(provenance, reading.made)
    console.print(table)
    if options.sound:
        primitives = _sound(primitives)
    if not taken or not primitives:
        raise OSError("nothing of these files can be used, so nothing was written")
    save(options.out, primitives, shared.made(provenance, options))
    print(f"{options.out}: {len(primitives)} primitives")
    return 0
