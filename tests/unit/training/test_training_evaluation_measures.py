"""Figures of the evaluation follow from counts, as textbooks and scikit-learn have them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import f1_score

from training.evaluation.cache import Cache
from training.evaluation.measures import Tally, estimate, tally
from training.evaluation.ridge import Ridge


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=60))
def test_weighted_f1_is_that_of_scikit_learn(pairs: list[tuple[int, int]]) -> None:
    truth, said = (np.array(column, dtype=np.int64) for column in zip(*pairs, strict=True))
    found = tally(truth, np.eye(4)[said], has_probabilities=False)
    expected = f1_score(truth, said, average="weighted", zero_division=0.0)
    assert found.f1 == pytest.approx(expected)
    assert found.accuracy == pytest.approx((truth == said).mean())


def test_arcs_and_sines_taken_for_each_other_are_a_share_of_arcs_and_sines() -> None:
    confusion = np.diag([50, 40, 40, 50])
    confusion[1, 2], confusion[2, 1], confusion[0, 1] = 3, 1, 7
    assert Tally(confusion, np.zeros((0, 3))).arc_sine == pytest.approx(4 / 84)


def test_calibration_error_is_how_far_confidence_is_from_being_right() -> None:
    truth = np.zeros(100, dtype=np.int64)
    scores = np.tile([0.1, 0.7, 0.1, 0.1], (100, 1))
    scores[:70] = [0.7, 0.1, 0.1, 0.1]
    assert tally(truth, scores, True).calibration_error == pytest.approx(0.0, abs=1e-9)
    scores[:] = [0.1, 0.7, 0.1, 0.1]
    assert tally(truth, scores, True).calibration_error == pytest.approx(0.7)


def test_scores_that_are_no_probabilities_have_no_calibration_error() -> None:
    found = tally(np.array([0, 1]), np.array([[5.0, 1, 1, 1], [0.0, 9, 1, 1]]), False)
    assert found.calibration_error is None


def test_counts_add_up_and_survive_a_file() -> None:
    rng = np.random.default_rng(0)
    parts = [tally(rng.integers(0, 4, 40), rng.dirichlet(np.ones(4), 40), True) for _ in range(2)]
    total = Tally.from_json((parts[0] + parts[1]).to_json())
    assert total.count == 80
    assert total.bins[:, 0].sum() == 80


def test_the_interval_is_students() -> None:
    found = estimate([0.90, 0.92, 0.94, 0.91, 0.93])
    assert found.mean == pytest.approx(0.92)
    assert found.half == pytest.approx(2.776 * 0.015811 / math.sqrt(5), rel=1e-3)
    assert found.text(2) == "0.92 ± 0.02"


def test_one_seed_has_no_interval() -> None:
    assert estimate([0.5]).text() == "0.500"


def test_what_was_not_asked_is_a_dash() -> None:
    assert estimate([]).text() == "-"


def test_a_result_of_another_mark_or_half_a_file_is_no_result(tmp_path) -> None:
    cache = Cache(tmp_path)
    cache.keep({"f1": 0.5}, "people-a", "geometry + trees", 0)
    assert cache.find("people-a", "geometry + trees", 0)["f1"] == 0.5
    assert cache.find("people-b", "geometry + trees", 0) is None
    assert cache.find("people-a", "geometry + trees", 1) is None
    cache.path("geometry + trees", 0).write_text('{"f1": 0.')
    assert cache.find("people-a", "geometry + trees", 0) is None


@pytest.mark.parametrize("features", [20, 400])
def test_the_ridge_learns_with_more_features_than_rows_and_with_fewer(features: int) -> None:
    rng = np.random.default_rng(1)
    centres = rng.standard_normal((3, features))
    labels = rng.integers(0, 3, 240)
    rows = (centres[labels] + rng.standard_normal((240, features))).astype(np.float32)
    ridge = Ridge()
    ridge.fit(rows[:120].copy(), labels[:120], rows[120:180].copy(), labels[120:180], 3)
    said = ridge.scores(rows[180:].copy()).argmax(axis=1)
    assert (said == labels[180:]).mean() > 0.95
