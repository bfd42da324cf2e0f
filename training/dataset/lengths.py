"""How long a primitive may be, and what becomes of one that is too long. Pure."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from training.dataset.primitive import Primitive

Over = Literal["newest", "resample", "drop"]


@dataclass(frozen=True)
class Limit:
    """So many samples, or so many seconds."""

    amount: float
    is_time: bool = False

    def of(self, primitive: Primitive) -> float:
        """What of a primitive the limit is compared with."""
        return primitive.duration_s if self.is_time else len(primitive)

    def __str__(self) -> str:
        return f"{self.amount:g} s" if self.is_time else f"{self.amount:g} samples"


def parse_limit(text: str) -> Limit:
    """A limit from `45` (samples) or `1s`.

    Raises:
        ValueError: if it is neither.
    """
    is_time = text.endswith("s")
    try:
        amount = float(text.removesuffix("s"))
    except ValueError:
        amount = -1.0
    if not 0.0 <= amount < float("inf"):
        raise ValueError(f"{text!r}: use samples, for example 45, or seconds, for example 1s")
    return Limit(amount, is_time)


@dataclass(frozen=True)
class Lengths:
    """Which primitives are kept, and how.

    Attributes:
        shortest: what is shorter is dropped.
        longest: what is longer is dropped.
        length: what has more samples is brought to so many, as `over` says; None leaves it whole.
        over: the newest samples are kept, the whole is resampled, or it is dropped.
        padded: whether what has fewer than `length` samples ends in zeros.
    """

    shortest: Limit
    longest: Limit
    length: int | None = None
    over: Over = "newest"
    padded: bool = False

    def apply(self, primitive: Primitive) -> Primitive | str:
        """The primitive at its length, or why it is dropped."""
        size = len(primitive)
        if self.shortest.of(primitive) < self.shortest.amount:
            return f"{size} samples in {primitive.duration_s:.2f} s, shorter than {self.shortest}"
        if self.longest.of(primitive) > self.longest.amount:
            return f"{size} samples in {primitive.duration_s:.2f} s, longer than {self.longest}"
        if self.length is None or size == self.length:
            return primitive
        if size < self.length:
            return _padded(primitive, self.length) if self.padded else primitive
        if self.over == "drop":
            return f"{size} samples, more than {self.length}"
        return (_newest if self.over == "newest" else _resampled)(primitive, self.length)


PRESETS: dict[str, Lengths] = {
    "ours": Lengths(Limit(1.0, is_time=True), Limit(20.0, is_time=True)),
    # Section 4.1. It does not say what becomes of 201 to 400 samples; `newest` is what flies here.
    "thesis": Lengths(Limit(45), Limit(400), length=200, over="newest", padded=True),
}


def _newest(primitive: Primitive, length: int) -> Primitive:
    times_s = primitive.times_s[-length:]
    began_ns = primitive.utc_ns + round(1e9 * float(times_s[0])) if primitive.utc_ns else 0
    return replace(
        primitive,
        times_s=times_s - times_s[0],
        sticks=primitive.sticks[-length:],
        utc_ns=began_ns,
    )


def _resampled(primitive: Primitive, length: int) -> Primitive:
    times_s = np.linspace(0.0, primitive.times_s[-1], length)
    sticks = [np.interp(times_s, primitive.times_s, axis) for axis in primitive.sticks.T]
    return replace(primitive, times_s=times_s, sticks=np.stack(sticks, axis=1))


def _padded(primitive: Primitive, length: int) -> Primitive:
    lacking = length - len(primitive)
    step_s = 1.0 / primitive.rate_hz if primitive.rate_hz > 0.0 else 0.0
    after_s = primitive.times_s[-1] + step_s * np.arange(1, lacking + 1)
    return replace(
        primitive,
        times_s=np.concatenate([primitive.times_s, after_s]),
        sticks=np.concatenate([primitive.sticks, np.zeros((lacking, 4))]),
    )
