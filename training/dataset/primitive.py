"""One performance of a primitive: sticks with their times, who moved them, where they are from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.labels import CLASSES

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Primitive:
    """One performance of a primitive.

    Checked are shapes and the label: what a pad may send, however odd, can be held and told of
    (see `training.dataset.check`).

    Attributes:
        times_s: (N,) of each sample since the first, rising, irregular as a pad's are.
        sticks: (N, 4) vx vy vz wz as fractions of full stick, heading frame.
        label: what was performed, one of `CLASSES`.
        operator: who; unique in a set.
        family: the kind of people the operator is of, "" if unknown.
        source: where it is from: a generator's preset and seed, or a file's name.
        utc_ns: when it began, 0 if unknown.

    Raises:
        ValueError: if the label is unknown or the shapes do not fit.
    """

    times_s: Array
    sticks: Array
    label: str
    operator: str
    family: str
    source: str
    utc_ns: int = 0

    def __post_init__(self) -> None:
        if self.label not in CLASSES:
            raise ValueError(f"label {self.label!r} is unknown; use {', '.join(CLASSES)}")
        if self.times_s.ndim != 1 or self.sticks.shape != (len(self.times_s), 4):
            raise ValueError(
                f"times_s has shape {self.times_s.shape}, sticks {self.sticks.shape};"
                " they should be (N,) and (N, 4)"
            )

    def __len__(self) -> int:
        """How many samples there are."""
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        return float(self.times_s[-1] - self.times_s[0]) if len(self.times_s) else 0.0

    @property
    def rate_hz(self) -> float:
        """The mean rate of its samples; 0 where there is none."""
        return (len(self) - 1) / self.duration_s if self.duration_s > 0.0 else 0.0
