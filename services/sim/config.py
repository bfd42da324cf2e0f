"""What can be set on the simulator."""

from dataclasses import dataclass
from typing import Literal

import worlds
from services.sim import plants
from services.sim.crew import crew_of

FrontSize = Literal["360p", "480p", "720p"]
FrontLens = Literal["tum", "ardrone", "measured"]


@dataclass(frozen=True)
class Config:
    """Configuration of the simulator."""

    world: str = "track"
    """Where it starts: one of `autocomplete worlds`, or the path of a YAML file like those."""
    plant: str = "tum"
    """What the vehicle is: tum, ardrone, rover, or a file of your own in services/sim/plants."""
    vehicles: int | str = 1
    """How many share the world; or a plant for each, as tum,ardrone,rover; NAME=PLANT names it."""
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
    front_size: FrontSize = "360p"
    """640x360; 480p is 640x480, 720p 1280x720."""
    front_lens: FrontLens = "tum"
    """tum: a pinhole of 81 deg across, as tum_simulator's. ardrone: 73.5 deg, as the drone's maker
    states it. measured: a real one with its distortion."""
    front_fps: float = 30.0
    """Pictures a second, at most 200."""
    down_fps: float = 60.0
    """Pictures a second, at most 200; they are 320x240."""
    exposure_s: float = 0.0
    """How long a shutter stays open, which smears what moves; a picture is then drawn 5 times."""
    picture_noise: float = 0.0
    """Scale of the noise of pixels and exposure; 0 is none."""
    jpeg_quality: int = 80
    """Of the pictures, 1 to 100."""

    def __post_init__(self) -> None:
        try:
            worlds.load(self.world)
        except worlds.WorldError as error:
            raise ValueError(f"world: {error}") from None
        try:
            plants.load(self.plant)
        except ValueError as error:
            raise ValueError(f"plant: {error}") from None
        try:
            for member in crew_of(self.vehicles, self.plant):
                plants.load(member.plant)
        except ValueError as error:
            raise ValueError(f"vehicles: {error}") from None
        if self.seed < 0:
            raise ValueError("seed: must be 0 or more")
        for name in ("command_noise", "sensor_noise", "picture_noise"):
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
        for name in ("front_fps", "down_fps"):
            if not 0.0 < getattr(self, name) <= 200.0:
                raise ValueError(f"{name}: must lie above 0 and not above 200")
        if not 0.0 <= self.exposure_s <= 0.05:
            raise ValueError("exposure_s: must lie in 0..0.05")
        if not 1 <= self.jpeg_quality <= 100:
            raise ValueError("jpeg_quality: must lie in 1..100")
