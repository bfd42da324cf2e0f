"""Reads the original set's CSV: `secs,a,b,c,tri,cir,X,squ`, a row a sample."""

import csv
from pathlib import Path

from training.dataset.axes import Axes
from training.dataset.track import Problem, Track, TrackBuilder

TIME = "secs"
VALUES = ("a", "b", "c")
FACES = {"tri": "triangle", "cir": "circle", "X": "cross", "squ": "square"}
COLUMNS = (TIME, *VALUES, *FACES)


def read_table(path: Path, axes: Axes) -> tuple[list[Track], list[Problem]]:
    """The sticks of a file, and its rows that cannot be used. The header is row 1.

    Raises:
        OSError: if it cannot be read.
    """
    builder = TrackBuilder(str(path))
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        rows = csv.reader(stream)
        header = [name.strip() for name in next(rows, [])]
        missing = [name for name in COLUMNS if name not in header]
        if missing:
            builder.reject(
                "row 1",
                f"no column {', '.join(missing)}; the columns should be {','.join(COLUMNS)}",
            )
            return [], builder.problems
        places = {name: header.index(name) for name in COLUMNS}
        try:
            for row in rows:
                if row:
                    _take(builder, f"row {rows.line_num}", row, places, axes)
        except csv.Error as error:
            builder.reject(f"row {rows.line_num}", f"{error}; what follows is left out")
    return builder.tracks(), builder.problems


def _take(
    builder: TrackBuilder, where: str, row: list[str], places: dict[str, int], axes: Axes
) -> None:
    cells = {}
    for name, place in places.items():
        try:
            cells[name] = float(row[place])
        except IndexError:
            builder.reject(where, f"column {name} is missing; the row is left out")
            return
        except ValueError:
            builder.reject(
                where, f"column {name}: {row[place]!r} is no number; the row is left out"
            )
            return
    try:
        sticks = axes.sticks([cells[name] for name in VALUES])
    except ValueError as error:
        builder.reject(where, f"{error}; the row is left out")
        return
    held = tuple(button for name, button in FACES.items() if cells[name])
    builder.add(where, cells[TIME], sticks, held)
