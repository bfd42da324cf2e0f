"""Peers of the field from aeon: random convolutions with a ridge, and intervals with trees.

They want series of one length. A motion's length tells shapes apart and is lost when each window
is stretched, so windows are zero-padded to the longest there is. For the sake of time they see 25
or 12.5 Hz, and learn from every third window.
"""

from typing import Any

import numpy as np
from aeon.transformations.collection.convolution_based import (
    HydraTransformer,
    MiniRocket,
    MultiRocket,
)
from aeon.transformations.collection.interval_based import QUANTTransformer
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier

from services.classifier.window import WINDOW_SAMPLES
from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.ridge import Ridge
from training.evaluation.views import padded, thinned
from training.labels import PRIMITIVES
from training.windows import Windows

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

BATCH = 2000
"""Series transformed at once: MultiRocket's features of more do not fit into a small memory."""
QUANT_EVERY = 2
QUANT_TREES = 200
"""As its authors use."""


def _series(windows: Windows, full_yaw_radps: float, every: int) -> Array32:
    return padded(windows, full_yaw_radps, WINDOW_SAMPLES, every)


def _lesson(windows: Windows, full_yaw_radps: float, every: int) -> tuple[Array32, IntArray]:
    """Series to learn from, and their labels."""
    some = thinned(windows)
    return _series(some, full_yaw_radps, every), some.labels


class Rocket:
    """Transforms of aeon whose features go to one ridge."""

    has_probabilities = False

    def __init__(self, name: str, kinds: tuple[type, ...], every: int) -> None:
        """`every` so many samples are averaged to one."""
        self.name = name
        self._kinds = kinds
        self._every = every

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Draw kernels, then solve the ridge."""
        self._yaw_radps = lesson.full_yaw_radps
        series, labels = _lesson(lesson.windows, self._yaw_radps, self._every)
        held, held_labels = _lesson(lesson.held, self._yaw_radps, self._every)
        self._transforms = [kind(random_state=seed) for kind in self._kinds]
        for transform in self._transforms:
            transform.fit(series)
        self._ridge = Ridge()
        rows = self._features(series, tell)
        self._ridge.fit(rows, labels, self._features(held, _quiet), held_labels, len(PRIMITIVES))

    def scores(self, windows: Windows) -> Scores:
        """Of the ridge."""
        series = _series(windows, self._yaw_radps, self._every)
        return self._ridge.scores(self._features(series, _quiet))

    def _features(self, series: Array32, tell: Tell) -> Array32:
        parts = []
        for begin in range(0, len(series), BATCH):
            batch = series[begin : begin + BATCH]
            parts.append(
                np.concatenate([_of(transform, batch) for transform in self._transforms], axis=1)
            )
            tell(min(begin + BATCH, len(series)), len(series))
        return np.concatenate(parts)


def _of(transform: Any, series: Array32) -> Array32:
    features = np.asarray(transform.transform(series), dtype=np.float32)
    if isinstance(transform, HydraTransformer):
        # Counts of a few kernels are many, of most few: its authors take the root.
        features = np.sqrt(np.maximum(features, 0.0))
    return features


def _quiet(_done: int, _of: int) -> None:
    pass


def minirocket() -> Rocket:
    """MiniRocket (Dempster et al. 2021)."""
    return Rocket("MiniRocket", (MiniRocket,), 2)


def multirocket_hydra() -> Rocket:
    """MultiRocket and Hydra together (Dempster et al. 2023)."""
    return Rocket("MultiRocketHydra", (MultiRocket, HydraTransformer), 4)


class Quant:
    """QUANT (Dempster et al. 2024): quantiles of intervals, and extremely randomised trees."""

    name = "QUANT"
    has_probabilities = True

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn from padded windows."""
        self._yaw_radps = lesson.full_yaw_radps
        series, labels = _lesson(lesson.windows, self._yaw_radps, QUANT_EVERY)
        self._transform = QUANTTransformer().fit(series, labels)
        self._trees = ExtraTreesClassifier(
            QUANT_TREES, criterion="entropy", max_features=0.1, random_state=seed
        )
        self._trees.fit(np.asarray(self._transform.transform(series)), labels)
        tell(1, 1)

    def scores(self, windows: Windows) -> Scores:
        """The trees' probabilities."""
        series = _series(windows, self._yaw_radps, QUANT_EVERY)
        return np.asarray(self._trees.predict_proba(np.asarray(self._transform.transform(series))))
