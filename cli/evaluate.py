"""`autocomplete evaluate`: every classifier on the same people, against the bars."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table as Grid

from cli import options as opts
from cli.progress import counted

if TYPE_CHECKING:
    from training.evaluation.tables import Table


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=Path,
        help="where results and report go; results that are there are not found again"
        " (evaluation, or evaluation-quick with --quick)",
    )
    parser.add_argument(
        "--seeds", type=_seeds, metavar="0,1,...", help="of people and training (all five)"
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
    opts.add_examples(
        parser,
        "autocomplete evaluate                       # everything; begun again, it goes on",
        "autocomplete evaluate --quick               # minutes; its figures mean nothing",
        "autocomplete evaluate --models 'cnn-gru,geometry + ExtraTrees' --seeds 0,1",
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
    try:
        from common.clock import SystemClock
        from training.evaluation.contenders import CONTENDERS
        from training.evaluation.run import ALL_SEEDS, Order, evaluate
    except ModuleNotFoundError as error:
        raise OSError(
            f"{error.name} is missing; install it with pip install -e '.[training]'"
        ) from None
    models = CONTENDERS
    if options.models is not None:
        models = tuple(name.strip() for name in options.models.split(","))
        unknown = [name for name in models if name not in CONTENDERS]
        if unknown:
            raise ValueError(f"--models {unknown[0]!r}: use {', '.join(CONTENDERS)}")
    out: Path = options.out or Path("evaluation-quick" if options.quick else "evaluation")
    order = Order(
        out=out,
        seeds=options.seeds or (ALL_SEEDS[:1] if options.quick else ALL_SEEDS),
        models=models,
        size="quick" if options.quick else "full",
        people=options.people,
    )
    console = Console()
    with counted(console) as progress:
        tables = evaluate(order, SystemClock(), _Bars(progress).show)
    for table in tables:
        console.print(_grid(table))
    console.print(f"{out / 'report.html'}  {out / 'report.md'}")
    return 0


def _grid(table: "Table") -> Grid:
    grid = Grid(title=table.title, caption=table.caption, box=None, padding=(0, 2, 0, 0))
    for heading in table.header:
        grid.add_column(heading)
    for row in table.rows:
        grid.add_row(*row)
    return grid
