"""What the vehicle's instruments say of its motion.

The accelerometer's white noise, and the altimeter's reach and cone, are tum_simulator's (a020d89);
the other noises are of the order of such parts. Offsets wander: a bias of a gyroscope is a random
walk that decays over minutes (first-order Gauss-Markov).
"""

import math
from collections.abc import Iterator

import numpy as np

from common import messages as m
from services.sim.body import GRAVITY_MPS2, BodyState, Vector3

ACCELERATION_NOISE_MPS2: Vector3 = (0.35, 0.35, 0.30)
ACCELERATION_BIAS_MPS2 = 0.03
RATE_NOISE_RADPS = 0.005
RATE_BIAS_RADPS = 0.003
MAGNETIC_NOISE = 0.01
MAGNETIC_BIAS = 0.005
BIAS_TIME_S = 300.0
"""An offset's memory."""
MAGNETIC_FIELD: Vector3 = (0.0, 0.5, -0.866)
"""World, in units of its strength: to the north (+y) and 60 deg down, as in mid-Europe."""

RANGE_NOISE_M = 0.01
RANGE_MIN_M = 0.01
RANGE_MAX_M = 3.0
CONE_RAD = math.radians(20.0)
"""Half of the altimeter's cone."""
DROPOUT = 0.01
"""The share of echoes that are not heard."""

_BLOCK = 512
"""Samples whose noise is drawn at once."""


class Imu:
    """Gyroscope, accelerometer, magnetometer.

    The specific force is the mean over the time since the last sample, as an instrument that
    integrates gives it.
    """

    def __init__(self, generator: np.random.Generator, scale: float, step_s: float) -> None:
        self._step_s = step_s
        self._noise = _noise(generator, scale, step_s)
        self._last_mps: Vector3 | None = None

    def sample(self, stamp_ns: int, state: BodyState) -> m.Imu:
        """One sample."""
        vx, vy, vz = state.velocity_mps
        lx, ly, lz = self._last_mps or state.velocity_mps
        self._last_mps = state.velocity_mps
        step_s = self._step_s
        noise = next(self._noise)
        wx, wy, wz = state.to_body(state.angular_velocity_radps)
        fx, fy, fz = state.to_body(
            ((vx - lx) / step_s, (vy - ly) / step_s, (vz - lz) / step_s + GRAVITY_MPS2)
        )
        mx, my, mz = state.to_body(MAGNETIC_FIELD)
        return m.Imu(
            stamp=stamp_ns,
            seq=0,
            angular_velocity=(wx + noise[0], wy + noise[1], wz + noise[2]),
            linear_acceleration=(fx + noise[3], fy + noise[4], fz + noise[5]),
            magnetic_field=(mx + noise[6], my + noise[7], mz + noise[8]),
        )


def _noise(generator: np.random.Generator, scale: float, step_s: float) -> Iterator[list[float]]:
    """Errors of rate, acceleration and field, by samples: white noise on wandering offsets."""
    white = scale * np.asarray(
        [*[RATE_NOISE_RADPS] * 3, *ACCELERATION_NOISE_MPS2, *[MAGNETIC_NOISE] * 3]
    )
    bias = scale * np.repeat([RATE_BIAS_RADPS, ACCELERATION_BIAS_MPS2, MAGNETIC_BIAS], 3)
    offset = generator.standard_normal(9) * bias
    keep = math.exp(-_BLOCK * step_s / BIAS_TIME_S)
    walk = bias * math.sqrt((1.0 - keep * keep) / _BLOCK)
    while True:
        draws = generator.standard_normal((2, _BLOCK, 9))
        # Within a block, a few seconds, the decay is a straight line.
        fade = np.linspace(1.0, keep, _BLOCK + 1)[1:, None]
        offsets = offset * fade + np.cumsum(draws[0], axis=0) * walk
        offset = offsets[-1]
        yield from (offsets + draws[1] * white).tolist()


class Altimeter:
    """An ultrasound range to the nearest thing in a cone around body -z, from the body's origin.

    So over an edge it jumps before the vehicle is there. Beyond its reach, and when no echo is
    heard, it says the end of its reach.
    """

    def __init__(self, generator: np.random.Generator, scale: float) -> None:
        self._errors = _altimeter_errors(generator, scale)

    def sample(self, stamp_ns: int, true_range_m: float) -> m.Range:
        """One sample."""
        error_m, is_heard = next(self._errors)
        measured_m = RANGE_MAX_M
        if is_heard and true_range_m < RANGE_MAX_M:
            measured_m = max(RANGE_MIN_M, min(RANGE_MAX_M, true_range_m + error_m))
        return m.Range(stamp=stamp_ns, seq=0, range=measured_m, min=RANGE_MIN_M, max=RANGE_MAX_M)


def _altimeter_errors(generator: np.random.Generator, scale: float) -> Iterator[tuple[float, bool]]:
    while True:
        errors = generator.normal(0.0, scale * RANGE_NOISE_M, _BLOCK).tolist()
        heard = (generator.random(_BLOCK) >= min(1.0, scale * DROPOUT)).tolist()
        yield from zip(errors, heard, strict=True)


def cone(state: BodyState) -> list[Vector3]:
    """Directions in the altimeter's cone, world: its axis, its rim, and down if that is in it."""
    r = state.rotation
    axis = (-r[2], -r[5], -r[8])
    rays = [axis]
    cos, sin = math.cos(CONE_RAD), math.sin(CONE_RAD)
    for x, y in _RIM:
        x, y = sin * x, sin * y
        rays.append(
            (
                cos * axis[0] + x * r[0] + y * r[1],
                cos * axis[1] + x * r[3] + y * r[4],
                cos * axis[2] + x * r[6] + y * r[7],
            )
        )
    if r[8] > cos:
        rays.append((0.0, 0.0, -1.0))
    return rays


_RIM = tuple((math.cos(a * math.pi / 3.0), math.sin(a * math.pi / 3.0)) for a in range(6))


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
