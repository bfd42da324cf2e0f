"""The localizer: sensors in, poses out.

The IMU drives it: each sample moves the filter on, and the pose is published on the IMU's time.
Compass, altimeter and flow correct it as they arrive; a picture is compared with the pose at its
capture. Landed, the vehicle does not move, which also calibrates the gyroscope.
"""

import math
from statistics import median

import numpy as np
from scipy.spatial.transform import Rotation

from common.clock import nanoseconds, seconds
from common.frames import Array, wrap_angle
from common.messages import HealthState, Image, Imu, Pose, PoseStatus, Range, VehicleStatus
from common.topics import TOPICS
from services.localizer.altimeter import AltimeterGate
from services.localizer.config import Config
from services.localizer.filter import (
    GYRO_BIAS,
    POSITION,
    ROTATION,
    SIZE,
    VELOCITY,
    ErrorStateFilter,
    Noise,
)
from services.localizer.flow import Key, Picture
from services.localizer.ground import LEAST_HEIGHT_M, LEAST_POINTS, View, displacement
from services.localizer.rotation import quaternion_of

SOURCE = "imu+altimeter+flow"
IMU_SILENT_S = TOPICS["imu"].max_age_s
STAMP_JUMP_S = 3.0
"""A gap between two samples that cannot be bridged: another vehicle, or another time."""
ALIGN_SAMPLES = 40
"""Samples averaged at the start: 0.2 s."""
ALIGN_SAMPLES_UNTOLD = 200
"""The same, if the vehicle does not say its state."""
ALIGN_READINGS = 5
"""Altimeter readings whose median is the height at the start, so that none can spoil it."""
BATCH = 10
"""Samples averaged for the compass and for standing still: 20 Hz."""
LOST_POSE_PERIOD_S = 0.5
STANDING_SIGMA_MPS = 0.02
STANDING_SIGMA_RADPS = 0.005
START_HEIGHT_SIGMA_M = 1.0
START_TILT_SIGMA_RAD = 0.02
START_SPEED_SIGMA_MPS = 0.05
FLYING_SPEED_SIGMA_MPS = 1.0
COMPASS_CONTRADICTS_RAD = 0.35
"""At start, more than a person mis-aims and the compass is disturbed: 20 degrees."""
COMPASS_GATE = 9.0
COMPASS_REFUSALS = 20
"""A compass that contradicts for a second is right: no disturbance flies along for so long."""
FLOW_GATE = 13.8
"""Of the squared Mahalanobis length, two degrees of freedom: one good measurement in 1000."""
FLOW_REFUSALS = 15
"""A quarter of a second of refused flow means that it is the filter that is wrong."""
OUTLIER_FLOOR_PX = 1.0
KEY_KEPT = 0.6
"""Share of the key's corners that must still be found."""
KEY_TURN_RAD = 0.2
KEY_CLIMB = 0.12
"""Share of the height: beyond, the key's texture is too much larger or smaller to be matched."""


class Localizer:
    """Pure: depends on what it is given and on the arrival times that come with it.

    Args:
        config: start, noises, limits.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._pose_period_ns = nanoseconds(1.0 / config.pose_rate_hz)
        # A little less than a period, as a camera's frames do not fall on it exactly.
        self._flow_period_ns = nanoseconds(0.9 / config.flow_rate_hz)
        self._vehicle: VehicleStatus | None = None
        self._restart()

    def _restart(self) -> None:
        self._filter: ErrorStateFilter | None = None
        self._alignment: list[Imu] = []
        self._first_heights_m: list[float] = []
        self._field = np.zeros(3)
        self._rate_radps = np.zeros(3)
        self._batched = 0
        self._gate = AltimeterGate(self._config.altimeter_noise_m, self._config.altimeter_jump_m)
        self._key: Key | None = None
        self._last_capture_ns: int | None = None
        self._flow_refused = 0
        self._compass_refused = 0
        self._next_pose_ns = 0
        self._imu_arrival_ns: int | None = None
        self._altimeter_arrival_ns: int | None = None
        self._flow_arrival_ns: int | None = None
        self._next_lost_ns = 0
        self._status: PoseStatus = "lost"
        self._detail = "waiting for the IMU"

    # --- sensors ---------------------------------------------------------------------------------

    def on_vehicle(self, status: VehicleStatus, now_ns: int) -> None:
        """Take the vehicle's state; begin anew when it was put elsewhere."""
        before, self._vehicle = self._vehicle, status
        if before is None:
            return
        # Nothing of this happens in flight: somebody has set the vehicle down, or a reset has.
        if (
            status.world != before.world
            or status.collisions < before.collisions
            or status.battery > before.battery
            or (status.state == "landed" and before.state in ("flying", "taking_off"))
        ):
            self._restart()

    def on_imu(self, imu: Imu, now_ns: int) -> Pose | None:
        """Move on by one sample; the pose, when one is due."""
        if self._filter is not None:
            dt_s = seconds(imu.stamp - self._filter.stamp_ns)
            if not 0.0 < dt_s < STAMP_JUMP_S:
                self._restart()
            elif dt_s > IMU_SILENT_S:
                self._filter.bridge(imu.stamp)
        if self._imu_arrival_ns is None:
            self._altimeter_arrival_ns = self._flow_arrival_ns = now_ns
        self._imu_arrival_ns = now_ns
        if self._filter is None:
            self._align(imu)
            return None
        rate = np.array(imu.angular_velocity)
        self._filter.predict(imu.stamp, rate, np.array(imu.linear_acceleration))
        # Turned into the world one by one: in a turn, a mean in the body would lag behind.
        self._field += self._filter.rotation @ np.array(imu.magnetic_field)
        self._rate_radps += rate
        self._batched += 1
        if self._batched >= BATCH:
            self._use_batch(self._filter)
        if imu.stamp < self._next_pose_ns:
            return None
        late = imu.stamp - self._next_pose_ns > self._pose_period_ns
        self._next_pose_ns = (imu.stamp if late else self._next_pose_ns) + self._pose_period_ns
        self._judge(self._filter, now_ns)
        return self._pose(self._filter, self._status)

    def on_altimeter(self, reading: Range, now_ns: int) -> None:
        """Correct the height."""
        if not reading.min <= reading.range < reading.max:
            return  # nothing was measured
        state = self._filter
        # The beam goes along the body's -z; its slope is taken off.
        upright = 1.0 if state is None else float(state.rotation[2, 2])
        height_m = reading.range * upright
        if len(self._first_heights_m) < ALIGN_READINGS:
            self._first_heights_m.append(height_m)
            height_m = median(self._first_heights_m)
        if state is None or len(self._first_heights_m) < ALIGN_READINGS:
            return
        age_s = max(state.age_s(reading.stamp), 0.0)
        expected_m = float(state.position_m[2] - age_s * state.velocity_mps[2])
        floor_m = self._gate.floor_m
        residual_m = self._gate.judge(height_m, expected_m, math.sqrt(state.covariance[2, 2]))
        if self._gate.floor_m != floor_m:
            self._key = None
        if residual_m is None:
            return
        self._altimeter_arrival_ns = now_ns
        jacobian = np.zeros((1, SIZE))
        jacobian[0, POSITION.start + 2] = 1.0
        jacobian[0, VELOCITY.start + 2] = -age_s
        noise = np.array([[self._config.altimeter_noise_m**2]])
        state.correct(np.array([residual_m]), jacobian, noise)

    def on_picture(self, image: Image, now_ns: int) -> None:
        """Correct by the displacement of the floor's texture since the key picture.

        Raises:
            ValueError: if the picture cannot be used.
        """
        state = self._filter
        last_ns = self._last_capture_ns
        if state is None or (
            last_ns is not None and 0 <= image.capture - last_ns < self._flow_period_ns
        ):
            return
        self._last_capture_ns = image.capture
        picture = Picture(image)
        snapshot = state.at(picture.capture_ns)
        if snapshot is None or self._standing:
            self._key = None
            return
        if self._gate.in_doubt:
            return
        now = View.of_body(snapshot.position_m, snapshot.rotation, self._gate.floor_m)
        if now.height_m < LEAST_HEIGHT_M:
            self._key = None
            return
        if self._key is None or not self._use_flow(state, self._key, picture, now, now_ns):
            self._new_key(state, picture)

    # --- corrections -----------------------------------------------------------------------------

    @property
    def _standing(self) -> bool:
        return self._vehicle is not None and self._vehicle.state == "landed"

    def _align(self, imu: Imu) -> None:
        """Level by gravity, turn by the mark and the compass, once enough samples are there."""
        self._alignment.append(imu)
        needed = ALIGN_SAMPLES if self._vehicle is not None else ALIGN_SAMPLES_UNTOLD
        if len(self._alignment) < needed:
            return
        config = self._config
        force = np.mean([sample.linear_acceleration for sample in self._alignment], axis=0)
        pitch = math.atan2(-force[0], math.hypot(force[1], force[2]))
        roll = math.atan2(force[1], force[2])
        level = Rotation.from_euler("ZYX", [0.0, pitch, roll])
        yaw, yaw_sigma = config.start_yaw_rad, config.start_yaw_sigma_rad
        field = np.mean([sample.magnetic_field for sample in self._alignment], axis=0)
        compass = _compass_yaw(level.apply(field))
        if compass is not None and abs(wrap_angle(compass - yaw)) > COMPASS_CONTRADICTS_RAD:
            yaw, yaw_sigma = compass, config.compass_noise_rad
        in_flight = self._vehicle is not None and self._vehicle.state != "landed"
        place_sigma = config.start_in_flight_sigma_m if in_flight else config.start_sigma_m
        speed_sigma = FLYING_SPEED_SIGMA_MPS if in_flight else START_SPEED_SIGMA_MPS
        height_m, height_sigma = 0.0, START_HEIGHT_SIGMA_M
        if len(self._first_heights_m) == ALIGN_READINGS:
            height_m, height_sigma = median(self._first_heights_m), config.altimeter_noise_m
        sigmas = np.array(
            [place_sigma, place_sigma, height_sigma]
            + [speed_sigma] * 3
            + [START_TILT_SIGMA_RAD, START_TILT_SIGMA_RAD, yaw_sigma]
            + [config.accel_bias_mps2] * 3
            + [config.gyro_bias_radps] * 3
        )
        self._filter = ErrorStateFilter(
            imu.stamp,
            np.array([config.start_x_m, config.start_y_m, height_m]),
            np.asarray((Rotation.from_euler("Z", yaw) * level).as_matrix()),
            sigmas,
            Noise(
                config.accel_noise_mps2,
                config.accel_bias_walk_mps2,
                config.gyro_noise_radps,
                config.gyro_bias_walk_radps,
            ),
        )
        self._alignment.clear()
        self._next_pose_ns = imu.stamp + self._pose_period_ns

    def _use_batch(self, state: ErrorStateFilter) -> None:
        """Correct by the last samples' mean field and, on the ground, by standing still."""
        field = self._field
        yaw_error = _compass_yaw(field)
        if yaw_error is not None:
            jacobian = np.zeros((1, SIZE))
            # A tilt leaks the field's vertical part into the heading.
            jacobian[0, ROTATION] = (0.0, -field[2] / math.hypot(field[0], field[1]), 1.0)
            residual = np.array([wrap_angle(yaw_error)])
            noise = np.array([[self._config.compass_noise_rad**2]])
            if state.surprise(residual, jacobian, noise) < COMPASS_GATE:
                self._compass_refused = 0
                state.correct(residual, jacobian, noise)
            else:
                self._compass_refused += 1
                if self._compass_refused >= COMPASS_REFUSALS:
                    state.loosen(0.0, abs(float(residual[0])))
        if self._standing:
            rate = self._rate_radps / self._batched
            jacobian = np.zeros((6, SIZE))
            jacobian[0:3, VELOCITY] = jacobian[3:6, GYRO_BIAS] = np.eye(3)
            residual = np.concatenate([-state.velocity_mps, rate - state.gyro_bias_radps])
            sigmas = np.array([STANDING_SIGMA_MPS] * 3 + [STANDING_SIGMA_RADPS] * 3)
            state.correct(residual, jacobian, np.diag(sigmas**2))
        self._field, self._rate_radps, self._batched = np.zeros(3), np.zeros(3), 0

    def _use_flow(
        self, state: ErrorStateFilter, key: Key, picture: Picture, now: View, now_ns: int
    ) -> bool:
        """Correct by the key picture; False when it is of no use for the next ones."""
        floor_m = self._gate.floor_m
        then = View.of_body(state.key_position_m, state.key_rotation, floor_m)
        if now.height_m < LEAST_HEIGHT_M or then.height_m < LEAST_HEIGHT_M:
            return False
        key_rays = key.rays
        offsets, _ = then.to_floor(key_rays)
        optical = now.of_floor(then.centre_m + offsets)
        ahead = optical[:, 2] > LEAST_HEIGHT_M / 2
        expected = np.full((len(key_rays), 2), -1.0)
        expected[ahead] = picture.pixels(optical[ahead])
        found, ok = key.follow(picture, expected)
        if np.count_nonzero(ok) < LEAST_POINTS:
            return False
        pixel_m = now.height_m / picture.focal_px
        seen = displacement(
            then,
            key_rays[ok],
            now,
            picture.rays(found[ok]),
            state.age_s(picture.capture_ns),
            OUTLIER_FLOOR_PX * pixel_m,
        )
        if seen is None:
            return False
        variance = (self._config.flow_noise_px * pixel_m) ** 2 + seen.spread_m**2 / seen.inliers
        noise = np.eye(2) * variance
        if state.surprise(seen.residual_m, seen.jacobian, noise) > FLOW_GATE:
            self._flow_refused += 1
            if self._flow_refused >= FLOW_REFUSALS:
                self._flow_refused = 0
                state.loosen(FLYING_SPEED_SIGMA_MPS)
                return False
            return True
        self._flow_refused = 0
        self._flow_arrival_ns = now_ns
        state.correct(seen.residual_m, seen.jacobian, noise)
        turn = abs(wrap_angle(_yaw(state.rotation) - _yaw(state.key_rotation)))
        return (
            seen.inliers >= KEY_KEPT * len(key_rays)
            and turn < KEY_TURN_RAD
            and abs(now.height_m / then.height_m - 1.0) < KEY_CLIMB
        )

    def _new_key(self, state: ErrorStateFilter, picture: Picture) -> None:
        """Measure later displacements against this picture."""
        snapshot = state.at(picture.capture_ns)
        key = Key(picture, self._config.flow_corners)
        if snapshot is None or len(key.rays) < LEAST_POINTS:
            self._key = None
            return
        moved_m = 0.0
        if self._key is not None:
            moved_m = float(np.linalg.norm((snapshot.position_m - state.key_position_m)[:2]))
        height_m = float(snapshot.position_m[2]) - self._gate.floor_m
        pixel_m = max(height_m, 0.0) / picture.focal_px
        state.set_key(
            snapshot,
            math.hypot(
                self._config.flow_noise_px * pixel_m, self._config.flow_scale_noise * moved_m
            ),
        )
        self._key = key

    # --- what is said ----------------------------------------------------------------------------

    def on_tick(self, now_ns: int) -> Pose | None:
        """Watch the IMU's silence: a `lost` pose at once, then every half second.

        Rarely enough that a reader who looks at the pose's age only sees it go stale too.
        """
        if self._imu_arrival_ns is None or seconds(now_ns - self._imu_arrival_ns) <= IMU_SILENT_S:
            self._next_lost_ns = now_ns
            return None
        self._status, self._detail = "lost", "no IMU"
        if self._filter is None or now_ns < self._next_lost_ns:
            return None
        self._next_lost_ns = now_ns + nanoseconds(LOST_POSE_PERIOD_S)
        return self._pose(self._filter, "lost")

    def health(self) -> tuple[HealthState, str]:
        """`degraded` with the reason whenever the pose is not `ok`."""
        if self._status == "ok":
            return "ok", ""
        return "degraded", f"{self._status}: {self._detail}"

    def _judge(self, state: ErrorStateFilter, now_ns: int) -> None:
        config = self._config
        variances = state.covariance.diagonal()
        place_sigma = math.sqrt(max(variances[POSITION]))
        speed_sigma = math.sqrt(max(variances[VELOCITY]))
        no_altimeter_s = _age_s(self._altimeter_arrival_ns, now_ns)
        if self._standing:
            # The camera sees nothing from the ground, and nothing is needed.
            self._flow_arrival_ns = now_ns
        no_flow_s = _age_s(self._flow_arrival_ns, now_ns)
        self._status, self._detail = "ok", ""
        for status, broken, detail in (
            ("lost", no_flow_s > config.flow_lost_s, f"no flow for {no_flow_s:.1f} s"),
            ("lost", place_sigma > config.lost_position_sigma_m, "place unknown"),
            ("lost", speed_sigma > config.lost_velocity_sigma_mps, "speed unknown"),
            ("degraded", no_flow_s > config.stale_s, f"no flow for {no_flow_s:.1f} s"),
            (
                "degraded",
                no_altimeter_s > config.stale_s,
                f"no altimeter for {no_altimeter_s:.1f} s",
            ),
            ("degraded", place_sigma > config.degraded_position_sigma_m, "place not well known"),
        ):
            if broken:
                self._status, self._detail = status, detail  # type: ignore[assignment]
                return

    def _pose(self, state: ErrorStateFilter, status: PoseStatus) -> Pose:
        variances = state.covariance.diagonal()
        roll, pitch, yaw = _euler_variances(state)
        return Pose(
            stamp=state.stamp_ns,
            seq=0,
            position=_triple(state.position_m),
            orientation=quaternion_of(state.rotation),
            velocity=_triple(state.velocity_mps),
            angular_velocity=_triple(state.rate_radps),
            covariance=(
                *_triple(variances[POSITION]),
                roll,
                pitch,
                yaw,
            ),
            status=status,
            source=SOURCE,
        )


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _yaw(rotation: Array) -> float:
    return math.atan2(rotation[1, 0], rotation[0, 0])


def _euler_variances(state: ErrorStateFilter) -> tuple[float, float, float]:
    """Variances of roll, pitch, yaw: those of the world-frame rotation seen from the heading."""
    yaw = _yaw(state.rotation)
    heading = np.array([math.cos(yaw), math.sin(yaw)])
    left = np.array([-heading[1], heading[0]])
    tilt = state.covariance[ROTATION, ROTATION][:2, :2]
    return (
        float(heading @ tilt @ heading),
        float(left @ tilt @ left),
        float(state.covariance[ROTATION.stop - 1, ROTATION.stop - 1]),
    )


def _compass_yaw(field: Array) -> float | None:
    """How far a field (level or world frame) must be turned to point north, along world +y.

    Only its direction on the horizontal counts. None where it has none.
    """
    if math.hypot(field[0], field[1]) < 1e-9 + 0.05 * abs(field[2]):
        return None
    return wrap_angle(math.pi / 2.0 - math.atan2(field[1], field[0]))


def _age_s(arrival_ns: int | None, now_ns: int) -> float:
    return math.inf if arrival_ns is None else seconds(now_ns - arrival_ns)
