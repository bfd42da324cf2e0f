"""`autocomplete train`: from simulated operators to a model file with its card."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from cli import options as opts
from cli.extras import needing
from cli.progress import counted
from services.classifier.config import SHIPPED_MODEL

if TYPE_CHECKING:
    from training.fit import Epoch
    from training.outcome import Judged, Run

PRESETS = ("shipped", "quick")


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.description = (
        "Trains the network on simulated people, judges it on others, and writes the file that"
        " the classifier loads (intent.onnx), its weights (intent.pt, what --finetune begins with),"
        " its card (README.md) and its figures (intent.json). A run that was stopped leaves"
        " intent.checkpoint in the folder; --resume goes on with it. docs/model.md tells more."
    )
    job = parser.add_mutually_exclusive_group()
    job.add_argument(
        "--preset",
        choices=PRESETS,
        help="how much to train on: shipped (about 11 minutes, the default) or quick (under one)",
    )
    parser.add_argument("--seed", type=opts.seed, help="same seed, same model (0)")
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=opts.folder,
        help="where intent.onnx, its card README.md and its figures go (models/; models/quick/ with"
        " --preset quick, models/finetuned/ with --finetune)",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run of the same preset, seed, people and folder that was stopped",
    )
    job.add_argument(
        "--finetune",
        metavar="FILE",
        type=Path,
        help="adapt a model to one person's performances, a file of 'autocomplete dataset'",
    )
    parser.add_argument(
        "--model",
        metavar="FILE",
        type=Path,
        help="the model that --finetune begins with (the shipped one)",
    )
    parser.add_argument(
        "--operator",
        metavar="NAME",
        help="whom of the file's people --finetune adapts to (needed if there are several)",
    )
    job.add_argument(
        "--ablation",
        metavar="FILE",
        type=Path,
        help="compare variants of the network, with seeds of its own, and write the page FILE",
    )
    opts.add_examples(
        parser,
        "autocomplete train                                # the shipped model anew, into models/",
        "autocomplete train --preset quick                 # a minute, to see that it works",
        "autocomplete train --finetune ana.npz --out models/ana   # adapted to Ana",
    )
    parser.set_defaults(action=_run)


class _Bars:
    """Shows a training run."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, TaskID] = {}

    def generating(self, name: str, done: int, total: int) -> None:
        self._show(f"people: {name}", done, total)

    def batch(self, done: int, total: int) -> None:
        self._show("epoch", done, total)

    def epoch(self, epoch: "Epoch", epochs: int) -> None:
        self._show("training", epoch.number, epochs)
        mark = " [green]best[/]" if epoch.is_best else ""
        self._progress.console.print(
            f"epoch {epoch.number:3d}  loss {epoch.training_loss:.3f}"
            f"  validation loss {epoch.validation_loss:.3f}"
            f"  accuracy {epoch.validation_accuracy:.3f}{mark}"
        )

    def _show(self, text: str, done: int, total: int) -> None:
        if text not in self._tasks:
            self._tasks[text] = self._progress.add_task(text, total=total)
        self._progress.update(self._tasks[text], completed=done, total=total)


def _require_one_job(options: argparse.Namespace) -> None:
    """Refuse options that would say nothing of what is asked for.

    Raises:
        ValueError: if there is one.
    """
    if options.resume and (options.finetune or options.ablation):
        raise ValueError("--resume goes on with a training; leave it or the other job out")
    if options.model is not None and options.finetune is None:
        raise ValueError("--model is what --finetune begins with; name a file with --finetune")
    if options.operator is not None and options.finetune is None:
        raise ValueError("--operator is whom --finetune adapts to; name a file with --finetune")
    if options.out is not None and options.ablation is not None:
        raise ValueError("--out is a model's folder; --ablation writes its page only")
    if options.seed is not None and options.ablation is not None:
        raise ValueError("--seed is of one model; --ablation has seeds of its own")


def _run(options: argparse.Namespace) -> int:
    # What is said wrongly is told before torch is loaded, which takes seconds.
    _require_one_job(options)
    if options.finetune is not None:
        return _finetune(Console(), options)
    with needing("training"):
        from training.train import train
    # Not argparse's defaults: what was said must be known, and it forgets what equals a default.
    seed, preset = options.seed or 0, options.preset or "shipped"
    console = Console()
    with counted(console) as progress:
        bars = _Bars(progress)
        if options.ablation is not None:
            return _ablation(console, options, bars)
        try:
            run = train(
                preset,
                seed,
                options.out or Path("models/quick" if preset == "quick" else "models"),
                bars,
                resume=options.resume,
                processes=1 if preset == "quick" else min(4, os.cpu_count() or 1),
            )
        except KeyboardInterrupt:
            raise OSError("stopped; --resume goes on after the last whole epoch") from None
    _report(console, run)
    return 0


def _finetune(console: Console, options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.check import load_sound

        primitives, findings = load_sound(options.finetune)
        from training.finetune import finetune
    for finding in findings:
        # What is wrong with a person as a whole leaves nobody's rows out.
        fate = "left out" if finding.row is not None else "look at this"
        console.print(f"{fate}: {finding}", markup=False, soft_wrap=True)
    out = options.out or Path("models/finetuned")
    begin = options.model or SHIPPED_MODEL
    with counted(console) as progress:
        tell = _Bars(progress).generating
        done = finetune(primitives, begin, out, options.seed or 0, tell, options.operator)
    learned = done.learned
    console.print(
        f"{done.performances} performances by {done.operator}: F1 {learned.before:.3f} before;"
        f" {learned.after:.3f} after, on those left out of each of three adaptations",
        markup=False,
    )
    if not learned.of_use:
        console.print("no more of them were named right than before, so the model stays as it was")
    console.print(
        f"of those left out {learned.given} of {done.performances} are answered surely enough to"
        f" be suggested, and {learned.given_right} of these answers are right; the threshold is"
        " that of the model it began with"
    )
    console.print(f"{done.path}  sha256 {done.sha256[:8]}")
    return 0


def _ablation(console: Console, options: argparse.Namespace, bars: _Bars) -> int:
    from training.ablation import ablate, page_of, sets_of, table_of

    sets = sets_of(bars.generating)
    rows = []
    for row in ablate(sets, bars.generating):
        rows.append(row)
        console.print(table_of(rows[-1:]).splitlines()[-1], soft_wrap=True)
        options.ablation.write_text(page_of(rows, {k: len(v) for k, v in sets.items()}))
    return 0


def _report(console: Console, run: "Run") -> None:
    table = Table(
        box=None,
        padding=(0, 2, 0, 0),
        title=f"{sum(j.whole.count for j in run.judged)} primitives of people held out",
        caption="F1 is weighted by class: at the end with its 95 % interval over people, and so"
        " many seconds after the beginning. ECE: expected calibration error. AUROC: none against"
        " the four.",
    )
    for heading in ("people", "F1", "interval"):
        table.add_column(heading, no_wrap=True)
    for after, _ in run.judged[0].early:
        table.add_column(f"{after:g} s", no_wrap=True)
    table.add_column("ECE")
    table.add_column("AUROC")
    for judged in run.judged:
        low, high = judged.whole.interval
        table.add_row(
            judged.name,
            f"{judged.whole.f1:.3f}",
            f"{low:.2f}-{high:.2f}",
            *(f"{s.f1:.3f}" for _, s in judged.early),
            f"{judged.calibration:.3f}",
            f"{judged.auroc:.3f}",
        )
    console.print(table)
    for judged in run.judged:
        console.print(_confusion(judged))
    console.print(f"{run.path}  sha256 {run.sha256[:8]}  card {run.path.with_name('README.md')}")


def _confusion(judged: "Judged") -> Table:
    from training.labels import PRIMITIVES

    table = Table(box=SIMPLE, title=f"{judged.name}: was (rows), said (columns)")
    table.add_column("")
    for label in PRIMITIVES:
        table.add_column(label, justify="right")
    for label, row in zip(PRIMITIVES, judged.whole.confusion.tolist(), strict=True):
        table.add_row(label, *(str(n) for n in row))
    return table
