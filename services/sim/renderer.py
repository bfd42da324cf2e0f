"""Pictures by moderngl over EGL: on a graphics card, or on the processor by Mesa's llvmpipe.

The picture of a lens is exact at pixel centres as OpenCV counts them: the centre of the first pixel
is (0, 0). Row 0 is the top row.
"""

import ctypes
import os
from dataclasses import dataclass
from typing import Any, get_args

import cv2
import moderngl
import numpy as np

from common.camera import Lens
from common.frames import Array, rotation_of
from services.sim import meshes, shaders
from services.sim.cameras import Camera, Shot
from services.sim.stage import Scene
from services.sim.textures import PIXELS, Picture, paint, patches, sky
from worlds import Body, Texture

FAR_M = 400.0
PAINT_M = 0.003
"""Of each layer of paint on the ground, so that the upper hides the lower."""
SEE_THROUGH = frozenset({"fence"})
"""Textures with holes; they are drawn last."""
GROUND_SIDE_M = 600.0
SHADOW_PIXELS = 2048
MOST_FIGURES = 256
"""Bodies of vehicles of one shape that are drawn at once."""

LLVMPIPE_THREADS = "0"
"""The drawing thread rasterises itself: a tenth cheaper, and other services need the other core."""

_SIDES = np.asarray([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
_create_context: Any = moderngl.create_context


class NoOpenGlError(RuntimeError):
    """There is no OpenGL here."""


class GlRenderer:
    """Draws what cameras see; all calls from the thread that made it.

    Raises:
        NoOpenGlError: if there is no OpenGL.
    """

    def __init__(self) -> None:
        os.environ.setdefault("LP_NUM_THREADS", LLVMPIPE_THREADS)
        try:
            # moderngl's own types leave the members of a program open.
            self._gl: Any = _create_context(
                standalone=True, backend="egl", libgl="libGL.so.1", libegl="libEGL.so.1"
            )
            # moderngl holds Python's lock while it waits for pixels; ctypes lets it go.
            self._finish = ctypes.CDLL("libGL.so.1").glFinish
        except Exception as error:
            raise NoOpenGlError(str(error)) from error
        gl = self._gl
        # Rows are drawn top first, which mirrors the winding.
        gl.front_face = "cw"
        self._body_program = gl.program(shaders.BODY_VERTEX, shaders.BODY_FRAGMENT)
        self._shadow_program = gl.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT)
        self._ground_program = gl.program(shaders.GROUND_VERTEX, shaders.GROUND_FRAGMENT)
        self._sky_program = gl.program(shaders.SKY_VERTEX, shaders.SKY_FRAGMENT)
        self._meshes = {
            "box": gl.buffer(meshes.box().tobytes()),
            "cylinder": gl.buffer(meshes.cylinder().tobytes()),
            "sphere": gl.buffer(meshes.sphere().tobytes()),
        }
        self._sky = gl.vertex_array(
            self._sky_program,
            [(gl.buffer(meshes.dome().tobytes()), "3f 2f", "in_position", "in_uv")],
        )
        self._sky_texture = _texture_of(gl, sky())
        self._patches = _texture_of(gl, patches())
        self._patches.repeat_y = True
        corners = np.asarray([(-1, -1), (1, -1), (-1, 1), (1, 1)], "f4")
        self._patches_all_over = gl.vertex_array(
            gl.program(shaders.PATCHES_VERTEX, shaders.PATCHES_FRAGMENT),
            [(gl.buffer(corners.tobytes()), "2f", "corner")],
        )
        self._load_textures()
        # 11 floats a body, as in `_table`.
        tables = {
            shape: gl.buffer(reserve=MOST_FIGURES * 44, dynamic=True) for shape in self._meshes
        }
        self._figures = {
            shape: (tables[shape], self._drawn(mesh, tables[shape]))
            for shape, mesh in self._meshes.items()
        }
        self._targets: dict[Lens, tuple[Any, Picture]] = {}
        self._scene_objects: list[Any] = []

    @property
    def name(self) -> str:
        """What draws, for people."""
        return f"moderngl on {self._gl.info['GL_RENDERER']}"

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        for each in self._scene_objects:
            each.release()
        self._scene_objects = []
        self._load_bodies(scene.bodies)
        self._light(scene)
        self._load_ground(scene)

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR; overwritten by the camera's next one."""
        target, pixels = self._target_of(camera.lens)
        from_world, eye, _ = view_of(camera, shot)
        gl = self._gl
        target.use()
        gl.clear()
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for program in (self._body_program, self._ground_program, self._sky_program):
            program["from_world"] = tuple(from_world.T.ravel())
        self._textures.use(0)
        self._ground_light.use(1)
        away_m = self._away_m(eye, from_world)
        # Near to far, so that what is hidden is not painted.
        for flock in self._flocks:
            flock.draw(away_m, 1)
        if shot.others:
            self._draw_figures([body for other in shot.others for body in other.bodies()])
        gl.disable(moderngl.CULL_FACE)
        for height_m, (vertices, layer, tint, dash_m) in self._ground:
            self._ground_program["height_m"] = height_m
            self._ground_program["layer"] = layer
            self._ground_program["tint"] = tint
            self._ground_program["dash_m"] = dash_m
            vertices.render(moderngl.TRIANGLE_STRIP)
        self._sky_program["eye"] = tuple(eye)
        self._sky_texture.use(0)
        gl.depth_func = "<="
        self._sky.render()
        gl.depth_func = "<"
        self._textures.use(0)
        gl.enable(moderngl.CULL_FACE | moderngl.BLEND)
        for pane in self._panes:
            # Far to near, so that nets are seen through nets.
            pane.draw(away_m, -1)
        self._finish()
        target.read_into(pixels, components=3)
        return pixels

    def close(self) -> None:
        """Free everything."""
        self._gl.release()

    def _draw_figures(self, bodies: list[Body]) -> None:
        """Draw what moves; it casts no shadow on the ground."""
        for shape in self._meshes:
            alike = [body for body in bodies if body.shape == shape]
            for begin in range(0, len(alike), MOST_FIGURES):
                some = alike[begin : begin + MOST_FIGURES]
                buffer, vertices = self._figures[shape]
                buffer.orphan()
                buffer.write(_table(some, self._layers).tobytes())
                vertices.render(instances=len(some))

    def _target_of(self, lens: Lens) -> tuple[Any, Picture]:
        if lens not in self._targets:
            size = (lens.width, lens.height)
            target = self._gl.framebuffer(
                [self._gl.renderbuffer(size, 4)], self._gl.depth_renderbuffer(size)
            )
            self._targets[lens] = (target, np.empty((lens.height, lens.width, 3), np.uint8))
        return self._targets[lens]

    def _load_textures(self) -> None:
        """All of them, so that another world is there at once."""
        self._layers = {texture: index for index, texture in enumerate(get_args(Texture))}
        paints = [paint(texture) for texture in self._layers]
        # OpenGL's first row is the lowest.
        data = np.stack([each.picture[::-1] for each in paints])
        self._textures = self._gl.texture_array((PIXELS, PIXELS, len(paints)), 4, data.tobytes())
        self._textures.build_mipmaps()
        self._textures.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self._extent = np.zeros((shaders.MAX_LAYERS, 2))
        for index, each in enumerate(paints):
            self._extent[index] = (each.width_m or 0.0, each.height_m or 0.0)
        for program in (self._body_program, self._shadow_program):
            program["extent"] = [tuple(each) for each in self._extent]

    def _load_bodies(self, bodies: tuple[Body, ...]) -> None:
        self._flocks: list[_Flock] = []
        self._panes: list[_Flock] = []
        tables = [np.empty((0, 11), "f4")]
        begin = 0
        for flocks, is_pane in ((self._flocks, False), (self._panes, True)):
            for shape, mesh in self._meshes.items():
                alike = [
                    body
                    for body in bodies
                    if body.shape == shape and (body.texture in SEE_THROUGH) == is_pane
                ]
                if not alike:
                    continue
                table = _table(alike, self._layers)
                buffer = self._gl.buffer(table.tobytes(), dynamic=True)
                drawn, shadow = self._drawn(mesh, buffer), self._shadowing(mesh, buffer)
                rows = slice(begin, begin + len(table))
                flocks.append(_Flock(table, rows, buffer, drawn, shadow))
                self._scene_objects += [drawn, shadow, buffer]
                tables.append(table)
                begin += len(table)
        whole = np.concatenate(tables).astype(np.float64)
        self._centres_m = whole[:, :3]
        self._radii_m = 0.5 * np.linalg.norm(whole[:, 7:10], axis=1)

    def _away_m(self, eye: Array, from_world: Array) -> Array:
        """How far each body is from the eye, (N,); infinitely if it is out of sight."""
        # A plane of the view's pyramid is a sum of rows of the matrix; its normal is not of unit.
        sides = from_world[3] + _SIDES @ from_world[:2]
        lengths = np.linalg.norm(sides[:, :3], axis=1)
        inside = (self._centres_m @ sides[:, :3].T + sides[:, 3]) / lengths
        seen = (inside > -self._radii_m[:, None]).all(axis=1)
        return np.where(seen, np.linalg.norm(self._centres_m - eye, axis=1), np.inf)

    def _drawn(self, mesh: Any, table: Any) -> Any:
        names = ("in_position", "in_normal", "in_uv", "in_across", "in_up")
        return self._gl.vertex_array(
            self._body_program,
            [
                (mesh, "3f 3f 2f 3f 3f", *names),
                (table, "3f 4f 3f 1f/i", "at", "turn", "size", "layer"),
            ],
        )

    def _shadowing(self, mesh: Any, table: Any) -> Any:
        return self._gl.vertex_array(
            self._shadow_program,
            [
                (mesh, "3f 3x4 2f 3f 3f", "in_position", "in_uv", "in_across", "in_up"),
                (table, "3f 4f 3f 1f/i", "at", "turn", "size", "layer"),
            ],
        )

    def _light(self, scene: Scene) -> None:
        """Paint the light on the ground: the sun's shadows, and patches that hide repetition.

        Once is enough, since nothing that casts a shadow moves.
        """
        gl = self._gl
        reach = [
            (body.position_m[0] + s * r - k * h, body.position_m[1] + t * r - j * h)
            for body in scene.bodies
            for r in [max(body.size_m)]
            for h in [body.position_m[2] + r]
            for s, t in ((1, 1), (-1, -1))
            for k, j in (
                (0.0, 0.0),
                (shaders.SUN[0] / shaders.SUN[2], shaders.SUN[1] / shaders.SUN[2]),
            )
        ] or [(0.0, 0.0)]
        low, high = np.min(reach, axis=0) - 1.0, np.max(reach, axis=0) + 1.0
        window = np.asarray([*low, *(1.0 / (high - low))], "f4")
        shadows = gl.texture((SHADOW_PIXELS, SHADOW_PIXELS), 1)
        target = gl.framebuffer([shadows])
        target.use()
        gl.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        self._patches.use(0)
        self._patches_all_over.render(moderngl.TRIANGLE_STRIP)
        self._shadow_program["window"] = tuple(window)
        self._textures.use(0)
        gl.enable(moderngl.BLEND)
        gl.blend_equation = moderngl.MIN
        for flock in self._flocks + self._panes:
            flock.shadow.render(instances=len(flock.table))
        gl.blend_equation = moderngl.FUNC_ADD
        target.release()
        shadows.build_mipmaps()
        shadows.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        shadows.repeat_x = shadows.repeat_y = False
        self._ground_light = shadows
        self._ground_program["window"] = tuple(window)
        self._ground_program["light"] = 1
        self._scene_objects.append(shadows)

    def _load_ground(self, scene: Scene) -> None:
        half = GROUND_SIDE_M / 2.0
        corners = np.asarray([(-half, -half), (half, -half), (-half, half), (half, half)])
        layers_up: list[tuple[Any, float, tuple[float, float, float], float]] = []

        def add(
            points: Array,
            uv_m: Array,
            texture: Texture | None,
            tint: tuple[float, float, float],
            dash_m: float | None,
        ) -> None:
            layer = -1 if texture is None else self._layers[texture]
            step_m = self._extent[layer] if texture is not None else np.ones(2)
            data = np.hstack([points, uv_m / np.where(step_m > 0.0, step_m, 1.0)]).astype("f4")
            buffer = self._gl.buffer(data.tobytes())
            vertices = self._gl.vertex_array(
                self._ground_program, [(buffer, "2f 2f", "in_position", "in_uv")]
            )
            layers_up.append((vertices, float(layer), tint, dash_m or 0.0))
            self._scene_objects.extend([vertices, buffer])

        add(corners, corners, scene.ground, (1.0, 1.0, 1.0), None)
        for strip in scene.strips:
            points, along_m = meshes.ribbon(strip)
            # A texture lies flat on the world, so that it bends and stretches nowhere.
            uv_m = along_m if strip.texture is None else points
            add(points, uv_m, strip.texture, strip.colour, strip.dash_m)
        # Top paint first and a little higher, so that it hides what is under it from painting.
        self._ground = [(PAINT_M * up, each) for up, each in enumerate(layers_up)][::-1]


@dataclass(frozen=True, eq=False)
class _Flock:
    """Bodies of one shape, drawn at once: a row of the table each, and its copy in OpenGL.

    Attributes:
        table: see `_table`.
        rows: which of all bodies they are.
        buffer: the table's copy.
        vertices: draws it.
        shadow: draws its shadows.
    """

    table: Array
    rows: slice
    buffer: Any
    vertices: Any
    shadow: Any

    def draw(self, away_m: Array, order: int) -> None:
        """Draw those in sight, the nearest first (order 1) or last (-1)."""
        away_m = away_m[self.rows]
        nearest = np.argsort(away_m)[: np.count_nonzero(np.isfinite(away_m))]
        if len(nearest):
            self.buffer.write(self.table[nearest[::order]].tobytes())
            self.vertices.render(instances=len(nearest))


def view_of(camera: Camera, shot: Shot) -> tuple[Array, Array, Array]:
    """World to clip coordinates (4, 4), the eye's place (3,), and body to world (3, 3)."""
    lens, mount, near_m = camera.lens, camera.mount, camera.near_m
    body_to_world = rotation_of(shot.orientation)
    eye = np.asarray(shot.position_m) + body_to_world @ np.asarray(mount.position_m)
    to_optical = np.eye(4)
    to_optical[:3, :3] = (body_to_world @ np.asarray(mount.body_from_optical)).T
    to_optical[:3, 3] = -to_optical[:3, :3] @ eye
    fx, fy, cx, cy = lens.intrinsics
    depth = (FAR_M + near_m) / (FAR_M - near_m)
    clip = np.asarray(
        [
            [2.0 * fx / lens.width, 0.0, (2.0 * cx + 1.0) / lens.width - 1.0, 0.0],
            [0.0, 2.0 * fy / lens.height, (2.0 * cy + 1.0) / lens.height - 1.0, 0.0],
            [0.0, 0.0, depth, -near_m * (1.0 + depth)],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )
    return clip @ to_optical, eye, body_to_world


def _texture_of(gl: Any, picture: Picture) -> Any:
    height, width, channels = picture.shape
    texture = gl.texture((width, height), channels, np.ascontiguousarray(picture).tobytes())
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_y = False
    return texture


def _table(bodies: list[Body], layers: dict[Texture, int]) -> Array:
    """One row a body: place, turn, size, layer."""
    rows = [
        (*body.position_m, *body.orientation, *body.size_m, layers[body.texture]) for body in bodies
    ]
    return np.asarray(rows, "f4").reshape(-1, 11)


def jpeg_of(picture: Picture, quality: int) -> bytes:
    """A BGR picture as JPEG."""
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError("the picture cannot be encoded")
    return data.tobytes()
