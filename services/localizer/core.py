"""The localizer: sensors in, poses out.

The IMU drives it: each sample moves the filter on, and the pose is published on the IMU's time.
Compass, altimeter and flow correct it as they arrive; a picture is compared with the pose at its
capture. Landed, the vehicle does not move, which also calibrates the gyroscope.
"""

import math

import numpy as np

from common.clock import nanoseconds, seconds
from common.frames import Array
from common.messages import HealthState, Image, Imu, Pose, PoseStatus, Range, VehicleStatus
from common.topics import TOPICS
from services.localizer.alignment import SAMPLES, Alignment
from services.localizer.altimeter import AltimeterGate
from services.localizer.compass import Compass
from services.localizer.config import Config
from services.localizer.filter import (
    GYRO_BIAS,
    POSITION,
    ROTATION,
    SIZE,
    VELOCITY,
    ErrorStateFilter,
)
from services.localizer.flow import Picture
from services.localizer.odometer import Odometer
from services.localizer.rotation import quaternion_of
from services.localizer.status import OK, Verdict, judge

SOURCE = "imu+altimeter+flow"
IMU_SILENT_S = TOPICS["imu"].max_age_s
ALTIMETER_OLD_S = TOPICS["altimeter"].max_age_s
STAMP_JUMP_S = 3.0
"""A gap between two samples that cannot be bridged: another vehicle, or another time."""
STRAYS = 5
"""Samples in a row whose stamps do not follow make a new start; fewer are left out."""
MOST_RADPS, MOST_MPS2 = 100.0, 1000.0
"""An IMU that says more is broken: its sample counts as missing."""
LAST_STAMP_NS = 2**62
"""The year 2116; what is later does not fit the filter's memory."""
SAMPLES_UNTOLD = 200
"""The samples of the start, if the vehicle does not say its state."""
BATCH = 10
"""Samples averaged for the compass and for standing still: 20 Hz."""
STANDING_SIGMA_MPS = 0.02
STANDING_SIGMA_RADPS = 0.005
LOST_POSE_PERIOD_S = 0.5


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
        self._alignment = Alignment(self._config)
        self._compass = Compass(self._config.compass_noise_rad)
        self._gate = AltimeterGate(self._config.altimeter_noise_m, self._config.altimeter_jump_m)
        self._odometer = Odometer(self._config)
        self._field = np.zeros(3)
        self._rate_radps = np.zeros(3)
        self._batched = 0
        self._strays = 0
        self._last_capture_ns: int | None = None
        self._next_pose_ns = 0
        self._imu_arrival_ns: int | None = None
        self._altimeter_arrival_ns = self._flow_arrival_ns = 0
        self._next_lost_ns = 0
        self._verdict = Verdict("lost", "waiting for the IMU")

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
        rate, force = np.array(imu.angular_velocity), np.array(imu.linear_acceleration)
        if (
            np.abs(rate).max() > MOST_RADPS
            or np.abs(force).max() > MOST_MPS2
            or not 0 <= imu.stamp < LAST_STAMP_NS
        ):
            return None
        if self._filter is not None and not self._follows(self._filter, imu.stamp):
            return None
        if self._imu_arrival_ns is None:
            self._altimeter_arrival_ns = self._flow_arrival_ns = now_ns
        self._imu_arrival_ns = now_ns
        state = self._filter
        if state is None:
            self._align(imu)
            return None
        state.predict(imu.stamp, rate, force)
        # Turned into the world one by one: in a turn, a mean in the body would lag behind.
        self._field += state.rotation @ np.array(imu.magnetic_field)
        self._rate_radps += rate
        self._batched += 1
        if self._batched == BATCH:
            self._use_batch(state)
        if not np.isfinite(state.position_m).all():
            self._restart()  # each input was finite, but absurd
            return None
        if imu.stamp < self._next_pose_ns:
            return None
        late = imu.stamp - self._next_pose_ns > self._pose_period_ns
        self._next_pose_ns = (imu.stamp if late else self._next_pose_ns) + self._pose_period_ns
        if self._standing:
            # The camera sees nothing from the ground, and nothing is needed.
            self._flow_arrival_ns = now_ns
        self._verdict = judge(
            state, self._config, self._flow_arrival_ns, self._altimeter_arrival_ns, now_ns
        )
        return _pose(state, self._verdict.status)

    def on_altimeter(self, reading: Range, now_ns: int) -> None:
        """Correct the height."""
        if not reading.min <= reading.range < reading.max:
            return  # nothing was measured
        state = self._filter
        # The beam goes along the body's -z; its slope is taken off.
        height_m = reading.range * (1.0 if state is None else float(state.rotation[2, 2]))
        if self._alignment.height_m is None:
            self._alignment.add_height(height_m)
            height_m = self._alignment.height_m or 0.0
        if state is None or self._alignment.height_m is None:
            return
        age_s = max(state.age_s(reading.stamp), 0.0)
        if age_s > ALTIMETER_OLD_S:
            return
        expected_m = float(state.position_m[2] - age_s * state.velocity_mps[2])
        floor_m = self._gate.floor_m
        residual_m = self._gate.judge(height_m, expected_m, math.sqrt(state.covariance[2, 2]))
        if self._gate.floor_m != floor_m:
            self._odometer.forget()
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
        state, last_ns = self._filter, self._last_capture_ns
        if state is None:
            return
        if last_ns is not None and 0 <= image.capture - last_ns < self._flow_period_ns:
            return
        self._last_capture_ns = image.capture
        if self._standing:
            self._odometer.forget()
            return
        # While the altimeter is in doubt, so is the scale of what is seen.
        if not self._gate.in_doubt and self._odometer.use(
            state, Picture(image), self._gate.floor_m
        ):
            self._flow_arrival_ns = now_ns

    # --- inside ----------------------------------------------------------------------------------

    @property
    def _standing(self) -> bool:
        return self._vehicle is not None and self._vehicle.state == "landed"

    def _follows(self, state: ErrorStateFilter, stamp_ns: int) -> bool:
        """Whether a sample can be used; bridges a gap before it, or begins anew."""
        dt_s = seconds(stamp_ns - state.stamp_ns)
        if 0.0 < dt_s < STAMP_JUMP_S:
            self._strays = 0
            if dt_s > IMU_SILENT_S:
                state.bridge(stamp_ns)
            return True
        self._strays += 1
        if self._strays < STRAYS:
            return False
        self._restart()
        return True

    def _align(self, imu: Imu) -> None:
        count = self._alignment.add(imu)
        if count < (SAMPLES if self._vehicle is not None else SAMPLES_UNTOLD):
            return
        in_flight = self._vehicle is not None and not self._standing
        self._filter = self._alignment.start(in_flight)
        self._next_pose_ns = imu.stamp + self._pose_period_ns

    def _use_batch(self, state: ErrorStateFilter) -> None:
        """Correct by the last samples' mean field and, on the ground, by standing still."""
        self._compass.correct(state, self._field / BATCH)
        if self._standing:
            jacobian = np.zeros((6, SIZE))
            jacobian[0:3, VELOCITY] = jacobian[3:6, GYRO_BIAS] = np.eye(3)
            turn = self._rate_radps / BATCH - state.gyro_bias_radps
            sigmas = np.array([STANDING_SIGMA_MPS] * 3 + [STANDING_SIGMA_RADPS] * 3)
            residual = np.concatenate([-state.velocity_mps, turn])
            state.correct(residual, jacobian, np.diag(sigmas**2))
        self._field, self._rate_radps, self._batched = np.zeros(3), np.zeros(3), 0

    # --- what is said ----------------------------------------------------------------------------

    def on_tick(self, now_ns: int) -> Pose | None:
        """Watch the IMU's silence: a `lost` pose at once, then every half second.

        Rarely enough that a reader who looks at the pose's age only sees it go stale too.
        """
        if self._imu_arrival_ns is None or seconds(now_ns - self._imu_arrival_ns) <= IMU_SILENT_S:
            self._next_lost_ns = now_ns
            return None
        self._verdict = Verdict("lost", "no IMU")
        if self._filter is None or now_ns < self._next_lost_ns:
            return None
        self._next_lost_ns = now_ns + nanoseconds(LOST_POSE_PERIOD_S)
        return _pose(self._filter, "lost")

    def health(self) -> tuple[HealthState, str]:
        """`degraded` with the reason whenever the pose is not `ok`."""
        if self._verdict == OK:
            return "ok", ""
        return "degraded", f"{self._verdict.status}: {self._verdict.reason}"


def _pose(state: ErrorStateFilter, status: PoseStatus) -> Pose:
    variances = state.covariance.diagonal()
    # The rotation's error is in the world; roll and pitch are about the heading's axes.
    cos, sin = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
    to_heading = np.array([[cos, sin], [-sin, cos]])
    tilt = to_heading @ state.covariance[ROTATION, ROTATION][:2, :2] @ to_heading.T
    return Pose(
        stamp=state.stamp_ns,
        seq=0,
        position=_triple(state.position_m),
        orientation=quaternion_of(state.rotation),
        velocity=_triple(state.velocity_mps),
        angular_velocity=_triple(state.rate_radps),
        covariance=(
            *_triple(variances[POSITION]),
            float(tilt[0, 0]),
            float(tilt[1, 1]),
            float(variances[ROTATION][2]),
        ),
        status=status,
        source=SOURCE,
    )


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
