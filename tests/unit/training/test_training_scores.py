import numpy as np
import pytest
from sklearn.metrics import f1_score

from training.scores import calibration_error, confidence_bins, score, weighted_f1


def test_f1_is_that_of_a_library_not_eq_5_1() -> None:
    rng = np.random.default_rng(0)
    truth, said = rng.integers(0, 4, 300), rng.integers(0, 4, 300)
    people = rng.integers(0, 12, 300)
    found = score(truth, said, people, 4, seed=0)
    assert found.f1 == pytest.approx(f1_score(truth, said, average="weighted"))
    assert weighted_f1(truth, said) == pytest.approx(found.f1)
    assert found.accuracy == pytest.approx(float((truth == said).mean()))
    assert found.interval[0] < found.f1 < found.interval[1]
    assert found.confusion.sum() == found.count == 300
    assert found.operators == 12


def test_the_interval_is_over_people() -> None:
    """Two people, one always right and one always wrong: it is as wide as can be."""
    truth = np.zeros(200, dtype=np.int64)
    people = np.repeat([0, 1], 100)
    low, high = score(truth, people.copy(), people, 2, seed=0).interval
    assert low == 0.0
    assert high == 1.0


def test_calibration_error_is_the_gap_between_confidence_and_accuracy() -> None:
    probabilities = np.tile([0.8, 0.2], (100, 1))
    truth = np.repeat([0, 1], 50)
    assert calibration_error(confidence_bins(probabilities, truth)) == pytest.approx(0.3)
    truth = np.repeat([0, 1], [80, 20])
    assert calibration_error(confidence_bins(probabilities, truth)) == pytest.approx(0.0)
