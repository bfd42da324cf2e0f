"""Worlds: one YAML a world in this folder, read by the simulator, operators and studies.

World frame ENU; lengths in m, angles in the files in degrees (for people), in memory in rad.
"""

from worlds.files import WorldError, load, load_file, names
from worlds.model import (
    MAX_COORDINATE_M,
    MAX_HEIGHT_M,
    Body,
    Primitive,
    Segment,
    Shape,
    Strip,
    Texture,
    World,
)
from worlds.path import PATH_STEP_M

__all__ = [
    "MAX_COORDINATE_M",
    "MAX_HEIGHT_M",
    "PATH_STEP_M",
    "Body",
    "Primitive",
    "Segment",
    "Shape",
    "Strip",
    "Texture",
    "World",
    "WorldError",
    "load",
    "load_file",
    "names",
]
