"""The shade of vehicles on the ground: a soft spot each, where the sun throws it.

So people see how high another vehicle flies. What stands in the world casts its true shadow once,
see ground.py; that of a vehicle moves, and a spot is all that costs next to nothing.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import moderngl
import numpy as np

from common.frames import Array
from services.sim import shaders
from services.sim.body import Vector3
from services.sim.cameras import Figure
from services.sim.crew import MOST
from services.sim.ground import PAINT_M
from services.sim.stage import Scene
from worlds import Body

DARKNESS = 0.5
"""In its middle, as in the shadow of what stands there."""
_VERTEX = f"""
#version 330
uniform mat4 from_world;
uniform float height_m;
in vec3 spot;
out vec2 off; out float darkest;
void main() {{
    // Wound so that it is seen from above.
    off = vec2(gl_VertexID % 2, gl_VertexID / 2) * 2.0 - 1.0;
    gl_Position = from_world * vec4(spot.xy + off * spot.z, height_m, 1.0);
    darkest = {DARKNESS} / (1.0 + {shaders.HAZE_PER_M} * gl_Position.w);
}}
"""
_FRAGMENT = """
#version 330
in vec2 off; in float darkest;
out vec4 bgra;
void main() { bgra = vec4(0.0, 0.0, 0.0, darkest * min(2.0 - 2.0 * dot(off, off), 1.0)); }
"""


class Shade:
    """The spots of vehicles.

    Args:
        gl: where they are drawn.
    """

    def __init__(self, gl: Any) -> None:
        self._program = gl.program(_VERTEX, _FRAGMENT)
        self._spots = gl.buffer(reserve=MOST * 3 * 4, dynamic=True)
        self._vertices = gl.vertex_array(self._program, [(self._spots, "3f/i", "spot")])

    def load(self, scene: Scene) -> None:
        """Lie on the paint of this scene from now on."""
        self._program["height_m"] = PAINT_M * (len(scene.strips) + 1)

    def draw(self, figures: Sequence[Figure], from_world: Array) -> None:
        """Draw those of these vehicles that are in sight.

        The ground and what stands on it are drawn already, and blending is on.

        Args:
            figures: vehicles; the camera's own is none of them.
            from_world: to clip coordinates, (4, 4).
        """
        if not figures:
            return
        spots = _in_sight([_spot_of(figure) for figure in figures], from_world)
        if spots:
            self._program["from_world"] = tuple(from_world.T.ravel())
            self._spots.write(np.asarray(spots, "f4").tobytes())
            self._vertices.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(spots))


def _spot_of(figure: Figure) -> Vector3:
    """Its middle (x, y) on the ground, and its radius."""
    x, y, z = figure.position_m
    east, north, up = shaders.SUN
    high = max(z, 0.0) / up
    return x - east * high, y - north * high, _radius_m(figure.look)


def _in_sight(spots: list[Vector3], from_world: Array) -> list[Vector3]:
    """Those that may be: to draw one that is not costs 50 us, to ask 1 us."""
    (ax, ay, az, a0), (bx, by, bz, b0), _, (wx, wy, wz, w0) = from_world.tolist()
    # How much farther from the middle of the view a metre around a place may reach.
    wide, high = math.hypot(ax, ay, az), math.hypot(bx, by, bz)
    deep = math.hypot(wx, wy, wz)
    seen = []
    for x, y, radius_m in spots:
        edge = wx * x + wy * y + w0 + deep * radius_m
        if (
            abs(ax * x + ay * y + a0) < edge + wide * radius_m
            and abs(bx * x + by * y + b0) < edge + high * radius_m
        ):
            seen.append((x, y, radius_m))
    return seen


def _radius_m(look: Iterable[Body]) -> float:
    """How far it reaches about its middle, whichever way its bodies lie."""
    return max(math.hypot(*body.position_m[:2]) + max(body.size_m) / 2.0 for body in look)
