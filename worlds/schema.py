"""Worlds as people write them: YAML, checked as it is read; an error names the field.

Lengths are in m, angles in degrees.
"""

import re
from collections import Counter
from typing import Annotated, Any, get_args

import msgspec
import yaml
from msgspec import Meta

from worlds.model import MAX_COORDINATE_M, MAX_HEIGHT_M, Primitive, Shape, Texture

try:
    # libyaml, 8 times faster.
    from yaml import CSafeLoader as SafeLoader
except ImportError:
    from yaml import SafeLoader  # type: ignore[assignment]

_Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4)]
_Point = tuple[_Coordinate, _Coordinate, _Coordinate]
_Level = Annotated[float, Meta(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M)]
_Height = Annotated[float, Meta(ge=0.0, le=MAX_HEIGHT_M)]
_Place = tuple[_Level, _Level, _Height]
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


class _Read(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Part of a file."""


class Start(_Read, frozen=True, kw_only=True):
    """Where a vehicle is set down."""

    position_m: _Place = (0.0, 0.0, 0.0)
    yaw_deg: _Angle = 0.0


class SegmentText(_Read, frozen=True, kw_only=True):
    """One primitive of the ideal path."""

    primitive: Primitive
    length_m: _Length | None = None
    radius_m: _Length | None = None
    sweep_deg: _Angle | None = None
    climb_m: Annotated[float, Meta(ge=-1000.0, le=1000.0)] | None = None
    amplitude_m: _Length | None = None
    wavelength_m: Annotated[float, Meta(ge=0.1, le=1000.0)] | None = None

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


class IdealPath(_Read, frozen=True, kw_only=True):
    """Segments put end to end."""

    start_m: _Point
    yaw_deg: _Angle = 0.0
    closed: bool = False
    segments: Annotated[list[SegmentText], Meta(min_length=1)]


class Fence(_Read, frozen=True, kw_only=True):
    """On both sides of the lane."""

    height_m: _Length
    thickness_m: _Length = 0.05
    panel_m: Annotated[float, Meta(ge=0.1, le=1000.0)] = 2.5
    texture: Texture = "fence"


class Lane(_Read, frozen=True, kw_only=True):
    """Painted along the ideal path."""

    width_m: _Length
    texture: Texture = "asphalt"
    fence: Fence | None = None


class Row(_Read, frozen=True, kw_only=True):
    """How often a body stands there again, each a step further."""

    count: _Count
    step_m: _Point


class Ring(_Read, frozen=True, kw_only=True):
    """How often a body stands around a point."""

    count: _Count
    centre_m: tuple[_Coordinate, _Coordinate] = (0.0, 0.0)


class BodyText(_Read, frozen=True, kw_only=True):
    """A body, and where it stands again."""

    shape: Shape
    size_m: tuple[_Length, _Length, _Length]
    position_m: _Point
    roll_deg: _Angle = 0.0
    pitch_deg: _Angle = 0.0
    yaw_deg: _Angle = 0.0
    texture: Texture
    rows: list[Row] = []
    ring: Ring | None = None

    def __post_init__(self) -> None:
        round_sides = {"box": 1, "cylinder": 2, "sphere": 3}[self.shape]
        if len(set(self.size_m[:round_sides])) > 1:
            raise ValueError(f"{self.shape}: the first {round_sides} of `size_m` must be equal")


class WorldText(_Read, frozen=True, kw_only=True):
    """All of a file."""

    description: str
    ground: Texture = "grass"
    start: Start = Start()
    ideal_path: IdealPath | None = None
    lane: Lane | None = None
    bodies: list[BodyText] = []


_PLACE = re.compile(r" - at `\$[^`]*\.(\w+)[^.`]*`$")
"""The name of the field that msgspec's error is about."""
_PARTS: dict[str, type[_Read]] = {
    "": WorldText,
    "start": Start,
    "ideal_path": IdealPath,
    "segments": SegmentText,
    "lane": Lane,
    "fence": Fence,
    "bodies": BodyText,
    "rows": Row,
    "ring": Ring,
}


class _Loader(SafeLoader):
    """Refuses what is there twice, of which YAML would silently take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names = Counter(str(key.value) for key, _ in node.value)
        name, times = names.most_common(1)[0] if names else ("", 1)
        if times > 1:
            line = node.start_mark.line + 1
            raise yaml.YAMLError(f"`{name}` is there twice in what begins in line {line}")
        return super().construct_mapping(node, deep)


def read(text: bytes) -> WorldText:
    """A world's file.

    Raises:
        ValueError: if it is none; one line that says what is wrong, and what is allowed.
    """
    try:
        return msgspec.convert(yaml.load(text, _Loader), WorldText)
    except (ValueError, msgspec.DecodeError, yaml.YAMLError) as error:
        raise ValueError(_line_of(error)) from None


def _line_of(error: Exception) -> str:
    text = " ".join(str(error).split()).replace('"<byte string>", ', "")
    place = _PLACE.search(text)
    field = place[1] if place else ""
    if text.startswith("Invalid enum value"):
        text = f"{text}; use {', '.join(get_args(_CHOICES[field]))}"
    elif text.startswith(("Object contains unknown field", "Expected `object`")) and (
        part := _PARTS.get(field)
    ):
        text = f"{text}; use {', '.join(part.__struct_fields__)}"
    return text
