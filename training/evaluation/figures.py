"""Figures of the evaluation: the early curve, reliability, confusions, losses, families, bars."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from training.dataset.figures import draw_lengths
from training.evaluation.bars import EARLY_F1, FAMILY_F1
from training.evaluation.contenders import CONTENDERS
from training.evaluation.measures import Tally
from training.evaluation.names import CALIBRATED, FAMILY, MOMENTS, OURS, THESIS, WHOLE
from training.evaluation.results import Results
from training.evaluation.tables import Table, is_met
from training.generator.dataset import THESIS as THESIS_PEOPLE
from training.generator.dataset import counts_of, populate
from training.labels import PRIMITIVES

COLOURS = (
    "#000000", "#e69f00", "#56b4e9", "#009e73", "#cc79a7", "#0072b2", "#d55e00", "#999999",
    "#f0e442",
)  # fmt: skip
"""Okabe and Ito's and grey, told apart by colour-blind eyes; ours is black and bold."""
MARKS = ("o", "s", "^", "v", "D", "P", "X", "*", "h")
DPI = 110
PICTURE_OF_BARS = "bars.png"
LENGTHS_OF = 40
"""So many people's primitives are drawn by their lengths."""
FEWEST_IN_A_BIN = 20
"""Answers: of fewer a share says nothing."""

Drawn = tuple[str, str]


def _look(model: str) -> dict[str, Any]:
    number = CONTENDERS.index(model)
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKS[number % len(MARKS)],
        "linewidth": 2.6 if model == OURS else 1.3,
        "markersize": 7 if model == OURS else 5,
        "zorder": 3 if model == OURS else 2,
    }


def _clean(panel: Axes) -> None:
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(alpha=0.25)


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=DPI, bbox_inches="tight")
    plt.close(figure)


def _early(results: Results, path: Path) -> str:
    figure, panels = plt.subplots(1, 2, figsize=(9.6, 4.2), sharey=True)
    at = np.arange(len(MOMENTS))
    for panel, people, title in (
        (panels[0], CALIBRATED, "calibrated people, held out"),
        (panels[1], FAMILY, "families left out"),
    ):
        for model in results.models:
            found = [
                results.f1(model, people, moment)
                if people == CALIBRATED
                else results.of_families(model, moment)
                for moment in MOMENTS
            ]
            means = np.array([one.mean for one in found])
            look = _look(model)
            panel.plot(at, means, label=model, **look)
            if model == OURS:
                half = np.nan_to_num([one.half for one in found])
                panel.fill_between(at, means - half, means + half, color=look["color"], alpha=0.15)
        panel.plot(
            at[: len(EARLY_F1)], list(EARLY_F1.values()), "_", color="#a33c00", ms=22, mew=2,
            label="bar" if panel is panels[0] else None,
        )  # fmt: skip
        panel.set_xticks(at, list(MOMENTS))
        panel.set_title(title, fontsize=11)
        panel.set_xlabel("time since the motion began")
        panel.set_ylim(0.2, 1.01)
        _clean(panel)
    panels[0].set_ylabel("weighted F1")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="lower center", ncols=5, fontsize=9,
        bbox_to_anchor=(0.5, -0.14), frameon=False,
    )  # fmt: skip
    _save(figure, path)
    count = results.count(CALIBRATED)
    return (
        f"Weighted F1 so long after a motion began, mean over seeds (left, n = {count} primitives"
        " in all) and over families (right); shaded: 95 % interval of ours."
    )


def _answered(results: Results, path: Path) -> str:
    """Beside the early curve: what of it flies."""
    figure, panels = plt.subplots(1, 2, figsize=(9.6, 3.8), sharey=True)
    at = np.arange(len(MOMENTS))
    for people, title, style in (
        (CALIBRATED, "calibrated", "-"),
        (FAMILY, "family left out", "--"),
    ):
        found = [results.answered(people, moment) for moment in MOMENTS]
        for part, (text, colour) in enumerate(
            (("answered", "#0072b2"), ("right when answered", "#009e73"))
        ):
            means = [100.0 * pair[part].mean for pair in found]
            panels[0].plot(at, means, style, color=colour, marker="o", label=f"{title}: {text}")
    first = next(iter(results.judged[OURS].values()))
    for kind, colour, mark in zip(first["none"], COLOURS, MARKS, strict=False):
        means = [100.0 * results.nothing(kind, moment, "answered").mean for moment in MOMENTS]
        panels[1].plot(at, means, color=colour, marker=mark, label=kind)
    panels[0].set_title("the four", fontsize=11)
    panels[1].set_title("nothing: answered all the same", fontsize=11)
    panels[0].set_ylabel("% of windows")
    for panel in panels:
        panel.set_xticks(at, list(MOMENTS))
        panel.set_xlabel("time since the motion began")
        panel.set_ylim(-2.0, 102.0)
        panel.legend(
            fontsize=9, frameon=False, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.18)
        )
        _clean(panel)
    _save(figure, path)
    return (
        "What flies: how many windows are answered with the threshold that flies, and how many of"
        " these answers are right; ours, mean over seeds, or over families left out."
    )


def _reliability(results: Results, path: Path) -> str:
    figure, panels = plt.subplots(
        2, 2, figsize=(8.4, 4.9), sharex=True, height_ratios=(3, 1), sharey="row"
    )
    counts = []
    for column, (people, title) in enumerate(
        ((CALIBRATED, "calibrated people, held out"), (FAMILY, "families left out"))
    ):
        tally = results.pooled(OURS, people, tuple(MOMENTS))
        answers, confidence, right = tally.bins.T
        full = answers >= FEWEST_IN_A_BIN
        panel, below = panels[:, column]
        panel.plot(
            [0.25, 1], [0.25, 1], color="#999999", linestyle="--", label="as confident as right"
        )
        share = right[full] / answers[full]
        error = 1.96 * np.sqrt(share * (1 - share) / answers[full])
        panel.errorbar(
            confidence[full] / answers[full], share, error, color="black", marker="o", capsize=3,
            label="cnn-gru, 95 % interval",
        )  # fmt: skip
        panel.set_title(f"{title}: ECE {tally.calibration_error:.3f}", fontsize=11)
        edges = np.linspace(0.0, 1.0, len(answers) + 1)
        below.bar(edges[:-1], answers, np.diff(edges), align="edge", color="#56b4e9")
        below.set_yscale("log")
        below.set_xlabel("confidence")
        below.set_xlim(0.2, 1.01)
        _clean(panel)
        _clean(below)
        counts.append(tally.count)
    panels[0, 0].set_ylabel("share that is right")
    panels[1, 0].set_ylabel("answers")
    panels[0, 0].legend(fontsize=9, frameon=False, loc="upper left")
    _save(figure, path)
    return (
        "Reliability: how often answers of a confidence are right, at all moments and seeds"
        f" together (n = {counts[0]} and {counts[1]} windows;"
        f" bins of fewer than {FEWEST_IN_A_BIN} are left out)."
    )


def _confusion(panel: Axes, tally: Tally, title: str) -> None:
    shares = tally.confusion / tally.confusion.sum(axis=1, keepdims=True)
    panel.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for row, column in np.ndindex(shares.shape):
        share = shares[row, column]
        panel.text(
            column, row, f"{share:.1%}\n{tally.confusion[row, column]}", ha="center", va="center",
            fontsize=9, color="white" if share > 0.5 else "black",
        )  # fmt: skip
    panel.set_xticks(range(len(PRIMITIVES)), PRIMITIVES)
    panel.set_yticks(range(len(PRIMITIVES)), PRIMITIVES)
    panel.set_xlabel("said")
    panel.set_title(f"{title}: F1 {tally.f1:.3f}", fontsize=11)


def _confusions(results: Results, path: Path) -> str:
    models = [model for model in (OURS, THESIS) if model in results.models]
    figure, panels = plt.subplots(
        1, len(models), figsize=(4.4 * len(models), 4.2), squeeze=False, sharey=True
    )
    for panel, model in zip(panels[0], models, strict=True):
        _confusion(panel, results.pooled(model, CALIBRATED, [WHOLE]), model)
    panels[0, 0].set_ylabel("was")
    _save(figure, path)
    counts = (str(results.pooled(model, CALIBRATED, [WHOLE]).count) for model in models)
    return (
        "Figure 5.7 of the thesis, remade: confusions at the end of a primitive, calibrated people"
        f" held out, all seeds together (n = {' and '.join(counts)})."
    )


def _losses(results: Results, path: Path) -> str:
    models = [model for model in (OURS, THESIS) if model in results.models]
    figure, panels = plt.subplots(1, len(models), figsize=(4.6 * len(models), 3.4), squeeze=False)
    for panel, model in zip(panels[0], models, strict=True):
        for number, result in enumerate(results.judged[model].values()):
            history = np.array(result["history"])
            epochs = np.arange(1, len(history) + 1)
            for column, (colour, style, text) in enumerate(
                (("#0072b2", "-", "training"), ("#d55e00", "--", "validation"))
            ):
                panel.plot(
                    epochs, history[:, column], color=colour, linestyle=style, linewidth=1.3,
                    label=text if number == 0 else None,
                )  # fmt: skip
        panel.set_title(model, fontsize=11)
        panel.set_xlabel("epoch")
        panel.set_ylim(bottom=0.0)
        _clean(panel)
    panels[0, 0].set_ylabel("loss, nats")
    panels[0, 0].legend(fontsize=9, frameon=False)
    _save(figure, path)
    return (
        "Figure 5.6 of the thesis, remade: training and validation loss, a line a seed. Ours learns"
        " from augmented, mixed and noisy windows, and is judged on plain ones."
    )


def _families(results: Results, path: Path) -> str:
    families = results.families
    order = sorted(families, key=lambda family: results.f1(results.models[0], FAMILY + family).mean)
    figure, panel = plt.subplots(figsize=(8.4, 0.38 * len(families) + 1.4))
    for model in results.models:
        means = [results.f1(model, FAMILY + family).mean for family in order]
        look = _look(model) | {"linestyle": "none"}
        panel.plot(means, range(len(order)), label=model, **look)
    panel.axvline(FAMILY_F1, color="#a33c00", linestyle="--", linewidth=1.2, label="bar")
    panel.set_yticks(range(len(order)), order)
    panel.set_xlabel("weighted F1 at the end")
    panel.legend(fontsize=9, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _clean(panel)
    _save(figure, path)
    counts = [results.count(FAMILY + one) for one in families]
    few, many = min(counts), max(counts)
    return (
        "Each family left out of training in turn: weighted F1 of its people"
        f" (n = {few if few == many else f'{few} to {many}'} primitives a family)."
    )


def _picture(table: Table, path: Path) -> str:
    """The table of bars as a picture."""
    columns = zip(table.header, *table.rows, strict=True)
    widths = [max(len(cell) for cell in column) + 3.0 for column in columns]
    widths[-1] *= 1.2  # it is bold
    figure, panel = plt.subplots(figsize=(0.086 * sum(widths), 0.27 * (len(table.rows) + 1)))
    panel.axis("off")
    grid = panel.table(
        cellText=table.rows,
        colLabels=table.header,
        colWidths=[width / sum(widths) for width in widths],
        cellLoc="left",
        bbox=Bbox.from_bounds(0.0, 0.0, 1.0, 1.0),
    )
    grid.auto_set_font_size(False)
    grid.set_fontsize(9)
    for (row, column), cell in grid.get_celld().items():
        cell.PAD = 0.03
        cell.set_edgecolor("#dddddd")
        if row == 0:
            cell.set_text_props(weight="bold")
            cell.set_facecolor("#eef2f6")
        elif column == len(table.header) - 1:
            met = is_met(table.rows[row - 1][column])
            colour = {True: "#006b4f", False: "#a33c00", None: "#666666"}[met]
            cell.set_text_props(color=colour, weight="bold")
    _save(figure, path)
    return f"{table.title}. {table.caption}"


def _lengths(path: Path) -> str:
    people = populate(THESIS_PEOPLE, LENGTHS_OF, counts_of(1.0), 0)
    draw_lengths(people, path)
    return (
        "Figure 4.1 of the thesis, remade: sizes of primitives of calibrated people"
        f" (n = {len(people)}, the thesis' counts by class)."
    )


def draw(results: Results, table: Table, out: Path) -> list[Drawn]:
    """Draw what there are results for; (file name, caption) of each figure."""
    wanted: list[tuple[str, Callable[[Path], str]]] = []
    if table.rows:
        wanted.append((PICTURE_OF_BARS, lambda path: _picture(table, path)))
    if results.judged:
        wanted.append(("early.png", lambda path: _early(results, path)))
        if OURS in results.models:
            wanted.append(("answered.png", lambda path: _answered(results, path)))
        wanted.append(("families.png", lambda path: _families(results, path)))
        wanted.append(("lengths.png", _lengths))
    if OURS in results.models:
        wanted.append(("reliability.png", lambda path: _reliability(results, path)))
    if {OURS, THESIS} & set(results.models):
        wanted.append(("confusion.png", lambda path: _confusions(results, path)))
        wanted.append(("losses.png", lambda path: _losses(results, path)))
    return [(name, make(out / name)) for name, make in wanted]
