"""Pictures by moderngl over EGL: on a graphics card, or on the processor by Mesa's llvmpipe.

The picture of a lens is exact at pixel centres as OpenCV counts them: the centre of the first pixel
is (0, 0). Row 0 is the top row.
"""

import ctypes
import os
from typing import Any, get_args

import cv2
import moderngl
import numpy as np

from common.camera import Lens
from common.frames import Array, rotation_of
from services.sim import shaders
from services.sim.bodies import Bodies
from services.sim.cameras import Camera, Shot
from services.sim.ground import Ground
from services.sim.shade import Shade
from services.sim.sky import Sky
from services.sim.stage import Scene
from services.sim.textures import PIXELS, Picture, paint
from worlds import Texture

FAR_M = 400.0

LLVMPIPE_THREADS = "0"
"""The drawing thread rasterises itself: a tenth cheaper, and other services need the other core."""

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
        # All of them, so that another world is there at once.
        textures: dict[Texture, Any] = {each: _texture_of(gl, each) for each in get_args(Texture)}
        self._bodies = Bodies(gl, textures)
        self._ground = Ground(gl, textures)
        self._shade = Shade(gl)
        self._sky = Sky(gl)
        self._programs = (
            *self._bodies.programs,
            self._ground.textured,
            self._ground.painted,
            self._sky.program,
        )
        self._targets: dict[Lens, _Target] = {}

    @property
    def name(self) -> str:
        """What draws, for people."""
        return f"moderngl on {self._gl.info['GL_RENDERER']}"

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        self._bodies.load(scene.bodies)
        self._ground.load(scene, self._bodies.cast_shadows)
        self._shade.load(scene)

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR; overwritten by the next but one of this lens."""
        if camera.lens not in self._targets:
            self._targets[camera.lens] = _Target(self._gl, camera.lens)
        target = self._targets[camera.lens]
        from_world, eye, _ = view_of(camera, shot)
        gl = self._gl
        target.begin()
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for program in self._programs:
            program["from_world"] = tuple(from_world.T.ravel())
        away_m = self._bodies.look(eye, from_world)
        figures = [body for other in shot.others for body in other.bodies()]
        focal_px = camera.lens.intrinsics[0]
        self._bodies.draw_opaque(away_m, focal_px, figures)
        gl.disable(moderngl.CULL_FACE)
        self._ground.draw(eye)
        gl.depth_func = "<="
        self._sky.draw(eye, from_world)
        gl.depth_func = "<"
        gl.enable(moderngl.CULL_FACE | moderngl.BLEND)
        self._shade.draw(shot.others, from_world)
        self._bodies.draw_nets(away_m, focal_px)
        self._finish()
        return target.read()

    def close(self) -> None:
        """Free everything."""
        self._gl.release()


class _Target:
    """What the pictures of a lens are drawn into."""

    def __init__(self, gl: Any, lens: Lens) -> None:
        size = (lens.width, lens.height)
        self._frame = gl.framebuffer([gl.renderbuffer(size, 4)], gl.depth_renderbuffer(size))
        self._raw = np.empty((lens.height, lens.width, 4), np.uint8)
        # One is encoded while the next one is drawn.
        self._pictures = [np.empty((lens.height, lens.width, 3), np.uint8) for _ in range(2)]

    def begin(self) -> None:
        """Draw into it from now on."""
        self._frame.use()
        # Where there is neither ground nor sky, far out, there is haze; colours are BGR here.
        self._frame.clear(*reversed(shaders.HAZE))

    def read(self) -> Picture:
        """What was drawn (height, width, 3)."""
        # All four channels as they are: to leave one out while reading takes Mesa thrice as long.
        self._frame.read_into(self._raw, components=4)
        self._pictures.reverse()
        cv2.cvtColor(self._raw, cv2.COLOR_BGRA2BGR, self._pictures[0])
        return self._pictures[0]


def _texture_of(gl: Any, texture: Texture) -> Any:
    # OpenGL's first row is the lowest.
    data = paint(texture).picture[::-1].tobytes()
    made = gl.texture((PIXELS, PIXELS), 4, data)
    made.build_mipmaps()
    made.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return made


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


def jpeg_of(picture: Picture, quality: int) -> bytes:
    """A BGR picture as JPEG."""
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError("the picture cannot be encoded")
    return data.tobytes()
