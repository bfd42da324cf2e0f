"""Helices: an arc's circle, and a pitch with its sign, in both senses."""

import math

import numpy as np
import pytest
from synthesis_truth import helix_points, noisy

from services.synthesis.config import Config
from services.synthesis.primitives.helix import Helix
from services.synthesis.primitives.shape import UnfitError

RADIUS = 2.0


@pytest.mark.parametrize("pitch", [1.0, -1.0])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("turns", [0.5, 1.0, 2.0])
def test_a_clean_helix_is_found_and_flown_on(pitch, sense, turns):
    points = helix_points(RADIUS, 0.7, sense * turns * 2.0 * math.pi, pitch)
    helix = Helix.fit(points, points[-1])
    helix.check(Config())
    params = helix.params
    assert params["pitch"] == pytest.approx(pitch, rel=1e-4)
    assert params["radius"] == pytest.approx(RADIUS, rel=1e-4)
    assert params["sweep"] == pytest.approx(sense * 6.0 * math.pi)
    assert params["z"] == pytest.approx(points[-1, 2], abs=1e-4)
    ahead = helix.ahead()
    assert np.allclose(ahead[0], points[-1], atol=1e-4)
    assert ahead[-1, 2] - ahead[0, 2] == pytest.approx(3.0 * pitch, rel=1e-3)
    # It goes on as it came: the same step beyond the end as before it.
    after = ahead[1] - ahead[0]
    before = points[-1] - points[-2]
    assert after @ before / np.linalg.norm(after) / np.linalg.norm(before) > 0.995


@pytest.mark.parametrize(
    ("turns", "median", "p95"), [(0.5, 0.04, 0.12), (1.0, 0.02, 0.06), (2.0, 0.01, 0.03)]
)
def test_the_pitch_at_five_percent_noise_is_as_good_as_published(turns, median, p95):
    rng = np.random.default_rng(9)
    errors = []
    for _ in range(300):
        sense, pitch = rng.choice([-1.0, 1.0]), 2.0 * rng.choice([-1.0, 1.0])
        clean = helix_points(RADIUS, rng.uniform(-3.0, 3.0), sense * turns * 2.0 * math.pi, pitch)
        helix = Helix.fit(noisy(clean, 0.05 * RADIUS, rng), clean[-1])
        errors.append(abs(helix.pitch_m / pitch - 1.0))
    assert np.median(errors) < median
    assert np.percentile(errors, 95) < p95


def test_a_level_turn_is_no_helix_but_an_arc():
    points = noisy(helix_points(RADIUS, 0.0, 4.0, 0.0), 0.01, np.random.default_rng(10))
    with pytest.raises(UnfitError) as unfit:
        Helix.fit(points, points[-1]).check(Config())
    assert unfit.value.simpler == "arc"


def test_a_climb_that_hardly_turns_is_no_helix():
    points = helix_points(0.5, 0.0, 4.0, 10.0)
    with pytest.raises(UnfitError, match="steep"):
        Helix.fit(points, points[-1]).check(Config())


def test_steps_of_a_wide_helix_fit_a_suggestion():
    points = helix_points(14.0, 0.0, 2.0, 3.0)
    ahead = Helix.fit(points, points[-1]).ahead()
    assert len(ahead) <= 4096
    assert np.linalg.norm(np.diff(ahead, axis=0), axis=1).max() < 0.11
