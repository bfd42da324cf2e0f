"""`autocomplete dataset generate`: a set by simulated operators."""

import argparse
from dataclasses import replace
from functools import partial

from rich.console import Console

from cli import options as opts
from cli.dataset import shared
from cli.extras import needing
from cli.progress import counted
from training.labels import NONE


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--out", metavar="FILE.npz", type=shared.set_file, required=True, help="the set to write"
    )
    parser.add_argument(
        "--preset",
        choices=("wide", "thesis"),
        default="wide",
        help="wide: many kinds of people; thesis: those on which the thesis' SVM scores as in the"
        " thesis (wide)",
    )
    parser.add_argument(
        "--operators", metavar="N", type=opts.positive, default=20, help="how many people (20)"
    )
    parser.add_argument(
        "--multiple",
        metavar="X",
        type=_multiple,
        default=1.0,
        help="of the thesis' 597 lines, 716 arcs, 617 sines, 469 helices (1)",
    )
    parser.add_argument(
        "--none", metavar="N", type=opts.seed, default=0, help="and so many that are none (0)"
    )
    parser.add_argument("--seed", type=opts.seed, default=0, help="same seed, same set (0)")
    opts.add_examples(
        parser,
        "autocomplete dataset generate --out people.npz",
        "autocomplete dataset generate --out small.npz --operators 5 --multiple 0.05 --none 20",
        "autocomplete dataset generate --out thesis.npz --preset thesis --seed 1",
    )
    parser.set_defaults(action=_run)


def _multiple(text: str) -> float:
    try:
        multiple = float(text)
    except ValueError:
        multiple = 0.0
    if not 0.0 < multiple <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r}: use a number above 0, to 1000")
    return multiple


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.store import save
        from training.generator.dataset import THESIS, counts_of, generate, populate
    # What is there may be somebody's performances, which no seed brings back.
    if options.out.exists():
        raise OSError(f"{options.out} is there already; choose another --out, or remove it")
    counts = counts_of(options.multiple)
    if options.none:
        counts[NONE] = options.none
    with counted(Console(stderr=True)) as progress:
        task = progress.add_task("performing", total=sum(counts.values()))

        def advance(more: int) -> None:
            progress.advance(task, more)

        make = partial(populate, THESIS) if options.preset == "thesis" else generate
        primitives = make(options.operators, counts, options.seed, progress=advance)
    # People of other sets are other people, so that sets may be joined.
    begin = f"{options.preset}{options.seed}"
    primitives = [replace(one, operator=f"{begin}-{one.operator}") for one in primitives]
    made = (
        f"generate --preset {options.preset} --operators {options.operators}"
        f" --multiple {options.multiple!r} --none {options.none} --seed {options.seed}"
    )
    save(options.out, primitives, {"made": made})
    operators = len({one.operator for one in primitives})
    print(f"{options.out}: {len(primitives)} primitives by {operators} operators")
    return 0
