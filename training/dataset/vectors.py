"""Reads the original set's vectors: a sequence a row, cells `"[a, b, c]"`, its label at the end."""

import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from training.dataset.axes import Axes
from training.dataset.primitive import Array
from training.dataset.track import BEYOND, Problem

THESIS_RATE_HZ = 45.0
"""Vectors have no times; the thesis measured around 45 Hz."""

_decoder = msgspec.json.Decoder(list[float])


@dataclass(frozen=True, eq=False)
class Vector:
    """One row.

    Attributes:
        row: its number in the file, from 1.
        sticks: (N, 4), without the zeros it was padded with, before or after.
        label: the integer at its end, as a name.
    """

    row: int
    sticks: Array
    label: str


def read_vectors(
    path: Path, axes: Axes, classes: Sequence[str]
) -> tuple[list[Vector], list[Problem]]:
    """The sequences of a file, and its rows that cannot be used.

    Args:
        path: the file.
        axes: which stick each number of a cell is.
        classes: the label that each integer stands for.

    Raises:
        OSError: if it cannot be read.
    """
    vectors, problems = [], []
    csv.field_size_limit(sys.maxsize)
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        rows = csv.reader(stream)
        try:
            for number, cells in enumerate(rows, start=1):
                # A table program writes the columns' numbers first.
                if not cells or (number == 1 and "[" not in "".join(cells)):
                    continue
                try:
                    sticks, label = _parse([cell.strip() for cell in cells], axes, classes)
                except ValueError as error:
                    where = f"row {number}"
                    problems.append(Problem(str(path), where, f"{error}; the row is left out"))
                else:
                    vectors.append(Vector(number, sticks, label))
        except csv.Error as error:
            problems.append(
                Problem(str(path), f"row {rows.line_num}", f"{error}; what follows is left out")
            )
    return vectors, problems


def _parse(cells: list[str], axes: Axes, classes: Sequence[str]) -> tuple[Array, str]:
    if not cells[-1].isdecimal():
        raise ValueError(f"its last cell {cells[-1][:20]!r} should be its label, an integer")
    if int(cells[-1]) >= len(classes):
        raise ValueError(f"label {cells[-1]} has no name; --classes names {','.join(classes)}")
    rows = []
    for place, cell in enumerate(cells[:-1], start=1):
        # Rows of one table are of one length: what a short one lacks is empty.
        if not cell:
            continue
        try:
            sticks = axes.sticks(_decoder.decode(cell))
        except (msgspec.DecodeError, ValueError) as error:
            reason = str(error) if cell.startswith("[") else "no [a, b, c]"
            raise ValueError(f"cell {place} {cell[:30]!r}: {reason}") from None
        if max(map(abs, sticks)) > 1.0 + BEYOND:
            raise ValueError(f"cell {place} {cell[:30]!r} is beyond [-1, 1]")
        rows.append(sticks)
    array = np.array(rows, dtype=np.float64).reshape(-1, 4)
    moved = np.flatnonzero(array.any(axis=1))
    if not len(moved):
        raise ValueError("it holds no motion")
    return array[moved[0] : moved[-1] + 1], classes[int(cells[-1])]
