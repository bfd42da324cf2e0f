"""Bodies that are drawn as instances: one draw a shape and texture, of what is in sight."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from common.frames import Array
from services.sim import meshes, shaders
from services.sim.textures import paint
from worlds import Body, Shape, Texture

NET: Texture = "fence"
"""It has holes, and is drawn last."""
MOST_FIGURES = 256
"""Bodies of vehicles of one shape that are drawn at once."""
_FORMS = {
    "box": meshes.box(),
    "cylinder": meshes.cylinder(12),
    "sphere": meshes.sphere(10),
    # Their corners stand out by as much as their sides fall short.
    "far cylinder": meshes.cylinder(6, 0.536),
    "far sphere": meshes.sphere(6, 0.509),
}
_FAR = {"cylinder": ("far cylinder", 10.0), "sphere": ("far sphere", 50.0)}
"""What a shape is drawn as where it is narrower than so many pixels: it is off by half a one at
most, and small triangles cost more than what is in them."""
_COLUMNS = 12
_LAYOUT = "3f 4f 3f 2f/i"
_PLACEMENT = ("at", "turn", "size", "repeat_m")
_SIDES = np.asarray([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])


class Bodies:
    """What stands in the world, and the vehicles that move in it.

    Args:
        gl: where they are drawn.
        textures: what they are made of.
    """

    def __init__(self, gl: Any, textures: dict[Texture, Any]) -> None:
        self._gl = gl
        self._textures = textures
        self._opaque = gl.program(shaders.BODY_VERTEX, shaders.BODY_FRAGMENT)
        self._net = gl.program(shaders.BODY_VERTEX, shaders.NET_FRAGMENT)
        self._shadow_program = gl.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT)
        self._meshes: dict[str, tuple[Any, Any]] = {}
        for form, mesh in _FORMS.items():
            corners, triangles = meshes.indexed(mesh)
            self._meshes[form] = gl.buffer(corners.tobytes()), gl.buffer(triangles.tobytes())
        self._figures = {}
        for shape in get_args(Shape):
            buffer = gl.buffer(reserve=MOST_FIGURES * _COLUMNS * 4, dynamic=True)
            self._figures[shape] = (buffer, self._drawn(self._opaque, shape, buffer))
        self._scene_objects: list[Any] = []

    @property
    def programs(self) -> tuple[Any, Any]:
        """What draws them."""
        return self._opaque, self._net

    def load(self, bodies: Sequence[Body]) -> None:
        """Draw these from now on."""
        for each in self._scene_objects:
            each.release()
        self._scene_objects = []
        self._flocks: list[_Flock] = []
        self._nets: list[_Flock] = []
        whole = _table([body for alike in _kinds_of(bodies).values() for body in alike])
        self._centres_m = whole[:, :3].astype(np.float64)
        self._radii_m = 0.5 * np.linalg.norm(whole[:, 7:10].astype(np.float64), axis=1)
        begin = 0
        for (shape, texture), alike in _kinds_of(bodies).items():
            flocks, program = (
                (self._nets, self._net) if texture == NET else (self._flocks, self._opaque)
            )
            rows = slice(begin, begin + len(alike))
            table = whole[rows]
            buffer = self._gl.buffer(table.tobytes(), dynamic=True)
            near = self._drawn(program, shape, buffer)
            # Nets are drawn from far to near, whatever their form.
            far_form, fine_px = (shape, 0.0) if texture == NET else _FAR.get(shape, (shape, 0.0))
            far = self._drawn(program, far_form, buffer)
            shadow = self._shadowing(shape, buffer)
            skin, radii_m = self._textures[texture], self._radii_m[rows]
            flocks.append(_Flock(table, rows, radii_m, skin, buffer, near, far, fine_px, shadow))
            self._scene_objects += [near, far, shadow, buffer]
            begin += len(alike)

    def cast_shadows(self, window: Array) -> None:
        """Draw the shadows into a window of the ground."""
        self._shadow_program["window"] = tuple(window)
        for flock in self._flocks + self._nets:
            flock.skin.use(0)
            flock.shadow.render(instances=len(flock.table))

    def look(self, eye: Array, from_world: Array) -> Array:
        """How far each body is from the eye, (N,); infinitely if it is out of sight."""
        # A plane of the view's pyramid is a sum of rows of the matrix; its normal is not of unit.
        sides = from_world[3] + _SIDES @ from_world[:2]
        lengths = np.linalg.norm(sides[:, :3], axis=1)
        inside = (self._centres_m @ sides[:, :3].T + sides[:, 3]) / lengths
        seen = (inside > -self._radii_m[:, None]).all(axis=1)
        return np.where(seen, np.linalg.norm(self._centres_m - eye, axis=1), np.inf)

    def draw_opaque(self, away_m: Array, focal_px: float, figures: Sequence[Body]) -> None:
        """Draw what has no holes, near to far, so that what is hidden is not painted.

        Args:
            away_m: of each body, see `look`.
            focal_px: the camera's focal length.
            figures: bodies that move; they cast no shadows.
        """
        for flock in self._flocks:
            flock.draw(away_m, focal_px, 1)
        for (shape, texture), alike in _kinds_of(figures).items():
            buffer, vertices = self._figures[shape]
            self._textures[texture].use(0)
            for begin in range(0, len(alike), MOST_FIGURES):
                some = alike[begin : begin + MOST_FIGURES]
                buffer.orphan()
                buffer.write(_table(some).tobytes())
                vertices.render(instances=len(some))

    def draw_nets(self, away_m: Array, focal_px: float) -> None:
        """Draw the nets, far to near, so that they are seen through each other."""
        for net in self._nets:
            net.draw(away_m, focal_px, -1)

    def _drawn(self, program: Any, form: str, table: Any) -> Any:
        names = ("in_position", "in_normal", "in_uv", "in_across", "in_up")
        corners, triangles = self._meshes[form]
        placed = (table, _LAYOUT, *_PLACEMENT)
        mesh = (corners, "3f 3f 2f 3f 3f", *names)
        return self._gl.vertex_array(program, [mesh, placed], triangles)

    def _shadowing(self, form: str, table: Any) -> Any:
        names = ("in_position", "in_uv", "in_across", "in_up")
        corners, triangles = self._meshes[form]
        placed = (table, _LAYOUT, *_PLACEMENT)
        mesh = (corners, "3f 3x4 2f 3f 3f", *names)
        return self._gl.vertex_array(self._shadow_program, [mesh, placed], triangles)


@dataclass(frozen=True, eq=False)
class _Flock:
    """Bodies of one kind, drawn at once: a row of the table each, and its copy in OpenGL.

    Attributes:
        table: see `_table`.
        rows: which of all bodies they are.
        radii_m: no point of each is farther from its centre.
        skin: their texture.
        buffer: the table's copy.
        near: draws it.
        far: the same with fewer sides.
        fine_px: what is narrower is far.
        shadow: draws its shadows.
    """

    table: Array
    rows: slice
    radii_m: Array
    skin: Any
    buffer: Any
    near: Any
    far: Any
    fine_px: float
    shadow: Any

    def draw(self, away_m: Array, focal_px: float, order: int) -> None:
        """Draw those in sight, the nearest first (order 1) or last (-1)."""
        away_m = away_m[self.rows]
        nearest = np.argsort(away_m)[: np.count_nonzero(np.isfinite(away_m))]
        if not len(nearest):
            return
        self.skin.use(0)
        near_m = away_m[nearest] - self.radii_m[nearest]
        fine = self.table[nearest, 7] * focal_px >= self.fine_px * near_m
        for vertices, some in ((self.near, nearest[fine]), (self.far, nearest[~fine])):
            if len(some):
                self.buffer.write(self.table[some[::order]].tobytes())
                vertices.render(instances=len(some))


def _kinds_of(bodies: Sequence[Body]) -> dict[tuple[str, Texture], list[Body]]:
    """Bodies by shape and texture."""
    kinds: dict[tuple[str, Texture], list[Body]] = defaultdict(list)
    for body in bodies:
        kinds[body.shape, body.texture].append(body)
    return kinds


def _table(bodies: Sequence[Body]) -> Array:
    """One row a body: place, turn, size, and what one repetition of its texture measures."""
    rows = []
    for body in bodies:
        look = paint(body.texture)
        repeat_m = (look.width_m or 0.0, look.height_m or 0.0)
        rows.append((*body.position_m, *body.orientation, *body.size_m, *repeat_m))
    return np.asarray(rows, "f4").reshape(-1, _COLUMNS)
