import numpy as np
import pytest
import torch
from sklearn.metrics import f1_score

from training.fit import class_weights, temperature_of
from training.generator.dataset import generate
from training.labels import PRIMITIVES
from training.scores import calibration_error, score, weighted_f1
from training.svm import features, fit_svm
from training.windows import (
    SHORTEST_SAMPLES,
    Examples,
    examples_of,
    random_windows,
    seen_after,
    spliced,
)


@pytest.fixture(scope="module")
def examples() -> Examples:
    return examples_of(generate(10, dict.fromkeys(PRIMITIVES, 25), seed=1))


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
    assert calibration_error(probabilities, truth) == pytest.approx(0.3)
    assert calibration_error(probabilities, np.repeat([0, 1], [80, 20])) == pytest.approx(0.0)


def test_the_temperature_cools_overconfident_logits() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    true_logits = torch.from_numpy(rng.normal(0.0, 1.5, (1000, 4)))
    labels = torch.distributions.Categorical(logits=true_logits).sample()
    assert temperature_of(3.0 * true_logits, labels) == pytest.approx(3.0, rel=0.15)


def test_class_weights_make_all_classes_count_the_same() -> None:
    labels = np.repeat([0, 1, 2], [10, 20, 70])
    weights = class_weights(labels, 3).numpy()
    assert weights * np.array([10, 20, 70]) == pytest.approx(100 / 3)


def test_early_windows_end_where_asked(examples: Examples) -> None:
    windows = seen_after(examples, 1.5)
    assert windows.lengths.max() == 75
    assert windows.sticks.shape[1:] == (200, 3)
    for row, length in zip(windows.sticks, windows.lengths, strict=True):
        assert not row[length:].any()


def test_the_window_at_the_end_is_the_newest_four_seconds(examples: Examples) -> None:
    windows = seen_after(examples, None)
    for row, length, track in zip(windows.sticks, windows.lengths, examples.tracks, strict=True):
        assert length == min(200, len(track))
        assert np.array_equal(row[:length], track[-length:])


def test_random_windows_are_seeded_and_long_enough(examples: Examples) -> None:
    one = random_windows(examples, np.random.default_rng(4))
    other = random_windows(examples, np.random.default_rng(4))
    assert np.array_equal(one.sticks, other.sticks)
    assert one.lengths.min() >= SHORTEST_SAMPLES
    assert one.lengths.max() <= 200
    assert len(set(one.lengths.tolist())) > 20


def test_one_primitive_is_flown_into_the_next_without_a_turn() -> None:
    """A line to the left, then an arc: joined where the arc begins, in its direction."""
    t = np.arange(0.0, 4.0, 0.02)
    line = np.stack([0.0 * t, 0.4 + 0.0 * t, 0.0 * t], 1).astype(np.float32)
    arc = np.stack([0.8 * np.cos(0.5 * t), 0.8 * np.sin(0.5 * t), 0.0 * t], 1).astype(np.float32)
    for seed in range(10):
        window = spliced(line, arc, np.random.default_rng(seed))
        assert window is not None
        assert len(window) <= 200
        assert np.hypot(window[:, 0], window[:, 1]) == pytest.approx(0.8, rel=0.01)
        heading = np.unwrap(np.arctan2(window[:, 1], window[:, 0]))
        assert np.abs(np.diff(heading)).max() < 0.1
        assert heading[-1] - heading[0] > 0.4
    assert spliced(line, arc[:50], np.random.default_rng(0)) is None
    assert spliced(0.0 * line, arc, np.random.default_rng(0)) is None


def test_the_svm_sees_100_roll_and_100_pitch_samples(examples: Examples) -> None:
    windows = seen_after(examples, None)
    rows = features(windows)
    assert rows.shape == (100, 200)
    length = windows.lengths[0]
    assert rows[0, 0] == pytest.approx(windows.sticks[0, 0, 1])
    assert rows[0, 199] == pytest.approx(windows.sticks[0, length - 1, 0])
    machine = fit_svm(windows)
    assert machine.named_steps["svc"].gamma == 0.001
    assert (machine.predict(rows) == windows.labels).mean() > 0.6
