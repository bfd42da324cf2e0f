import numpy as np
import pytest
import torch

from training.calibration import (
    RIGHT_SHARE,
    confidence_min_of,
    platt_of,
    scaled,
    scaling_of,
)

torch.set_num_threads(1)


def test_the_scaling_cools_overconfident_logits_the_more_the_shorter_the_window() -> None:
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    true_logits = torch.from_numpy(rng.normal(0.0, 1.5, (4000, 4)))
    labels = torch.distributions.Categorical(logits=true_logits).sample()
    lengths = torch.from_numpy(rng.integers(20, 401, 4000))
    temperature = 3.0 * (lengths / 100.0).unsqueeze(1) ** -0.5
    scaling = scaling_of(temperature * true_logits, lengths, labels)
    found = scaled(temperature * true_logits, lengths, torch.tensor(scaling))
    assert (found.std() / true_logits.std()).item() == pytest.approx(1.0, abs=0.07)
    assert scaling[1] == pytest.approx(0.5, abs=0.1)


def test_meant_becomes_a_probability() -> None:
    torch.manual_seed(1)
    logit = torch.randn(20000) * 2.0
    is_meant = torch.rand(20000) < torch.sigmoid(logit)
    scale, shift = platt_of(3.0 * logit + 2.0, is_meant)
    assert scale == pytest.approx(1 / 3, abs=0.02)
    assert shift == pytest.approx(-2 / 3, abs=0.06)


def test_above_the_threshold_95_percent_are_right() -> None:
    rng = np.random.default_rng(2)
    confidence = rng.uniform(0.25, 1.0, 5000).astype(np.float32)
    probabilities = np.stack([confidence, *[(1 - confidence) / 3] * 3], axis=1)
    labels = np.where(rng.random(5000) < confidence, 0, 1)
    meant = np.ones(5000, dtype=np.float32)
    least = confidence_min_of(probabilities, meant, labels)
    above = confidence >= least
    assert (labels[above] == 0).mean() == pytest.approx(RIGHT_SHARE, abs=0.001)
    assert least == pytest.approx(0.9, abs=0.03)


def test_what_was_not_meant_is_never_right() -> None:
    """A hundred sure answers to rest and forty to lines: only above those of rest all is well."""
    probabilities = np.tile([[0.9, 0.1, 0.0, 0.0]], (140, 1)).astype(np.float32)
    labels = np.repeat([4, 0], [100, 40])
    meant = np.repeat([0.5, 0.8], [100, 40]).astype(np.float32)
    assert confidence_min_of(probabilities, meant, labels) == pytest.approx(0.72)


def test_a_classifier_that_is_never_right_says_nothing() -> None:
    probabilities = np.tile([[0.9, 0.1, 0.0, 0.0]], (50, 1)).astype(np.float32)
    never = confidence_min_of(probabilities, np.ones(50, dtype=np.float32), np.full(50, 2))
    assert never == 1.0
