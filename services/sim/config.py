"""What can be set on the simulator."""

from dataclasses import dataclass
from typing import Literal

import worlds
from common.messages import Plant
from services.sim.plants import PLANTS


@dataclass(frozen=True)
class Config:
    """Configuration of the simulator."""

    world: str = "track"
    """Where it starts: one of `autocomplete worlds`, or the path of a YAML file like those."""
    plant: Plant = "tum"
    """How the vehicle follows the stick."""
    seed: int = 0
    """Of all noise; the same seed and commands give the same flight."""
    clock: Literal["real", "lockstep"] = "real"
    """Real time, or steps that wait for the command of each 20 ms."""
    wind_mps: float = 0.0
    """Its steady part, 6 m above ground."""
    wind_from_deg: float = 270.0
    """Where it blows from, clockwise from north (+y): 270 is a west wind, along +x."""
    gusts: bool = True
    """Whether wind gusts (Dryden)."""
    battery: float = 1.0
    """What it starts with, 0 to 1."""
    ceiling_m: float = 30.0
    """It climbs no higher; the AR.Drone's driver has 4 m."""
    command_delay_s: float = 0.0
    """From a command's arrival to its effect; tum_ardrone reckons with 0.1 s."""
    sensor_delay_s: float = 0.0
    """From a sample to its message; tum_ardrone reckons with 0.04 s."""
    video_delay_s: float = 0.0
    """From a picture to its message; tum_ardrone reckons with 0.075 s."""
    command_noise: float = 1.0
    """Scale of the plant's noise on the sticks; 0 is none."""
    sensor_noise: float = 1.0
    """Scale of the sensors' noise; 0 is none."""
    renderer: Literal["auto", "gl", "tiny", "none"] = "auto"
    """What draws the pictures; auto is gl where there is OpenGL, else pybullet's TinyRenderer."""
    front_width: int = 640
    """Pixels."""
    front_height: int = 360
    """Pixels."""
    front_fps: float = 30.0
    """Pictures a second, at most 200."""
    front_view_deg: float = 81.0
    """Horizontal field of view; 81 deg is tum_simulator's."""
    down_width: int = 320
    """Pixels."""
    down_height: int = 240
    """Pixels."""
    down_fps: float = 60.0
    """Pictures a second, at most 200."""
    down_view_deg: float = 53.13
    """Horizontal field of view; the AR.Drone's lens has about 64 deg along the diagonal."""
    jpeg_quality: int = 80
    """Of the pictures, 1 to 100."""

    def __post_init__(self) -> None:
        try:
            worlds.load(self.world)
        except worlds.WorldError as error:
            raise ValueError(f"world: {error}") from None
        if self.plant not in PLANTS:
            raise ValueError(f"plant: no {self.plant!r}; there are {', '.join(PLANTS)}")
        if self.seed < 0:
            raise ValueError("seed: must be 0 or more")
        for name in ("command_noise", "sensor_noise"):
            if not 0.0 <= getattr(self, name) <= 10.0:
                raise ValueError(f"{name}: must lie in 0..10")
        if not 0.0 <= self.wind_mps <= 20.0:
            raise ValueError("wind_mps: must lie in 0..20")
        if not -360.0 <= self.wind_from_deg <= 360.0:
            raise ValueError("wind_from_deg: must lie in -360..360")
        if not 0.0 < self.battery <= 1.0:
            raise ValueError("battery: must lie above 0 and not above 1")
        if not 1.0 <= self.ceiling_m <= 100.0:
            raise ValueError("ceiling_m: must lie in 1..100")
        for name in ("command_delay_s", "sensor_delay_s", "video_delay_s"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name}: must lie in 0..1")
        for name in ("front_width", "front_height", "down_width", "down_height"):
            if not 16 <= getattr(self, name) <= 4096:
                raise ValueError(f"{name}: must lie in 16..4096 pixels")
        for name in ("front_fps", "down_fps"):
            if not 0.0 < getattr(self, name) <= 200.0:
                raise ValueError(f"{name}: must lie above 0 and not above 200")
        for name in ("front_view_deg", "down_view_deg"):
            if not 1.0 <= getattr(self, name) <= 150.0:
                raise ValueError(f"{name}: must lie in 1..150 deg")
        if not 1 <= self.jpeg_quality <= 100:
            raise ValueError("jpeg_quality: must lie in 1..100")
