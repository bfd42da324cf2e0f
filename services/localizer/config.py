"""What a person may set of the localizer.

The noises are those of the sensors as the filter believes them, a little above the real ones:
what the model leaves out (vibration, JPEG, uneven ground) has to be covered too.
"""

from dataclasses import dataclass, fields

_MAY_BE_ZERO = ("start_x_m", "start_y_m", "start_yaw_rad", "flow_scale_noise")


@dataclass(frozen=True)
class Config:
    """The start, the sensors' noises, the gates and the limits of the status."""

    start_x_m: float = 0.0
    """Where the vehicle is set down: east."""
    start_y_m: float = 0.0
    """Where the vehicle is set down: north."""
    start_yaw_rad: float = 0.0
    """How the vehicle is set down; the compass wins where it contradicts this strongly."""
    start_sigma_m: float = 0.02
    """How well a person hits the mark."""
    start_yaw_sigma_rad: float = 0.03
    """How well a person aims the vehicle."""
    start_in_flight_sigma_m: float = 3.0
    """What is known of the place where a localizer finds itself when it starts in flight."""

    pose_rate_hz: float = 100.0
    """Poses published, on the time of the IMU."""

    accel_noise_mps2: float = 0.4
    """One sample of the accelerometer."""
    accel_bias_mps2: float = 0.1
    """The accelerometer's offset at start."""
    accel_bias_walk_mps2: float = 0.01
    """How much that offset wanders in a second."""
    gyro_noise_radps: float = 0.01
    """One sample of the gyroscope."""
    gyro_bias_radps: float = 0.02
    """The gyroscope's offset at start."""
    gyro_bias_walk_radps: float = 0.0005
    """How much that offset wanders in a second."""
    compass_noise_rad: float = 0.05
    """The heading of ten averaged samples of the magnetometer, disturbances included."""
    altimeter_noise_m: float = 0.02
    """One reading of the altimeter."""
    altimeter_jump_m: float = 0.15
    """Readings further than this from what is expected are not believed (tum_ardrone)."""
    flow_noise_px: float = 0.3
    """The picture's displacement against the key picture."""
    flow_scale_noise: float = 0.005
    """Share of the way from key picture to key picture that the filter cannot account for."""
    flow_rate_hz: float = 30.0
    """Pictures looked at; twice as many gain nothing and cost 3 % of a processor."""
    flow_corners: int = 60
    """Corners followed at most."""

    stale_s: float = 0.5
    """Without flow or altimeter for this long the pose is degraded."""
    flow_lost_s: float = 3.0
    """In flight without flow for this long the pose is lost."""
    degraded_position_sigma_m: float = 1.0
    """A place known less well than this is degraded."""
    lost_position_sigma_m: float = 5.0
    """A place known less well than this is lost."""
    lost_velocity_sigma_mps: float = 0.5
    """A speed known less well than this is lost."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name not in _MAY_BE_ZERO and not value > 0:
                raise ValueError(f"{field.name} must be above 0, not {value}")
        if not self.flow_corners >= 16:
            raise ValueError(f"flow_corners must be at least 16, not {self.flow_corners}")
        if not 50.0 <= self.pose_rate_hz <= 200.0:
            raise ValueError(f"pose_rate_hz must be 50 to 200, not {self.pose_rate_hz}")
