"""The sky: a dome in the colours of its corners, since to fetch texels would take twice as long."""

import math
from typing import Any

import numpy as np

from common.frames import Array
from services.sim import shaders
from services.sim.textures import CANVAS, noise

SIDES, RINGS = 120, 20
"""Of the dome; corners 3 deg apart let clouds look soft and hills rugged."""
_CORNERS = np.asarray([(-1.0, -1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)])
"""Of a picture: x, y and w in clip coordinates."""
_GROUND_ENDS_M = 100.0
"""From the eye at least, see ground.py."""
_RIM_RAD = math.pi / 4.0
"""Below the horizon, before SKY_VERTEX lays it on the edge of the ground."""
_SEED = 20210
_ZENITH, _HORIZON = np.asarray((0.22, 0.45, 0.78)), np.asarray(shaders.HAZE)
_CLOUD, _CLOUDED = np.asarray((1.0, 0.99, 0.97)), 0.85
_HILLS = ((0.047, (0.36, 0.48, 0.42)), (0.079, (0.55, 0.65, 0.72)))
"""How high near and far hills rise, in rad, and their colours."""


class Sky:
    """What is behind everything else.

    Args:
        gl: where it is drawn.
    """

    def __init__(self, gl: Any) -> None:
        corners, triangles = _dome()
        self.program = gl.program(shaders.SKY_VERTEX, shaders.SKY_FRAGMENT)
        self._vertices = gl.vertex_array(
            self.program,
            [(gl.buffer(corners.tobytes()), "3f 3f", "in_position", "in_colour")],
            gl.buffer(triangles.tobytes()),
        )

    def draw(self, eye: Array, from_world: Array) -> None:
        """Draw it where nothing else was drawn."""
        slope = max(float(eye[2]), 1.0) / _GROUND_ENDS_M
        rays = np.linalg.solve(from_world[[0, 1, 3], :3], _CORNERS.T)
        # Steeper than a slope is a convex cone: it holds the whole picture if it holds its corners.
        if (rays[2] < -slope * np.hypot(rays[0], rays[1])).all():
            return
        self.program["eye"] = tuple(eye)
        self.program["slope"] = slope
        self._vertices.render()


def _dome() -> tuple[Array, Array]:
    """Corners as rings upwards (N, 6: position, colour), and the triangles between them (M, 3)."""
    generator = np.random.default_rng(_SEED)
    clouds = noise(generator, 8, 5).astype(np.float64)
    near, far = (_ridge(generator, rise) for rise, _ in _HILLS)
    far = np.maximum(near, far)
    # Every corner of a ridge twice, below it and above it, for its edge to be sharp.
    rings = [(np.full(SIDES, -_RIM_RAD), near), (near, far)]
    parts = [
        (rises, np.tile(colour, (SIDES, 1)))
        for edges, (_, colour) in zip(rings, _HILLS, strict=True)
        for rises in edges
    ]
    for step in np.linspace(0.0, 1.0, RINGS):
        # Denser where colours change most.
        rises = far + (np.pi / 2.0 - far) * step**1.5
        parts.append((rises, _colours(rises, clouds)))
    rises = np.asarray([each for each, _ in parts])
    turns = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    positions = np.stack(
        [np.cos(rises) * np.cos(turns), np.cos(rises) * np.sin(turns), np.sin(rises)], axis=-1
    )
    corners = np.concatenate([positions, [each for _, each in parts]], axis=-1).reshape(-1, 6)
    numbers = np.arange(len(corners)).reshape(len(parts), SIDES)
    a, b = numbers[:-1], np.roll(numbers[:-1], -1, axis=1)
    d, c = numbers[1:], np.roll(numbers[1:], -1, axis=1)
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return corners.astype("f4"), triangles.astype("i4")


def _ridge(generator: np.random.Generator, rise_rad: float) -> Array:
    """How high hills rise all round, (SIDES,), in rad."""
    turns = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    waves = np.arange(3, 40)[:, None]
    phases = generator.uniform(0.0, 2.0 * np.pi, waves.shape)
    rugged = 1.0 + 0.5 * (np.sin(waves * turns + phases) / waves**0.9).sum(axis=0)
    return np.asarray(rise_rad * np.maximum(rugged, 0.25))


def _colours(rises_rad: Array, clouds: Array) -> Array:
    """Of the sky at these angles above the horizon all round, (SIDES, 3)."""
    up = (rises_rad / (np.pi / 2.0))[:, None]
    clear = _HORIZON + (_ZENITH - _HORIZON) * up**0.55
    # Clouds are drawn out along the horizon, as perspective has them.
    rows = np.asarray((1.0 - up[:, 0]) * (CANVAS // 2 - 1), int)
    columns = np.arange(SIDES) * CANVAS // SIDES
    cover = np.clip((clouds[rows, columns, None] - 0.55) * 3.2, 0.0, 1.0)
    # None at the horizon, and none at the zenith, where all columns meet.
    cover *= _CLOUDED * np.clip(up * 6.0, 0.0, 1.0) * np.clip((1.0 - up) * 3.0, 0.0, 1.0)
    colours: Array = clear + (_CLOUD - clear) * cover
    return colours
