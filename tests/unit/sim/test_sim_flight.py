"""How the `tum` plant flies: its formulas, its states, its collisions."""

import math

import numpy as np
import pybullet
import pytest
from flights import command, fly, hovering
from scipy.integrate import solve_ivp

from common.messages import Message, ResetRequest, VehicleStatus
from services.sim.body import GRAVITY_MPS2, INERTIA_KGM2, MASS_KG, Sticks
from services.sim.config import Config
from services.sim.core import PHYSICS_HZ, STEP_S, Simulation


def test_forward_step_follows_the_loops_of_tum_simulator() -> None:
    def slopes(_t: float, y: np.ndarray) -> list[float]:
        v, goal, tilt, rate = y
        # P 5, D 1 on the speed to a tilt, smoothed by 0.05 s; P 10, D 5 on the tilt.
        acceleration = GRAVITY_MPS2 * math.tan(tilt)
        goal_slope = ((5.0 * (0.8 - v) - acceleration) / GRAVITY_MPS2 - goal) / 0.05
        return [
            acceleration,
            goal_slope,
            rate,
            10.0 * (goal - tilt) + 5.0 * (goal_slope - rate),
        ]

    states, _ = fly(hovering(), 3.0, Sticks(vx=0.8))
    times_s = np.arange(1, len(states) + 1) * STEP_S
    expected = solve_ivp(slopes, (0.0, 3.01), [0.0] * 4, t_eval=times_s, rtol=1e-8).y[0]
    flown = np.asarray([state.velocity_mps[0] for state in states])
    assert np.abs(flown - expected).max() < 0.01
    assert flown[-1] == pytest.approx(0.8, abs=0.01)
    assert np.abs([state.position_m[2] - 1.0 for state in states]).max() < 0.01


@pytest.mark.parametrize("stick", [1.0, -1.0])
def test_climb_and_yaw_steps_are_first_order(stick: float) -> None:
    states, _ = fly(hovering(), 1.2, Sticks(vz=stick, wz=stick))
    times_s = np.arange(1, len(states) + 1) * STEP_S
    climb = np.asarray([state.velocity_mps[2] for state in states])
    turn = np.asarray([state.angular_velocity_radps[2] for state in states])
    # P 5 with D 1 on the acceleration it makes: 0.4 s. Yaw P 2: 0.5 s.
    assert np.abs(climb - stick * 0.5 * (1.0 - np.exp(-times_s / 0.4))).max() < 0.005
    assert np.abs(turn - stick * 1.0 * (1.0 - np.exp(-times_s / 0.5))).max() < 0.005


def test_the_stick_means_speed_in_the_heading_frame() -> None:
    simulation = hovering()
    simulation.reset(ResetRequest(position=(0.0, 0.0, 1.0), yaw=2.0))
    states, _ = fly(simulation, 4.0, Sticks(vx=0.6, vy=-0.3))
    vx, vy, _ = states[-1].velocity_mps
    assert vx == pytest.approx(0.6 * math.cos(2.0) + 0.3 * math.sin(2.0), abs=0.01)
    assert vy == pytest.approx(0.6 * math.sin(2.0) - 0.3 * math.cos(2.0), abs=0.01)


def test_silence_is_a_hover_after_the_watchdog() -> None:
    simulation = hovering()
    fly(simulation, 2.0, Sticks(vx=1.0))
    states, _ = fly(simulation, 4.0, silent=True)
    speed_mps = [math.hypot(*state.velocity_mps) for state in states]
    assert speed_mps[round(0.19 * PHYSICS_HZ)] > 0.98
    assert speed_mps[-1] < 0.01


def test_take_off_flight_and_landing() -> None:
    simulation = Simulation(Config(world="empty", command_noise=0.0))
    assert simulation.status().state == "landed"
    fly(simulation, 0.2, Sticks(vx=1.0))
    assert simulation.status().state == "landed"
    fly(simulation, 0.1, action="takeoff")
    assert simulation.status().state == "taking_off"
    _, messages = fly(simulation, 3.0)
    assert simulation.status().state == "flying"
    assert 0.5 < simulation.state.position_m[2] < 1.0
    assert abs(simulation.state.velocity_mps[2]) < 0.02
    fly(simulation, 4.0, action="land")
    assert simulation.status().state == "landed"
    assert simulation.state.position_m[2] == pytest.approx(0.055, abs=0.005)
    assert simulation.status().collisions == 0
    told = [m.state for _, m in messages if isinstance(m, VehicleStatus)]
    assert told[0] == "taking_off"
    assert told[-1] == "flying"


def test_emergency_stops_the_rotors_until_it_lies_still() -> None:
    simulation = hovering()
    fly(simulation, 0.02, action="emergency")
    fly(simulation, 0.3, Sticks(vz=1.0))
    assert simulation.status().state == "emergency"
    assert simulation.state.velocity_mps[2] < -2.5
    fly(simulation, 0.05, action="takeoff")
    assert simulation.status().state == "emergency"
    fly(simulation, 3.0, action="land")
    assert simulation.status().state == "landed"


def test_a_bump_into_a_fence_counts_once_however_long_it_lasts() -> None:
    simulation = hovering(world="track")
    simulation.reset(ResetRequest(position=(3.0, 0.6, 1.0)))
    fly(simulation, 3.0, Sticks(vy=0.8))
    assert simulation.status().collisions == 1
    assert simulation.state.position_m[1] < 1.5
    fly(simulation, 1.5, Sticks(vy=-0.5))
    fly(simulation, 3.0, Sticks(vy=0.8))
    assert simulation.status().collisions == 2


@pytest.mark.parametrize("plant", ["tum", "ardrone"])
def test_a_fall_is_a_crash_and_a_landing_or_a_button_on_the_ground_is_none(plant: str) -> None:
    simulation = hovering(plant=plant, height_m=2.0)
    _, messages = fly(simulation, 2.0, action="emergency")
    counted = [each.collisions for each in messages_of(messages, "vehicle")]
    assert (counted[0], counted[-1]) == (0, 1)
    fly(simulation, 0.1, action="land")
    fly(simulation, 3.0, action="takeoff")
    fly(simulation, 5.0, action="land")
    assert simulation.status().state == "landed"
    fly(simulation, 1.0, action="emergency")
    assert simulation.status().state == "emergency"
    assert simulation.status().collisions == 1
    simulation.close()


def test_nothing_but_gravity_acts_on_a_body_that_falls() -> None:
    simulation = hovering(height_m=50.0)
    fly(simulation, 2.0, Sticks(vx=1.0, wz=1.0))
    before = simulation.state
    states, _ = fly(simulation, 2.0, action="emergency")
    vx, vy, vz = states[-1].velocity_mps
    assert (vx, vy) == pytest.approx(before.velocity_mps[:2], abs=1e-9)
    assert vz - before.velocity_mps[2] == pytest.approx(-2.0 * GRAVITY_MPS2, rel=1e-6)
    # A body that is not round tumbles, but keeps what it turns with.
    turning = np.asarray(INERTIA_KGM2)
    spins = [turning * s.to_body(s.angular_velocity_radps) for s in (before, states[-1])]
    assert np.linalg.norm(spins[1]) == pytest.approx(np.linalg.norm(spins[0]), rel=0.01)
    simulation.close()


def messages_of(messages: list[tuple[str, Message]], topic: str) -> list[VehicleStatus]:
    return [each for name, each in messages if name == topic]


def test_pybullet_has_the_stated_weight_and_inertia() -> None:
    simulation = hovering()
    hull = simulation.actors[0].hull
    info = pybullet.getDynamicsInfo(hull._body, -1, physicsClientId=hull._id)
    assert info[0] == MASS_KG == 0.42
    assert info[2] == pytest.approx(INERTIA_KGM2)
    simulation.close()


def test_flying_into_the_ground_counts_and_raises_nothing() -> None:
    simulation = hovering()
    fly(simulation, 3.0, Sticks(vz=-1.0))
    assert simulation.status().collisions == 1


def test_the_same_seed_and_commands_give_the_same_bytes() -> None:
    def recorded(simulation: Simulation) -> list[object]:
        begin_ns = simulation.now_ns
        _, messages = fly(simulation, 2.0, Sticks(vx=0.4, wz=0.2), action="takeoff")
        fields = [
            {**{f: getattr(m, f) for f in m.__struct_fields__}, "stamp": m.stamp - begin_ns}
            for _, m in messages
        ]
        return list(fields)

    simulation = Simulation(Config(seed=7))
    first = recorded(simulation)
    simulation.reset(ResetRequest())
    assert recorded(simulation) == first
    assert recorded(Simulation(Config(seed=7))) == first
    assert recorded(Simulation(Config(seed=8))) != first


def test_stamps_rise_with_the_steps_and_go_on_over_a_reset() -> None:
    simulation = Simulation(Config(world="empty"), start_ns=10**18)
    _, before = fly(simulation, 0.5)
    simulation.reset(ResetRequest(world="track"))
    _, after = fly(simulation, 0.5)
    stamps = [m.stamp for topic, m in before + after if topic == "imu"]
    assert set(np.diff(stamps)) == {5_000_000}
    assert stamps[0] == 10**18 + 5_000_000


def test_rates_are_those_of_the_contract() -> None:
    simulation = Simulation(Config(world="empty"))
    counts: dict[str, int] = {}
    for _ in range(PHYSICS_HZ):
        step = simulation.step()
        for topic in [t for t, _ in step.messages] + [shot.topic for shot in step.shots]:
            counts[topic] = counts.get(topic, 0) + 1
    assert counts.pop("vehicle") in (10, 11)
    assert counts == {
        "imu": 200,
        "truth": 100,
        "altimeter": 25,
        "camera/front": 30,
        "camera/down": 60,
    }


def test_a_command_is_never_nan() -> None:
    with pytest.raises(ValueError, match="vx"):
        command(Sticks(vx=math.nan))
