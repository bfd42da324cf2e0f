"""Wind pushes the vehicle, from where it is said to blow, with the gusts of MIL-F-8785C."""

import math

import numpy as np
import pytest
from flights import fly, hovering

from services.sim.wind import STEP_S, Wind, gusts_at

HIGH_M = 20.0


def test_an_ardrone_that_is_let_go_drifts_with_the_wind() -> None:
    simulation = hovering(
        plant="ardrone", height_m=HIGH_M, wind_mps=3.0, wind_from_deg=270.0, gusts=False
    )
    states, _ = fly(simulation, 10.0)
    vx, vy, vz = states[-1].velocity_mps
    assert vx == pytest.approx(3.0, rel=0.02)
    assert (vy, vz) == pytest.approx((0.0, 0.0), abs=0.02)


def test_a_tum_is_pushed_and_holds_against_it() -> None:
    states, _ = fly(hovering(wind_mps=3.0, wind_from_deg=0.0, gusts=False), 6.0)
    vx, vy, _ = states[-1].velocity_mps
    # A north wind pushes to the south; a loop of P 5 without I gives way by a fifth of the push.
    assert vy == pytest.approx(-0.58 * 3.0 / 5.0, rel=0.05)
    assert vx == pytest.approx(0.0, abs=0.01)


def test_gusts_are_as_strong_and_as_long_as_the_model_says() -> None:
    sigma_mps, along_m, up_m = gusts_at(6.1, 5.0)
    assert sigma_mps[2] == pytest.approx(0.5)
    assert sigma_mps[0] == pytest.approx(0.5 / (0.177 + 0.000823 * 20.0) ** 0.4, rel=0.01)
    wind = Wind(np.random.default_rng(1), 5.0, 270.0, gusts=True)
    air = np.asarray([wind.step((0.0, 0.0, 6.1), (0.0, 0.0, 0.0)) for _ in range(200_000)])
    assert air.mean(axis=0) == pytest.approx((5.0, 0.0, 0.0), abs=0.15)
    assert air.std(axis=0) == pytest.approx(sigma_mps, rel=0.1)
    for axis, length_m in ((0, along_m), (2, up_m)):
        deviation = air[:, axis] - air[:, axis].mean()
        # Along the wind the correlation falls to 1/e in one length; across it is 0.29 there.
        lag = round(length_m / 5.0 / STEP_S)
        correlation = np.mean(deviation[:-lag] * deviation[lag:]) / deviation.var()
        expected = math.exp(-1.0) * (1.0 if axis == 0 else 0.5)
        assert correlation == pytest.approx(expected, abs=0.08)


def test_the_same_seed_is_the_same_weather() -> None:
    def flight(seed: int) -> tuple[float, ...]:
        simulation = hovering(plant="ardrone", height_m=HIGH_M, wind_mps=4.0, seed=seed)
        return fly(simulation, 3.0)[0][-1].position_m

    assert flight(1) == flight(1)
    assert flight(1) != flight(2)
