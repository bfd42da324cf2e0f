"""The localizer on made-up flights: what it says of place, speed, heading, and of itself."""

import dataclasses
import math

import msgspec
import numpy as np
import pytest
from localizer_flight import (
    FIELD,
    QUIET,
    Flight,
    Noises,
    Trajectory,
    eased,
    image_of,
    see_floor,
    still,
    straight,
    vehicle,
)

from common.clock import nanoseconds
from common.frames import wrap_angle, yaw_of
from common.messages import Imu, Pose
from services.localizer.config import Config
from services.localizer.core import Localizer

NOISY = Noises()


def place_error(pose: Pose, truth) -> np.ndarray:
    return np.array(pose.position) - truth.position_m


def speed_error(pose: Pose, truth) -> np.ndarray:
    return np.array(pose.velocity) - truth.velocity_mps


def yaw_error(pose: Pose, truth) -> float:
    return wrap_angle(yaw_of(pose.orientation) - truth.yaw_rad)


def banked_curve(speed_mps: float, radius_m: float, bank_rad: float) -> Trajectory:
    """Straight on, then a curve to the left, rolled into it, always looking ahead."""

    def trajectory(t_s):
        angle = speed_mps * eased(t_s, 0.5) / radius_m
        roll = -bank_rad * (eased(t_s, 0.5) - eased(t_s, 1.5))
        return (
            radius_m * math.sin(angle),
            radius_m * (1 - math.cos(angle)),
            1.0,
            roll,
            0.0,
            angle,
        )

    return trajectory


def test_standing_still_it_stays():
    places, speeds = [], []
    for pose, truth in Flight(still(), noises=NOISY, seed=3).run(4.0):
        if truth.stamp_ns > nanoseconds(1.0):
            places.append(place_error(pose, truth))
            speeds.append(speed_error(pose, truth))
    assert np.abs(places)[:, :2].max() < 0.01
    assert np.abs(places)[:, 2].max() < 0.05
    assert np.sqrt(np.mean(np.square(speeds))) < 0.03


@pytest.mark.parametrize("way", [(0.9, 0.0), (0.0, -0.9)])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_constant_velocity_is_known(way, yaw):
    flight = Flight(straight(*way, yaw_rad=yaw), noises=NOISY, seed=1)
    errors = [
        speed_error(pose, truth)
        for pose, truth in flight.run(4.0)
        if truth.stamp_ns > nanoseconds(2.0)
    ]
    assert np.sqrt(np.mean(np.square(errors), axis=0)).max() < 0.05
    assert np.abs(np.mean(errors, axis=0)).max() < 0.02


def test_a_banked_curve_is_followed_within_one_percent():
    flight = Flight(banked_curve(0.9, 4.0, 0.08), noises=NOISY, seed=2)
    records = list(flight.run(9.0))
    pose, truth = records[-1]
    assert np.linalg.norm(place_error(pose, truth)[:2]) < 0.01 * 0.9 * 8.0
    assert max(abs(yaw_error(*record)) for record in records) < math.radians(2.0)
    assert {pose.status for pose, _ in records} == {"ok"}


def test_poses_come_at_their_rate_on_the_time_of_the_imu():
    stamps = [pose.stamp for pose, _ in Flight(still()).run(1.2)]
    assert set(np.diff(stamps)) == {10_000_000}


def test_the_pose_is_close_to_the_truth_as_often_as_its_covariance_says():
    """Normalised errors squared of place and speed, over flights with the noise it expects."""
    matched = Noises(
        accel=0.4, gyro=0.02, field=0.1, altimeter=0.03, accel_bias=0.1, gyro_bias=0.02
    )
    total, count = 0.0, 0
    for seed in range(6):
        pose, truth = Flight(straight(0.8, 0.4), noises=matched, seed=seed).last(3.0)
        variances = np.array(pose.covariance[:3])
        total += float(np.sum(place_error(pose, truth) ** 2 / variances))
        count += 3
    assert total / count < 2.5


def test_without_flow_the_covariance_grows():
    def blind(topic, message, t_s):
        return None if topic == "camera/down" and t_s > 1.0 else message

    seeing, _ = Flight(still(), noises=NOISY).last(2.5)
    unseeing, _ = Flight(still(), noises=NOISY, alter=blind).last(2.5)
    assert unseeing.covariance[0] > 2 * seeing.covariance[0]


# --- compass ---------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [-2.5, -0.5, 0.0, 1.0, 3.0])
def test_the_compass_says_where_the_vehicle_looks(yaw):
    """Set down turned by anything, it finds its heading; a slight mistake too."""
    flight = Flight(still(yaw_rad=yaw), config=Config(compass_noise_rad=0.02), state="landed")
    config = Config(compass_noise_rad=0.02)
    for mistake in (0.04, 1.0):
        flight.localizer = Localizer(dataclasses.replace(config, start_yaw_rad=yaw + mistake))
        pose, truth = flight.last(2.0)
        assert abs(yaw_error(pose, truth)) < math.radians(2.0)


def test_only_the_horizontal_direction_of_the_field_counts():
    def stronger(topic, message, _t_s):
        if topic != "imu":
            return message
        x, y, z = message.magnetic_field
        return msgspec.structs.replace(message, magnetic_field=(40 * x, 40 * y, 40 * z + 7.0))

    pose, truth = Flight(still(yaw_rad=1.0), alter=stronger, state="landed").last(1.5)
    assert abs(yaw_error(pose, truth)) < math.radians(0.1)


def test_in_a_turn_the_compass_does_not_lag():
    """At 1 rad/s, a mean of 0.05 s in the body would be 1.3 degrees behind."""

    def spin(t_s):
        return 0.0, 0.0, 1.0, 0.0, 0.0, eased(t_s, 0.5)

    records = list(Flight(spin).run(4.0))
    assert max(abs(yaw_error(*record)) for record in records) < math.radians(0.5)


@pytest.mark.parametrize(("seconds", "believed"), [(0.6, False), (3.0, True)])
def test_a_compass_that_contradicts_is_believed_only_after_a_while(seconds, believed):
    def disturbed(topic, message, t_s):
        if topic == "imu" and 1.0 < t_s < 1.0 + seconds:
            return msgspec.structs.replace(message, magnetic_field=(0.5, 0.0, -0.8))
        return message

    pose, truth = Flight(still(), alter=disturbed).last(1.0 + seconds)
    error = abs(yaw_error(pose, truth))
    assert error > 1.0 if believed else error < 0.02


def test_without_a_field_the_gyroscope_alone_holds_the_heading():
    def no_field(topic, message, _t_s):
        if topic != "imu":
            return message
        return msgspec.structs.replace(message, magnetic_field=(0.0, 0.0, -1.0))

    pose, truth = Flight(still(yaw_rad=0.3), alter=no_field).last(1.5)
    assert abs(yaw_error(pose, truth)) < math.radians(1.0)
    assert math.hypot(FIELD[0], FIELD[1]) > 0.1


# --- altimeter -------------------------------------------------------------------------------


def test_a_first_reading_that_is_wrong_spoils_nothing():
    def wrong_first(topic, message, t_s):
        if topic == "altimeter" and t_s < 0.1:
            return msgspec.structs.replace(message, range=2.7)
        return message

    poses = [pose for pose, _ in Flight(still(), alter=wrong_first).run(1.5)]
    assert abs(poses[-1].position[2] - 1.0) < 0.03


def test_a_jump_of_the_altimeter_moves_nothing():
    def jumping(topic, message, t_s):
        if topic == "altimeter" and 1.5 < t_s < 1.7:
            return msgspec.structs.replace(message, range=0.5)
        return message

    heights = [pose.position[2] for pose, _ in Flight(still(), alter=jumping).run(2.5)][100:]
    assert np.ptp(heights) < 0.03


def test_over_a_box_height_and_speed_go_on():
    """The floor rises by 0.4 m for a second: neither the height nor the scale may follow."""

    def over_box(topic, message, t_s):
        if topic == "altimeter" and 2.0 < t_s < 3.0:
            return msgspec.structs.replace(message, range=message.range - 0.4)
        return message

    pose, truth = Flight(still(1.5), alter=over_box, noises=NOISY).last(4.5)
    assert np.abs(place_error(pose, truth)).max() < 0.08


@pytest.mark.parametrize("range_m", [0.0, 3.0, 99.0, -1.0])
def test_out_of_reach_is_no_reading(range_m):
    def out_of_reach(topic, message, t_s):
        if topic == "altimeter" and t_s > 1.0:
            return msgspec.structs.replace(message, range=range_m)
        return message

    pose, _ = Flight(still(), alter=out_of_reach).last(2.0)
    assert pose.position[2] == pytest.approx(1.0, abs=0.02)
    assert pose.status == "degraded"


def test_the_slope_of_the_altimeters_beam_is_taken_off():
    """At 20 degrees the beam is 6 % longer than the height."""

    def leaning(t_s):
        return 0.0, 0.0, 1.0, 0.35 * (eased(t_s, 0.5) - eased(t_s, 1.5)), 0.0, 0.0

    pose, _ = Flight(leaning).last(3.0)
    assert pose.position[2] == pytest.approx(1.0, abs=0.01)


# --- status ----------------------------------------------------------------------------------


def silence_after(topic: str, t0_s: float):
    return lambda name, message, t_s: None if name == topic and t_s > t0_s else message


@pytest.mark.parametrize("topic", ["camera/down", "altimeter"])
def test_a_missing_sensor_degrades_the_pose(topic):
    statuses = {
        round(truth.stamp_ns * 1e-9, 2): pose.status
        for pose, truth in Flight(still(), alter=silence_after(topic, 1.0)).run(2.0)
    }
    assert statuses[1.4] == "ok"
    assert statuses[1.7] == "degraded"


def test_long_without_flow_in_flight_is_lost():
    flight = Flight(still(), alter=silence_after("camera/down", 1.0))
    pose, _ = flight.last(4.5)
    assert pose.status == "lost"
    state, detail = flight.localizer.health()
    assert state == "degraded"
    assert "no flow" in detail


def test_on_the_ground_no_flow_is_needed():
    flight = Flight(still(0.06), alter=silence_after("camera/down", 0.0), state="landed")
    pose, truth = flight.last(4.5)
    assert pose.status == "ok"
    assert np.abs(place_error(pose, truth)).max() < 0.05
    assert flight.localizer.health() == ("ok", "")


def test_flow_that_comes_back_heals():
    def gap(topic, message, t_s):
        return None if topic == "camera/down" and 1.0 < t_s < 2.0 else message

    flight = Flight(straight(0.5, 0.0), alter=gap, noises=NOISY)
    pose, truth = flight.last(3.5)
    assert pose.status == "ok"
    assert np.abs(speed_error(pose, truth)).max() < 0.06


def test_a_silent_imu_is_lost_and_stays_stale():
    """At once, then at most every half second: a reader that judges by age sees it too."""
    flight = Flight(still())
    last, _ = flight.last(1.0)
    begin_ns = nanoseconds(1.0)
    told = []
    for tick in range(100):
        now_ns = begin_ns + tick * 20_000_000
        pose = flight.localizer.on_tick(now_ns)
        if pose is not None:
            told.append((now_ns - begin_ns, pose))
    assert {pose.status for _, pose in told} == {"lost"}
    assert 100_000_000 < told[0][0] <= 140_000_000
    assert min(np.diff([at for at, _ in told])) >= 400_000_000
    assert told[0][1].stamp == last.stamp
    assert flight.localizer.health()[0] == "degraded"


def test_before_the_imu_nothing_is_said():
    localizer = Localizer(Config())
    assert localizer.on_tick(10**12) is None
    localizer.on_picture(image_of(see_floor(np.array([0, 0, 1.0]), np.eye(3)), 0), 0)
    assert localizer.health()[0] == "degraded"


def test_started_in_flight_it_says_that_the_place_is_a_guess():
    flight = Flight(still(), state=None)
    flight.localizer.on_vehicle(vehicle("flying"), 0)
    pose, _ = flight.last(1.5)
    assert pose.status == "degraded"
    assert pose.covariance[0] > 1.0


# --- a new start -----------------------------------------------------------------------------


@pytest.mark.parametrize("gap_s", [0.3, 1.5])
def test_a_gap_of_all_sensors_in_flight_is_bridged(gap_s):
    def gap(topic, message, t_s):
        return None if 2.0 < t_s < 2.0 + gap_s else message

    flight = Flight(straight(0.6, 0.0), alter=gap, noises=NOISY)
    pose, truth = flight.last(5.0)
    assert pose.status == "ok"
    assert np.abs(place_error(pose, truth)).max() < 0.15
    assert pose.covariance[0] > place_error(pose, truth)[0] ** 2
    assert np.abs(speed_error(pose, truth)).max() < 0.1


@pytest.mark.parametrize("how", ["world", "set down", "battery", "stamps back", "stamps ahead"])
def test_after_a_reset_it_begins_again_at_the_mark(how):
    flight = Flight(straight(1.0, 0.0), state="flying")
    moved, _ = flight.last(2.5)
    assert moved.position[0] > 1.0
    shift_ns = 0
    if how == "world":
        flight.localizer.on_vehicle(vehicle("landed", world="empty"), 0)
    elif how == "battery":
        flight.localizer.on_vehicle(msgspec.structs.replace(vehicle("flying"), battery=1.0), 0)
    elif how == "set down":
        flight.localizer.on_vehicle(vehicle("landed"), 0)
    else:
        flight.localizer.on_vehicle(vehicle("landing"), 0)
        flight.localizer.on_vehicle(vehicle("landed"), 0)
        shift_ns = nanoseconds(-2.0 if how == "stamps back" else 5.0)
    poses = []
    for step in range(1, 101):
        stamp_ns = nanoseconds(2.5) + step * 5_000_000
        imu = Imu(
            stamp=stamp_ns + shift_ns,
            seq=0,
            angular_velocity=(0.0, 0.0, 0.0),
            linear_acceleration=(0.0, 0.0, 9.81),
            magnetic_field=tuple(FIELD.tolist()),
        )
        pose = flight.localizer.on_imu(imu, stamp_ns)
        if pose is not None:
            poses.append(pose)
    assert poses
    assert all(abs(pose.position[0]) < 0.01 for pose in poses)


@pytest.mark.parametrize("stamp_s", [0.0, 1.99, 500.0])
def test_one_stray_sample_changes_nothing(stamp_s):
    def stray(topic, message, t_s):
        if topic == "imu" and abs(t_s - 2.0) < 1e-6:
            return msgspec.structs.replace(message, stamp=nanoseconds(stamp_s))
        return message

    pose, truth = Flight(straight(1.0, 0.0), alter=stray).last(2.5)
    assert np.abs(place_error(pose, truth)).max() < 0.02


@pytest.mark.parametrize("field", ["angular_velocity", "linear_acceleration"])
def test_a_sample_beyond_all_reason_is_left_out(field):
    def mad(topic, message, t_s):
        if topic == "imu" and abs(t_s - 2.0) < 1e-6:
            return msgspec.structs.replace(message, **{field: (0.0, -1e300, 0.0)})
        return message

    pose, truth = Flight(straight(1.0, 0.0), alter=mad).last(2.5)
    assert np.abs(place_error(pose, truth)).max() < 0.02


def test_absurd_readings_stop_nothing():
    """All of it is allowed by the contract; the pose stays a pose or is missing."""

    def absurd(topic, message, t_s):
        if topic == "altimeter" and t_s > 0.5:
            return msgspec.structs.replace(message, range=1e300, max=1e301, stamp=-(10**18))
        if topic == "camera/down" and t_s > 0.5:
            lens = (100.0, 100.0, 1e300, -1e300)
            return msgspec.structs.replace(message, intrinsics=lens, distortion=(1e9,) * 4)
        if topic == "imu" and t_s > 1.0:
            return msgspec.structs.replace(
                message, magnetic_field=(1e300, -1e300, 1e300), stamp=message.stamp + 2**63
            )
        return message

    with np.errstate(all="ignore"):
        poses = [pose for pose, _ in Flight(still(), alter=absurd).run(1.5)]
    assert all(math.isfinite(value) for pose in poses for value in pose.position)
    assert all(variance >= 0.0 for pose in poses for variance in pose.covariance)


def test_landing_is_no_reset():
    flight = Flight(straight(1.0, 0.0))
    before, _ = flight.last(2.5)
    flight.localizer.on_vehicle(vehicle("landing"), 0)
    flight.localizer.on_vehicle(vehicle("landed"), 0)
    after = next(pose for pose, _ in flight.run(0.1))
    assert abs(after.position[0] - before.position[0]) < 0.1


# --- pictures --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "spoil",
    [
        {"data": b""},
        {"data": b"no picture"},
        {"width": 640, "height": 480},
        {"intrinsics": (0.0, 0.0, 160.0, 120.0)},
        {"intrinsics": (1e-300, 1e300, 160.0, 120.0)},
    ],
)
def test_a_picture_that_is_none_is_refused(spoil):
    flight = Flight(still())
    flight.last(0.5)
    good = image_of(see_floor(np.array([0, 0, 1.0]), np.eye(3)), nanoseconds(0.6))
    with pytest.raises(ValueError, match=r"."):
        flight.localizer.on_picture(msgspec.structs.replace(good, **spoil), nanoseconds(0.5))


def test_a_floor_without_texture_is_no_flow():
    grey = np.full((240, 320), 128, np.uint8)

    def plain(topic, message, t_s):
        if topic == "camera/down" and t_s > 1.0:
            return image_of(grey, message.capture)
        return message

    pose, _ = Flight(still(), alter=plain).last(2.0)
    assert pose.status == "degraded"


def test_same_inputs_same_poses():
    first = [pose for pose, _ in Flight(straight(0.5, 0.0), noises=NOISY, seed=9).run(1.2)]
    again = [pose for pose, _ in Flight(straight(0.5, 0.0), noises=NOISY, seed=9).run(1.2)]
    assert first == again
    assert QUIET != NOISY


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("pose_rate_hz", 20.0),
        ("flow_corners", 3),
        ("accel_noise_mps2", -1.0),
        ("altimeter_noise_m", 0.0),
        ("start_sigma_m", math.nan),
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        Config(**{field: value})
