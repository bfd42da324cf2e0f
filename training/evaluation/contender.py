"""What a classifier must offer to be compared, and what it is given to learn from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from training.dataset.primitive import Primitive
from training.windows import Windows

Scores = NDArray[np.float64]
Tell = Callable[[int, int], None]
"""Told how many of how many steps of a training are done."""


@dataclass(frozen=True)
class Lesson:
    """What every classifier of a fold learns from.

    Attributes:
        training: performances of the people to learn from, `none` among them.
        validation: of other people, to choose by.
        windows: of the four primitives in `training`: each whole, and cut at a random time.
        held: the same of `validation`.
        full_yaw_radps: the vehicle's yaw rate at full stick.
        budget: windows that our network is shown in all.
    """

    training: Sequence[Primitive]
    validation: Sequence[Primitive]
    windows: Windows
    held: Windows
    full_yaw_radps: float
    budget: int


class Contender(Protocol):
    """A classifier of windows.

    Attributes:
        name: in tables.
        has_probabilities: whether scores are probabilities.
    """

    name: str
    has_probabilities: bool

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn."""
        ...

    def scores(self, windows: Windows) -> Scores:
        """Scores (n, 4) of the primitives; the largest is the answer."""
        ...
