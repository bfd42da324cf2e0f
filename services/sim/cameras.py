"""The vehicle's cameras, their lenses, and the pictures that they are asked for."""

import math
from dataclasses import dataclass, replace

from scipy.spatial.transform import Rotation

from common.camera import Lens, Mount
from services.sim.body import Quaternion, Vector3
from services.sim.build import ARDRONE, Build
from services.sim.config import Config, FrontLens, FrontSize
from worlds import Body

VIDEO_TOPICS = ("camera/front", "camera/down")

SIZES: dict[FrontSize, tuple[int, int]] = {
    "360p": (640, 360),
    "480p": (640, 480),
    "720p": (1280, 720),
}
_VIEWS_RAD: dict[FrontLens, float] = {
    "tum": math.radians(81.0),
    # As its maker states them, 73.5 x 58.5 deg, of a sensor of 4:3: at 16:9 it is 45.6 deg down.
    "ardrone": math.radians(73.5),
}
_MEASURED = Lens(640, 360, (569.9, 568.0, 331.4, 135.9), (-0.527, 0.274, 0.0, 0.0))
"""A real AR.Drone's front camera as ardrone_autonomy ships its calibration."""
_DOWN = Lens.of_view(320, 240, math.radians(53.13))
"""About 64 deg along the diagonal, as the AR.Drone's."""


@dataclass(frozen=True)
class Camera:
    """A camera of the vehicle.

    Attributes:
        topic: where its pictures go.
        lens: its size and projection.
        mount: its place in the body.
        fps: pictures a second.
        near_m: it sees nothing nearer; the nearer, the less it tells far things apart.
        exposure_s: how long the shutter is open: what moves meanwhile is smeared.
        noise: scale of a picture's noise.
        vehicle: whose it is, 0 for the first.
    """

    topic: str
    lens: Lens
    mount: Mount
    fps: float
    near_m: float = 0.08
    exposure_s: float = 0.0
    noise: float = 0.0
    vehicle: int = 0


@dataclass(frozen=True, slots=True)
class Figure:
    """A vehicle as others see it: its bodies in its own coordinates, and where it is."""

    look: tuple[Body, ...]
    position_m: Vector3
    orientation: Quaternion

    def bodies(self) -> list[Body]:
        """Its bodies in the world."""
        turn = Rotation.from_quat(self.orientation)
        places = turn.apply([body.position_m for body in self.look]) + self.position_m
        turns = (turn * Rotation.from_quat([body.orientation for body in self.look])).as_quat()
        return [
            replace(body, position_m=tuple(place), orientation=tuple(turned))
            for body, place, turned in zip(self.look, places.tolist(), turns.tolist(), strict=True)
        ]


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture to be taken: by which camera, when, and where the body is then.

    Attributes:
        topic: the camera's.
        stamp_ns: when the shutter closes.
        position_m: of the body, world.
        orientation: body to world, [x, y, z, w].
        velocity_mps: world.
        angular_velocity_radps: world.
        vehicle: whose camera, 0 for the first.
        others: the other vehicles, where the step left them in which the picture falls.
        seed: of its noise.
    """

    topic: str
    stamp_ns: int
    position_m: Vector3
    orientation: Quaternion
    velocity_mps: Vector3 = (0.0, 0.0, 0.0)
    angular_velocity_radps: Vector3 = (0.0, 0.0, 0.0)
    vehicle: int = 0
    others: tuple[Figure, ...] = ()
    seed: tuple[int, ...] = (0,)


def cameras_of(config: Config, vehicle: int = 0, build: Build = ARDRONE) -> tuple[Camera, Camera]:
    """A vehicle's cameras, front and down."""
    eyes = (config.exposure_s, config.picture_noise, vehicle)
    return (
        Camera("camera/front", front_lens(config), build.front, config.front_fps, 0.08, *eyes),
        # On the ground it is 25 mm above it.
        Camera("camera/down", _DOWN, build.down, config.down_fps, 0.01, *eyes),
    )


def front_lens(config: Config) -> Lens:
    """The front camera's lens at the size that is set."""
    width, height = SIZES[config.front_size]
    if config.front_lens != "measured":
        return Lens.of_view(width, height, _VIEWS_RAD[config.front_lens])
    scale = width / _MEASURED.width
    fx, fy, cx, cy = (scale * each for each in _MEASURED.intrinsics)
    # The taller picture of the same width shows more above and below.
    cy += (height - scale * _MEASURED.height) / 2.0
    return Lens(width, height, (fx, fy, cx, cy), _MEASURED.distortion)
