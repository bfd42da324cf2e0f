"""What holds for every plant, whatever the sticks do."""

import math

import numpy as np
import pytest
from flights import command, fly, hovering
from hypothesis import example, given, settings
from hypothesis import strategies as st

from common.messages import ResetRequest
from common.sticks import FULL_STICK
from services.sim import plants as all_plants
from services.sim.body import GRAVITY_MPS2, BodyState, Sticks
from services.sim.config import Config
from services.sim.core import STEP_S, Simulation
from services.sim.plants.rover import FORWARD_MPS, TURN_RADPS
from services.sim.vehicle import StickNoise

PLAN_S = 0.5
fraction = st.one_of(st.floats(-1.0, 1.0), st.sampled_from((-1.0, 1.0)))
sticks = st.builds(Sticks, fraction, fraction, fraction, fraction)
plants = pytest.mark.parametrize(
    "plant", [name for name in all_plants.names() if all_plants.load(name).flies]
)
TILT_LIMIT_RAD = {"tum": math.acos(math.cos(0.5) ** 2), "ardrone": math.acos(math.cos(0.21) ** 2)}
"""Of two axes at once: 0.5 rad each by tum_simulator, 0.21 rad each by the AR.Drone's driver."""
SPEED_EXCESS = {"tum": 1.2, "ardrone": 1.05}
"""Beyond full stick along both axes: noise on the sticks, and the overshoot of tum's loops."""
CLIMB_EXCESS = 1.05
FULL = Sticks(1.0, 1.0, 1.0, 1.0)
DIVE = Sticks(-1.0, 1.0, -1.0, -1.0)


@plants
@settings(max_examples=8, deadline=None)
@given(plan=st.lists(sticks, min_size=1, max_size=4))
def test_mirrored_sticks_give_mirrored_flight(plant: str, plan: list[Sticks]) -> None:
    def path(side: float) -> np.ndarray:
        simulation = hovering(plant=plant, height_m=5.0, renderer="none")
        states: list[BodyState] = []
        for each in plan:
            mirrored = Sticks(each.vx, side * each.vy, each.vz, side * each.wz)
            states += fly(simulation, PLAN_S, mirrored)[0]
        simulation.close()
        return np.asarray([state.position_m for state in states])

    assert np.allclose(path(1.0), path(-1.0) * (1.0, -1.0, 1.0), atol=1e-6)


@plants
@settings(max_examples=12, deadline=None)
@given(
    plan=st.lists(st.tuples(sticks, st.sampled_from((0.1, 0.3, 1.0))), min_size=1, max_size=12),
    seed=st.integers(0, 1000),
)
@example(plan=[(FULL, 10.0)], seed=0)
@example(plan=[(DIVE, 10.0)], seed=0)
@example(plan=[(FULL, 0.3), (DIVE, 0.3)] * 10, seed=0)
def test_no_stick_takes_it_beyond_the_limits_of_the_plant(
    plant: str, plan: list[tuple[Sticks, float]], seed: int
) -> None:
    full = FULL_STICK[plant]
    begin_m = 50.0
    simulation = hovering(
        plant=plant,
        height_m=begin_m,
        command_noise=1.0,
        seed=seed,
        ceiling_m=100.0,
        renderer="none",
    )
    level_mps = SPEED_EXCESS[plant] * math.hypot(full.forward_mps, full.left_mps)
    down_mps, up_mps = CLIMB_EXCESS * full.down_mps, CLIMB_EXCESS * full.up_mps
    states = [state for each, duration_s in plan for state in fly(simulation, duration_s, each)[0]]
    simulation.close()
    for count, state in enumerate(states, start=1):
        vx, vy, vz = state.velocity_mps
        assert math.hypot(vx, vy) < level_mps
        assert -down_mps < vz < up_mps
        assert state.tilt_rad < TILT_LIMIT_RAD[plant]
        # Nothing but a climb stores more energy than the top speed has.
        climbed_m = state.position_m[2] - begin_m
        energy = 0.5 * math.hypot(vx, vy, vz) ** 2 + GRAVITY_MPS2 * climbed_m
        most = 0.5 * math.hypot(level_mps, up_mps) ** 2 + GRAVITY_MPS2 * up_mps * count * STEP_S
        assert energy < most


@plants
def test_hands_off_it_wanders_as_far_as_its_noise_carries_it(plant: str) -> None:
    flights, duration_s, step_s = 8, 15.0, 0.02
    simulation = hovering(plant=plant, height_m=5.0, command_noise=1.0, renderer="none")
    ends_m = []
    for seed in range(flights):
        simulation.reset(ResetRequest(seed=seed))
        ends_m.append(fly(simulation, duration_s)[0][-1].position_m[:2])
    simulation.close()
    # The same noise on a linear model of the plant.
    generator = np.random.default_rng(0)
    noise, drift = all_plants.load(plant).noise, all_plants.load(plant).drift
    count, people = round(duration_s / step_s), 2000
    offset = generator.uniform(-noise, noise, (count, people))
    offset += np.repeat(generator.uniform(-drift, drift, (3, people)), count // 3, axis=0)
    speed, way = np.zeros(people), np.zeros(people)
    full = FULL_STICK[plant]
    delay_s = 0.25 if plant == "tum" else 1.0 / 0.58
    for row in offset:
        speed += step_s / delay_s * (row / full.linear_to * full.forward_mps - speed)
        way += step_s * speed
    assert np.std(ends_m) == pytest.approx(way.std(), rel=0.4)


@plants
def test_noise_on_sticks_is_uniform_and_redrawn_as_often_as_stated(plant: str) -> None:
    noise, drift = all_plants.load(plant).noise, all_plants.load(plant).drift
    source = StickNoise(np.random.default_rng(1), noise, drift, STEP_S)
    each = [source.add_to(FULL) for _ in range(round(50.0 / STEP_S))]
    added = np.asarray([(s.vx, s.vy, s.vz, s.wz) for s in each]).reshape(10, 250, 4, 4) - 1.0
    # At 50 Hz, for four steps each; the mean of 5 s is the drift.
    assert np.array_equal(added, added[:, :, :1] * np.ones((1, 1, 4, 1)))
    wanders = added.mean(axis=(1, 2))
    assert np.std(added - wanders[:, None, None]) == pytest.approx(noise / 3**0.5, rel=0.03)
    assert np.std(wanders) == pytest.approx(drift / 3**0.5, rel=0.3)
    assert np.abs(added).max() <= noise + drift


@settings(max_examples=8, deadline=None)
@given(plan=st.lists(sticks, min_size=1, max_size=6))
@example(plan=[FULL] * 6)
@example(plan=[FULL, DIVE] * 3)
def test_a_rover_keeps_to_its_speeds_and_its_mirror_image(plan: list[Sticks]) -> None:
    def driven(side: float) -> list[BodyState]:
        settings_ = {"command_noise": 0.0, "renderer": "none"}
        simulation = Simulation(Config(world="empty", plant="rover", **settings_))
        states: list[BodyState] = []
        for each in plan:
            mirrored = Sticks(each.vx, side * each.vy, each.vz, side * each.wz)
            states += fly(simulation, PLAN_S, mirrored)[0]
        simulation.close()
        return states

    states = driven(1.0)
    for state in states:
        assert math.hypot(*state.velocity_mps[:2]) < 1.05 * FORWARD_MPS
        assert abs(state.angular_velocity_radps[2]) < 1.05 * TURN_RADPS
        assert abs(state.position_m[2] - states[0].position_m[2]) < 0.01
        assert state.tilt_rad < 0.02
    path, mirrored = (np.asarray([s.position_m for s in each]) for each in (states, driven(-1.0)))
    assert np.allclose(path, mirrored * (1.0, -1.0, 1.0), atol=1e-3)


@plants
def test_a_hover_empties_the_battery_in_its_stated_time_and_ends_on_the_ground(plant: str) -> None:
    simulation = hovering(plant=plant, battery=0.06)
    before = simulation.status().battery
    fly(simulation, 3.0)
    assert before - simulation.status().battery == pytest.approx(3.0 / 720.0, rel=0.03)
    assert simulation.status().state == "flying"
    fly(simulation, 9.0)
    # It lands by itself, and does not take off again.
    assert simulation.status().state == "landed"
    assert simulation.status().collisions == 0
    fly(simulation, 0.5, action="takeoff")
    assert simulation.status().state == "landed"


def test_without_a_battery_it_falls() -> None:
    simulation = hovering(plant="ardrone", height_m=20.0, battery=0.004)
    fly(simulation, 4.0)
    assert simulation.status().state == "emergency"
    assert simulation.status().battery == 0.0
    assert simulation.state.velocity_mps[2] < -5.0


@plants
def test_a_ceiling_ends_the_climb(plant: str) -> None:
    states, _ = fly(hovering(plant=plant, ceiling_m=2.0), 8.0, Sticks(vz=1.0))
    assert 1.95 < max(state.position_m[2] for state in states) < 3.0


def test_delays_hold_back_commands_samples_and_pictures_but_not_truth() -> None:
    simulation = hovering(
        plant="ardrone", command_delay_s=0.1, sensor_delay_s=0.04, video_delay_s=0.075
    )
    begin_ns = simulation.now_ns
    ages_ms: dict[str, set[float]] = {}
    for count in range(60):
        step = simulation.step(command(Sticks(vz=1.0)) if count % 4 == 0 else None)
        for topic, message in step.messages:
            ages_ms.setdefault(topic, set()).add((simulation.now_ns - message.stamp) / 1e6)
        for shot in step.shots:
            ages_ms.setdefault(shot.topic, set()).add((simulation.now_ns - shot.stamp_ns) / 1e6)
        if count * 5 < 100:
            assert abs(simulation.state.velocity_mps[2]) < 0.02
    assert simulation.state.velocity_mps[2] > 0.05
    assert begin_ns < simulation.now_ns
    assert ages_ms["imu"] == ages_ms["altimeter"] == {40.0}
    assert ages_ms["truth"] == {0.0}
    # A picture falls into a step of 5 ms.
    assert all(75.0 <= age < 80.0 for age in ages_ms["camera/front"] | ages_ms["camera/down"])
