"""What is wrong with labelled sticks, row by row."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.sticks import DEAD_BAND
from training.dataset.primitive import Primitive
from training.dataset.store import DatasetError, Stored, open_set
from training.dataset.track import BEYOND
from training.labels import NONE

SHORTEST_S = 1.0
GAP_S = 0.5
"""Longer than any loss on a link that can be flown over."""
RATES_HZ = (20.0, 100.0)
"""What the classifier accepts, with a tenth to spare on either side."""
RATE_SPARE = 1.1
AXES = ("vx", "vy", "vz")
DEAD_FROM = 5
"""Fewer primitives than these say nothing about an axis."""


@dataclass(frozen=True)
class Finding:
    """Something wrong with a row; `row` None is about the whole set."""

    row: int | None
    text: str

    def __str__(self) -> str:
        return self.text if self.row is None else f"row {self.row}: {self.text}"


def check(primitives: Sequence[Primitive], rows: Sequence[int] | None = None) -> list[Finding]:
    """What is wrong with a set.

    Args:
        primitives: the set.
        rows: their numbers in a file; None counts from 0.
    """
    rows = range(len(primitives)) if rows is None else rows
    findings = [
        Finding(row, f"{p.label} by {p.operator}: {text}")
        for row, p in zip(rows, primitives, strict=True)
        for text in _faults(p)
    ]
    return [*findings, *_duplicates(primitives, rows), *_dead_axes(primitives)]


def check_stored(stored: Stored) -> list[Finding]:
    """What is wrong with a file, in the order of its rows."""
    primitives, rows, findings = [], [], []
    for row in range(len(stored)):
        try:
            primitives.append(stored.primitive(row))
            rows.append(row)
        except DatasetError as error:
            findings.append(Finding(row, str(error).removeprefix(f"{stored.path}: row {row}: ")))
    if not len(stored):
        findings.append(Finding(None, "there is no primitive in it; record or import some"))
    findings += check(primitives, rows)
    return sorted(findings, key=lambda each: len(stored) if each.row is None else each.row)


def sound_of(primitives: Sequence[Primitive]) -> tuple[list[Primitive], list[Finding]]:
    """Those that nothing is wrong with, and what is wrong with the others, in their order."""
    faulty = [finding for finding in check(primitives) if finding.row is not None]
    rows = {finding.row for finding in faulty}
    sound = [primitive for row, primitive in enumerate(primitives) if row not in rows]
    return sound, sorted(faulty, key=lambda each: each.row or 0)


def load_sound(path: Path) -> tuple[list[Primitive], list[Finding]]:
    """The primitives of a file that nothing is wrong with, and what is wrong with the others.

    Raises:
        DatasetError: if it is no data set, or nothing of it is sound.
        OSError: if it cannot be read.
    """
    stored = open_set(path)
    findings = check_stored(stored)
    faulty = {finding.row for finding in findings}
    sound = [stored.primitive(row) for row in range(len(stored)) if row not in faulty]
    if not sound:
        raise DatasetError(
            f"{path}: none of its {len(stored)} primitives can be used;"
            f" 'autocomplete dataset check {path}' tells why"
        )
    return sound, findings


def _faults(p: Primitive) -> list[str]:
    if len(p) < 2:
        return [f"{len(p)} samples are no motion; remove it"]
    faults = []
    if not p.operator.strip():
        faults.append("it names no operator, so it cannot be split; import it with --operator")
    if not np.isfinite(p.times_s).all() or not np.isfinite(p.sticks).all():
        bad = ~np.isfinite(p.times_s) | ~np.isfinite(p.sticks).all(axis=1)
        faults.append(f"{bad.sum()} samples are not finite, first {int(np.argmax(bad))}")
        return faults
    steps_s = np.diff(p.times_s)
    if (steps_s <= 0.0).any():
        first = int(np.argmax(steps_s <= 0.0)) + 1
        faults.append(f"times do not rise at {(steps_s <= 0.0).sum()} samples, first {first}")
        return faults
    if p.times_s[0] != 0.0:
        faults.append(f"times begin at {p.times_s[0]:.3g} s, not at 0")
    beyond = (np.abs(p.sticks) > 1.0 + BEYOND).any(axis=1)
    if beyond.any():
        faults.append(
            f"{beyond.sum()} samples are beyond [-1, 1], first {int(np.argmax(beyond))};"
            " are they speeds instead of sticks?"
        )
    if p.duration_s < SHORTEST_S:
        faults.append(f"{p.duration_s:.2f} s is shorter than {SHORTEST_S:g} s")
    low_hz, high_hz = RATES_HZ[0] / RATE_SPARE, RATES_HZ[1] * RATE_SPARE
    if not low_hz <= p.rate_hz <= high_hz:
        faults.append(f"{p.rate_hz:.1f} Hz is outside {RATES_HZ[0]:g} to {RATES_HZ[1]:g} Hz")
    gaps = np.flatnonzero(steps_s > GAP_S)
    if len(gaps):
        faults.append(
            f"{len(gaps)} gaps of more than {GAP_S:g} s, the longest {steps_s.max():.2f} s"
            f" after sample {int(np.argmax(steps_s))}"
        )
    if p.label != NONE and not (np.abs(p.sticks[:, :3]) > DEAD_BAND).any():
        faults.append(f"the sticks rest all the time, which is no {p.label}")
    elif (p.sticks == p.sticks[0]).all() and p.label != NONE:
        faults.append("every sample is the same: a pad that hangs?")
    return faults


def _duplicates(primitives: Sequence[Primitive], rows: Sequence[int]) -> list[Finding]:
    first: dict[bytes, tuple[int, Primitive]] = {}
    findings = []
    for row, p in zip(rows, primitives, strict=True):
        # Rests of the same length are alike, whoever rests.
        if not p.sticks.any():
            continue
        earlier, other = first.setdefault(p.sticks.tobytes(), (row, p))
        if earlier != row:
            note = f" but called {other.label}" if other.label != p.label else ""
            text = f"{p.label} by {p.operator}: the same sticks as row {earlier}{note}; keep one"
            findings.append(Finding(row, text))
    return findings


def _dead_axes(primitives: Sequence[Primitive]) -> list[Finding]:
    by_operator: dict[str, list[Primitive]] = defaultdict(list)
    for p in primitives:
        by_operator[p.operator].append(p)
    findings = []
    for operator, theirs in by_operator.items():
        if len(theirs) < DEAD_FROM:
            continue
        for axis, name in enumerate(AXES):
            if name == "vz" and all(p.label != "helix" for p in theirs):
                continue
            if all(not (np.abs(p.sticks[:, axis]) > DEAD_BAND).any() for p in theirs):
                findings.append(
                    Finding(
                        None,
                        f"operator {operator}: {name} never moves in {len(theirs)} primitives;"
                        " a dead axis, or wrong --axes",
                    )
                )
    return findings
