"""The thesis' baseline: an RBF support vector machine on 100 + 100 resampled sticks."""

from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

POINTS = 100
"""Of roll, and as many of pitch, over a primitive's whole length."""
C, GAMMA = 100.0, 0.001


def machine() -> Pipeline:
    """The machine, one against one; gamma 0.001 means something on standardised features only."""
    return make_pipeline(StandardScaler(), SVC(C=C, gamma=GAMMA, kernel="rbf"))
