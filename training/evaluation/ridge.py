"""A ridge classifier for thousands of features, its penalty chosen on people held out."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from sklearn.preprocessing import StandardScaler

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

PENALTIES = (10.0, 100.0, 1e3, 1e4, 1e5)


class Ridge:
    """Least squares to +1 and -1 with a penalty, as convolution kernels are used in the field.

    aeon's classifiers choose the penalty by leave-one-out, which takes an eigenvalue decomposition
    (minutes at 10 000 windows). A Cholesky decomposition a penalty and people held out take
    seconds, and are the better question: the windows left in are of the same people.
    """

    def fit(
        self, rows: Array32, labels: IntArray, held: Array32, held_labels: IntArray, classes: int
    ) -> None:
        """Learn from `rows` (n, p), which are overwritten; choose the penalty by `held`."""
        self._scaler = StandardScaler(copy=False)
        rows = self._scaler.fit_transform(rows)
        held = self._scaler.transform(held)
        goal = np.where(labels[:, None] == np.arange(classes), 1.0, -1.0).astype(np.float32)
        self._mean = goal.mean(axis=0)
        goal -= self._mean
        is_wide = rows.shape[0] < rows.shape[1]
        gram = rows @ rows.T if is_wide else rows.T @ rows
        right = goal if is_wide else rows.T @ goal
        diagonal = np.einsum("ii->i", gram)
        added, best = 0.0, -1.0
        for penalty in PENALTIES:
            diagonal += np.float32(penalty - added)
            added = penalty
            solved = cho_solve(cho_factor(gram, lower=True, check_finite=False), right)
            weights = rows.T @ solved if is_wide else solved
            share = float(((held @ weights + self._mean).argmax(axis=1) == held_labels).mean())
            if share > best:
                best, self._weights, self.penalty = share, weights, penalty

    def scores(self, rows: Array32) -> NDArray[np.float64]:
        """Scores (n, classes) of rows, which are overwritten."""
        return np.asarray(self._scaler.transform(rows) @ self._weights + self._mean, np.float64)
