"""What flies: only answers that are sure enough. How many those are, and how many are right."""

from typing import Any

import numpy as np

from training.evaluation.folds import Fold
from training.evaluation.names import CALIBRATED, EVERYTHING, FAMILY, KNOWN, MOMENTS
from training.evaluation.ours import Ours
from training.scores import none_auroc
from training.windows import Examples, examples_of, seen_after


def rejection(ours: Ours, fold: Fold) -> dict[str, Any]:
    """What a classifier with a rejection is asked beyond the others, as a JSON map.

    Returns:
        `answered`: by set of people and moment, [windows, answered, right of those].
        `none`: by kind of nothing (and `EVERYTHING`) and moment (and `EVERYTHING`), `n` windows,
        the share that is `answered` all the same, and the `auroc` of `meant` against primitives of
        the same moment.
    """
    answered: dict[str, dict[str, list[int]]] = {}
    for name, people in fold.tests.items():
        if name == CALIBRATED or name.startswith(FAMILY):
            examples = examples_of(people)
            answered[name] = {
                moment: _answered(ours, examples, after) for moment, after in MOMENTS.items()
            }
    four = examples_of(fold.tests[KNOWN])
    kinds = {kind: examples_of(people) for kind, people in fold.none.items()}
    none: dict[str, dict[str, dict[str, float]]] = {kind: {} for kind in (EVERYTHING, *kinds)}
    meant: dict[str, list[np.ndarray]] = {kind: [] for kind in ("four", *none)}
    sure: dict[str, list[np.ndarray]] = {kind: [] for kind in none}
    for moment, after in MOMENTS.items():
        meant["four"].append(ours.asked(seen_after(four, after))[1])
        for kind, examples in kinds.items():
            probabilities, certainty = ours.asked(seen_after(examples, after))
            meant[kind].append(certainty)
            sure[kind].append(ours.sure(probabilities, certainty))
        for parts in (meant, sure):
            parts[EVERYTHING].append(np.concatenate([parts[kind][-1] for kind in kinds]))
        for kind in none:
            none[kind][moment] = _told(meant["four"][-1:], meant[kind][-1:], sure[kind][-1:])
    for kind in none:
        none[kind][EVERYTHING] = _told(meant["four"], meant[kind], sure[kind])
    return {"answered": answered, "none": none}


def _answered(ours: Ours, examples: Examples, after: float | None) -> list[int]:
    windows = seen_after(examples, after)
    probabilities, meant = ours.asked(windows)
    sure = ours.sure(probabilities, meant)
    right = sure & (probabilities.argmax(axis=1) == windows.labels)
    return [len(windows), int(sure.sum()), int(right.sum())]


def _told(
    four: list[np.ndarray], none: list[np.ndarray], sure: list[np.ndarray]
) -> dict[str, float]:
    """How well nothing is told from the four, and how often it is answered all the same."""
    scores = np.concatenate([*four, *none])
    of_four = sum(len(part) for part in four)
    is_meant = np.arange(len(scores)) < of_four
    return {
        "n": float(len(scores) - of_four),
        "auroc": none_auroc(scores, is_meant),
        "answered": float(np.concatenate(sure).mean()),
    }
