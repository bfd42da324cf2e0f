"""Peers of the field from aeon: random convolutions with a ridge, and intervals with trees.

They want series of one length. A motion's length tells shapes apart and is lost when each window
is stretched, so windows are zero-padded to 4 s.
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

from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.ridge import Ridge
from training.evaluation.views import padded
from training.labels import PRIMITIVES
from training.windows import Windows

Array32 = NDArray[np.float32]

BATCH = 2000
"""Series transformed at once: MultiRocket's features of more do not fit into a small memory."""
QUANT_TREES = 200
"""As its authors use."""


class Rocket:
    """Transforms of aeon whose features go to one ridge."""

    has_probabilities = False

    def __init__(self, name: str, kinds: tuple[type, ...], every: int) -> None:
        """`every` so many samples are averaged to one, to shorten the series."""
        self.name = name
        self._kinds = kinds
        self._every = every

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Draw kernels, then solve the ridge."""
        self._yaw_radps = lesson.full_yaw_radps
        series = padded(lesson.windows, self._yaw_radps, self._every)
        self._transforms = [kind(random_state=seed) for kind in self._kinds]
        for transform in self._transforms:
            transform.fit(series)
        self._ridge = Ridge()
        rows = self._features(series, tell)
        held = self._features(padded(lesson.held, self._yaw_radps, self._every), _quiet)
        self._ridge.fit(rows, lesson.windows.labels, held, lesson.held.labels, len(PRIMITIVES))

    def scores(self, windows: Windows) -> Scores:
        """Of the ridge."""
        rows = self._features(padded(windows, self._yaw_radps, self._every), _quiet)
        return self._ridge.scores(rows)

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
    return Rocket("MiniRocket", (MiniRocket,), 1)


def multirocket_hydra() -> Rocket:
    """MultiRocket and Hydra (Dempster et al. 2023), at 25 Hz for the sake of time."""
    return Rocket("MultiRocketHydra", (MultiRocket, HydraTransformer), 2)


class Quant:
    """QUANT (Dempster et al. 2024): quantiles of intervals, and extremely randomised trees."""

    name = "QUANT"
    has_probabilities = True

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn from padded windows."""
        self._yaw_radps = lesson.full_yaw_radps
        series = padded(lesson.windows, self._yaw_radps, 2)
        self._transform = QUANTTransformer().fit(series, lesson.windows.labels)
        self._trees = ExtraTreesClassifier(
            QUANT_TREES, criterion="entropy", max_features=0.1, random_state=seed
        )
        self._trees.fit(np.asarray(self._transform.transform(series)), lesson.windows.labels)
        tell(1, 1)

    def scores(self, windows: Windows) -> Scores:
        """The trees' probabilities."""
        series = padded(windows, self._yaw_radps, 2)
        return np.asarray(self._trees.predict_proba(np.asarray(self._transform.transform(series))))
