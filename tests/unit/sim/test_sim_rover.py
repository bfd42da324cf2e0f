"""The rover: a stick is a speed and a turn rate, the ground holds it, and nothing flies."""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from flights import command, fly
from hypothesis import given, settings
from hypothesis import strategies as st

from common.messages import ResetRequest
from services.sim.body import BodyState, Sticks
from services.sim.config import Config
from services.sim.core import PHYSICS_HZ, Simulation
from services.sim.plants.rover import (
    FORWARD_MPS,
    GRIP,
    MOTOR_MPS2,
    MOTOR_S,
    SIZE_M,
    TURN_RADPS,
)

REST_M = SIZE_M[2] / 2.0
fraction = st.one_of(st.floats(-1.0, 1.0), st.sampled_from((-1.0, 1.0)))
sticks = st.builds(Sticks, fraction, fraction, fraction, fraction)


def standing(world: str = "empty") -> Simulation:
    return Simulation(Config(world=world, plant="rover", sensor_noise=0.0))


def test_it_follows_the_stick_as_its_motors_do() -> None:
    simulation = standing()
    states, _ = fly(simulation, 2.0, Sticks(vx=0.2))
    speed = np.asarray([state.velocity_mps[0] for state in states])
    assert speed[-1] == pytest.approx(0.2 * FORWARD_MPS, rel=0.01)
    # 0.2 m/s in a lag of 0.1 s asks for less than the motors have.
    assert speed[round(MOTOR_S * PHYSICS_HZ) - 1] / speed[-1] == pytest.approx(0.632, abs=0.05)
    states, _ = fly(simulation, 2.0, Sticks(vx=1.0))
    rise = (states[40].velocity_mps[0] - states[0].velocity_mps[0]) / 0.2
    assert rise == pytest.approx(MOTOR_MPS2, rel=0.05)
    assert states[-1].velocity_mps[0] == pytest.approx(FORWARD_MPS, rel=0.01)
    states, _ = fly(simulation, 2.0, Sticks(wz=-0.5))
    assert states[-1].angular_velocity_radps[2] == pytest.approx(-0.5 * TURN_RADPS, rel=0.01)
    simulation.close()


def test_sideways_and_upward_sticks_do_nothing() -> None:
    simulation = standing()
    states, _ = fly(simulation, 2.0, Sticks(vy=1.0, vz=1.0))
    assert states[-1].position_m == pytest.approx((0.0, 0.0, REST_M), abs=1e-3)
    simulation.close()


def test_it_drives_a_square_by_sticks() -> None:
    simulation = standing()
    corners = []
    for _ in range(4):
        fly(simulation, 2.0 / FORWARD_MPS, Sticks(vx=1.0))
        fly(simulation, 0.6)
        corners.append(simulation.state.position_m[:2])
        # A quarter turn, as long as full stick needs for it.
        fly(simulation, math.pi / 2.0 / TURN_RADPS, Sticks(wz=1.0))
        fly(simulation, 0.6)
    assert np.allclose(corners, [(2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)], atol=0.1)
    assert math.cos(simulation.state.yaw_rad) > 0.99
    assert simulation.status().collisions == 0
    simulation.close()


@settings(max_examples=8, deadline=None)
@given(plan=st.lists(sticks, min_size=1, max_size=4))
def test_mirrored_sticks_give_mirrored_driving(plan: list[Sticks]) -> None:
    def path(side: float) -> np.ndarray:
        simulation = standing()
        states: list[BodyState] = []
        for each in plan:
            states += fly(
                simulation, 0.5, Sticks(each.vx, side * each.vy, each.vz, side * each.wz)
            )[0]
        simulation.close()
        return np.asarray([state.position_m for state in states])

    assert np.allclose(path(1.0), path(-1.0) * (1.0, -1.0, 1.0), atol=1e-6)


@settings(max_examples=8, deadline=None)
@given(plan=st.lists(sticks, min_size=1, max_size=4), height_m=st.sampled_from((0.0, 0.3, 1.0)))
def test_no_stick_takes_it_beyond_its_limits_or_through_the_floor(
    plan: list[Sticks], height_m: float
) -> None:
    simulation = standing()
    simulation.reset(ResetRequest(position=(0.0, 0.0, height_m)))
    fly(simulation, 0.8)
    for each in plan:
        states, _ = fly(simulation, 0.5, each)
        for before, state in itertools.pairwise(states):
            vx, vy, _ = state.velocity_mps
            assert math.hypot(vx, vy) < 1.01 * FORWARD_MPS
            assert abs(state.angular_velocity_radps[2]) < 1.01 * TURN_RADPS
            change = math.dist(before.velocity_mps[:2], (vx, vy)) * PHYSICS_HZ
            assert change < 1.05 * GRIP * 9.81
            assert abs(state.position_m[2] - REST_M) < 0.01
            assert state.tilt_rad < 0.02
    simulation.close()


def test_an_emergency_stops_it_within_the_grip_of_its_tyres_until_it_is_let_go() -> None:
    simulation = standing()
    fly(simulation, 2.0, Sticks(vx=1.0))
    begin_m = simulation.state.position_m[0]
    fly(simulation, 0.5, Sticks(vx=1.0), action="emergency")
    assert simulation.status().state == "emergency"
    assert simulation.state.position_m[0] - begin_m < 1.2 * FORWARD_MPS**2 / (2 * GRIP * 9.81)
    fly(simulation, 0.5, Sticks(vx=1.0))
    assert simulation.status().state == "emergency"
    fly(simulation, 0.1, action="land")
    assert simulation.status().state == "landed"
    fly(simulation, 0.1, action="takeoff")
    assert simulation.status().state == "flying"
    simulation.close()


def test_take_off_and_landing_mean_nothing_to_it() -> None:
    simulation = standing()
    for action in ("takeoff", "land"):
        fly(simulation, 0.5, action=action)
        assert simulation.status().state == "flying"
        assert simulation.state.position_m == pytest.approx((0.0, 0.0, REST_M), abs=1e-3)
    simulation.close()


def test_without_commands_it_stops() -> None:
    simulation = standing()
    fly(simulation, 1.5, Sticks(vx=1.0, wz=0.5))
    states, _ = fly(simulation, 1.5, silent=True)
    assert math.hypot(*states[-1].velocity_mps) < 0.01
    simulation.close()


def test_a_wall_stops_it_and_counts() -> None:
    simulation = standing("track")
    simulation.reset(ResetRequest(yaw=math.pi / 2.0))
    fly(simulation, 4.0, Sticks(vx=1.0))
    assert simulation.status().collisions == 1
    assert abs(simulation.state.velocity_mps[1]) < 0.05
    assert simulation.state.position_m[1] < 1.5
    simulation.close()


LEDGE = """\
description: a ledge 1 m high with a wall on it
start: {position_m: [0, 0, 1.5], yaw_deg: 0}
bodies:
  - {shape: box, size_m: [4, 4, 1], position_m: [0, 0, 0.5], texture: concrete}
  - {shape: box, size_m: [0.5, 4, 2], position_m: [-1.75, 0, 1], texture: concrete}
"""


@pytest.fixture
def ledge(tmp_path: Path) -> Iterator[Simulation]:
    file = tmp_path / "ledge.yaml"
    file.write_text(LEDGE)
    simulation = standing(str(file))
    simulation.reset(ResetRequest(position=(0.0, 0.0, 1.0 + REST_M)))
    yield simulation
    simulation.close()


def test_in_the_air_neither_sticks_nor_brakes_change_its_way(ledge: Simulation) -> None:
    fly(ledge, 1.5, Sticks(vx=1.0))
    while ledge.state.position_m[2] > 1.0:
        fly(ledge, 0.02, Sticks(vx=1.0))
    before = ledge.state.velocity_mps
    assert before[0] > 0.9
    states, _ = fly(ledge, 0.1, Sticks(vx=-1.0, wz=1.0), action="emergency")
    assert ledge.status().state == "emergency"
    assert ledge.state.position_m[2] > REST_M + 0.1
    for state in states:
        assert state.velocity_mps[:2] == pytest.approx(before[:2], abs=1e-6)


def test_tipped_over_an_edge_it_says_so_scrapes_to_a_halt_and_is_reset(ledge: Simulation) -> None:
    _, messages = fly(ledge, 5.0, Sticks(vx=1.0))
    told = [message for topic, message in messages if topic == "vehicle"]
    states = [message.state for message in told]
    assert states[0] == "flying"
    assert states[-1] == "emergency"
    assert told[-1].collisions >= 1
    assert ledge.state.tilt_rad > 1.0
    assert math.hypot(*ledge.state.velocity_mps) < 0.01
    place = ledge.state.position_m
    for action in ("land", "takeoff", "fly"):
        fly(ledge, 0.2, Sticks(vx=1.0), action=action)
    assert ledge.status().state == "emergency"
    assert ledge.state.position_m == pytest.approx(place, abs=0.01)
    status = ledge.reset(ResetRequest())
    assert (status.state, status.collisions) == ("flying", 0)
    fly(ledge, 0.5, Sticks(vx=1.0))
    # On its wheels again: the hull does not scrape.
    assert ledge.state.velocity_mps[0] == pytest.approx(FORWARD_MPS, rel=0.05)


def test_a_wall_is_counted_where_it_stands_on_something_too(ledge: Simulation) -> None:
    fly(ledge, 0.5)
    assert ledge.status().collisions == 0
    fly(ledge, 3.0, Sticks(vx=-1.0))
    assert ledge.status().collisions == 1


@pytest.mark.parametrize(("height_m", "collisions"), [(0.0, 0), (0.03, 0), (0.5, 1)])
def test_a_hard_fall_is_counted(height_m: float, collisions: int) -> None:
    simulation = standing()
    simulation.reset(ResetRequest(position=(0.0, 0.0, REST_M + height_m)))
    fly(simulation, 1.0, Sticks(vx=0.5))
    assert simulation.status().collisions == collisions
    simulation.close()


def test_its_battery_runs_down_and_stops_it_and_a_reset_charges_it() -> None:
    simulation = Simulation(Config(world="empty", plant="rover", battery=0.0001, sensor_noise=0.0))
    fly(simulation, 1.0, Sticks(vx=1.0))
    assert simulation.status().battery == pytest.approx(0.0001 - 1.0 / (4 * 3600.0), rel=0.01)
    fly(simulation, 2.0, Sticks(vx=1.0))
    status = simulation.status()
    assert (status.state, status.battery) == ("emergency", 0.0)
    assert math.hypot(*simulation.state.velocity_mps) < 0.01
    status = simulation.reset(ResetRequest())
    assert (status.state, status.battery) == ("flying", 0.0001)
    simulation.close()


def test_its_status_tells_how_it_follows_the_stick() -> None:
    simulation = standing()
    status = simulation.status()
    assert status.full_stick == (FORWARD_MPS, 0.0, 0.0, 0.0, TURN_RADPS)
    assert simulation.step(command(Sticks())).messages
    simulation.close()
