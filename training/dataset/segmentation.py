"""Where one primitive ends and the next begins. Pure."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.sticks import DEAD_BAND
from training.dataset.track import Track

IDLE_S = 1.0
"""Sticks at rest, or silent, for this long end a primitive; shorter rests are hesitations."""
REMNANT_S = 0.6
"""A stick still held when the button goes down is back by then: what it did is no new motion."""
THESIS_ROWS = 90


@dataclass(frozen=True)
class Segment:
    """Rows `begin` to `end` (not included) of a track, and the button that ended them, or ""."""

    begin: int
    end: int
    button: str


def at_buttons(track: Track, idle_s: float = IDLE_S) -> list[Segment]:
    """Motions ended by a button, by a long rest or by a gap; rest before and after is cut off.

    Motion along one axis is motion. The button of a segment is the first one pressed after it and
    before the next motion.
    """
    is_held = np.array([bool(held) for held in track.held], dtype=bool)
    pressed = np.flatnonzero(is_held & ~np.concatenate([[False], is_held[:-1]]))
    is_moving = (np.abs(track.sticks) > DEAD_BAND).any(axis=1) & ~is_held
    for row in pressed:
        _let_go(track, is_held, is_moving, int(row))
    moving = np.flatnonzero(is_moving)
    if not len(moving):
        return []
    rested = np.diff(track.times_s[moving]) > idle_s
    marked = np.searchsorted(pressed, moving[1:]) > np.searchsorted(pressed, moving[:-1])
    breaks = np.flatnonzero(rested | marked)
    begins = moving[np.concatenate([[0], breaks + 1])]
    ends = moving[np.concatenate([breaks, [len(moving) - 1]])] + 1
    segments = []
    for number, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        limit = begins[number + 1] if number + 1 < len(begins) else len(track.held)
        after = pressed[(pressed >= end) & (pressed < limit)]
        button = track.held[after[0]][0] if len(after) else ""
        segments.append(Segment(int(begin), int(end), button))
    return segments


def _let_go(
    track: Track, is_held: NDArray[np.bool_], is_moving: NDArray[np.bool_], pressed: int
) -> None:
    """Take out of the motion the stick's way back to rest after a button was pressed."""
    free = np.flatnonzero(~is_held[pressed:])
    if not len(free):
        return
    begin = pressed + int(free[0])
    soon = int(np.searchsorted(track.times_s, track.times_s[begin] + REMNANT_S, side="right"))
    resting = np.flatnonzero(~is_moving[begin:soon])
    if len(resting):
        is_moving[begin : begin + int(resting[0])] = False


def as_thesis(track: Track) -> list[Segment]:
    """The original parser's runs, cut to 90 rows: it ends one at each button and at vx or vy of 0.

    So it throws away what goes purely forward, sideways or up (see docs/data.md).
    """
    is_end = np.array([bool(held) for held in track.held], dtype=bool)
    pressed = np.flatnonzero(is_end)
    is_end |= (track.sticks[:, :2] == 0.0).any(axis=1)
    ends = np.concatenate([[-1], np.flatnonzero(is_end), [len(is_end)]])
    segments = []
    for before, end in itertools.pairwise(ends.tolist()):
        if end - before - 1 < THESIS_ROWS:
            continue
        after = pressed[pressed >= end]
        button = track.held[after[0]][0] if len(after) else ""
        begin = before + 1
        segments.append(Segment(begin, begin + THESIS_ROWS, button))
    return segments
