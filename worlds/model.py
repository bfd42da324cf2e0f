"""What a world is made of. Lengths in m, angles in rad, world frame ENU."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Texture = Literal[
    "asphalt",
    "grass",
    "concrete",
    "fence",
    "post",
    "crate",
    "brick",
    "container",
    "foliage",
    "soil",
    "roof",
    "wood",
    "metal",
    "board",
]
Shape = Literal["box", "cylinder", "sphere"]
Primitive = Literal["line", "arc", "sine", "helix"]
Vector3 = tuple[float, float, float]
Colour = tuple[float, float, float]

MAX_COORDINATE_M = 1000.0
"""A vehicle is set down no farther to the east, north, west or south of the world's middle."""
MAX_HEIGHT_M = 100.0
"""Nor higher above its ground."""


@dataclass(frozen=True)
class Segment:
    """One primitive of the ideal path.

    Attributes:
        primitive: its shape.
        length_m: its length along the path.
        radius_m: of an arc and a helix.
        sweep_rad: of an arc and a helix, + counter-clockwise.
        climb_m: from its begin to its end.
        amplitude_m: of a sine, whose axis is the heading that it begins with.
        wavelength_m: of a sine.
    """

    primitive: Primitive
    length_m: float
    radius_m: float | None = None
    sweep_rad: float | None = None
    climb_m: float = 0.0
    amplitude_m: float | None = None
    wavelength_m: float | None = None

    @property
    def bend_m(self) -> float:
        """The radius of its sharpest bend, seen from above."""
        if self.amplitude_m is not None and self.wavelength_m is not None:
            # Of A sin(k x) at its crests.
            return 1.0 / (self.amplitude_m * (2.0 * math.pi / self.wavelength_m) ** 2)
        return math.inf if self.radius_m is None else self.radius_m


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
        name: as it was asked for.
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
