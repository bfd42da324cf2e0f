"""Trees on hand-made geometry features: the peer that sees what our network is to see."""

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier, HistGradientBoostingClassifier

from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.geometry import features
from training.evaluation.views import in_start_frame
from training.windows import Windows

TREES = 500
LEAF = 2


def geometry_of(windows: Windows, full_yaw_radps: float) -> NDArray[np.float64]:
    """Features (n, k) of windows, each over its own length."""
    sticks = in_start_frame(windows, full_yaw_radps)
    return np.stack(
        [features(one[:length]) for one, length in zip(sticks, windows.lengths, strict=True)]
    )


class GeometryTrees:
    """Extremely randomised or boosted trees on geometry features."""

    has_probabilities = True

    def __init__(self, *, boosted: bool) -> None:
        self.name = "geometry + boosting" if boosted else "geometry + ExtraTrees"
        self._boosted = boosted

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn from the features of the windows."""
        self._yaw_radps = lesson.full_yaw_radps
        self._trees = (
            HistGradientBoostingClassifier(learning_rate=0.08, random_state=seed)
            if self._boosted
            else ExtraTreesClassifier(
                TREES, min_samples_leaf=LEAF, max_features=0.3, random_state=seed
            )
        )
        rows = geometry_of(lesson.windows, self._yaw_radps)
        self._trees.fit(rows, lesson.windows.labels)
        tell(1, 1)

    def scores(self, windows: Windows) -> Scores:
        """The trees' probabilities."""
        return np.asarray(self._trees.predict_proba(geometry_of(windows, self._yaw_radps)))
