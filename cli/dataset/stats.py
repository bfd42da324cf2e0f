"""`autocomplete dataset stats`: counts, lengths and rates of sets, and their length histograms."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cli import options as opts
from cli.extras import needing
from training.labels import CLASSES

if TYPE_CHECKING:
    from training.dataset.summary import Group

GROUPS_SHOWN = 20
"""Generated sets have hundreds of operators."""
FIGURES = (".png", ".pdf", ".svg")


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("files", metavar="FILE.npz", nargs="+", type=opts.existing_file)
    parser.add_argument(
        "--figure",
        metavar="FILE.png",
        type=_figure,
        help="also draw the lengths by class, as the thesis' figure 4.1, as .png, .pdf or .svg",
    )
    opts.add_examples(
        parser,
        "autocomplete dataset stats ana.npz",
        "autocomplete dataset stats *.npz --figure lengths.png",
    )
    parser.set_defaults(action=_run)


def _figure(text: str) -> Path:
    path = Path(text)
    if path.suffix not in FIGURES or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: name a file that ends in {', '.join(FIGURES)}")
    return path


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.store import open_set
        from training.dataset.summary import by_class, group_of, grouped
    stored = [open_set(path) for path in options.files]
    primitives = [primitive for one in stored for primitive in one.primitives()]
    if not primitives:
        raise OSError("there is nothing in it; add primitives with 'autocomplete dataset record'")
    console = Console()
    total = group_of("all", primitives)
    console.print(_lengths([*by_class(primitives), total]))
    families = grouped(primitives, lambda p: p.family or "unknown")
    console.print(_counts("family", families, with_operators=True))
    people = grouped(primitives, lambda p: p.operator)
    console.print(_counts("operator", people, with_operators=False))
    for one in stored:
        told = ", ".join(f"{name}: {text}" for name, text in sorted(one.provenance.items()))
        console.print(f"{one.path}: {told}", markup=False, highlight=False, soft_wrap=True)
    if options.figure is not None:
        with needing("training"):
            from training.dataset.figures import draw_lengths
        names = ", ".join(path.name for path in options.files)
        title = f"Lengths of {len(primitives)} primitives: {names}"
        draw_lengths(primitives, options.figure, title)
        console.print(f"figure: {options.figure}", markup=False, highlight=False, soft_wrap=True)
    return 0


def _lengths(groups: "Sequence[Group]") -> Table:
    table = Table("class", box=None, padding=(0, 2, 0, 0), caption="least / median / most")
    for name in ("n", "operators", "samples", "seconds", "Hz"):
        table.add_column(name, justify="right")
    for group in groups:
        table.add_row(
            group.name,
            str(group.count),
            str(group.operators),
            "{} / {:.0f} / {}".format(*group.samples),
            "{:.1f} / {:.1f} / {:.1f}".format(*group.seconds),
            "{:.0f} / {:.0f} / {:.0f}".format(*group.rates_hz),
        )
    return table


def _counts(kind: str, groups: "Sequence[Group]", *, with_operators: bool) -> Table:
    hidden = len(groups) - GROUPS_SHOWN
    more = f"and {hidden} more" if hidden > 0 else None
    table = Table(box=None, padding=(0, 2, 0, 0), caption=more)
    # Whole names, however long: --operator takes no others.
    table.add_column(kind, overflow="fold")
    people = ("operators",) if with_operators else ()
    for name in ("n", *CLASSES, *people, "samples", "Hz"):
        table.add_column(name, justify="right")
    for group in groups[:GROUPS_SHOWN]:
        table.add_row(
            escape(group.name),
            str(group.count),
            *(str(group.counts[name]) for name in CLASSES),
            *(str(group.operators) for _ in people),
            f"{group.samples[1]:.0f}",
            f"{group.rates_hz[1]:.0f}",
        )
    return table
