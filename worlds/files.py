"""Worlds by their names, or from files of one's own: what stands in them, and where one flies."""

import itertools
import math
from pathlib import Path as FilePath

import numpy as np
from scipy.spatial.transform import Rotation

from worlds import lane, schema
from worlds.model import Array, Body, Segment, Strip, World
from worlds.path import PATH_STEP_M, Path, sampled, sine_length_m

FOLDER = FilePath(__file__).parent
SUFFIX = ".yaml"
MAX_BODIES = 5000
MAX_PATH_M = 10_000.0


class WorldError(ValueError):
    """A world that is not there or cannot be used; the text names the file and the field."""


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
        return _built(schema.read(path.read_bytes()), name or path.stem)
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror}") from None
    except ValueError as error:
        raise WorldError(f"{path}: {error}") from None


def _built(read: schema.WorldText, name: str) -> World:
    """The world that a file describes.

    Raises:
        ValueError: if there can be none like it.
    """
    if read.lane is not None and read.ideal_path is None:
        raise ValueError("`lane` needs an `ideal_path` to lie along")
    _check_number(sum(_number_of(each) for each in read.bodies))
    bodies = [body for each in read.bodies for body in _bodies(each)]
    strips: list[Strip] = []
    course: Path | None = None
    ideal_path_m = np.empty((0, 3))
    if read.ideal_path is not None:
        course = _path(read.ideal_path)
        ideal_path_m = _sampled(course)
        if read.lane is not None:
            _check_bends(course, read.lane.width_m)
            strips = lane.paint(course, read.lane.width_m, read.lane.texture)
            bodies = _fence(course, read.lane) + bodies
    _check_number(len(bodies))
    return World(
        name=name,
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


def _check_number(bodies: int) -> None:
    if bodies > MAX_BODIES:
        raise ValueError(f"`bodies` are {bodies}; {MAX_BODIES} at most")


def _check_bends(course: Path, width_m: float) -> None:
    """Refuse a lane whose inner edge would turn back on itself."""
    sharpest_m = min(segment.bend_m for segment in course.segments)
    if sharpest_m <= width_m / 2.0:
        raise ValueError(
            f"`lane.width_m` is {width_m:g}, but a bend of the path has a radius"
            f" of {sharpest_m:.3g} m; it must be below twice that"
        )


def _sampled(course: Path) -> Array:
    """The ideal path, (N, 3).

    Raises:
        ValueError: if nobody can fly it.
    """
    length_m = sum(segment.length_m for segment in course.segments)
    if length_m > MAX_PATH_M:
        raise ValueError(f"`ideal_path` is {length_m:.0f} m long; {MAX_PATH_M:.0f} m at most")
    path_m = sampled(course, 0.0, PATH_STEP_M, math.pi)
    if course.closed and not np.allclose(path_m[0], path_m[-1], atol=1e-6):
        raise ValueError("`ideal_path.closed`, but its end does not meet its start")
    lowest_m = float(path_m[:, 2].min())
    if lowest_m < 0.0:
        raise ValueError(f"`ideal_path` goes down to {lowest_m:g} m; the ground is at 0")
    return path_m


def _path(read: schema.IdealPath) -> Path:
    segments = tuple(_segment(each) for each in read.segments)
    return Path(read.start_m, math.radians(read.yaw_deg), read.closed, segments)


def _segment(read: schema.SegmentText) -> Segment:
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


def _fence(course: Path, read: schema.Lane) -> list[Body]:
    if read.fence is None:
        return []
    fence = read.fence
    return lane.fence(
        course, read.width_m, fence.height_m, fence.thickness_m, fence.panel_m, fence.texture
    )


def _number_of(read: schema.BodyText) -> int:
    """In how many places a body stands."""
    return math.prod(row.count for row in read.rows) * (read.ring.count if read.ring else 1)


def _bodies(read: schema.BodyText) -> list[Body]:
    """A body, in as many places as its rows and its ring put it."""
    steps = [np.outer(np.arange(row.count), row.step_m) for row in read.rows]
    places = np.asarray([np.sum(each, axis=0) for each in itertools.product(*steps)])
    places = places.reshape(-1, 3) if read.rows else np.zeros((1, 3))
    count, centre = (1, (0.0, 0.0)) if read.ring is None else (read.ring.count, read.ring.centre_m)
    around = Rotation.from_euler("Z", 2.0 * math.pi * np.arange(count)[:, None] / count)
    middle = np.asarray((*centre, 0.0))
    arms = places + read.position_m - middle
    # (places, ring, 3)
    stands = middle + np.einsum("rij,pj->pri", around.as_matrix(), arms)
    angles = [read.yaw_deg, read.pitch_deg, read.roll_deg]
    turns = (around * Rotation.from_euler("ZYX", angles, degrees=True)).as_quat()
    return [
        Body(read.shape, read.size_m, tuple(stand), tuple(turn), read.texture)
        for ring in stands.tolist()
        for stand, turn in zip(ring, turns.tolist(), strict=True)
    ]
