"""Sines at any angle, continued with the right phase, against scipy as an oracle."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from synthesis_truth import noisy, sine_points, wave_from

from services.synthesis.config import Config
from services.synthesis.primitives.shape import UnfitError
from services.synthesis.primitives.sine import Sine

AMPLITUDE, WAVELENGTH = 0.5, 3.0


def oracle(xy, heading, phase):
    """The same five parameters by another minimiser that starts at the truth."""

    def off(wave):
        axis, offset, sine, cosine, number = wave
        along = math.cos(axis) * xy[:, 0] + math.sin(axis) * xy[:, 1]
        across = math.cos(axis) * xy[:, 1] - math.sin(axis) * xy[:, 0]
        return across - offset - sine * np.sin(number * along) - cosine * np.cos(number * along)

    number = 2.0 * math.pi / WAVELENGTH
    along = 3.0 * math.cos(heading) - 2.0 * math.sin(heading)
    across = -2.0 * math.cos(heading) - 3.0 * math.sin(heading)
    shift = phase - number * along
    start = [heading, across, AMPLITUDE * math.cos(shift), AMPLITUDE * math.sin(shift), number]
    best = least_squares(off, start, method="lm", x_scale=[0.1] * 5).x
    return math.hypot(best[2], best[3]), 2.0 * math.pi / best[4]


@pytest.mark.parametrize(
    ("waves", "share"), [(0.6, 0.01), (0.8, 0.05), (1.0, 0.1), (1.5, 0.1), (2.0, 0.1)]
)
def test_amplitude_and_wavelength_are_as_good_as_an_oracles(waves, share):
    rng = np.random.default_rng(round(10 * waves))
    ours, oracles = [], []
    for _ in range(150):
        heading, phase = rng.uniform(-math.pi, math.pi, 2)
        clean = sine_points(AMPLITUDE, WAVELENGTH, heading, phase, waves)
        points = noisy(clean, share * AMPLITUDE, rng)
        params = Sine.fit(points, points[-1]).params
        amplitude, wavelength = oracle(points[:, :2], heading, phase)
        ours.append([abs(params["amplitude"] - AMPLITUDE), abs(params["wavelength"] - WAVELENGTH)])
        oracles.append([abs(amplitude - AMPLITUDE), abs(wavelength - WAVELENGTH)])
    assert np.all(np.percentile(ours, 95, axis=0) <= 1.1 * np.percentile(oracles, 95, axis=0))


@settings(max_examples=60, deadline=None)
@given(
    heading=st.floats(-math.pi, math.pi),
    phase=st.floats(-math.pi, math.pi),
    waves=st.floats(0.8, 3.0),
    wavelength=st.floats(1.5, 8.0),
    slenderness=st.floats(0.06, 0.2),
)
def test_a_clean_sine_is_found_at_any_angle_and_goes_on_in_phase(
    heading, phase, waves, wavelength, slenderness
):
    amplitude = slenderness * wavelength
    whole = sine_points(amplitude, wavelength, heading, phase, waves + 1.0, count=400)
    seen = whole[: round(400 * waves / (waves + 1.0))]
    wave = Sine.fit(seen, seen[-1])
    wave.check(Config())
    params = wave.params
    assert params["amplitude"] == pytest.approx(amplitude, rel=0.02)
    assert params["wavelength"] == pytest.approx(wavelength, rel=0.02)
    assert math.remainder(params["heading"] - heading, 2.0 * math.pi) == pytest.approx(0, abs=0.02)
    ahead = wave.ahead()
    assert np.allclose(ahead[0], seen[-1], atol=0.02 * wavelength)
    # What comes is what was hidden: every hidden point lies on the path.
    for point in whole[len(seen) :: 20]:
        assert np.linalg.norm(ahead - point, axis=1).min() < 0.03 * wavelength + 0.05


def test_the_parameters_describe_the_path():
    points = sine_points(0.4, 2.5, 2.0, 1.0, 1.7)
    wave = Sine.fit(points, points[-1])
    expected = wave_from(wave.params, np.linspace(0.0, 7.5, 3000))
    for point in wave.ahead()[::10]:
        assert np.linalg.norm(expected - point, axis=1).min() < 0.01


def test_a_straight_way_is_no_sine_but_a_line():
    along = np.linspace(0.0, 4.0, 90)
    points = noisy(np.column_stack([along, along, np.ones(90)]), 0.01, np.random.default_rng(11))
    with pytest.raises(UnfitError) as unfit:
        Sine.fit(points, points[-1]).check(Config())
    assert unfit.value.simpler == "line"
