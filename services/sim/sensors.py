"""What the vehicle's instruments say of its motion.

Noise is white. The accelerometer's is tum_simulator's (a020d89); the others are of the order of
such parts.
"""

import numpy as np

from common import messages as m
from services.sim.plant import GRAVITY_MPS2, BodyState, Vector3

ACCELERATION_NOISE_MPS2: Vector3 = (0.35, 0.35, 0.30)
RATE_NOISE_RADPS = 0.005
MAGNETIC_NOISE = 0.01
RANGE_NOISE_M = 0.01
RANGE_MIN_M = 0.01
RANGE_MAX_M = 3.0
MAGNETIC_FIELD: Vector3 = (0.0, 0.5, -0.866)
"""World, in units of its strength: to the north (+y) and 60 deg down, as in mid-Europe."""


class Imu:
    """Gyroscope, accelerometer, magnetometer.

    The specific force is the mean over the time since the last sample, as an instrument that
    integrates gives it.
    """

    def __init__(self, generator: np.random.Generator, scale: float, step_s: float) -> None:
        self._generator = generator
        self._step_s = step_s
        self._deviation = scale * np.asarray(
            [*[RATE_NOISE_RADPS] * 3, *ACCELERATION_NOISE_MPS2, *[MAGNETIC_NOISE] * 3]
        )
        self._last_mps: Vector3 | None = None

    def sample(self, stamp_ns: int, state: BodyState) -> m.Imu:
        """One sample."""
        v, last = state.velocity_mps, self._last_mps or state.velocity_mps
        self._last_mps = v
        force = (
            (v[0] - last[0]) / self._step_s,
            (v[1] - last[1]) / self._step_s,
            (v[2] - last[2]) / self._step_s + GRAVITY_MPS2,
        )
        noise = (self._generator.standard_normal(9) * self._deviation).tolist()
        wx, wy, wz = state.to_body(state.angular_velocity_radps)
        fx, fy, fz = state.to_body(force)
        mx, my, mz = state.to_body(MAGNETIC_FIELD)
        return m.Imu(
            stamp=stamp_ns,
            seq=0,
            angular_velocity=(wx + noise[0], wy + noise[1], wz + noise[2]),
            linear_acceleration=(fx + noise[3], fy + noise[4], fz + noise[5]),
            magnetic_field=(mx + noise[6], my + noise[7], mz + noise[8]),
        )


class Altimeter:
    """An ultrasound range along body -z, from the body's origin.

    Beyond its reach it says the end of its reach.
    """

    def __init__(self, generator: np.random.Generator, scale: float) -> None:
        self._generator = generator
        self._deviation_m = scale * RANGE_NOISE_M

    def sample(self, stamp_ns: int, true_range_m: float) -> m.Range:
        """One sample."""
        measured_m = true_range_m
        if true_range_m < RANGE_MAX_M:
            measured_m += float(self._generator.normal(0.0, self._deviation_m))
        return m.Range(
            stamp=stamp_ns,
            seq=0,
            range=max(RANGE_MIN_M, min(RANGE_MAX_M, measured_m)),
            min=RANGE_MIN_M,
            max=RANGE_MAX_M,
        )


def truth(stamp_ns: int, state: BodyState) -> m.Pose:
    """The motion itself, as a pose without variance."""
    return m.Pose(
        stamp=stamp_ns,
        seq=0,
        position=state.position_m,
        orientation=state.orientation,
        velocity=state.velocity_mps,
        angular_velocity=state.to_body(state.angular_velocity_radps),
        covariance=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        status="ok",
        source="truth",
    )
