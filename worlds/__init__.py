"""Worlds: one YAML a world in this folder, read by the simulator, operators and studies.

A file is checked as it is read; an error names the file and the field. Lengths are in m, angles in
the files in degrees (for people), in memory in rad. World frame ENU.
"""

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

FOLDER = Path(__file__).parent
PATH_STEP_M = 0.05
"""The ideal path is sampled at least this densely."""
CORNER_RAD = math.radians(15.0)
"""A fence follows a curve in panels of at most this angle."""

Array = NDArray[np.float64]
Texture = Literal[
    "asphalt", "grass", "concrete", "fence", "post", "crate", "brick", "container", "foliage"
]
Shape = Literal["box", "cylinder", "sphere"]
Primitive = Literal["line", "arc"]
_Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4)]
Vector3 = tuple[float, float, float]
_Point = tuple[_Coordinate, _Coordinate, _Coordinate]
Colour = tuple[float, float, float]
_Length = Annotated[float, Meta(gt=0.0, le=1000.0)]


class WorldError(ValueError):
    """A world that is not there or cannot be used; the text names the file and the field."""


@dataclass(frozen=True)
class Segment:
    """One primitive of the ideal path.

    Attributes:
        primitive: its shape.
        length_m: its length along the path.
        radius_m: of an arc.
        sweep_rad: of an arc, + counter-clockwise.
    """

    primitive: Primitive
    length_m: float
    radius_m: float | None = None
    sweep_rad: float | None = None


@dataclass(frozen=True)
class Body:
    """A fixed thing that is seen and collided with.

    Attributes:
        shape: its kind.
        size_m: length, width, height of its bounding box before it is turned; the axis of a
            cylinder is its z.
        position_m: of its centre.
        orientation: body to world, [x, y, z, w].
        texture: what it looks like.
    """

    shape: Shape
    size_m: Vector3
    position_m: Vector3
    orientation: tuple[float, float, float, float]
    texture: Texture


@dataclass(frozen=True, eq=False)
class Strip:
    """Paint on the ground along a line.

    Attributes:
        points_m: (N, 2), its middle.
        width_m: across.
        texture: of the strip; None is plain paint.
        colour: red, green, blue in [0, 1]; tints the texture.
        dash_m: length of the dashes, and of the gaps between them; None is a solid strip.
    """

    points_m: Array
    width_m: float
    texture: Texture | None
    colour: Colour
    dash_m: float | None = None


@dataclass(frozen=True, eq=False)
class World:
    """A place to fly in.

    Attributes:
        name: of the file.
        description: for people.
        start_position_m: where a vehicle is set down; z 0 is the ground.
        start_yaw_rad: which way it looks.
        width_m: of the lane around the ideal path, if there is one.
        closed: whether the ideal path's end joins its start.
        segments: the primitives of the ideal path, in order.
        ideal_path_m: (N, 3), evenly spaced by at most PATH_STEP_M within a segment; the last point
            of a closed path is its first again; no points where there is no ideal path.
        bodies: what stands in it.
        strips: what is painted on its ground, first painted first.
        ground: the texture of the ground.
    """

    name: str
    description: str
    start_position_m: Vector3
    start_yaw_rad: float
    width_m: float | None
    closed: bool
    segments: tuple[Segment, ...]
    ideal_path_m: Array
    bodies: tuple[Body, ...]
    strips: tuple[Strip, ...]
    ground: Texture


class _Read(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Part of a file."""


class _Start(_Read, frozen=True, kw_only=True):
    position_m: _Point = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0


class _Segment(_Read, frozen=True, kw_only=True):
    primitive: Primitive
    length_m: _Length | None = None
    radius_m: _Length | None = None
    sweep_deg: Annotated[float, Meta(ge=-3600.0, le=3600.0)] | None = None

    def __post_init__(self) -> None:
        if self.primitive == "line" and self.length_m is None:
            raise ValueError("a line needs `length_m`")
        if self.primitive == "arc" and (self.radius_m is None or not self.sweep_deg):
            raise ValueError("an arc needs `radius_m` and a `sweep_deg` that is not 0")


class _IdealPath(_Read, frozen=True, kw_only=True):
    start_m: _Point
    yaw_deg: float = 0.0
    closed: bool = False
    segments: Annotated[list[_Segment], Meta(min_length=1)]


class _Fence(_Read, frozen=True, kw_only=True):
    height_m: _Length
    thickness_m: _Length = 0.05
    panel_m: _Length = 2.5
    texture: Texture = "fence"


class _Lane(_Read, frozen=True, kw_only=True):
    width_m: _Length
    texture: Texture = "asphalt"
    fence: _Fence | None = None


class _Body(_Read, frozen=True, kw_only=True):
    shape: Shape
    size_m: tuple[_Length, _Length, _Length]
    position_m: _Point
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    texture: Texture


class _File(_Read, frozen=True, kw_only=True):
    description: str
    ground: Texture = "grass"
    start: _Start = _Start()
    ideal_path: _IdealPath | None = None
    lane: _Lane | None = None
    bodies: list[_Body] = []


def names() -> list[str]:
    """The worlds there are."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load(name: str) -> World:
    """The world of a name.

    Raises:
        WorldError: if there is none, or its file is wrong.
    """
    if name not in names():
        raise WorldError(f"no world {name!r}; there are {', '.join(names())}")
    return load_file(FOLDER / f"{name}.yaml")


def load_file(path: Path) -> World:
    """The world in a file.

    Raises:
        WorldError: if the file cannot be read or is wrong.
    """
    try:
        read = msgspec.yaml.decode(path.read_bytes(), type=_File)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError) as error:
        raise WorldError(f"{path}: {error}") from None
    if read.lane is not None and read.ideal_path is None:
        raise WorldError(f"{path}: `lane` needs an `ideal_path` to lie along")
    bodies = [_body(each) for each in read.bodies]
    strips: list[Strip] = []
    segments: tuple[Segment, ...] = ()
    ideal_path_m = np.empty((0, 3))
    if read.ideal_path is not None:
        segments = tuple(_segment(each) for each in read.ideal_path.segments)
        ideal_path_m = _sampled(read.ideal_path, segments, 0.0, PATH_STEP_M, math.pi)
        closed = read.ideal_path.closed
        if closed and not np.allclose(ideal_path_m[0], ideal_path_m[-1], atol=1e-6):
            raise WorldError(f"{path}: `ideal_path.closed`, but its end does not meet its start")
        if read.lane is not None:
            strips = _paint(read.ideal_path, segments, read.lane)
            bodies = _fence(read.ideal_path, segments, read.lane) + bodies
    return World(
        name=path.stem,
        description=read.description,
        start_position_m=read.start.position_m,
        start_yaw_rad=math.radians(read.start.yaw_deg),
        width_m=None if read.lane is None else read.lane.width_m,
        closed=read.ideal_path is not None and read.ideal_path.closed,
        segments=segments,
        ideal_path_m=ideal_path_m,
        bodies=tuple(bodies),
        strips=tuple(strips),
        ground=read.ground,
    )


def _segment(read: _Segment) -> Segment:
    if read.primitive == "line":
        assert read.length_m is not None
        return Segment("line", read.length_m)
    assert read.radius_m is not None
    assert read.sweep_deg is not None
    sweep_rad = math.radians(read.sweep_deg)
    return Segment("arc", read.radius_m * abs(sweep_rad), read.radius_m, sweep_rad)


def _sampled(
    path: _IdealPath,
    segments: tuple[Segment, ...],
    left_m: float,
    step_m: float,
    step_rad: float,
) -> Array:
    """The path (N, 3), moved `left_m` to its left, in steps of at most `step_m` and `step_rad`."""
    x, y, z = path.start_m
    yaw = math.radians(path.yaw_deg)
    points = [(x - left_m * math.sin(yaw), y + left_m * math.cos(yaw))]
    for segment in segments:
        if segment.radius_m is None or segment.sweep_rad is None:
            along = np.linspace(0.0, segment.length_m, 1 + _steps(segment.length_m, step_m))
            xs, ys = x + along * math.cos(yaw), y + along * math.sin(yaw)
            yaws = np.full_like(along, yaw)
        else:
            count = max(_steps(segment.length_m, step_m), _steps(abs(segment.sweep_rad), step_rad))
            yaws = yaw + np.linspace(0.0, segment.sweep_rad, 1 + count)
            side = math.copysign(segment.radius_m, segment.sweep_rad)
            xs = x + side * (np.sin(yaws) - math.sin(yaw))
            ys = y - side * (np.cos(yaws) - math.cos(yaw))
        points.extend(
            zip(xs[1:] - left_m * np.sin(yaws[1:]), ys[1:] + left_m * np.cos(yaws[1:]), strict=True)
        )
        x, y, yaw = float(xs[-1]), float(ys[-1]), float(yaws[-1])
    return np.column_stack([np.asarray(points), np.full(len(points), z)])


def _steps(whole: float, step: float) -> int:
    return max(1, math.ceil(whole / step - 1e-9))


def _paint(path: _IdealPath, segments: tuple[Segment, ...], lane: _Lane) -> list[Strip]:
    """A lane with white edges and a dashed yellow midline."""

    def line(left_m: float) -> Array:
        return _sampled(path, segments, left_m, math.inf, math.radians(3.0))[:, :2]

    edge_m = lane.width_m / 2.0 - 0.15
    white, yellow = (0.92, 0.92, 0.9), (0.98, 0.78, 0.1)
    return [
        Strip(line(0.0), lane.width_m + 0.4, lane.texture, (1.0, 1.0, 1.0)),
        Strip(line(edge_m), 0.1, None, white),
        Strip(line(-edge_m), 0.1, None, white),
        Strip(line(0.0), 0.12, None, yellow, dash_m=0.5),
    ]


def _fence(path: _IdealPath, segments: tuple[Segment, ...], lane: _Lane) -> list[Body]:
    """Panels and posts on both sides of the lane."""
    if lane.fence is None:
        return []
    fence = lane.fence
    bodies: list[Body] = []
    upright = (0.0, 0.0, 0.0, 1.0)
    post_m = (0.09, 0.09, fence.height_m + 0.1)
    for left_m in (lane.width_m / 2.0, -lane.width_m / 2.0):
        corners = _sampled(path, segments, left_m, fence.panel_m, CORNER_RAD)[:, :2]
        for begin, end in itertools.pairwise(corners):
            dx, dy = end - begin
            x, y = (begin + end) / 2.0
            half_yaw = math.atan2(dy, dx) / 2.0
            bodies.append(
                Body(
                    "box",
                    (math.hypot(dx, dy), fence.thickness_m, fence.height_m),
                    (float(x), float(y), fence.height_m / 2.0),
                    (0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)),
                    fence.texture,
                )
            )
        for x, y in corners[:-1] if path.closed else corners:
            bodies.append(
                Body("cylinder", post_m, (float(x), float(y), post_m[2] / 2.0), upright, "post")
            )
    return bodies


def _body(read: _Body) -> Body:
    angles = [read.yaw_deg, read.pitch_deg, read.roll_deg]
    x, y, z, w = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()
    orientation = (float(x), float(y), float(z), float(w))
    return Body(read.shape, read.size_m, read.position_m, orientation, read.texture)
