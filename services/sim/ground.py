"""The ground: its textures, the paint on it, and the light that falls on it."""

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np

from common.frames import Array
from services.sim import meshes, shaders
from services.sim.stage import Scene
from services.sim.textures import paint, patches
from worlds import Strip, Texture

PAINT_M = 0.003
"""Of each layer of paint, so that the upper hides the lower."""
SIDE_M = 600.0
"""What is drawn of it: it has no end, so it goes along with the camera."""
STEP_M = 100.0
"""How far it goes at once; within half of that around the world's middle it lies still."""
LIGHT_PIXELS = 2048
"""2 to 3 cm each where a world is 60 m wide, so that the nearest one is enough: to blend four costs
a quarter of the ground, and more of them no longer fit in a cache."""

_Layer = tuple[Any, Any, Any, dict[str, Any]]
"""Of the ground: what draws it, its vertices, its texture if it has one, its uniforms."""


class Ground:
    """A plane with layers of paint, in the light of the sun.

    Args:
        gl: where it is drawn.
        textures: what it is made of.
    """

    def __init__(self, gl: Any, textures: dict[Texture, Any]) -> None:
        self._gl = gl
        self._textures = textures
        self.textured = gl.program(shaders.GROUND_VERTEX, shaders.GROUND_FRAGMENT)
        self.painted = gl.program(shaders.PAINT_VERTEX, shaders.PAINT_FRAGMENT)
        for program in (self.textured, self.painted):
            program["light"] = 1
        # OpenGL's texture of one channel.
        pixels = patches()
        self._patches = gl.texture(pixels.shape[1::-1], 1, pixels.tobytes())
        corners = np.asarray([(-1, -1), (1, -1), (-1, 1), (1, 1)], "f4")
        self._patches_all_over = gl.vertex_array(
            gl.program(shaders.PATCHES_VERTEX, shaders.PATCHES_FRAGMENT),
            [(gl.buffer(corners.tobytes()), "2f", "corner")],
        )
        self._light = gl.texture((LIGHT_PIXELS, LIGHT_PIXELS), 1)
        self._light.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._light.repeat_x = self._light.repeat_y = False
        # One for all scenes: another framebuffer is made while the last one is bound, which must
        # not have been released.
        self._sunlit = gl.framebuffer([self._light])
        self._scene_objects: list[Any] = []

    def load(self, scene: Scene, cast_shadows: Callable[[Array], None]) -> None:
        """Draw the ground of this scene from now on.

        Args:
            scene: what stands on it, and what is painted on it.
            cast_shadows: draws the scene's shadows into a window of the ground (its corner, and 1
                over its sides).
        """
        for each in self._scene_objects:
            each.release()
        self._scene_objects = []
        self._light_up(_window_of(scene), cast_shadows)
        half = SIDE_M / 2.0
        corners = np.asarray([(-half, -half), (half, -half), (-half, half), (half, half)])
        layers_up = [self._laid(corners, scene.ground)]
        self._endless = layers_up[0]
        for strip in scene.strips:
            points, along_m = meshes.ribbon(strip)
            if strip.texture is None:
                layers_up.append(self._dabbed(points, along_m, strip))
            else:
                layers_up.append(self._laid(points, strip.texture))
        # Top paint first and a little higher, so that it hides what is under it from painting.
        self._layers_down = [(PAINT_M * up, each) for up, each in enumerate(layers_up)][::-1]

    def draw(self, eye: Array) -> None:
        """Draw it as it is seen from a place in the world, (3,)."""
        self._light.use(1)
        moved_m = tuple(np.round(eye[:2] / STEP_M) * STEP_M)
        for height_m, layer in self._layers_down:
            program, vertices, paving, look = layer
            program["height_m"] = height_m
            program["moved_m"] = moved_m if layer is self._endless else (0.0, 0.0)
            if paving is not None:
                paving.use(0)
            for name, value in look.items():
                program[name] = value
            vertices.render(moderngl.TRIANGLE_STRIP)

    def _light_up(self, window: Array, cast_shadows: Callable[[Array], None]) -> None:
        """Paint the sun's shadows, and patches of light that hide the textures' repetition.

        Once is enough, since nothing that casts a shadow moves.
        """
        gl = self._gl
        self._sunlit.use()
        gl.enable_only(moderngl.NOTHING)
        self._patches.use(0)
        self._patches_all_over.render(moderngl.TRIANGLE_STRIP)
        gl.enable(moderngl.BLEND)
        gl.blend_equation = moderngl.MIN
        cast_shadows(window)
        gl.blend_equation = moderngl.FUNC_ADD
        for program in (self.textured, self.painted):
            program["window"] = tuple(window)

    def _laid(self, points: Array, texture: Texture) -> _Layer:
        """A layer of a texture, which lies flat on the world: it bends and stretches nowhere."""
        painted = paint(texture)
        per_m = (1.0 / (painted.width_m or 1.0), 1.0 / (painted.height_m or 1.0))
        vertices = self._vertices(self.textured, points, "2f", "in_position")
        return self.textured, vertices, self._textures[texture], {"per_m": per_m}

    def _dabbed(self, points: Array, along_m: Array, strip: Strip) -> _Layer:
        """A layer of plain paint."""
        data = np.hstack([points, along_m[:, :1]])
        vertices = self._vertices(self.painted, data, "2f 1f", "in_position", "in_along_m")
        dashes_per_m = 0.5 / strip.dash_m if strip.dash_m else 0.0
        look = {"tint": strip.colour, "dashes_per_m": dashes_per_m}
        return self.painted, vertices, None, look

    def _vertices(self, program: Any, data: Array, layout: str, *names: str) -> Any:
        buffer = self._gl.buffer(data.astype("f4").tobytes())
        vertices = self._gl.vertex_array(program, [(buffer, layout, *names)])
        self._scene_objects += [vertices, buffer]
        return vertices


def _window_of(scene: Scene) -> Array:
    """What holds all bodies and their shadows: a corner (x, y), and 1 over its sides."""
    east, north = -shaders.SUN[0] / shaders.SUN[2], -shaders.SUN[1] / shaders.SUN[2]
    reach = [
        (x + side * size + east * height, y + side * size + north * height)
        for body in scene.bodies
        for x, y, z in [body.position_m]
        for size in [max(body.size_m)]
        for height in (0.0, z + size)
        for side in (1.0, -1.0)
    ] or [(0.0, 0.0)]
    low, high = np.min(reach, axis=0) - 1.0, np.max(reach, axis=0) + 1.0
    return np.concatenate([low, 1.0 / (high - low)])
