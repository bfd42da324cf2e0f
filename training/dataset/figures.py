"""Figure 4.1 of the thesis: histograms of how long primitives are, by class."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from training.dataset.primitive import Primitive
from training.labels import CLASSES

LIMITS_SAMPLES = (45, 400)
"""Shorter and longer ones the thesis drops."""
BIN_SAMPLES = 15


def draw_lengths(primitives: Sequence[Primitive], path: Path, title: str = "") -> None:
    """Draw the histograms of sizes in samples, a panel a class that occurs, into an image file.

    Raises:
        ValueError: if there is nothing to draw.
        OSError: if the file cannot be written.
    """
    sizes = {label: np.array([len(p) for p in primitives if p.label == label]) for label in CLASSES}
    present = [label for label in CLASSES if len(sizes[label])]
    if not present:
        raise ValueError("there is nothing to draw: the set is empty")
    most = max(LIMITS_SAMPLES[1], *(int(sizes[label].max()) for label in present))
    bins = np.arange(0, most + 2 * BIN_SAMPLES, BIN_SAMPLES)
    columns = 2 if len(present) > 1 else 1
    rows = -(-len(present) // columns)
    figure, panels = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 2.4 * rows + 0.4), sharex=True, squeeze=False
    )
    for panel in panels.flat[len(present) :]:
        panel.axis("off")
    for panel, label in zip(panels.flat, present, strict=False):
        panel.hist(sizes[label], bins=bins, color="#3b6ea8", edgecolor="white", linewidth=0.3)
        for limit in LIMITS_SAMPLES:
            panel.axvline(limit, color="#b03a2e", linewidth=1.0, linestyle="--")
        panel.set_title(
            f"{label}: n = {len(sizes[label])}, mean {sizes[label].mean():.0f},"
            f" max {sizes[label].max()}",
            fontsize=9,
        )
        panel.set_ylabel("primitives", fontsize=8)
        panel.tick_params(labelsize=8, labelbottom=True)
        panel.set_xlim(0, bins[-1])
        panel.spines[["top", "right"]].set_visible(False)
    for column in range(columns):
        bottom = max(i for i in range(len(present)) if i % columns == column)
        panels.flat[bottom].set_xlabel("samples (dashed: the thesis' limits)", fontsize=8)
    figure.suptitle(title, fontsize=10)
    figure.tight_layout()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=130)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OSError(f"{path} cannot be written: {reason}; choose another file") from None
    finally:
        plt.close(figure)
