"""Pictures by moderngl over EGL: on a graphics card, or on the processor by Mesa's llvmpipe.

The picture of a lens is exact at pixel centres as OpenCV counts them: the centre of the first pixel
is (0, 0). Row 0 is the top row.
"""

import ctypes
import math
import os
from typing import Any

import cv2
import moderngl
import numpy as np

from common.camera import Lens, Mount
from common.frames import Array, rotation_of
from services.sim.core import Camera, Shot
from services.sim.stage import Scene
from services.sim.textures import PIXELS, Picture, paint, sky
from worlds import Body, Strip, Texture

NEAR_M, FAR_M = 0.05, 400.0
GROUND_SIDE_M = 600.0
SHADOW_PIXELS = 2048
_SUN = np.asarray((-0.42, -0.33, 0.845))
"""Towards it, world."""
_CYLINDER_SIDES, _SPHERE_RINGS = 24, 12

# Rasterising threads of llvmpipe beside the drawing thread.
LLVMPIPE_THREADS = "1"

_COMMON = """
#version 330
const vec3 SUN = vec3(-0.42, -0.33, 0.845);
const vec3 HAZE = vec3(0.78, 0.87, 0.93);
vec3 hazy(vec3 colour, float distance_m) {
    return mix(HAZE, colour, exp(-distance_m * 0.006));
}
"""

_BODY_VERTEX = (
    _COMMON
    + """
uniform mat4 from_world;
uniform vec3 eye;
uniform vec2 extent[16];
in vec3 in_position; in vec3 in_normal; in vec2 in_uv; in vec3 in_across; in vec3 in_up;
in vec3 at; in vec4 turn; in vec3 size; in float layer;
out vec3 uv; out float light; out float distance_m;
vec3 turned(vec3 v) { return v + 2.0 * cross(turn.xyz, cross(turn.xyz, v) + turn.w * v); }
void main() {
    vec3 world = at + turned(in_position * size);
    vec3 normal = normalize(turned(in_normal / size));
    float sun = max(dot(normal, SUN), 0.0);
    light = 0.50 + 0.12 * normal.z + 0.58 * sun;
    vec2 metres = vec2(dot(abs(in_across), size), dot(abs(in_up), size));
    vec2 step_m = extent[int(layer)];
    vec2 repeats = vec2(step_m.x > 0.0 ? metres.x / step_m.x : 1.0,
                        step_m.y > 0.0 ? metres.y / step_m.y : 1.0);
    uv = vec3(in_uv * repeats, layer);
    distance_m = distance(world, eye);
    gl_Position = from_world * vec4(world, 1.0);
}
"""
)
_BODY_FRAGMENT = (
    _COMMON
    + """
uniform sampler2DArray textures;
in vec3 uv; in float light; in float distance_m;
out vec4 bgra;
void main() {
    vec4 texel = texture(textures, uv);
    if (texel.a < 0.02) discard;
    bgra = vec4(hazy(texel.rgb * light, distance_m).bgr, texel.a);
}
"""
)
_SHADOW_VERTEX = (
    _COMMON
    + """
uniform vec4 window;
in vec3 in_position; in vec2 in_uv; in vec3 in_across; in vec3 in_up;
in vec3 at; in vec4 turn; in vec3 size; in float layer;
uniform vec2 extent[16];
out vec3 uv;
vec3 turned(vec3 v) { return v + 2.0 * cross(turn.xyz, cross(turn.xyz, v) + turn.w * v); }
void main() {
    vec3 world = at + turned(in_position * size);
    vec2 fallen = world.xy - SUN.xy / SUN.z * max(world.z, 0.0);
    vec2 metres = vec2(dot(abs(in_across), size), dot(abs(in_up), size));
    vec2 step_m = extent[int(layer)];
    uv = vec3(in_uv * vec2(step_m.x > 0.0 ? metres.x / step_m.x : 1.0,
                           step_m.y > 0.0 ? metres.y / step_m.y : 1.0), layer);
    gl_Position = vec4((fallen - window.xy) * window.zw * 2.0 - 1.0, 0.0, 1.0);
}
"""
)
_SHADOW_FRAGMENT = """
#version 330
uniform sampler2DArray textures;
in vec3 uv;
out float shade;
void main() { shade = 1.0 - 0.55 * textureLod(textures, uv, 2.0).a; }
"""
_GROUND_VERTEX = (
    _COMMON
    + """
uniform mat4 from_world;
uniform vec3 eye;
uniform vec4 window;
in vec2 in_position; in vec2 in_uv;
out vec2 uv; out vec2 shadow_uv; out float distance_m;
void main() {
    vec3 world = vec3(in_position, 0.0);
    uv = in_uv;
    shadow_uv = (in_position - window.xy) * window.zw;
    distance_m = distance(world, eye);
    gl_Position = from_world * vec4(world, 1.0);
}
"""
)
_GROUND_FRAGMENT = (
    _COMMON
    + """
uniform sampler2DArray textures;
uniform sampler2D shadows;
uniform float layer;
uniform vec3 tint;
uniform float dash_m;
in vec2 uv; in vec2 shadow_uv; in float distance_m;
out vec4 bgra;
void main() {
    if (dash_m > 0.0 && fract(uv.x / (2.0 * dash_m)) > 0.5) discard;
    vec3 colour = vec3(0.8 + 0.2 * texture(textures, vec3(uv, max(layer, 0.0))).g);
    if (layer >= 0.0) {
        colour = texture(textures, vec3(uv, layer)).rgb;
        // The same texture enlarged breaks up its own repetition.
        colour *= 0.62 + 0.9 * texture(textures, vec3(uv * 0.137 + 0.31, layer)).g;
    }
    colour *= tint * texture(shadows, shadow_uv).r * 1.08;
    bgra = vec4(hazy(colour, distance_m).bgr, 1.0);
}
"""
)
_SKY_VERTEX = """
#version 330
uniform mat4 from_world;
uniform vec3 eye;
in vec3 in_position; in vec2 in_uv;
out vec2 uv;
void main() {
    uv = in_uv;
    gl_Position = (from_world * vec4(eye + in_position * 100.0, 1.0)).xyww;
}
"""
_SKY_FRAGMENT = """
#version 330
uniform sampler2D picture;
in vec2 uv;
out vec4 bgra;
void main() { bgra = vec4(texture(picture, uv).bgr, 1.0); }
"""


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
            self._gl: Any = moderngl.create_context(
                standalone=True, backend="egl", libgl="libGL.so.1", libegl="libEGL.so.1"
            )
            # moderngl holds Python's lock while it waits for pixels; ctypes lets it go.
            self._finish = ctypes.CDLL("libGL.so.1").glFinish
        except Exception as error:
            raise NoOpenGlError(str(error)) from error
        gl = self._gl
        # Rows are drawn top first, which mirrors the winding.
        gl.front_face = "cw"
        self._body_program = gl.program(_BODY_VERTEX, _BODY_FRAGMENT)
        self._shadow_program = gl.program(_SHADOW_VERTEX, _SHADOW_FRAGMENT)
        self._ground_program = gl.program(_GROUND_VERTEX, _GROUND_FRAGMENT)
        self._sky_program = gl.program(_SKY_VERTEX, _SKY_FRAGMENT)
        self._meshes = {
            "box": gl.buffer(_box().tobytes()),
            "cylinder": gl.buffer(_cylinder().tobytes()),
            "sphere": gl.buffer(_sphere().tobytes()),
        }
        self._sky = gl.vertex_array(
            self._sky_program,
            [(gl.buffer(_dome().tobytes()), "3f 2f", "in_position", "in_uv")],
        )
        self._sky_texture = _texture_of(gl, sky())
        self._targets: dict[Lens, tuple[Any, Picture]] = {}
        self._scene_objects: list[Any] = []

    @property
    def name(self) -> str:
        """What draws, for people."""
        return f"moderngl on {self._gl.info['GL_RENDERER']}"

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        gl = self._gl
        for each in self._scene_objects:
            each.release()
        self._scene_objects = []
        used = {body.texture for body in scene.bodies} | {scene.ground}
        used |= {strip.texture for strip in scene.strips if strip.texture is not None}
        layers = {texture: index for index, texture in enumerate(sorted(used))}
        self._load_textures(layers)
        self._load_bodies(scene.bodies, layers)
        self._cast_shadows(scene)
        self._load_ground(scene, layers)
        gl.gc()

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR; overwritten by the camera's next one."""
        target, pixels = self._target_of(camera.lens)
        from_world, eye, _ = view_of(camera.lens, camera.mount, shot)
        gl = self._gl
        target.use()
        gl.clear(depth=1.0)
        gl.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        for program in (self._body_program, self._ground_program, self._sky_program):
            program["from_world"].write(from_world.T.astype("f4").tobytes())
            program["eye"].write(eye.astype("f4").tobytes())
        self._sky_texture.use(0)
        self._sky.render()
        self._textures.use(0)
        self._shadows.use(1)
        for vertices, mode, layer, tint, dash_m in self._ground:
            self._ground_program["layer"] = layer
            self._ground_program["tint"] = tint
            self._ground_program["dash_m"] = dash_m
            vertices.render(mode)
        gl.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for vertices, count in self._opaque:
            vertices.render(instances=count)
        if len(self._panes):
            gl.enable(moderngl.BLEND)
            # Far ones first, so that nets are seen through nets.
            order = np.argsort(-np.linalg.norm(self._panes[:, :3] - eye, axis=1))
            self._pane_buffer.write(self._panes[order].tobytes())
            self._pane_vertices.render(instances=len(order))
        self._finish()
        target.read_into(pixels, components=3)
        return pixels

    def close(self) -> None:
        """Free everything."""
        self._gl.release()

    def _target_of(self, lens: Lens) -> tuple[Any, Picture]:
        if lens not in self._targets:
            size = (lens.width, lens.height)
            target = self._gl.framebuffer(
                [self._gl.renderbuffer(size, 4)], self._gl.depth_renderbuffer(size)
            )
            self._targets[lens] = (target, np.empty((lens.height, lens.width, 3), np.uint8))
        return self._targets[lens]

    def _load_textures(self, layers: dict[Texture, int]) -> None:
        paints = [paint(texture) for texture in layers]
        # OpenGL's first row is the lowest.
        data = np.stack([each.picture[::-1] for each in paints])
        self._textures = self._gl.texture_array((PIXELS, PIXELS, len(paints)), 4, data.tobytes())
        self._textures.build_mipmaps()
        self._textures.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._textures.anisotropy = float(os.environ.get("ANISO","1"))
        extent = np.zeros((16, 2), "f4")
        for index, each in enumerate(paints):
            extent[index] = (each.width_m or 0.0, each.height_m or 0.0)
        self._extent = extent
        for program in (self._body_program, self._shadow_program):
            program["extent"].write(extent[: program["extent"].array_length].tobytes())
        self._scene_objects.append(self._textures)

    def _load_bodies(self, bodies: tuple[Body, ...], layers: dict[Texture, int]) -> None:
        see_through = [body for body in bodies if body.texture == "fence" and body.shape == "box"]
        solid = [body for body in bodies if body not in see_through]
        self._opaque = []
        self._casters = []
        for shape, mesh in self._meshes.items():
            table = _table([body for body in solid if body.shape == shape], layers)
            if len(table):
                buffer = self._gl.buffer(table.tobytes())
                self._opaque.append((self._instanced(mesh, buffer), len(table)))
                self._casters.append((self._shadowing(mesh, buffer), len(table)))
                self._scene_objects.append(buffer)
        self._panes = _table(see_through, layers)
        if len(self._panes):
            self._pane_buffer = self._gl.buffer(self._panes.tobytes(), dynamic=True)
            self._pane_vertices = self._instanced(self._meshes["box"], self._pane_buffer)
            casting = self._shadowing(self._meshes["box"], self._pane_buffer)
            self._casters.append((casting, len(self._panes)))
            self._scene_objects += [self._pane_buffer, self._pane_vertices]
        self._scene_objects += [vertices for vertices, _ in self._opaque + self._casters]

    def _instanced(self, mesh: Any, table: Any) -> Any:
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

    def _cast_shadows(self, scene: Scene) -> None:
        """Let the sun's shadows fall on the ground, once: nothing that casts them moves."""
        gl = self._gl
        reach = [
            (body.position_m[0] + s * r - k * h, body.position_m[1] + t * r - j * h)
            for body in scene.bodies
            for r in [max(body.size_m)]
            for h in [body.position_m[2] + r]
            for s, t in ((1, 1), (-1, -1))
            for k, j in ((0.0, 0.0), (_SUN[0] / _SUN[2], _SUN[1] / _SUN[2]))
        ] or [(0.0, 0.0)]
        low, high = np.min(reach, axis=0) - 1.0, np.max(reach, axis=0) + 1.0
        window = np.asarray([*low, *(1.0 / (high - low))], "f4")
        shadows = gl.texture((SHADOW_PIXELS, SHADOW_PIXELS), 1)
        target = gl.framebuffer([shadows])
        target.use()
        target.clear(1.0)
        self._shadow_program["window"].write(window.tobytes())
        self._textures.use(0)
        gl.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        gl.enable(moderngl.BLEND)
        gl.blend_equation = moderngl.MIN
        for vertices, count in self._casters:
            vertices.render(instances=count)
        gl.blend_equation = moderngl.FUNC_ADD
        target.release()
        shadows.build_mipmaps()
        shadows.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        shadows.repeat_x = shadows.repeat_y = False
        self._shadows = shadows
        self._ground_program["window"].write(window.tobytes())
        self._ground_program["shadows"] = 1
        self._scene_objects.append(shadows)

    def _load_ground(self, scene: Scene, layers: dict[Texture, int]) -> None:
        half = GROUND_SIDE_M / 2.0
        corners = np.asarray([(-half, -half), (half, -half), (-half, half), (half, half)])
        self._ground: list[tuple[Any, int, float, tuple[float, float, float], float]] = []

        def add(
            points: Array,
            uv_m: Array,
            texture: Texture | None,
            tint: tuple[float, float, float],
            dash_m: float | None,
        ) -> None:
            layer = -1 if texture is None else layers[texture]
            step_m = self._extent[layer] if texture is not None else np.ones(2)
            data = np.hstack([points, uv_m / np.where(step_m > 0.0, step_m, 1.0)]).astype("f4")
            buffer = self._gl.buffer(data.tobytes())
            vertices = self._gl.vertex_array(
                self._ground_program, [(buffer, "2f 2f", "in_position", "in_uv")]
            )
            self._ground.append(
                (vertices, moderngl.TRIANGLE_STRIP, float(layer), tint, dash_m or 0.0)
            )
            self._scene_objects.extend([vertices, buffer])

        add(corners, corners, scene.ground, (1.0, 1.0, 1.0), None)
        for strip in scene.strips:
            points, uv_m = _ribbon(strip)
            add(points, uv_m, strip.texture, strip.colour, strip.dash_m)


def view_of(lens: Lens, mount: Mount, shot: Shot) -> tuple[Array, Array, Array]:
    """World to clip coordinates (4, 4), the eye's place (3,), and body to world (3, 3)."""
    body_to_world = rotation_of(shot.orientation)
    eye = np.asarray(shot.position_m) + body_to_world @ np.asarray(mount.position_m)
    to_optical = np.eye(4)
    to_optical[:3, :3] = (body_to_world @ np.asarray(mount.body_from_optical)).T
    to_optical[:3, 3] = -to_optical[:3, :3] @ eye
    fx, fy, cx, cy = lens.intrinsics
    depth = (FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    clip = np.asarray(
        [
            [2.0 * fx / lens.width, 0.0, (2.0 * cx + 1.0) / lens.width - 1.0, 0.0],
            [0.0, 2.0 * fy / lens.height, (2.0 * cy + 1.0) / lens.height - 1.0, 0.0],
            [0.0, 0.0, depth, -NEAR_M * (1.0 + depth)],
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


def _ribbon(strip: Strip) -> tuple[Array, Array]:
    """A triangle strip along a line: points (2N, 2), and metres along and across (2N, 2)."""
    ahead = np.gradient(strip.points_m, axis=0)
    if np.allclose(strip.points_m[0], strip.points_m[-1]):
        ahead[0] = ahead[-1] = ahead[0] + ahead[-1]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) * (strip.width_m / 2.0)
    steps = np.linalg.norm(np.diff(strip.points_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    points = np.stack([strip.points_m + left, strip.points_m - left], axis=1).reshape(-1, 2)
    uv = np.empty_like(points)
    uv[0::2] = np.stack([along, np.full_like(along, strip.width_m)], axis=1)
    uv[1::2] = np.stack([along, np.zeros_like(along)], axis=1)
    return points, uv


# Meshes are triangles of vertices: position, normal, uv, and which of the body's sides the uv
# measure, so that a texture keeps its size in metres on bodies of any size.


def _box() -> Array:
    vertices = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            up = np.asarray((0.0, 0.0, 1.0)) if axis < 2 else np.asarray((0.0, 1.0, 0.0))
            across = np.cross(up, normal)
            quad = [
                (*(normal * 0.5 + across * (u - 0.5) + up * (v - 0.5)), *normal, u, v, *across, *up)
                for u, v in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
            ]
            vertices += [quad[index] for index in (0, 1, 2, 0, 2, 3)]
    return np.asarray(vertices, "f4")


def _cylinder() -> Array:
    vertices = []
    round_side = (math.pi, 0.0, 0.0)
    up = (0.0, 0.0, 1.0)
    flat = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    def rim(step: int, z: float, v: float) -> tuple[float, ...]:
        angle = 2.0 * math.pi * step / _CYLINDER_SIDES
        x, y = math.cos(angle), math.sin(angle)
        return (0.5 * x, 0.5 * y, z, x, y, 0.0, step / _CYLINDER_SIDES, v, *round_side, *up)

    def lid(x: float, y: float, z: float) -> tuple[float, ...]:
        return (x, y, z, 0.0, 0.0, 2.0 * z, x + 0.5, y + 0.5, *flat[0], *flat[1])

    for step in range(_CYLINDER_SIDES):
        a, b = rim(step, -0.5, 0.0), rim(step + 1, -0.5, 0.0)
        c, d = rim(step + 1, 0.5, 1.0), rim(step, 0.5, 1.0)
        vertices += [a, b, c, a, c, d]
        vertices += [lid(0.0, 0.0, 0.5), lid(d[0], d[1], 0.5), lid(c[0], c[1], 0.5)]
        vertices += [lid(0.0, 0.0, -0.5), lid(b[0], b[1], -0.5), lid(a[0], a[1], -0.5)]
    return np.asarray(vertices, "f4")


def _sphere() -> Array:
    sides = 2 * _SPHERE_RINGS

    def point(ring: int, side: int) -> tuple[float, ...]:
        rise = math.pi * (ring / _SPHERE_RINGS - 0.5)
        turn = 2.0 * math.pi * side / sides
        x, y = math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn)
        z = math.sin(rise)
        uv = (side / sides, ring / _SPHERE_RINGS)
        return (0.5 * x, 0.5 * y, 0.5 * z, x, y, z, *uv, math.pi, 0.0, 0.0, 0.0, 0.0, 1.57)

    vertices = []
    for ring in range(_SPHERE_RINGS):
        for side in range(sides):
            a, b = point(ring, side), point(ring, side + 1)
            c, d = point(ring + 1, side + 1), point(ring + 1, side)
            vertices += [a, b, c, a, c, d]
    return np.asarray(vertices, "f4")


def _dome() -> Array:
    """The upper half of a sphere seen from inside: position, uv; a little below the horizon too."""
    rings, sides = 12, 48

    def point(ring: int, side: int) -> tuple[float, ...]:
        rise = math.pi / 2.0 * max(ring, -1) / rings
        turn = 2.0 * math.pi * side / sides
        level = math.cos(rise)
        v = 1.0 - max(ring, 0) / rings
        return (level * math.cos(turn), level * math.sin(turn), math.sin(rise), side / sides, v)

    vertices = []
    for ring in range(-1, rings):
        for side in range(sides):
            a, b = point(ring, side), point(ring, side + 1)
            c, d = point(ring + 1, side + 1), point(ring + 1, side)
            vertices += [a, b, c, a, c, d]
    return np.asarray(vertices, "f4")


def jpeg_of(picture: Picture, quality: int) -> bytes:
    """A BGR picture as JPEG."""
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError("the picture cannot be encoded")
    return data.tobytes()
