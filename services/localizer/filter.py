"""The error-state Kalman filter: where the body is, how it moves, and how well both are known.

Nominal state: position and velocity (world), rotation (body to world), offsets of accelerometer
and gyroscope (body). The error of the rotation is a small rotation in the world frame, applied on
the left. One past pose, that of the key picture, is kept in the state ("stochastic cloning"), so
that a displacement against it corrects both ends and a hover does not drift.
"""

import math
from dataclasses import dataclass

import numpy as np

from common.clock import nanoseconds, seconds
from common.frames import Array
from services.localizer.rotation import cross_matrix, orthonormal, rotation_by

GRAVITY_MPS2 = 9.81

POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
ROTATION = slice(6, 9)
ACCEL_BIAS = slice(9, 12)
GYRO_BIAS = slice(12, 15)
KEY_POSITION = slice(15, 18)
KEY_ROTATION = slice(18, 21)
SIZE = 21

GAP_MPS2, GAP_RADPS = 1.0, 0.2
"""How the vehicle may have moved in a gap without samples, one sigma."""

_SAMPLE_S = 0.005
_HISTORY = 64
"""Past states kept: 0.32 s at 200 Hz, more than a picture takes to arrive."""
_REACH_S = 0.02
"""From one sample to a stamp after it, by its rates."""


@dataclass(frozen=True)
class Noise:
    """What the filter believes of the inertial sensors, one sample's or one second's sigma."""

    accel_mps2: float
    accel_bias_walk_mps2: float
    gyro_radps: float
    gyro_bias_walk_radps: float


@dataclass(frozen=True)
class Snapshot:
    """The nominal pose at some stamp."""

    stamp_ns: int
    position_m: Array
    rotation: Array


class ErrorStateFilter:
    """Inertial navigation with corrections.

    Args:
        stamp_ns: time of the start.
        position_m: place at the start.
        rotation: body to world at the start.
        sigmas: (15,) standard deviations of position, velocity, rotation and both offsets.
        noise: of the inertial sensors.
    """

    def __init__(
        self, stamp_ns: int, position_m: Array, rotation: Array, sigmas: Array, noise: Noise
    ) -> None:
        self.stamp_ns = stamp_ns
        self.position_m = position_m.copy()
        self.velocity_mps = np.zeros(3)
        self.rotation = rotation.copy()
        self.accel_bias_mps2 = np.zeros(3)
        self.gyro_bias_radps = np.zeros(3)
        self.rate_radps = np.zeros(3)
        self.covariance = np.zeros((SIZE, SIZE))
        self.covariance[:15, :15] = np.diag(sigmas**2)
        self.key_position_m = position_m.copy()
        self.key_rotation = rotation.copy()
        self._white, self._walk = np.zeros(SIZE), np.zeros(SIZE)
        self._white[VELOCITY], self._white[ROTATION] = noise.accel_mps2**2, noise.gyro_radps**2
        self._walk[ACCEL_BIAS] = noise.accel_bias_walk_mps2**2
        self._walk[GYRO_BIAS] = noise.gyro_bias_walk_radps**2
        self._transition = np.eye(SIZE)
        self._steps = 0
        self._past_ns = np.full(_HISTORY, -1, dtype=np.int64)
        self._past_position_m = np.zeros((_HISTORY, 3))
        self._past_velocity_mps = np.zeros((_HISTORY, 3))
        self._past_rotation = np.tile(np.eye(3), (_HISTORY, 1, 1))
        self._past_rate_radps = np.zeros((_HISTORY, 3))
        self._remember()

    # --- time ------------------------------------------------------------------------------------

    def predict(self, stamp_ns: int, rate_radps: Array, force_mps2: Array) -> None:
        """Move on to `stamp_ns` by one sample of body rates and specific force."""
        dt_s = seconds(stamp_ns - self.stamp_ns)
        self.rate_radps = rate_radps - self.gyro_bias_radps
        half_turn = rotation_by(self.rate_radps * (0.5 * dt_s))
        middle = self.rotation @ half_turn
        force = middle @ (force_mps2 - self.accel_bias_mps2)
        acceleration = force - (0.0, 0.0, GRAVITY_MPS2)
        self.position_m += self.velocity_mps * dt_s + acceleration * (0.5 * dt_s * dt_s)
        self.velocity_mps += acceleration * dt_s
        self.rotation = middle @ half_turn

        transition = self._transition
        transition[0, 3] = transition[1, 4] = transition[2, 5] = dt_s
        transition[VELOCITY, ROTATION] = cross_matrix(force * -dt_s)
        transition[VELOCITY, ACCEL_BIAS] = middle * -dt_s
        transition[ROTATION, GYRO_BIAS] = middle * -dt_s
        self.covariance = transition @ self.covariance @ transition.T
        diagonal = _diagonal_of(self.covariance)
        diagonal += (self._white * dt_s + self._walk) * dt_s
        self.stamp_ns = stamp_ns
        self._remember()

    def bridge(self, stamp_ns: int) -> None:
        """Move on to just before a sample that comes after a gap, at the same speed and turn."""
        gap_s = seconds(stamp_ns - self.stamp_ns) - _SAMPLE_S
        self.loosen(GAP_MPS2 * gap_s, GAP_RADPS * gap_s)
        hover = self.rotation.T @ (0.0, 0.0, GRAVITY_MPS2) + self.accel_bias_mps2
        turn = self.gyro_bias_radps + np.array([0.0, 0.0, self.rate_radps[2]])
        self.predict(stamp_ns - nanoseconds(_SAMPLE_S), turn, hover)

    def at(self, stamp_ns: int) -> Snapshot | None:
        """The nominal pose at a stamp, from the last sample before it.

        None if that sample is forgotten, or was too long before.
        """
        known = (self._past_ns >= 0) & (self._past_ns <= stamp_ns)
        index = int(np.argmax(np.where(known, self._past_ns, -1)))
        dt_s = seconds(stamp_ns - int(self._past_ns[index]))
        if not known[index] or dt_s > _REACH_S:
            return None
        return Snapshot(
            stamp_ns,
            self._past_position_m[index] + self._past_velocity_mps[index] * dt_s,
            self._past_rotation[index] @ rotation_by(self._past_rate_radps[index] * dt_s),
        )

    # --- corrections -----------------------------------------------------------------------------

    def set_key(self, snapshot: Snapshot, extra_sigma_m: float) -> None:
        """Keep the pose of `snapshot` as the key pose.

        Args:
            snapshot: a recent pose.
            extra_sigma_m: what corrections against the last key leave unknown of the place.
        """
        self.covariance[0, 0] += extra_sigma_m**2
        self.covariance[1, 1] += extra_sigma_m**2
        self.key_position_m = snapshot.position_m.copy()
        self.key_rotation = snapshot.rotation.copy()
        clone = np.zeros((6, SIZE))
        clone[0:3, POSITION] = clone[3:6, ROTATION] = np.eye(3)
        clone[0:3, VELOCITY] = np.eye(3) * -self.age_s(snapshot.stamp_ns)
        with_clone = np.eye(SIZE)
        with_clone[15:21] = clone
        self.covariance = with_clone @ self.covariance @ with_clone.T

    @property
    def yaw_rad(self) -> float:
        """The heading."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    def age_s(self, stamp_ns: int) -> float:
        """How long ago a stamp was, on the time of the IMU."""
        return seconds(self.stamp_ns - stamp_ns)

    def surprise(self, residual: Array, jacobian: Array, noise: Array) -> float:
        """The squared Mahalanobis length of a residual (m,), given (m, 21) and (m, m)."""
        spread = jacobian @ self.covariance @ jacobian.T + noise
        return float(residual @ np.linalg.solve(spread, residual))

    def correct(self, residual: Array, jacobian: Array, noise: Array) -> None:
        """Take a measurement in.

        Args:
            residual: measured minus expected, (m,).
            jacobian: of the measurement by the error state, (m, 21).
            noise: covariance of the measurement, (m, m).
        """
        cross = self.covariance @ jacobian.T
        gain = np.linalg.solve(jacobian @ cross + noise, cross.T).T
        self._inject(gain @ residual)
        covariance = self.covariance - gain @ cross.T
        self.covariance = 0.5 * (covariance + covariance.T)
        # Rounding may take a variance that is all but zero below it.
        diagonal = _diagonal_of(self.covariance)
        np.maximum(diagonal, 0.0, out=diagonal)

    def loosen(self, velocity_mps: float, rotation_rad: float = 0.0) -> None:
        """Know velocity and rotation less well, by these sigmas."""
        diagonal = _diagonal_of(self.covariance)
        diagonal[VELOCITY] += velocity_mps**2
        diagonal[ROTATION] += rotation_rad**2

    def _inject(self, error: Array) -> None:
        turn = rotation_by(error[ROTATION])
        self.position_m += error[POSITION]
        self.velocity_mps += error[VELOCITY]
        self.rotation = orthonormal(turn @ self.rotation)
        self.accel_bias_mps2 += error[ACCEL_BIAS]
        self.gyro_bias_radps += error[GYRO_BIAS]
        self.key_position_m += error[KEY_POSITION]
        self.key_rotation = rotation_by(error[KEY_ROTATION]) @ self.key_rotation
        ages_s = (self.stamp_ns - self._past_ns) * 1e-9
        self._past_position_m += error[POSITION] - ages_s[:, None] * error[VELOCITY]
        self._past_velocity_mps += error[VELOCITY]
        self._past_rotation = turn @ self._past_rotation

    def _remember(self) -> None:
        slot = self._steps % _HISTORY
        self._past_ns[slot] = self.stamp_ns
        self._past_position_m[slot] = self.position_m
        self._past_velocity_mps[slot] = self.velocity_mps
        self._past_rotation[slot] = self.rotation
        self._past_rate_radps[slot] = self.rate_radps
        self._steps += 1


def _diagonal_of(matrix: Array) -> Array:
    """A view of it, to be written to."""
    diagonal: Array = np.einsum("ii->i", matrix)
    return diagonal
