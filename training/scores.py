"""How good a classifier is: accuracy, weighted F1 with an interval over people, calibration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import confusion_matrix, f1_score, roc_auc_score

BOOTSTRAPS = 1000
CALIBRATION_BINS = 15

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Score:
    """Figures of one classifier on one set of windows.

    Attributes:
        accuracy: share that is right.
        f1: F1 of the classes, weighted by their sizes: 2 PR RC / (PR + RC), not eq. 5.1.
        interval: 2.5 and 97.5 % of F1 when operators are drawn again (with replacement).
        confusion: (classes, classes) rows are what it was, columns what was said.
        count: windows.
        operators: people.
    """

    accuracy: float
    f1: float
    interval: tuple[float, float]
    confusion: IntArray
    count: int
    operators: int


def weighted_f1(truth: IntArray, said: IntArray) -> float:
    """F1 of the classes, weighted by their sizes."""
    return float(f1_score(truth, said, average="weighted", zero_division=0.0))


def score(
    truth: IntArray,
    said: IntArray,
    operators: IntArray | NDArray[np.str_],
    classes: int,
    seed: int,
) -> Score:
    """The figures; people, not primitives, are drawn again, as one person's are alike."""
    rng = np.random.default_rng(seed)
    people = np.unique(operators)
    # F1 of a redrawn set follows from the sum of its people's confusion matrices.
    tables = np.stack(
        [
            confusion_matrix(
                truth[operators == person], said[operators == person], labels=range(classes)
            )
            for person in people
        ]
    )
    draws = rng.integers(0, len(people), (BOOTSTRAPS, len(people)))
    low, high = np.percentile(f1_of(tables[draws].sum(axis=1)), [2.5, 97.5])
    table = tables.sum(axis=0)
    return Score(
        accuracy=float(np.trace(table) / table.sum()),
        f1=float(f1_of(table)),
        interval=(float(low), float(high)),
        confusion=table,
        count=len(truth),
        operators=len(people),
    )


def f1_of(tables: IntArray) -> NDArray[np.float64]:
    """Weighted F1 (...) of confusion matrices (..., classes, classes)."""
    right = np.diagonal(tables, axis1=-2, axis2=-1)
    was, said = tables.sum(axis=-1), tables.sum(axis=-2)
    f1 = 2.0 * right / np.maximum(was + said, 1)
    return np.asarray((f1 * was).sum(axis=-1) / was.sum(axis=-1))


def confidence_bins(probabilities: NDArray[np.float64], truth: IntArray) -> NDArray[np.float64]:
    """Bins (15, 3) of the confidence of answers (n, classes): how many, its sum, how many right."""
    confidence = probabilities.max(axis=1)
    right = probabilities.argmax(axis=1) == truth
    index = np.minimum((confidence * CALIBRATION_BINS).astype(np.int64), CALIBRATION_BINS - 1)
    weights = (np.ones(len(truth)), confidence, right)
    return np.stack([np.bincount(index, each, CALIBRATION_BINS) for each in weights], axis=1)


def calibration_error(bins: NDArray[np.float64]) -> float:
    """Expected calibration error: mean distance of confidence from accuracy, of bins (15, 3)."""
    return float(np.abs(bins[:, 1] - bins[:, 2]).sum() / bins[:, 0].sum())


def none_auroc(meant: NDArray[np.floating], is_meant: NDArray[np.bool_]) -> float:
    """How well `meant` tells primitives from none: the area under the ROC curve."""
    return float(roc_auc_score(is_meant, meant))
