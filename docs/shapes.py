"""Draws the shapes that are suggested: what was flown, and the path that continues it.

Run by `make shapes`; writes docs/shapes.png. Each panel is one seeded example of a primitive's own
generator, seen with 2 cm of noise in each coordinate (5 mm for the compound).
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from services.synthesis.continuation import Vehicle, continue_from
from services.synthesis.primitives import EXTENDED, PRIMITIVES

OUTPUT = Path(__file__).with_name("shapes.png")
EXTENTS = {
    "line": 3.0,
    "arc": 1.6,
    "helix": 3.0,
    "sine": 1.2,
    "spiral": 8.0,
    "eight": 1.1,
    "zigzag": 3.4,
    "compound": 2.4,
}
NOISE_M = {"compound": 0.005}
SEEDS = {"line": 3, "helix": 5}
FLOWN, AHEAD = "#5b6675", "#d98a00"


def main() -> None:
    """Draw one panel a primitive."""
    figure = plt.figure(figsize=(11.0, 5.8))
    for index, (name, primitive) in enumerate((PRIMITIVES | EXTENDED).items(), start=1):
        rng = np.random.default_rng(SEEDS.get(name, 1))
        example = primitive.example(rng, EXTENTS[name])
        noise = rng.normal(0.0, NOISE_M.get(name, 0.02), example.points_m.shape)
        here = example.points_m[-1]
        shape = primitive.fit(example.points_m + noise, here)
        path = continue_from(shape, Vehicle(here, None))[:, :3]
        flown = example.points_m + noise
        solid = name == "helix"
        axes = figure.add_subplot(2, 4, index, projection="3d" if solid else None)
        columns = slice(0, 3 if solid else 2)
        axes.plot(*path[:, columns].T, color=AHEAD, linewidth=1.6, label="suggested")
        dots = {"linestyle": "", "marker": ".", "markersize": 2.5}
        axes.plot(*flown[:, columns].T, color=FLOWN, label="flown", **dots)
        axes.plot(*here[columns, None], linestyle="", marker="o", color="k", label="vehicle")
        axes.set_title(f"{name}, m; rms {100.0 * shape.quality.rms_m:.1f} cm", fontsize=9)
        axes.tick_params(labelsize=6)
        axes.set_aspect("equal")
        if index == 1:
            axes.legend(fontsize=7, frameon=False)
    figure.tight_layout()
    figure.savefig(OUTPUT, dpi=90)


if __name__ == "__main__":
    main()
