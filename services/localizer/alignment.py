"""The start: level by gravity, turned by the mark and the compass, at the altimeter's height."""

import math
from statistics import median

import numpy as np
from scipy.spatial.transform import Rotation

from common.frames import wrap_angle
from common.messages import Imu
from services.localizer.compass import north_error
from services.localizer.config import Config
from services.localizer.filter import ErrorStateFilter, Noise

SAMPLES = 40
"""Averaged: 0.2 s."""
READINGS = 5
"""Of the altimeter; their median is the height, so that none can spoil it."""
HEIGHT_SIGMA_M = 1.0
"""Without readings."""
TILT_SIGMA_RAD = 0.02
SPEED_SIGMA_MPS = 0.05
FLYING_SPEED_SIGMA_MPS = 1.0
COMPASS_CONTRADICTS_RAD = 0.35
"""More than a person mis-aims and the compass is disturbed: 20 degrees."""


class Alignment:
    """Collects the first samples and readings.

    Args:
        config: where the vehicle is set down, and the sensors' noises.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._samples: list[Imu] = []
        self._heights_m: list[float] = []

    @property
    def height_m(self) -> float | None:
        """The median of the first readings, once there are enough."""
        return median(self._heights_m) if len(self._heights_m) == READINGS else None

    def add_height(self, height_m: float) -> None:
        """Take one of the first readings."""
        if len(self._heights_m) < READINGS:
            self._heights_m.append(height_m)

    def add(self, imu: Imu) -> int:
        """Take a sample; how many there are."""
        self._samples.append(imu)
        return len(self._samples)

    def start(self, in_flight: bool) -> ErrorStateFilter:
        """The filter at the time of the last sample.

        Args:
            in_flight: the vehicle was not set down on its mark: its place is a guess.
        """
        config = self._config
        force = np.mean([sample.linear_acceleration for sample in self._samples], axis=0)
        pitch = math.atan2(-force[0], math.hypot(force[1], force[2]))
        roll = math.atan2(force[1], force[2])
        level = Rotation.from_euler("ZYX", [0.0, pitch, roll])
        yaw, yaw_sigma = config.start_yaw_rad, config.start_yaw_sigma_rad
        field = np.mean([sample.magnetic_field for sample in self._samples], axis=0)
        compass = north_error(level.apply(field))
        if compass is not None and abs(wrap_angle(compass - yaw)) > COMPASS_CONTRADICTS_RAD:
            yaw, yaw_sigma = compass, config.compass_noise_rad
        place_sigma = config.start_in_flight_sigma_m if in_flight else config.start_sigma_m
        speed_sigma = FLYING_SPEED_SIGMA_MPS if in_flight else SPEED_SIGMA_MPS
        height_m = self.height_m
        height_sigma = HEIGHT_SIGMA_M if height_m is None else config.altimeter_noise_m
        return ErrorStateFilter(
            self._samples[-1].stamp,
            np.array([config.start_x_m, config.start_y_m, height_m or 0.0]),
            np.asarray((Rotation.from_euler("Z", yaw) * level).as_matrix()),
            np.array(
                [place_sigma, place_sigma, height_sigma]
                + [speed_sigma] * 3
                + [TILT_SIGMA_RAD, TILT_SIGMA_RAD, yaw_sigma]
                + [config.accel_bias_mps2] * 3
                + [config.gyro_bias_radps] * 3
            ),
            Noise(
                config.accel_noise_mps2,
                config.accel_bias_walk_mps2,
                config.gyro_noise_radps,
                config.gyro_bias_walk_radps,
            ),
        )
