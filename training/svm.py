"""The thesis' baseline: an RBF support vector machine on 100 + 100 resampled sticks."""

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from training.windows import Windows

POINTS = 100
C, GAMMA = 100.0, 0.001


def features(windows: Windows) -> NDArray[np.float64]:
    """(n, 200): 100 roll (vy) then 100 pitch (vx) samples, over each window's own length."""
    rows = []
    for sticks, length in zip(windows.sticks, windows.lengths, strict=True):
        at = np.linspace(0.0, length - 1.0, POINTS)
        index = np.arange(length)
        rows.append(
            np.concatenate([np.interp(at, index, sticks[:length, axis]) for axis in (1, 0)])
        )
    return np.stack(rows)


def fit_svm(windows: Windows) -> Pipeline:
    """Train it; gamma 0.001 means something on standardised features only."""
    machine = make_pipeline(StandardScaler(), SVC(C=C, gamma=GAMMA, kernel="rbf"))
    machine.fit(features(windows), windows.labels)
    return machine
