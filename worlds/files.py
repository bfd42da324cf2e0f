"""Worlds as people write them: YAML, checked as it is read; an error names the file and the field.

Lengths are in m, angles in degrees.
"""

import itertools
import math
import re
from pathlib import Path as FilePath
from typing import Annotated, get_args

import msgspec
import numpy as np
from msgspec import Meta
from scipy.spatial.transform import Rotation

from worlds import lane
from worlds.model import Body, Primitive, Segment, Shape, Strip, Texture, World
from worlds.path import PATH_STEP_M, Path, sampled, sine_length_m

FOLDER = FilePath(__file__).parent
SUFFIX = ".yaml"
MAX_BODIES = 5000

_Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4)]
_Point = tuple[_Coordinate, _Coordinate, _Coordinate]
_Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
_Angle = Annotated[float, Meta(ge=-3600.0, le=3600.0)]
_Count = Annotated[int, Meta(ge=1, le=1000)]

_SHAPED_BY: dict[Primitive, tuple[str, ...]] = {
    "line": ("length_m",),
    "arc": ("radius_m", "sweep_deg"),
    "helix": ("radius_m", "sweep_deg", "climb_m"),
    "sine": ("length_m", "amplitude_m", "wavelength_m"),
}


_CHOICES = {"texture": Texture, "ground": Texture, "shape": Shape, "primitive": Primitive}


class WorldError(ValueError):
    """A world that is not there or cannot be used; the text names the file and the field."""


class _Read(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Part of a file."""


class _Start(_Read, frozen=True, kw_only=True):
    position_m: _Point = (0.0, 0.0, 0.0)
    yaw_deg: _Angle = 0.0


class _Segment(_Read, frozen=True, kw_only=True):
    primitive: Primitive
    length_m: _Length | None = None
    radius_m: _Length | None = None
    sweep_deg: _Angle | None = None
    climb_m: Annotated[float, Meta(ge=-1000.0, le=1000.0)] | None = None
    amplitude_m: _Length | None = None
    wavelength_m: _Length | None = None

    def __post_init__(self) -> None:
        needed = _SHAPED_BY[self.primitive]
        for name in self.__struct_fields__[1:]:
            given = getattr(self, name)
            if name in needed and not given:
                raise ValueError(f"{self.primitive}: `{name}` is needed, and not 0")
            if given is not None and name not in needed:
                raise ValueError(f"{self.primitive}: `{name}` does not shape it")
        if self.length_m is not None and self.wavelength_m is not None:
            halves = 2.0 * self.length_m / self.wavelength_m
            if abs(halves - round(halves)) > 1e-6:
                raise ValueError("sine: `length_m` must be a whole number of half `wavelength_m`")


class _IdealPath(_Read, frozen=True, kw_only=True):
    start_m: _Point
    yaw_deg: _Angle = 0.0
    closed: bool = False
    segments: Annotated[list[_Segment], Meta(min_length=1)]


class _Fence(_Read, frozen=True, kw_only=True):
    height_m: _Length
    thickness_m: _Length = 0.05
    panel_m: Annotated[float, Meta(ge=0.1, le=1000.0)] = 2.5
    texture: Texture = "fence"


class _Lane(_Read, frozen=True, kw_only=True):
    width_m: _Length
    texture: Texture = "asphalt"
    fence: _Fence | None = None


class _Row(_Read, frozen=True, kw_only=True):
    count: _Count
    step_m: _Point


class _Ring(_Read, frozen=True, kw_only=True):
    count: _Count
    centre_m: tuple[_Coordinate, _Coordinate] = (0.0, 0.0)


class _Body(_Read, frozen=True, kw_only=True):
    shape: Shape
    size_m: tuple[_Length, _Length, _Length]
    position_m: _Point
    roll_deg: _Angle = 0.0
    pitch_deg: _Angle = 0.0
    yaw_deg: _Angle = 0.0
    texture: Texture
    rows: list[_Row] = []
    ring: _Ring | None = None

    def __post_init__(self) -> None:
        round_sides = {"box": 1, "cylinder": 2, "sphere": 3}[self.shape]
        if len(set(self.size_m[:round_sides])) > 1:
            raise ValueError(f"{self.shape}: the first {round_sides} of `size_m` must be equal")


class _File(_Read, frozen=True, kw_only=True):
    description: str
    ground: Texture = "grass"
    start: _Start = _Start()
    ideal_path: _IdealPath | None = None
    lane: _Lane | None = None
    bodies: list[_Body] = []


_PLACE = re.compile(r" - at `\$[^`]*\.(\w+)[^.`]*`$")
"""The name of the field that msgspec's error is about."""
_PARTS: dict[str, type[_Read]] = {
    "": _File,
    "start": _Start,
    "ideal_path": _IdealPath,
    "segments": _Segment,
    "lane": _Lane,
    "fence": _Fence,
    "bodies": _Body,
    "rows": _Row,
    "ring": _Ring,
}


def names() -> list[str]:
    """The worlds that are shipped."""
    return sorted(path.stem for path in FOLDER.glob(f"*{SUFFIX}"))


def load(name: str) -> World:
    """The world of a name, or of a file of one's own: a path that ends in .yaml.

    Raises:
        WorldError: if there is none, or its file is wrong.
    """
    if name.endswith(SUFFIX):
        return load_file(FilePath(name).expanduser(), name)
    if name not in names():
        raise WorldError(
            f"no world {name!r}; there are {', '.join(names())},"
            f" or a file of your own that ends in {SUFFIX}"
        )
    return load_file(FOLDER / f"{name}{SUFFIX}", name)


def load_file(path: FilePath, name: str | None = None) -> World:
    """The world in a file.

    Args:
        path: of the file.
        name: what the world is called; by default its file's.

    Raises:
        WorldError: if the file cannot be read or is wrong.
    """
    try:
        read = msgspec.yaml.decode(path.read_bytes(), type=_File)
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror}") from None
    except (ValueError, msgspec.DecodeError) as error:
        raise WorldError(f"{path}: {_line_of(error)}") from None
    if read.lane is not None and read.ideal_path is None:
        raise WorldError(f"{path}: `lane` needs an `ideal_path` to lie along")
    number = sum(_number_of(each) for each in read.bodies)
    if number > MAX_BODIES:
        raise WorldError(f"{path}: `bodies` are {number}; {MAX_BODIES} at most")
    bodies = [body for each in read.bodies for body in _bodies(each)]
    strips: list[Strip] = []
    course: Path | None = None
    ideal_path_m = np.empty((0, 3))
    if read.ideal_path is not None:
        course = _path(read.ideal_path)
        ideal_path_m = sampled(course, 0.0, PATH_STEP_M, math.pi)
        if course.closed and not np.allclose(ideal_path_m[0], ideal_path_m[-1], atol=1e-6):
            raise WorldError(f"{path}: `ideal_path.closed`, but its end does not meet its start")
        if read.lane is not None:
            strips = lane.paint(course, read.lane.width_m, read.lane.texture)
            bodies = _fence(course, read.lane) + bodies
    if len(bodies) > MAX_BODIES:
        raise WorldError(f"{path}: `bodies` are {len(bodies)}; {MAX_BODIES} at most")
    return World(
        name=name or path.stem,
        description=read.description,
        start_position_m=read.start.position_m,
        start_yaw_rad=math.radians(read.start.yaw_deg),
        width_m=None if read.lane is None else read.lane.width_m,
        closed=course is not None and course.closed,
        segments=() if course is None else course.segments,
        ideal_path_m=ideal_path_m,
        bodies=tuple(bodies),
        strips=tuple(strips),
        ground=read.ground,
    )


def _line_of(error: Exception) -> str:
    """What is wrong with a file, and what is allowed, in one line."""
    text = " ".join(str(error).split()).replace('"<byte string>", ', "")
    place = _PLACE.search(text)
    field = place[1] if place else ""
    if text.startswith("Invalid enum value"):
        text = f"{text}; use {', '.join(get_args(_CHOICES[field]))}"
    elif text.startswith("Object contains unknown field"):
        text = f"{text}; use {', '.join(_PARTS[field].__struct_fields__)}"
    return text


def _path(read: _IdealPath) -> Path:
    segments = tuple(_segment(each) for each in read.segments)
    return Path(read.start_m, math.radians(read.yaw_deg), read.closed, segments)


def _segment(read: _Segment) -> Segment:
    climb_m = read.climb_m or 0.0
    if read.radius_m is not None and read.sweep_deg is not None:
        sweep_rad = math.radians(read.sweep_deg)
        length_m = math.hypot(read.radius_m * sweep_rad, climb_m)
        return Segment(read.primitive, length_m, read.radius_m, sweep_rad, climb_m)
    assert read.length_m is not None
    if read.amplitude_m is not None and read.wavelength_m is not None:
        return Segment(
            "sine",
            sine_length_m(read.length_m, read.amplitude_m, read.wavelength_m),
            amplitude_m=read.amplitude_m,
            wavelength_m=read.wavelength_m,
        )
    return Segment("line", read.length_m)


def _fence(course: Path, read: _Lane) -> list[Body]:
    if read.fence is None:
        return []
    fence = read.fence
    return lane.fence(
        course, read.width_m, fence.height_m, fence.thickness_m, fence.panel_m, fence.texture
    )


def _number_of(read: _Body) -> int:
    """In how many places a body stands."""
    return math.prod(row.count for row in read.rows) * (read.ring.count if read.ring else 1)


def _bodies(read: _Body) -> list[Body]:
    """A body, in as many places as its rows and its ring put it."""
    angles = [read.yaw_deg, read.pitch_deg, read.roll_deg]
    turn = Rotation.from_euler("ZYX", angles, degrees=True)
    steps = [[np.multiply(i, row.step_m) for i in range(row.count)] for row in read.rows]
    bodies = []
    for offsets in itertools.product(*steps):
        place = np.add(read.position_m, np.sum(offsets, axis=0) if offsets else 0.0)
        count = 1 if read.ring is None else read.ring.count
        centre = np.asarray((0.0, 0.0, 0.0) if read.ring is None else (*read.ring.centre_m, 0.0))
        for index in range(count):
            around = Rotation.from_euler("Z", 2.0 * math.pi * index / count)
            x, y, z = (float(each) for each in centre + around.apply(place - centre))
            qx, qy, qz, qw = (float(each) for each in (around * turn).as_quat())
            bodies.append(Body(read.shape, read.size_m, (x, y, z), (qx, qy, qz, qw), read.texture))
    return bodies
