"""Primitives as the windows that a model trains on and is judged by."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.classifier.model import SHORTEST_SAMPLES
from services.classifier.window import MODEL_RATE_HZ, WINDOW_SAMPLES, at_rate, newest_motion
from training.dataset.primitive import Primitive
from training.labels import CLASSES, NONE

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]
Text = NDArray[np.str_]

MOMENTS_S = (1.0, 1.5, 2.0, 3.0)
"""Early answers are judged so long after a motion began."""
NONE_INDEX = CLASSES.index(NONE)
ASKED_SAMPLES = (SHORTEST_SAMPLES, WINDOW_SAMPLES + 20)
"""When a service asks does not depend on how long a primitive will last: cuts must not either, or
a short window would tell of a short primitive."""
EARLY_SAMPLES = (SHORTEST_SAMPLES, 160)
HEADLESS_SAMPLES = 80
"""What is left of a window without its beginning, at least."""
MIRROR_SHARE = 0.5
SPLICE_SAMPLES = (20, 250)
SETTLED_SAMPLES = 60
"""The newer primitive is asked for once 1.2 s of it are seen."""
JOINT_SAMPLES = 15
SLOW = 0.15
"""Horizontal deflections below this have no direction to join by."""
SCALE = (0.45, 1.1)
MOTION_SHARE = 0.5
"""Of the windows of nothing, those that begin where a service would see a motion begin."""


@dataclass(frozen=True)
class Cuts:
    """How often windows are cut in which way; the rest are cut anywhere.

    Attributes:
        whole: end where the primitive ends.
        early: of the others, those that end in the first 3.2 s: an early answer is worth more than
            a late one.
        headless: lack their beginning.
        spliced: begin with the end of another primitive, flown into this one without a pause.
    """

    whole: float = 0.65
    early: float = 0.6
    headless: float = 0.05
    spliced: float = 0.05


CUTS = Cuts()
"""What our network learns from."""


@dataclass(frozen=True)
class Examples:
    """Primitives at the model's rate.

    Attributes:
        tracks: each (N, 4) vx vy vz wz at `MODEL_RATE_HZ`, heading frame, as a pad sends them.
        labels: (n,) indices of `CLASSES`.
        operators: (n,) who performed each.
        families: (n,) their kind of people.
    """

    tracks: tuple[Array32, ...]
    labels: IntArray
    operators: Text
    families: Text

    def __len__(self) -> int:
        """How many there are."""
        return len(self.tracks)

    def rows(self, index: IntArray) -> "Examples":
        """Those at these places."""
        return Examples(
            tuple(self.tracks[k] for k in index),
            self.labels[index],
            self.operators[index],
            self.families[index],
        )


@dataclass(frozen=True)
class Windows:
    """Windows as a model's file takes them, and what they are.

    Attributes:
        sticks: (n, T, 4), zero after a window's own length.
        times_s: (n, T) since each window's first sample.
        lengths: (n,) real samples of each.
        labels: (n,) indices of `CLASSES`.
    """

    sticks: Array32
    times_s: Array32
    lengths: IntArray
    labels: IntArray

    def __len__(self) -> int:
        """How many there are."""
        return len(self.labels)


def examples_of(primitives: Sequence[Primitive]) -> Examples:
    """Primitives through the classifier's own resampling."""
    return Examples(
        tuple(at_rate(p.times_s, p.sticks).astype(np.float32) for p in primitives),
        np.array([CLASSES.index(p.label) for p in primitives], dtype=np.int64),
        np.array([p.operator for p in primitives], dtype=np.str_),
        np.array([p.family for p in primitives], dtype=np.str_),
    )


def padded(tracks: Sequence[Array32], labels: IntArray) -> Windows:
    """Tracks padded with zeros to the longest of them."""
    lengths = np.array([len(track) for track in tracks], dtype=np.int64)
    samples = int(lengths.max(initial=0))
    sticks = np.zeros((len(tracks), samples, 4), dtype=np.float32)
    for row, track in enumerate(tracks):
        sticks[row, : len(track)] = track
    times_s = np.arange(samples, dtype=np.float32) / np.float32(MODEL_RATE_HZ)
    return Windows(sticks, np.tile(times_s, (len(tracks), 1)), lengths, labels)


def seen_after(examples: Examples, seconds: float | None) -> Windows:
    """The window `seconds` after each motion began; None: at its end.

    Of a motion of more than `WINDOW_SAMPLES` it is the newest ones, as in flight. (The thesis pads
    to 200, keeps sequences of up to 400, and does not say which samples it leaves out.)
    """
    tracks = []
    for track in examples.tracks:
        end = len(track) if seconds is None else round(seconds * MODEL_RATE_HZ)
        tracks.append(track[:end][-WINDOW_SAMPLES:])
    return padded(tracks, examples.labels)


def joined(parts: Sequence[Windows]) -> Windows:
    """Windows one set after another, padded to the longest."""
    tracks = [w.sticks[k, : w.lengths[k]] for w in parts for k in range(len(w))]
    return padded(tracks, np.concatenate([w.labels for w in parts]))


def asked_windows(examples: Examples, rng: np.random.Generator) -> Windows:
    """Windows as a service asks for them: of each motion after `MOMENTS_S` and at its end.

    Nothing is cut at random times, as often.
    """
    shapes = examples.rows(np.flatnonzero(examples.labels != NONE_INDEX))
    nothing = examples.rows(np.flatnonzero(examples.labels == NONE_INDEX))
    moments = (*MOMENTS_S, None)
    parts = [seen_after(shapes, after_s) for after_s in moments]
    if len(nothing):
        parts += [random_windows(nothing, rng, augment=False) for _ in moments]
    return joined(parts)


def random_windows(
    examples: Examples, rng: np.random.Generator, *, augment: bool = True
) -> Windows:
    """One window of each example; see `random_tracks`."""
    return padded(random_tracks(examples, rng, augment=augment), examples.labels)


def random_tracks(
    examples: Examples, rng: np.random.Generator, *, augment: bool = True, cuts: Cuts = CUTS
) -> list[Array32]:
    """One window of each example: cut at a random time, some without their beginning.

    Some begin with the end of another primitive.

    Args:
        examples: what to cut.
        rng: source of the cuts.
        augment: whether to splice, mirror and scale as well.
        cuts: how often which.
    """
    tracks = []
    shapes = np.flatnonzero(examples.labels != NONE_INDEX)
    for track, label in zip(examples.tracks, examples.labels, strict=True):
        window: Array32 | None = None
        if label == NONE_INDEX:
            window = _of_nothing(track, rng, cuts)
        elif augment and rng.random() < cuts.spliced:
            before = examples.tracks[int(shapes[rng.integers(len(shapes))])]
            window = spliced(before, track, rng)
        if window is None:
            window = _cut(track, rng, cuts)
        tracks.append(_augmented(window, rng) if augment else window)
    return tracks


def _asked(rng: np.random.Generator, cuts: Cuts) -> int:
    """After how many samples a service asks."""
    return int(rng.integers(*(EARLY_SAMPLES if rng.random() < cuts.early else ASKED_SAMPLES)))


def _cut(track: Array32, rng: np.random.Generator, cuts: Cuts) -> Array32:
    """A window that ends at a random time, and may lack its beginning."""
    end = len(track)
    if rng.random() > cuts.whole:
        end = min(end, _asked(rng, cuts))
    begin = max(0, end - WINDOW_SAMPLES)
    if rng.random() < cuts.headless and end - begin > HEADLESS_SAMPLES:
        begin = int(rng.integers(begin, end - HEADLESS_SAMPLES))
    return track[begin:end]


def _of_nothing(track: Array32, rng: np.random.Generator, cuts: Cuts) -> Array32:
    """A window of no primitive, cut at a random time."""
    window = track
    if rng.random() > cuts.whole:
        window = track[: _asked(rng, cuts)]
    if rng.random() < MOTION_SHARE:
        motion = window[newest_motion(window, MODEL_RATE_HZ)]
        if len(motion) >= SHORTEST_SAMPLES:
            window = motion
    return window[-WINDOW_SAMPLES:]


def _augmented(track: Array32, rng: np.random.Generator) -> Array32:
    """A track mirrored left to right, upside down, and scaled, at random."""
    side = -1.0 if rng.random() < MIRROR_SHARE else 1.0
    up = -1.0 if rng.random() < MIRROR_SHARE else 1.0
    scale = rng.uniform(*SCALE)
    # The yaw stick turns the vehicle as far as it does, so it is mirrored but not scaled.
    return track * np.array([scale, scale * side, scale * up, side], dtype=np.float32)


def spliced(before: Array32, after: Array32, rng: np.random.Generator) -> Array32 | None:
    """The end of one track turned and scaled into the beginning of another; None if neither fits.

    Their labels' order matters: the newer one is what the operator means now.
    """
    # Without lead-out and lead-in, which are a pause.
    before, after = before[:-JOINT_SAMPLES], after[JOINT_SAMPLES:]
    share = min(int(rng.integers(*SPLICE_SAMPLES)), len(before))
    if share < SPLICE_SAMPLES[0] or len(after) < SETTLED_SAMPLES:
        return None
    end = int(rng.integers(SETTLED_SAMPLES, len(after) + 1))
    out = before[-JOINT_SAMPLES:].mean(axis=0)
    into = after[:JOINT_SAMPLES].mean(axis=0)
    speeds = math.hypot(out[0], out[1]), math.hypot(into[0], into[1])
    if min(speeds) < SLOW:
        return None
    turn = math.atan2(into[1], into[0]) - math.atan2(out[1], out[0])
    gain = speeds[1] / speeds[0]
    c, s = gain * math.cos(turn), gain * math.sin(turn)
    frame = np.eye(4, dtype=np.float32)
    frame[:2, :2] = [[c, s], [-s, c]]
    joined = np.clip(before[-share:] @ frame, -1.0, 1.0)
    return np.concatenate([joined, after[:end]])[-WINDOW_SAMPLES:]
