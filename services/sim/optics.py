"""What a real camera makes of a scene: a lens that bends, a shutter that stays open, noise."""

from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from common.camera import Lens
from common.frames import Array
from services.sim.cameras import Camera, Shot
from services.sim.stage import Scene
from services.sim.textures import Picture

BLUR_DRAWS = 5
"""Pictures that are averaged into a smeared one."""
GAIN_NOISE = 0.04
"""How much brighter or darker than it should the exposure control makes a picture, as a sigma."""
PIXEL_NOISE = 3.0
"""The sigma of a pixel in the dark, in levels of 255; of a white one it is twice that."""
_TILE = 256


class Renderer(Protocol):
    """Draws pictures of a scene."""

    @property
    def name(self) -> str:
        """What draws, for people."""
        ...

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        ...

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR by a pinhole; the next but one may overwrite it."""
        ...

    def close(self) -> None:
        """Free everything."""
        ...


def picture_of(renderer: Renderer, camera: Camera, shot: Shot) -> Picture:
    """The picture (height, width, 3) in BGR as the camera takes it."""
    return noisy(exposed(renderer, camera, shot), camera, shot)


def exposed(renderer: Renderer, camera: Camera, shot: Shot) -> Picture:
    """The picture (height, width, 3) in BGR as it falls through lens and shutter.

    It may be overwritten by the next but one of its lens.
    """
    if camera.exposure_s == 0.0:
        return _bent(renderer, camera, shot)
    total: Any = 0
    for share in np.linspace(0.0, 1.0, BLUR_DRAWS):
        earlier = _earlier(shot, float(share) * camera.exposure_s)
        total = total + _bent(renderer, camera, earlier).astype(np.uint16)
    return np.asarray(total // BLUR_DRAWS, np.uint8)


def _earlier(shot: Shot, before_s: float) -> Shot:
    """The shot some time before."""
    x, y, z = (p - before_s * v for p, v in zip(shot.position_m, shot.velocity_mps, strict=True))
    back = Rotation.from_rotvec(-before_s * np.asarray(shot.angular_velocity_radps))
    qx, qy, qz, qw = (back * Rotation.from_quat(shot.orientation)).as_quat().tolist()
    return replace(shot, position_m=(x, y, z), orientation=(qx, qy, qz, qw))


def _bent(renderer: Renderer, camera: Camera, shot: Shot) -> Picture:
    """By a pinhole that sees a little more, bent as the lens bends."""
    if not any(camera.lens.distortion):
        return renderer.draw(camera, shot)
    pinhole, columns, rows = _bending(camera.lens)
    wide = renderer.draw(replace(camera, lens=pinhole), shot)
    return np.asarray(cv2.remap(wide, columns, rows, cv2.INTER_LINEAR), np.uint8)


@lru_cache(maxsize=4)
def _bending(lens: Lens) -> tuple[Lens, Any, Any]:
    """A pinhole whose picture holds that of the lens, and where in it each pixel comes from."""
    fx, fy, cx, cy = lens.intrinsics
    columns, rows = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    bent = np.stack([(columns - cx) / fx, (rows - cy) / fy], axis=-1)
    off_axis = np.linalg.norm(bent, axis=-1)
    straight = _unbent(off_axis, *lens.distortion[:2])
    rays = bent * (straight / np.maximum(off_axis, 1e-12))[..., None]
    low, high = rays.min(axis=(0, 1)), rays.max(axis=(0, 1))
    width, height = (int(each) for each in np.ceil((high - low) * (fx, fy)) + 3.0)
    pinhole = Lens(width, height, (fx, fy, 1.0 - low[0] * fx, 1.0 - low[1] * fy))
    places = (rays * (fx, fy) + pinhole.intrinsics[2:]).astype(np.float32)
    whole, fraction = cv2.convertMaps(places[..., 0], places[..., 1], cv2.CV_16SC2)
    return pinhole, whole, fraction


def _unbent(bent: Array, k1: float, k2: float) -> Array:
    """Distances from the axis before a lens bent them, by Newton's method."""
    r = bent.copy()
    for _ in range(20):
        square = r * r
        error = r * (1.0 + k1 * square + k2 * square * square) - bent
        r -= error / (1.0 + 3.0 * k1 * square + 5.0 * k2 * square * square)
    return r


def noisy(picture: Picture, camera: Camera, shot: Shot) -> Picture:
    """With a gain that is off, and noise that grows with the light, if the camera has any."""
    scale = camera.noise
    if scale == 0.0:
        return picture
    generator = np.random.default_rng(shot.seed)
    gain = 1.0 + scale * GAIN_NOISE * generator.standard_normal()
    height, width = picture.shape[:2]
    # One tile, begun anywhere and repeated: drawing a million numbers a picture takes 10 ms.
    begin = generator.integers(0, _TILE, 2)
    tile = np.roll(_tile(), tuple(begin), axis=(0, 1))
    grain = np.tile(tile, (-(-height // _TILE), -(-width // _TILE), 1))[:height, :width]
    levels = np.arange(256, dtype=np.float32)
    sigma = scale * PIXEL_NOISE * np.sqrt(1.0 + 3.0 * levels / 255.0)
    noise = cv2.multiply(grain, cv2.LUT(picture, sigma))
    bright = cv2.addWeighted(picture, gain, noise, 1.0, 0.0, dtype=cv2.CV_8U)
    return np.asarray(bright, np.uint8)


@lru_cache(maxsize=1)
def _tile() -> Any:
    return np.random.default_rng(0).standard_normal((_TILE, _TILE, 3), dtype=np.float32)
