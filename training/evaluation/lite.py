"""One LITE network of aeon's, a small InceptionTime; LITETime is the mean of five of them.

It needs TensorFlow, which nothing else here does: `pip install tensorflow-cpu` beside aeon.
"""

import os
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

# TensorFlow heeds it only before it is imported.
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import tensorflow as tf
from aeon.classification.deep_learning import IndividualLITEClassifier

from services.classifier.window import WINDOW_SAMPLES
from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.names import LITE
from training.evaluation.views import padded, thinned
from training.windows import Windows

EVERY = 2
EPOCHS = 60
"""Its authors train 1500, for sets of a tenth of the size; this is what a fold has time for."""


class Lite:
    """LITEMV (Ismail-Fawaz et al. 2023) on zero-padded windows, with its authors' sizes."""

    name = LITE
    has_probabilities = True

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn; of all epochs the one with the least training loss is kept, as aeon does."""
        self._yaw_radps = lesson.full_yaw_radps
        tf.config.threading.set_intra_op_parallelism_threads(1)
        tf.config.threading.set_inter_op_parallelism_threads(1)
        tf.keras.utils.disable_interactive_logging()
        some = thinned(lesson.windows)
        with TemporaryDirectory() as folder:
            self._network = IndividualLITEClassifier(
                use_litemv=True, n_epochs=EPOCHS, random_state=seed, file_path=f"{folder}/"
            )
            self._network.fit(self._series(some), some.labels)
        tell(1, 1)

    def scores(self, windows: Windows) -> Scores:
        """The softmax."""
        return np.asarray(self._network.predict_proba(self._series(windows)), dtype=np.float64)

    def _series(self, windows: Windows) -> NDArray[np.float32]:
        return padded(windows, self._yaw_radps, WINDOW_SAMPLES, EVERY)
