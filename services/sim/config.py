"""What can be set on the simulator."""

from dataclasses import dataclass
from typing import Literal

import worlds

PLANTS = ("tum",)
"""The plants that are built."""


@dataclass(frozen=True)
class Config:
    """Configuration of the simulator."""

    world: str = "track"
    """Where it starts: one of the files under worlds/."""
    plant: str = "tum"
    """How the vehicle follows the stick."""
    seed: int = 0
    """Of all noise; the same seed and commands give the same flight."""
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
        if self.world not in worlds.names():
            raise ValueError(f"world: no {self.world!r}; there are {', '.join(worlds.names())}")
        if self.plant not in PLANTS:
            raise ValueError(f"plant: no {self.plant!r}; there is {', '.join(PLANTS)}")
        if self.seed < 0:
            raise ValueError("seed: must be 0 or more")
        for name in ("command_noise", "sensor_noise"):
            if not 0.0 <= getattr(self, name) <= 10.0:
                raise ValueError(f"{name}: must lie in 0..10")
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
