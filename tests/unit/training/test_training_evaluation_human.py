"""Trainings on recordings of people: what is standardised, varied and learned."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from training.evaluation import human
from training.evaluation.human import HUMAN_SETS, Split, minirocket_accuracy, standardised
from training.evaluation.human_trunk import FittedTrunk, fit_trunk, read, varied


def split(classes: int = 2, each: int = 8, seed: int = 0) -> Split:
    """Slow and fast waves of two channels in strange units and of different lengths."""
    rng = np.random.default_rng(seed)

    def part() -> tuple[list[np.ndarray], np.ndarray]:
        series, labels = [], []
        for label in range(classes):
            for _ in range(each):
                t = np.arange(int(rng.integers(30, 60))) / 30.0
                wave = np.sin(2 * np.pi * (1 + 2 * label) * t + rng.uniform(0, 6))
                pair = np.stack([100.0 + 5.0 * wave, 1e-3 * wave])
                series.append(pair.astype(np.float32))
                labels.append(label)
        return series, np.array(labels)

    return Split(*part(), *part())


def test_channels_are_standardised_by_what_is_learned_from_alone() -> None:
    given = split()
    louder = Split(
        given.training,
        given.training_labels,
        [3.0 * one for one in given.test],
        given.test_labels,
    )
    made, other = standardised(given), standardised(louder)
    everything = np.concatenate(made.training, axis=1)
    assert everything.mean(axis=1) == pytest.approx([0.0, 0.0], abs=1e-3)
    assert everything.std(axis=1) == pytest.approx([1.0, 1.0], abs=1e-2)
    for one, same in zip(made.training, other.training, strict=True):
        np.testing.assert_array_equal(one, same)


def test_a_constant_channel_stays_finite() -> None:
    still = [np.ones((1, 20), dtype=np.float32)] * 2
    labels = np.array([0, 1])
    made = standardised(Split(still, labels, still, labels))
    assert np.isfinite(made.test[0]).all()


def test_a_series_is_read_from_its_first_sample_to_its_last() -> None:
    series = np.array([[0.0, 1.0, 4.0]], dtype=np.float32)
    np.testing.assert_allclose(
        read(series, np.linspace(0.0, 1.0, 5)), [[0.0, 0.5, 1.0, 2.5, 4.0]], atol=1e-6
    )


def test_a_varied_series_is_of_the_same_kind_and_never_the_same() -> None:
    rng = np.random.default_rng(0)
    series = np.stack([np.sin(np.linspace(0, 6, 50)), np.linspace(-1, 1, 50)]).astype(np.float32)
    made = [varied(series, 2.0, rng) for _ in range(50)]
    assert all(one.shape[0] == 2 and one.dtype == np.float32 for one in made)
    assert all(np.isfinite(one).all() for one in made)
    lengths = [one.shape[1] for one in made]
    assert min(lengths) >= 100 * 0.8 * 0.8 - 1
    assert max(lengths) <= 100 * 1.25 + 1
    assert len({one.tobytes() for one in made}) == 50
    alike = [
        np.corrcoef(one[0], read(series, np.linspace(0, 1, one.shape[1]))[0])[0, 1] for one in made
    ]
    assert np.median(alike) > 0.8


def test_very_short_series_are_long_enough_for_the_network() -> None:
    rng = np.random.default_rng(0)
    series = np.ones((3, 2), dtype=np.float32)
    assert varied(series, 1.0, rng).shape[1] >= 7


def test_the_trunk_learns_what_tells_two_kinds_apart_and_is_the_same_by_its_seed() -> None:
    made = standardised(split())

    def fitted() -> FittedTrunk:
        return fit_trunk(made.training, made.training_labels, seed=1, steps=40)

    told: list[tuple[int, int]] = []
    trunk = fit_trunk(
        made.training, made.training_labels, 1, 40, lambda done, of: told.append((done, of))
    )
    said = trunk.probabilities(made.test)
    assert told[-1] == (40, 40)
    assert said.sum(axis=1) == pytest.approx(1.0, abs=1e-5)
    assert (said.argmax(axis=1) == made.test_labels).mean() >= 0.9
    torch.rand(3)
    np.testing.assert_array_equal(said, fitted().probabilities(made.test))


def test_all_sets_are_learned_by_one_recipe(monkeypatch) -> None:
    recipes = []

    def learned(_series: object, _labels: object, *recipe: object) -> SimpleNamespace:
        recipes.append(recipe)
        return SimpleNamespace(probabilities=lambda series: np.eye(2)[[0] * len(series)])

    monkeypatch.setattr(human, "split_of", lambda name, seed: split(seed=len(name)))
    monkeypatch.setattr(human, "fit_trunk", learned)
    monkeypatch.setattr(human, "minirocket_accuracy", lambda *_, stretch: 0.25 + 0.5 * stretch)
    tell = print
    for one in HUMAN_SETS:
        found = human.judge_human(one, 30, 4, tell)
        assert found == {"ours": 0.5, "padded": 0.25, "stretched": 0.75, "n": 16.0}
    assert recipes == [(4, 30, tell)] * len(HUMAN_SETS)


@pytest.mark.parametrize("stretch", [False, True])
def test_the_peer_reads_the_very_same_series(monkeypatch, stretch: bool) -> None:
    read_by: list[np.ndarray] = []

    class Peer:
        def __init__(self, random_state: int) -> None:
            pass

        def fit(self, series: np.ndarray, labels: np.ndarray) -> None:
            read_by.append(series)

        def predict(self, series: np.ndarray) -> np.ndarray:
            read_by.append(series)
            return np.zeros(len(series))

    module = SimpleNamespace(MiniRocketClassifier=Peer)
    monkeypatch.setitem(sys.modules, "aeon.classification.convolution_based", module)
    made = standardised(split())
    assert minirocket_accuracy(made, 0, stretch=stretch) == 0.5
    for given, series in zip(read_by, (made.training, made.test), strict=True):
        assert given.shape[1:] == (2, max(one.shape[1] for one in (*made.training, *made.test)))
        for one, own in zip(given, series, strict=True):
            assert one[:, 0] == pytest.approx(own[:, 0])
            if not stretch:
                np.testing.assert_array_equal(one[:, : own.shape[1]], own)
                assert not one[:, own.shape[1] :].any()


@pytest.mark.parametrize("fold", range(2))
def test_nobody_of_the_shoulder_exercises_is_learned_from_and_judged_on(
    fold: int, monkeypatch
) -> None:
    seglearn = pytest.importorskip("seglearn.datasets")
    # A subject is known by their level, so that it can be found again in the windows.
    subjects = np.repeat(np.arange(1, 11), 2)
    recordings = [np.full((450, 6), float(subject)) for subject in subjects]
    watch = {"subject": subjects, "X": recordings, "y": np.tile([0, 1], 10)}
    monkeypatch.setattr(seglearn, "load_watch", lambda: watch)
    made = human.split_of(human.SHOULDER, fold)
    levels = [{round(float(one[0, 0]), 4) for one in part} for part in (made.training, made.test)]
    assert not levels[0] & levels[1]
    assert [len(part) for part in levels] == [8, 2]
    assert len(made.test) == 2 * 2 * 2
    assert len(made.training) == 8 * 2 * 3
