"""Any file of sticks as labelled primitives: format found, cut, labelled, kept to length."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from training.dataset.axes import JOY_AXES, SAMPLE_AXES, parse_axes
from training.dataset.joy import read_joy
from training.dataset.lengths import PRESETS, Lengths
from training.dataset.primitive import Primitive
from training.dataset.recordings import read_recording
from training.dataset.segmentation import IDLE_S, THESIS_ROWS, as_thesis, at_buttons
from training.dataset.store import DatasetError, Stored, open_set
from training.dataset.table import read_table
from training.dataset.track import Problem, Track
from training.dataset.vectors import THESIS_RATE_HZ, Vector, read_vectors
from training.labels import PRIMITIVES

Format = Literal["joy", "csv", "vectors", "mcap", "npz"]
Segmentation = Literal["ours", "thesis"]

BUTTONS = {
    **dict(zip(("triangle", "circle", "cross", "square"), PRIMITIVES, strict=False)),
    **dict(zip(("y", "b", "a", "x"), PRIMITIVES, strict=False)),
    **dict(zip(("face1", "face2", "face3", "face4"), PRIMITIVES, strict=False)),
}
"""Face buttons clockwise from the top are the first four primitives, on each family of pads."""


@dataclass(frozen=True)
class Rules:
    """How files are read.

    Attributes:
        axes: which stick each of the file's axes is; None: as the original data set has them.
        operator: who performed; None: the file's name, or as a set says.
        family: what kind of people that is.
        label: of everything in the files; None: by button, or as the file says.
        buttons: the label that each button stands for.
        segmentation: at buttons and long rests, or as the original parser did.
        idle_s: rest that ends a primitive.
        rate_hz: of files without times.
        classes: the label that each integer of vectors stands for.
        lengths: which primitives are kept.
    """

    axes: str | None = None
    operator: str | None = None
    family: str = ""
    label: str | None = None
    buttons: Mapping[str, str] = field(default_factory=lambda: dict(BUTTONS))
    segmentation: Segmentation = "ours"
    idle_s: float = IDLE_S
    rate_hz: float = THESIS_RATE_HZ
    classes: tuple[str, ...] = PRIMITIVES
    lengths: Lengths = PRESETS["ours"]


@dataclass(frozen=True)
class Reading:
    """What a file gave.

    Attributes:
        primitives: what can be used.
        problems: rows and primitives that cannot, each with its reason.
        made: the commands that the file says it came from; only sets do.
    """

    primitives: list[Primitive]
    problems: list[Problem]
    made: str = ""


def format_of(path: Path) -> Format:
    """A file's format, by how it begins.

    Raises:
        DatasetError: if it is empty or of no format that is known.
        OSError: if it cannot be read.
    """
    with path.open("rb") as stream:
        begin = stream.read(4096)
    if begin.startswith(b"\x89MCAP"):
        return "mcap"
    if begin.startswith(b"PK"):
        return "npz"
    lines = begin.decode("utf-8-sig", errors="replace").splitlines()
    first = next((line.strip() for line in lines if line.strip(" \t-%")), "")
    if not first:
        raise DatasetError(f"{path} is empty")
    if first.startswith("header:"):
        return "joy"
    if "[" in first or (first.replace(",", "").isdecimal() and b"[" in begin):
        return "vectors"
    if "secs" in first:
        return "csv"
    raise DatasetError(
        f"{path} is of no known format (it begins {first[:30]!r}); name its --format"
    )


def read_file(path: Path, rules: Rules, file_format: Format | None = None) -> Reading:
    """The primitives of a file; what cannot be used is told, and the rest is read.

    Args:
        path: the file.
        rules: how to read it.
        file_format: its format; None finds it.

    Raises:
        DatasetError: if nothing of it can be read.
        OSError: if it cannot be opened.
    """
    if file_format is None:
        file_format = format_of(path)
    if file_format == "npz":
        stored = open_set(path)
        primitives, problems = _from_set(stored, rules)
        reading = at_lengths(path, primitives, problems, rules.lengths)
        return replace(reading, made=stored.provenance.get("made", ""))
    if file_format == "vectors":
        vectors, problems = read_vectors(path, parse_axes(rules.axes or SAMPLE_AXES), rules.classes)
        primitives = [_from_vector(path, vector, rules) for vector in vectors]
    else:
        readers: dict[str, Callable[[Path], tuple[list[Track], list[Problem]]]] = {
            "joy": partial(read_joy, axes=parse_axes(rules.axes or JOY_AXES)),
            "csv": partial(read_table, axes=parse_axes(rules.axes or SAMPLE_AXES)),
            "mcap": read_recording,
        }
        tracks, problems = readers[file_format](path)
        primitives = []
        for track in tracks:
            found, unlabelled = _from_track(path, track, rules)
            primitives += found
            problems += unlabelled
    return at_lengths(path, primitives, problems, rules.lengths)


def at_lengths(
    path: Path, primitives: Sequence[Primitive], problems: Sequence[Problem], lengths: Lengths
) -> Reading:
    """A file's primitives at their lengths; those that are dropped join its problems."""
    reading = Reading([], list(problems))
    for primitive in primitives:
        at_length = lengths.apply(primitive)
        if isinstance(at_length, Primitive):
            reading.primitives.append(at_length)
        else:
            where = primitive.source.removeprefix(f"{path.name} ")
            text = f"{primitive.label}: {at_length}; dropped"
            reading.problems.append(Problem(str(path), where, text))
    return reading


def operator_of(path: Path, rules: Rules) -> str:
    """Who performed what is in a file."""
    return rules.operator or path.stem


def _from_set(stored: Stored, rules: Rules) -> tuple[list[Primitive], list[Problem]]:
    path = stored.path
    primitives, problems = [], []
    for row in range(len(stored)):
        try:
            primitive = stored.primitive(row)
        except DatasetError as error:
            text = str(error).removeprefix(f"{path}: row {row}: ")
            problems.append(Problem(str(path), f"row {row}", f"{text}; it is left out"))
        else:
            primitives.append(
                replace(
                    primitive,
                    label=rules.label or primitive.label,
                    operator=rules.operator or primitive.operator,
                    family=rules.family or primitive.family,
                )
            )
    return primitives, problems


def _from_vector(path: Path, vector: Vector, rules: Rules) -> Primitive:
    return Primitive(
        np.arange(len(vector.sticks)) / rules.rate_hz,
        vector.sticks,
        rules.label or vector.label,
        operator_of(path, rules),
        rules.family,
        f"{path.name} row {vector.row}",
    )


def _from_track(path: Path, track: Track, rules: Rules) -> tuple[list[Primitive], list[Problem]]:
    primitives, problems = [], []
    if rules.segmentation == "thesis":
        segments, sought = as_thesis(track), f"run of {THESIS_ROWS} rows with vx and vy off 0"
    else:
        segments, sought = at_buttons(track, rules.idle_s), "motion"
    if not segments:
        text = f"no {sought} in its {len(track.held)} samples: wrong --axes, or the wrong file?"
        problems.append(Problem(str(path), "", text))
    for segment in segments:
        first_s = float(track.times_s[segment.begin] - track.times_s[0])
        last_s = float(track.times_s[segment.end - 1] - track.times_s[0])
        where = f"{first_s:.2f} to {last_s:.2f} s"
        label = rules.label or rules.buttons.get(segment.button)
        if label is None:
            end = (
                f"button {segment.button!r} has no label"
                if segment.button
                else "no button ended it"
            )
            problems.append(
                Problem(str(path), where, f"{end}; left out (--label or --buttons names one)")
            )
            continue
        times_s = track.times_s[segment.begin : segment.end]
        primitives.append(
            Primitive(
                times_s - times_s[0],
                track.sticks[segment.begin : segment.end],
                label,
                operator_of(path, rules),
                rules.family,
                f"{path.name} {where}",
                track.utc_ns(segment.begin),
            )
        )
    return primitives, problems
