"""Sticks as other pads, links and hands would give them, to see what a classifier loses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from training.dataset.primitive import Primitive

Array = NDArray[np.float64]
Distortion = Callable[[Primitive, np.random.Generator], Primitive]

LATE_S = 0.03
LOST = 0.1


def _kept(primitive: Primitive, kept: NDArray[np.bool_]) -> Primitive:
    return replace(primitive, times_s=primitive.times_s[kept], sticks=primitive.sticks[kept])


def at_hz(rate_hz: float) -> Distortion:
    """The same hands read by a pad of another rate."""

    def distort(primitive: Primitive, rng: np.random.Generator) -> Primitive:
        duration_s = primitive.times_s[-1]
        times_s = np.arange(int(duration_s * rate_hz) + 1) / rate_hz
        sticks = [np.interp(times_s, primitive.times_s, axis) for axis in primitive.sticks.T]
        return replace(primitive, times_s=times_s, sticks=np.stack(sticks, axis=1))

    return distort


def lossy(primitive: Primitive, rng: np.random.Generator) -> Primitive:
    """A link that loses a tenth of the messages."""
    kept = rng.random(len(primitive)) >= LOST
    kept[0] = True
    return _kept(primitive, kept)


def late(primitive: Primitive, rng: np.random.Generator) -> Primitive:
    """A pad that stamps each message 0 to 30 ms late; the service drops stamps that do not rise."""
    times_s = primitive.times_s + rng.uniform(0.0, LATE_S, len(primitive))
    newest = np.maximum.accumulate(times_s)
    rises = np.concatenate([[True], times_s[1:] > newest[:-1]])
    moved = replace(primitive, times_s=times_s - times_s[0])
    return _kept(moved, rises)


def half(primitive: Primitive, rng: np.random.Generator) -> Primitive:
    """Hands that push half as far."""
    return replace(primitive, sticks=primitive.sticks * 0.5)


UNCHANGED = "as recorded"
DISTORTIONS: dict[str, Distortion] = {
    UNCHANGED: lambda primitive, _rng: primitive,
    "20 Hz": at_hz(20.0),
    "30 Hz": at_hz(30.0),
    "100 Hz": at_hz(100.0),
    "10 % lost": lossy,
    "30 ms jitter": late,
    "half-size sticks": half,
}


def distorted(primitives: list[Primitive], name: str, seed: int) -> list[Primitive]:
    """Performances, each distorted with randomness of its own."""
    rng = np.random.default_rng(seed)
    return [DISTORTIONS[name](primitive, rng) for primitive in primitives]
