"""The project's own network among the contenders."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.names import OURS
from training.export import export
from training.fit import Budget, Fitted, fit_network
from training.labels import PRIMITIVES
from training.windows import Windows


class Ours:
    """Convolutions and GRUs on geometry, trained as the shipped model is, on less."""

    name = OURS
    has_probabilities = True
    fitted: Fitted

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn from the performances themselves, cut anew in every epoch."""
        self.fitted = fit_network(
            lesson.training, lesson.validation, seed, Budget(windows=lesson.budget), progress=tell
        )

    def scores(self, windows: Windows) -> Scores:
        """Calibrated probabilities."""
        return np.asarray(self.fitted.probabilities(windows), dtype=np.float64)

    def meant(self, windows: Windows) -> NDArray[np.float64]:
        """How likely it is (n,) that any primitive is meant."""
        return np.asarray(self.fitted.meant(windows), dtype=np.float64)

    def export(self, path: Path) -> None:
        """Write the model file that a service would load."""
        export(self.fitted, PRIMITIVES, path.stem, path)
