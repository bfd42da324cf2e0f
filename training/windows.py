"""Primitives as the windows that a model trains on and is judged by."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.sticks import FULL_STICK
from services.classifier.window import MODEL_RATE_HZ, WINDOW_SAMPLES, at_rate, in_start_frame
from training.dataset.primitive import Primitive
from training.labels import PRIMITIVES

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

SHORTEST_SAMPLES = 40
"""Windows of less than 0.8 s are never asked for."""
WHOLE_SHARE = 0.35
HEAD_CUT_SHARE = 0.25
MIRROR_SHARE = 0.5
SPLICE_SHARE = 0.15
"""Windows that begin with the end of another primitive, flown into this one without a pause."""
SPLICE_SAMPLES = (20, 75)
SETTLED_SAMPLES = 60
"""The newer primitive is asked for once 1.2 s of it are seen."""
JOINT_SAMPLES = 15
SLOW = 0.15
"""Horizontal deflections below this have no direction to join by."""
SCALE = (0.5, 1.1)


@dataclass(frozen=True)
class Examples:
    """Primitives at the model's rate.

    Attributes:
        tracks: each (N, 3) vx vy vz at `MODEL_RATE_HZ`, in the frame of its start.
        labels: (n,) indices of labels.
        operators: (n,) who performed each.
    """

    tracks: tuple[Array32, ...]
    labels: IntArray
    operators: IntArray


@dataclass(frozen=True)
class Windows:
    """Windows as the network takes them.

    Attributes:
        sticks: (n, T, 3), zero after a window's own length.
        lengths: (n,) real samples of each.
        labels: (n,).
    """

    sticks: Array32
    lengths: IntArray
    labels: IntArray


def examples_of(primitives: Sequence[Primitive]) -> Examples:
    """Primitives through the classifier's own preprocessing."""
    yaw_radps = FULL_STICK["tum"].yaw_radps
    tracks = tuple(
        at_rate(p.times_s, in_start_frame(p.times_s, p.sticks, yaw_radps)).astype(np.float32)
        for p in primitives
    )
    return Examples(
        tracks,
        np.array([PRIMITIVES.index(p.label) for p in primitives], dtype=np.int64),
        np.unique([p.operator for p in primitives], return_inverse=True)[1].astype(np.int64),
    )


def padded(tracks: Sequence[Array32], labels: IntArray) -> Windows:
    """Tracks of at most `WINDOW_SAMPLES`, zero-padded to that as in the thesis."""
    sticks = np.zeros((len(tracks), WINDOW_SAMPLES, 3), dtype=np.float32)
    for row, track in enumerate(tracks):
        sticks[row, : len(track)] = track
    lengths = np.array([len(track) for track in tracks], dtype=np.int64)
    return Windows(sticks, lengths, labels)


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


def random_windows(
    examples: Examples, rng: np.random.Generator, *, augment: bool = True
) -> Windows:
    """One window of each example: cut at a random time, some without their beginning.

    Some begin with the end of another primitive.

    Args:
        examples: what to cut.
        rng: source of the cuts.
        augment: whether to mirror and scale as well.
    """
    labels = examples.labels
    tracks = []
    for track in examples.tracks:
        if rng.random() < SPLICE_SHARE:
            joined = spliced(examples.tracks[int(rng.integers(len(labels)))], track, rng)
            if joined is not None:
                tracks.append(_augmented(joined, rng) if augment else joined)
                continue
        end = len(track)
        if rng.random() > WHOLE_SHARE and end > SHORTEST_SAMPLES:
            end = int(rng.integers(SHORTEST_SAMPLES, end + 1))
        begin = max(0, end - WINDOW_SAMPLES)
        if rng.random() < HEAD_CUT_SHARE and end - begin > 2 * SHORTEST_SAMPLES:
            begin = int(rng.integers(begin, end - 2 * SHORTEST_SAMPLES))
        track = track[begin:end]
        tracks.append(_augmented(track, rng) if augment else track)
    return padded(tracks, labels)


def _augmented(track: Array32, rng: np.random.Generator) -> Array32:
    """A track mirrored left to right, upside down, and scaled, at random."""
    side = -1.0 if rng.random() < MIRROR_SHARE else 1.0
    up = -1.0 if rng.random() < MIRROR_SHARE else 1.0
    scale = rng.uniform(*SCALE)
    return track * np.array([scale, scale * side, scale * up], dtype=np.float32)


def spliced(before: Array32, after: Array32, rng: np.random.Generator) -> Array32 | None:
    """The end of one track turned and scaled into the beginning of another; None if neither fits.

    Their labels' order matters: the newer one is what the operator means now.
    """
    # Without lead-out and lead-in, which are a pause.
    before, after = before[:-JOINT_SAMPLES], after[JOINT_SAMPLES:]
    share = int(rng.integers(*SPLICE_SAMPLES))
    if len(before) < share or len(after) < max(SETTLED_SAMPLES, share):
        return None
    end = int(rng.integers(max(SETTLED_SAMPLES, share), len(after) + 1))
    out = before[-JOINT_SAMPLES:].mean(axis=0)
    into = after[:JOINT_SAMPLES].mean(axis=0)
    speeds = math.hypot(out[0], out[1]), math.hypot(into[0], into[1])
    if min(speeds) < SLOW:
        return None
    turn = math.atan2(into[1], into[0]) - math.atan2(out[1], out[0])
    gain = speeds[1] / speeds[0]
    c, s = gain * math.cos(turn), gain * math.sin(turn)
    frame = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    return np.concatenate([before[-share:] @ frame, after[:end]])[-WINDOW_SAMPLES:]
