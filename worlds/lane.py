"""A lane along the ideal path: asphalt, lines, fences with a board below and a net above."""

import itertools
import math

import numpy as np

from worlds.model import Array, Body, Strip, Texture
from worlds.path import Path, sampled

CORNER_RAD = math.radians(15.0)
"""A fence follows a curve in panels of at most this angle."""
BOARD_SHARE = 0.3
"""Of a fence's height. The board hides what is behind it from painting, which a net does not."""


def paint(path: Path, width_m: float, texture: Texture) -> list[Strip]:
    """A lane with white edges and a dashed yellow midline."""

    def line(left_m: float) -> Array:
        return sampled(path, left_m, math.inf, math.radians(3.0))[:, :2]

    edge_m = width_m / 2.0 - 0.15
    white, yellow = (0.92, 0.92, 0.9), (0.98, 0.78, 0.1)
    return [
        Strip(line(0.0), width_m + 0.4, texture, (1.0, 1.0, 1.0)),
        Strip(line(edge_m), 0.1, None, white),
        Strip(line(-edge_m), 0.1, None, white),
        Strip(line(0.0), 0.12, None, yellow, dash_m=0.5),
    ]


def fence(
    path: Path,
    width_m: float,
    height_m: float,
    thickness_m: float,
    panel_m: float,
    texture: Texture,
) -> list[Body]:
    """Panels and posts on both sides of a lane of a width."""
    bodies: list[Body] = []
    upright = (0.0, 0.0, 0.0, 1.0)
    board_m = BOARD_SHARE * height_m
    parts: tuple[tuple[float, float, Texture], ...] = ((0.0, height_m, texture),)
    if texture == "fence":
        parts = ((0.0, board_m, "board"), (board_m, height_m, "fence"))
    post_m = (0.09, 0.09, height_m + 0.1)
    for left_m in (width_m / 2.0, -width_m / 2.0):
        corners = sampled(path, left_m, panel_m, CORNER_RAD)[:, :2]
        for begin, end in itertools.pairwise(corners):
            dx, dy = end - begin
            x, y = (begin + end) / 2.0
            half_yaw = math.atan2(dy, dx) / 2.0
            bodies.extend(
                Body(
                    "box",
                    (float(np.hypot(dx, dy)), thickness_m, top_m - bottom_m),
                    (float(x), float(y), (bottom_m + top_m) / 2.0),
                    (0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)),
                    part,
                )
                for bottom_m, top_m, part in parts
            )
        for x, y in corners[:-1] if path.closed else corners:
            bodies.append(
                Body("cylinder", post_m, (float(x), float(y), post_m[2] / 2.0), upright, "post")
            )
    return bodies
