"""How hard the thesis' operators are: the difficulty at which its machine scores as it did there.

The thesis' SVM, its 794 vectors of three classes, its random split. It reports an accuracy of
82.25 % and an F1 of 79.64 %; the aim is a weighted F1 of 0.80. No other classifier is looked at.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student
from sklearn.metrics import f1_score
from sklearn.model_selection import train_test_split

from training.dataset.primitive import Primitive
from training.generator.dataset import THESIS, populate
from training.svm import POINTS, machine

COUNTS = {"line": 217, "arc": 315, "sine": 262}
OPERATORS = 20
AIM, TOLERANCE = 0.80, 0.02
TEST_SHARE = 0.2


@dataclass(frozen=True)
class Found:
    """Weighted F1 over seeds.

    Attributes:
        mean: over them.
        half_width: of its 95 % interval (Student's t).
        seeds: how many.
    """

    mean: float
    half_width: float
    seeds: int


def features(primitive: Primitive) -> NDArray[np.float64]:
    """(200,): 100 roll (vy), then 100 pitch (vx), over a whole primitive."""
    at_s = np.linspace(0.0, primitive.times_s[-1], POINTS)
    axes = (primitive.sticks[:, 1], primitive.sticks[:, 0])
    return np.concatenate([np.interp(at_s, primitive.times_s, axis) for axis in axes])


def machine_f1(difficulty: float, seed: int) -> float:
    """Weighted F1 of the thesis' SVM on one set of people and one split."""
    people = populate(replace(THESIS, difficulty=difficulty), OPERATORS, COUNTS, seed)
    x = np.stack([features(primitive) for primitive in people])
    y = np.array([primitive.label for primitive in people])
    learn_x, test_x, learn_y, test_y = train_test_split(
        x, y, test_size=TEST_SHARE, random_state=seed
    )
    said = machine().fit(learn_x, learn_y).predict(test_x)
    return float(f1_score(test_y, said, average="weighted"))


def measure(difficulty: float, seeds: Iterable[int]) -> Found:
    """The thesis' SVM at a difficulty, each seed with people and a split of its own."""
    scores = np.array([machine_f1(difficulty, seed) for seed in seeds])
    half = student.ppf(0.975, len(scores) - 1) * scores.std(ddof=1) / math.sqrt(len(scores))
    return Found(float(scores.mean()), float(half), len(scores))


def calibrate(low: float, high: float, seeds: Iterable[int], rounds: int = 6) -> float:
    """The difficulty between `low` and `high` at which the mean F1 is `AIM`, by halving.

    Raises:
        ValueError: if it is not between them.
    """
    seeds = tuple(seeds)
    easy, hard = measure(low, seeds).mean, measure(high, seeds).mean
    if not hard <= AIM <= easy:
        raise ValueError(
            f"F1 is {easy:.3f} at {low} and {hard:.3f} at {high}: {AIM} is not between"
        )
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        if measure(middle, seeds).mean > AIM:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
