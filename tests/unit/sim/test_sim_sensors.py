"""Instruments agree with the motion, and their noise is what is stated."""

import numpy as np
import pytest
from flights import fly, hovering
from scipy.spatial.transform import Rotation

from common.messages import Imu, Pose, Range, ResetRequest
from services.sim.body import GRAVITY_MPS2, Sticks
from services.sim.sensors import (
    ACCELERATION_BIAS_MPS2,
    ACCELERATION_NOISE_MPS2,
    BIAS_TIME_S,
    DROPOUT,
    MAGNETIC_BIAS,
    MAGNETIC_FIELD,
    RANGE_MAX_M,
    RANGE_NOISE_M,
    RATE_BIAS_RADPS,
    RATE_NOISE_RADPS,
    Altimeter,
)
from services.sim.sensors import (
    Imu as Gyro,
)


def test_integrating_the_imu_gives_the_velocity() -> None:
    simulation = hovering()
    _, messages = fly(simulation, 3.0, lambda t: Sticks(vx=0.8, vy=0.4 * (t > 1.0), wz=0.6))
    poses = {m.stamp: m for _, m in messages if isinstance(m, Pose)}
    velocity = np.zeros(3)
    turn = None
    for imu in (m for _, m in messages if isinstance(m, Imu)):
        if imu.stamp in poses:
            turn = Rotation.from_quat(poses[imu.stamp].orientation)
        elif turn is not None:
            turn = turn * Rotation.from_rotvec(np.multiply(imu.angular_velocity, 0.005))
        if turn is not None:
            force = turn.apply(imu.linear_acceleration)
            velocity += 0.005 * (force - (0.0, 0.0, GRAVITY_MPS2))
    assert np.allclose(velocity, simulation.state.velocity_mps, atol=0.02)


def test_at_rest_the_specific_force_points_up_and_noise_is_as_stated() -> None:
    simulation = hovering(sensor_noise=1.0)
    simulation.reset(ResetRequest(position=(0.0, 0.0, 0.0)))
    fly(simulation, 0.5, silent=True)
    _, messages = fly(simulation, 5.0, silent=True)
    imus = [m for _, m in messages if isinstance(m, Imu)]
    force = np.asarray([m.linear_acceleration for m in imus])
    rates = np.asarray([m.angular_velocity for m in imus])
    field = np.asarray([m.magnetic_field for m in imus])
    assert force.mean(axis=0) == pytest.approx((0.0, 0.0, GRAVITY_MPS2), abs=0.06)
    assert force.std(axis=0) == pytest.approx(ACCELERATION_NOISE_MPS2, rel=0.1)
    assert rates.std(axis=0) == pytest.approx([RATE_NOISE_RADPS] * 3, rel=0.1)
    assert field.mean(axis=0) == pytest.approx(MAGNETIC_FIELD, abs=3.0 * MAGNETIC_BIAS)


def test_the_magnetometer_turns_with_the_body() -> None:
    simulation = hovering()
    simulation.reset(ResetRequest(position=(0.0, 0.0, 1.0), yaw=np.pi / 2.0))
    _, messages = fly(simulation, 0.1)
    field = next(m for _, m in messages if isinstance(m, Imu)).magnetic_field
    # Facing north, the field is ahead and down.
    assert field == pytest.approx((0.5, 0.0, -0.866), abs=1e-3)


@pytest.mark.parametrize(
    ("position", "expected_m"),
    [
        ((0.0, 0.0, 1.0), 1.0),
        ((0.0, 0.0, 2.5), 2.5),
        ((0.0, 0.0, 3.5), 3.0),
        # Over a crate 1.2 m high.
        ((11.2, 3.6, 2.0), 0.8),
    ],
)
def test_the_altimeter_measures_to_what_is_below(
    position: tuple[float, float, float], expected_m: float
) -> None:
    simulation = hovering(world="track")
    simulation.reset(ResetRequest(position=position))
    _, messages = fly(simulation, 0.2)
    ranges = [m for _, m in messages if isinstance(m, Range)]
    assert [m.range for m in ranges] == pytest.approx([expected_m] * len(ranges), abs=0.005)
    assert (ranges[0].min, ranges[0].max) == (0.01, 3.0)


def test_truth_is_the_motion_itself() -> None:
    simulation = hovering(sensor_noise=1.0)
    states, messages = fly(simulation, 1.0, Sticks(vx=0.5, wz=0.5))
    pose = [m for _, m in messages if isinstance(m, Pose)][-1]
    assert pose.position == states[-1].position_m
    assert pose.velocity == states[-1].velocity_mps
    assert pose.angular_velocity[2] == pytest.approx(states[-1].angular_velocity_radps[2], rel=0.01)
    assert pose.source == "truth"


def test_over_an_edge_the_altimeter_jumps_before_the_vehicle_is_there() -> None:
    # A crate 1.2 m wide and high stands at x 11.2.
    simulation = hovering(world="track")
    jumped_m = []
    for x in np.arange(9.4, 11.0, 0.1):
        simulation.reset(ResetRequest(position=(float(x), 3.6, 2.2)))
        _, messages = fly(simulation, 0.05)
        range_m = next(m.range for _, m in messages if isinstance(m, Range))
        if range_m < 1.6:
            jumped_m.append(x)
    edge_m = 11.2 - 0.6
    # The rim of the cone is 20 deg off: what is 1.6 m away on it is 0.55 m ahead.
    assert edge_m - 0.6 < jumped_m[0] < edge_m - 0.1
    assert jumped_m == sorted(jumped_m)


def test_the_altimeter_hears_the_floor_not_the_slant_when_it_tilts() -> None:
    simulation = hovering(plant="ardrone", height_m=2.0)
    states, messages = fly(simulation, 1.0, Sticks(vx=1.0))
    assert states[-1].tilt_rad > 0.2
    range_m = [m for _, m in messages if isinstance(m, Range)][-1].range
    assert range_m == pytest.approx(states[-1].position_m[2], rel=0.002)


def test_the_altimeters_noise_and_dropouts_are_as_stated() -> None:
    altimeter = Altimeter(np.random.default_rng(2), 1.0)
    ranges_m = np.asarray([altimeter.sample(0, 1.0).range for _ in range(20_000)])
    lost = ranges_m == RANGE_MAX_M
    assert lost.mean() == pytest.approx(DROPOUT, rel=0.2)
    assert ranges_m[~lost].std() == pytest.approx(RANGE_NOISE_M, rel=0.05)


def test_offsets_wander_over_minutes_around_their_stated_size() -> None:
    still = hovering().state
    means = []
    for seed in range(60):
        imu = Gyro(np.random.default_rng(seed), 1.0, 0.005)
        samples = [imu.sample(0, still) for _ in range(1_000)]
        means.append(
            [
                np.mean([each.angular_velocity for each in samples], axis=0),
                np.mean([each.linear_acceleration for each in samples], axis=0),
                np.mean([each.magnetic_field for each in samples], axis=0),
            ]
        )
    # The mean of 1000 samples leaves 3 % of the white noise.
    rate, acceleration, field = np.std(means, axis=0).mean(axis=1)
    assert rate == pytest.approx(RATE_BIAS_RADPS, rel=0.2)
    assert acceleration == pytest.approx(ACCELERATION_BIAS_MPS2, rel=0.25)
    assert field == pytest.approx(MAGNETIC_BIAS, rel=0.2)
    imu = Gyro(np.random.default_rng(1), 1.0, 0.5)
    walk = np.asarray([imu.sample(0, still).angular_velocity for _ in range(60_000)])
    slow = walk.reshape(-1, 100, 3).mean(axis=1)
    assert slow.std() == pytest.approx(RATE_BIAS_RADPS, rel=0.3)
    lag = round(BIAS_TIME_S / 50.0)
    correlation = np.mean(slow[:-lag] * slow[lag:]) / np.mean(slow * slow)
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.25)
