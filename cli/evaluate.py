"""`autocomplete evaluate`: every classifier on the same people, against the bars."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table as Grid

from cli import options as opts
from cli.extras import needing
from cli.progress import counted

if TYPE_CHECKING:
    from training.evaluation.tables import Table


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.description = (
        "Trains every classifier on the same simulated people, asks it about people whom it has not"
        " learned from, and writes tables and figures of all results in the folder. A result that"
        " is there and not stale is not found again: an evaluation that was stopped goes on where"
        " it was, and several with other --seeds may run side by side in one folder. A change of"
        " the people, of what is asked, or of the code of a classifier makes its results stale."
    )
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=opts.folder,
        default=Path("evaluation"),
        help="where results and report go, with --quick into quick/ in it (evaluation)",
    )
    parser.add_argument(
        "--seeds",
        type=_seeds,
        metavar="0,1,...",
        help="of people and training, 0 to 4: each leaves other families out (all five)",
    )
    parser.add_argument(
        "--models", metavar="NAME,...", help="which classifiers, for example cnn-gru,svm (all)"
    )
    parser.add_argument(
        "--no-people",
        dest="people",
        action="store_false",
        help="leave out training on recordings of real people",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few people and one seed, to see that it works"
    )
    parser.add_argument(
        "--report", action="store_true", help="train nothing: report the results that are there"
    )
    parser.add_argument(
        "--docs",
        metavar="FILE.md",
        type=opts.existing_file,
        help="also renew the tables and figures at the end of this page",
    )
    opts.add_examples(
        parser,
        "autocomplete evaluate                       # everything: hours",
        "autocomplete evaluate --quick               # minutes; its figures mean nothing",
        "autocomplete evaluate --models 'cnn-gru,geometry + ExtraTrees' --seeds 0,1",
        "autocomplete evaluate --report --docs docs/evaluation.md",
    )
    parser.set_defaults(action=_run)


def _seeds(text: str) -> tuple[int, ...]:
    return tuple(opts.seed(part.strip()) for part in text.split(","))


class _Bars:
    """One bar a task; a finished one goes."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._text = ""
        self._task: TaskID | None = None

    def show(self, text: str, done: int, total: int) -> None:
        if text != self._text and self._task is not None:
            self._progress.remove_task(self._task)
            self._task = None
        if self._task is None:
            self._task = self._progress.add_task(text, total=total)
        self._text = text
        self._progress.update(self._task, completed=done, total=total)


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from common.clock import SystemClock
        from training.evaluation.contenders import CONTENDERS
        from training.evaluation.run import ALL_SEEDS, Order, evaluate
    models = CONTENDERS
    if options.models is not None:
        models = tuple(name.strip() for name in options.models.split(","))
        unknown = [name for name in models if name not in CONTENDERS]
        if unknown:
            raise ValueError(f"--models {unknown[0]!r}: use {', '.join(CONTENDERS)}")
    seeds: tuple[int, ...] = options.seeds or (ALL_SEEDS[:1] if options.quick else ALL_SEEDS)
    if not set(seeds) <= set(ALL_SEEDS):
        raise ValueError(f"--seeds {max(seeds)}: use {ALL_SEEDS[0]} to {ALL_SEEDS[-1]}")
    if options.docs is not None and options.quick:
        raise ValueError("--docs: figures of a quick run mean nothing; leave --quick out")
    if options.report:
        models, options.people = (), False
    order = Order(
        out=options.out,
        seeds=seeds,
        models=models,
        size="quick" if options.quick else "full",
        people=options.people,
        page=options.docs,
    )
    console = Console()
    with counted(console) as progress:
        tables = evaluate(order, SystemClock(), _Bars(progress).show)
    for table in tables:
        console.print(_grid(table))
    console.print(f"{order.folder / 'report.html'}  {order.folder / 'report.md'}")
    return 0


def _grid(table: "Table") -> Grid:
    grid = Grid(title=table.title, caption=table.caption, box=None, padding=(0, 2, 0, 0))
    for heading in table.header:
        grid.add_column(heading)
    for row in table.rows:
        grid.add_row(*row)
    return grid
