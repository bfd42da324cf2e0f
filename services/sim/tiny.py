"""Pictures by pybullet's TinyRenderer, for machines without OpenGL: plain colours, no sky, slow."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pybullet

from common.camera import Lens
from services.sim.body import Quaternion, Vector3
from services.sim.cameras import Camera, Figure, Shot
from services.sim.renderer import FAR_M, view_of
from services.sim.stage import Scene, add_visible
from services.sim.textures import Picture, paint
from worlds import Body, Texture

GROUND_SIDE_M = 60.0
_GROUND_PIXELS = 2000
_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""From the optical frame to OpenGL's camera frame: y up, looking along -z."""


_OUT_OF_SIGHT_M: Vector3 = (0.0, 0.0, -1000.0)
_UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class _Puppet:
    """What stands for a vehicle that looks so: its bodies' numbers in pybullet."""

    look: tuple[Body, ...]
    numbers: list[int]


class TinyRenderer:
    """Draws what cameras see, in a pybullet of its own, so that physics never waits for it."""

    name = "pybullet's TinyRenderer"

    def __init__(self) -> None:
        self._on = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        self._scratch = tempfile.TemporaryDirectory()
        self._puppets: list[_Puppet] = []
        self._colours: dict[Texture, tuple[float, ...]] = {}

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        pybullet.resetSimulation(**self._on)
        self._puppets.clear()
        for body in scene.bodies:
            add_visible(body, self._colour_of(body.texture), **self._on)
        half = GROUND_SIDE_M / 2.0
        ground = pybullet.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=(half, half, 0.01), **self._on
        )
        plan = Path(self._scratch.name) / "ground.png"
        cv2.imwrite(str(plan), _plan_of(scene))
        floor = pybullet.createMultiBody(
            0.0, -1, ground, basePosition=(0.0, 0.0, -0.01), **self._on
        )
        texture = pybullet.loadTexture(str(plan), **self._on)
        pybullet.changeVisualShape(floor, -1, textureUniqueId=texture, **self._on)

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR."""
        lens = camera.lens
        self._stage(shot.others)
        view, projection = matrices_of(camera, shot)
        pixels = pybullet.getCameraImage(
            lens.width,
            lens.height,
            view,
            projection,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            **self._on,
        )[2]
        picture = np.asarray(pixels, np.uint8).reshape(lens.height, lens.width, 4)
        return np.asarray(picture[..., 2::-1], np.uint8)

    def _stage(self, figures: tuple[Figure, ...]) -> None:
        """Put the other vehicles where they are.

        What was made for a picture is moved for the next one: pybullet keeps 2 kB of each body that
        is made and removed again.
        """
        idle = list(self._puppets)
        for figure in figures:
            bodies = figure.bodies()
            puppet = next((each for each in idle if each.look == figure.look), None)
            if puppet is None:
                numbers = [
                    add_visible(body, self._colour_of(body.texture), **self._on) for body in bodies
                ]
                self._puppets.append(_Puppet(figure.look, numbers))
                continue
            idle.remove(puppet)
            for number, body in zip(puppet.numbers, bodies, strict=True):
                self._move(number, body.position_m, body.orientation)
        for puppet in idle:
            for number in puppet.numbers:
                self._move(number, _OUT_OF_SIGHT_M, _UPRIGHT)

    def _move(self, number: int, position_m: Vector3, orientation: Quaternion) -> None:
        pybullet.resetBasePositionAndOrientation(number, position_m, orientation, **self._on)

    def _colour_of(self, texture: Texture) -> tuple[float, ...]:
        if texture not in self._colours:
            mean = paint(texture).picture.reshape(-1, 4).mean(axis=0) / 255.0
            self._colours[texture] = (*mean[:3].tolist(), 1.0)
        return self._colours[texture]

    def close(self) -> None:
        """Leave pybullet."""
        pybullet.disconnect(**self._on)
        self._scratch.cleanup()


def matrices_of(camera: Camera, shot: Shot) -> tuple[list[float], list[float]]:
    """View and projection as pybullet wants them (16 floats, column by column)."""
    _, eye, body_to_world = view_of(camera, shot)
    to_optical = np.eye(4)
    to_optical[:3, :3] = (body_to_world @ np.asarray(camera.mount.body_from_optical)).T
    to_optical[:3, 3] = -to_optical[:3, :3] @ eye
    view = _TO_OPENGL @ to_optical
    projection = _projection_of(camera.lens, camera.near_m)
    return view.T.ravel().tolist(), projection.T.ravel().tolist()


def _projection_of(lens: Lens, near_m: float) -> Any:
    fx, fy, cx, cy = lens.intrinsics
    depth = (FAR_M + near_m) / (near_m - FAR_M)
    # It samples pixels at their lower left corners, while OpenCV counts from their centres.
    return np.asarray(
        [
            [2.0 * fx / lens.width, 0.0, 1.0 - 2.0 * cx / lens.width, 0.0],
            [0.0, 2.0 * fy / lens.height, 2.0 * (cy + 1.0) / lens.height - 1.0, 0.0],
            [0.0, 0.0, depth, near_m * (depth - 1.0)],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def _plan_of(scene: Scene) -> Picture:
    """The ground from above as a picture: its texture, and the strips in their colours."""
    scale = _GROUND_PIXELS / GROUND_SIDE_M
    ground = paint(scene.ground)
    side = max(1, round((ground.width_m or 1.0) * scale))
    tile = cv2.resize(ground.picture[..., 2::-1], (side, side), interpolation=cv2.INTER_AREA)
    times = -(-_GROUND_PIXELS // side)
    plan = np.tile(tile, (times, times, 1))[:_GROUND_PIXELS, :_GROUND_PIXELS].copy()
    for strip in scene.strips:
        pixels = np.stack([strip.points_m[:, 0], -strip.points_m[:, 1]], axis=1) * scale
        colour = np.asarray(strip.colour[::-1]) * 255.0
        if strip.texture is not None:
            colour *= paint(strip.texture).picture[..., 2::-1].mean(axis=(0, 1)) / 255.0
        line = (pixels + _GROUND_PIXELS / 2.0).astype(np.int32)
        width = max(1, round(strip.width_m * scale))
        cv2.polylines(plan, [line], False, colour.tolist(), width)
    return np.asarray(plan, np.uint8)
