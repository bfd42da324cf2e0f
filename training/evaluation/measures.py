"""Counts that every figure follows from: confusions, and how confident answers turned out."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from training.labels import PRIMITIVES
from training.scores import calibration_error, confidence_bins, f1_of

IntArray = NDArray[np.int64]
Array = NDArray[np.float64]

ARC, SINE = PRIMITIVES.index("arc"), PRIMITIVES.index("sine")


@dataclass(frozen=True)
class Tally:
    """What a classifier said of a set of windows.

    Attributes:
        confusion: (4, 4) rows are what it was, columns what was said.
        bins: (15, 3) of confidence: answers, sum of confidence, how many were right; empty (0, 3)
            without probabilities.
    """

    confusion: IntArray
    bins: Array

    @property
    def count(self) -> int:
        """Windows."""
        return int(self.confusion.sum())

    @property
    def accuracy(self) -> float:
        """Share that is right."""
        return float(np.trace(self.confusion) / self.count)

    @property
    def f1(self) -> float:
        """F1 of the classes weighted by their sizes: 2 PR RC / (PR + RC), not eq. 5.1."""
        return float(f1_of(self.confusion))

    @property
    def arc_sine(self) -> float:
        """Share of arcs and sines that are taken for each other."""
        swapped = self.confusion[ARC, SINE] + self.confusion[SINE, ARC]
        return float(swapped / self.confusion[[ARC, SINE]].sum())

    @property
    def calibration_error(self) -> float | None:
        """Expected calibration error: mean distance of confidence from accuracy."""
        if not len(self.bins):
            return None
        return calibration_error(self.bins)

    def __add__(self, other: "Tally") -> "Tally":
        bins = self.bins + other.bins if len(self.bins) and len(other.bins) else self.bins[:0]
        return Tally(self.confusion + other.confusion, bins)

    def to_json(self) -> dict[str, Any]:
        """For a file."""
        return {"confusion": self.confusion.tolist(), "bins": self.bins.round(6).tolist()}

    @staticmethod
    def from_json(data: dict[str, Any]) -> "Tally":
        """From a file."""
        bins = np.array(data["bins"], dtype=np.float64).reshape(-1, 3)
        return Tally(np.array(data["confusion"], dtype=np.int64), bins)


def tally(truth: IntArray, scores: Array, has_probabilities: bool) -> Tally:
    """Count the answers (n, 4) to windows of labels (n,)."""
    said = scores.argmax(axis=1)
    classes = len(PRIMITIVES)
    confusion = np.bincount(truth * classes + said, minlength=classes**2)
    bins = confidence_bins(scores, truth) if has_probabilities else np.zeros((0, 3))
    return Tally(confusion.reshape(classes, classes), bins)


@dataclass(frozen=True)
class Estimate:
    """A mean over seeds.

    Attributes:
        mean: of them.
        half: half of the 95 % interval (Student); NaN of one seed.
        count: seeds.
    """

    mean: float
    half: float
    count: int

    def text(self, digits: int = 3, scale: float = 1.0) -> str:
        """As in tables: 0.953 ± 0.004."""
        if not self.count:
            return "-"
        # Adding 0 makes -0.0 a plain 0.
        mean = f"{round(self.mean * scale, digits) + 0.0:.{digits}f}"
        return mean if np.isnan(self.half) else f"{mean} ± {self.half * scale:.{digits}f}"


def estimate(values: Iterable[float]) -> Estimate:
    """The mean of values with its interval; NaN of none."""
    found = np.array(list(values), dtype=np.float64)
    if len(found) < 2:
        return Estimate(float(found[0]) if len(found) else np.nan, np.nan, len(found))
    spread = found.std(ddof=1) / np.sqrt(len(found))
    return Estimate(
        float(found.mean()), float(stats.t.ppf(0.975, len(found) - 1) * spread), len(found)
    )
