"""The project's own network among the contenders."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.names import OURS
from training.export import export, load, save
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

    def asked(self, windows: Windows) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Calibrated probabilities (n, 4), and how likely it is (n,) that any is meant."""
        return self.fitted.answers(windows)

    def sure(
        self, probabilities: NDArray[np.float32], meant: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Which (n,) of these answers a service would give, with the model's own threshold."""
        return np.asarray(meant * probabilities.max(axis=1) >= self.fitted.confidence_min)

    def save(self, path: Path) -> None:
        """Write the model file that a service would load, and the weights beside it."""
        export(self.fitted, PRIMITIVES, path.stem, path)
        save(self.fitted, path.with_suffix(".pt"))

    def load(self, path: Path) -> None:
        """Take the weights beside a model file, without their history.

        Raises:
            OSError: if there are none, or they are another network's.
        """
        self.fitted = load(path.with_suffix(".pt"))
