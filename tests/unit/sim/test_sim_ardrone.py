"""The `ardrone` plant answers sticks as tum_ardrone identified the real one."""

import math

import numpy as np
import pytest
from flights import fly, hovering

from common.sticks import FULL_STICK
from services.sim.body import BodyState, Sticks
from services.sim.core import STEP_S, Simulation
from services.sim.plants.ardrone import ground_effect

HIGH_M = 20.0
"""Far from the ground's effect."""


def aloft(**settings: object) -> Simulation:
    return hovering(plant="ardrone", height_m=HIGH_M, **settings)


def time_constant_s(values: np.ndarray) -> float:
    """When 1 - 1/e of a step from 0 to the last value is done."""
    share = values / values[-1]
    after = int(np.argmax(share >= 1.0 - math.exp(-1.0)))
    before = share[after - 1] if after else 0.0
    return float((after + (1.0 - math.exp(-1.0) - before) / (share[after] - before)) * STEP_S)


def pitch_rad(state: BodyState) -> float:
    return math.asin(-state.rotation[6])


def test_half_a_stick_tilts_by_12_degrees_with_c3() -> None:
    for stick in (0.5, 1.0):
        states, _ = fly(aloft(), 1.2, Sticks(vx=stick))
        tilt = np.asarray([pitch_rad(state) for state in states])
        assert tilt[-1] == pytest.approx(math.radians(12.0), rel=0.01)
        assert time_constant_s(tilt) == pytest.approx(1.0 / 7.0, rel=0.05)
        assert tilt.max() < math.radians(12.0) * 1.02
    states, _ = fly(aloft(), 1.2, Sticks(vy=0.25))
    roll = math.atan2(states[-1].rotation[7], states[-1].rotation[8])
    assert roll == pytest.approx(-math.radians(6.0), rel=0.01)


def test_speed_builds_up_against_the_drag_c1() -> None:
    simulation = aloft()
    fly(simulation, 1.0, Sticks(vx=0.5))
    begin_mps = simulation.state.velocity_mps[0]
    states, _ = fly(simulation, 12.0, Sticks(vx=0.5))
    speed = np.asarray([state.velocity_mps[0] for state in states])
    # Once the tilt stands, what is left is the first order of the drag.
    assert time_constant_s(speed - begin_mps) == pytest.approx(1.0 / 0.58, rel=0.05)
    assert speed[-1] == pytest.approx(FULL_STICK["ardrone"].forward_mps, rel=0.01)
    # c2 sin(12 deg) was identified.
    assert speed[-1] == pytest.approx(17.5 * math.sin(math.radians(12.0)), rel=0.02)


@pytest.mark.parametrize(("stick", "expected_mps"), [(1.0, 0.6), (0.5, 0.3), (-0.5, -0.6)])
def test_climb_follows_c7_and_c8(stick: float, expected_mps: float) -> None:
    states, _ = fly(aloft(), 8.0, Sticks(vz=stick))
    climb = np.asarray([state.velocity_mps[2] for state in states])
    assert climb[-1] == pytest.approx(expected_mps, rel=0.02)
    assert time_constant_s(climb) == pytest.approx(1.25, rel=0.05)


def test_turn_follows_c5_and_c6() -> None:
    states, _ = fly(aloft(), 0.5, Sticks(wz=-1.0))
    turn = np.asarray([state.angular_velocity_radps[2] for state in states])
    assert turn[-1] == pytest.approx(-math.pi / 2.0, rel=0.01)
    assert time_constant_s(turn) == pytest.approx(1.0 / 25.0, rel=0.05)


def test_hands_off_it_does_not_stop() -> None:
    simulation = aloft()
    fly(simulation, 4.0, Sticks(vx=0.5))
    states, _ = fly(simulation, 1.0)
    assert states[-1].velocity_mps[0] > 1.5


def test_the_ground_carries_a_low_rotor() -> None:
    assert ground_effect(0.05) == pytest.approx(4.0 / 3.0)
    assert ground_effect(0.1) == pytest.approx(1.0 / (1.0 - 1.0 / 16.0))
    assert ground_effect(2.0) == pytest.approx(1.0, abs=2e-4)
    low, _ = fly(hovering(plant="ardrone", height_m=0.25), 2.0)
    high, _ = fly(hovering(plant="ardrone", height_m=2.5), 2.0)
    assert low[-1].position_m[2] - 0.25 > 10.0 * (high[-1].position_m[2] - 2.5) > 0.0


def test_it_takes_off_and_lands() -> None:
    simulation = hovering(plant="ardrone", height_m=0.0)
    assert simulation.status().plant == "ardrone"
    fly(simulation, 0.1, action="takeoff")
    fly(simulation, 4.0)
    assert simulation.status().state == "flying"
    assert 0.5 < simulation.state.position_m[2] < 1.5
    states, _ = fly(simulation, 8.0, action="land")
    assert simulation.status().state == "landed"
    assert min(state.velocity_mps[2] for state in states) > -0.6
    assert simulation.status().collisions == 0
