"""Textures painted by rule: irregular everywhere, so that vision finds corners on all of them.

Each is a square of PIXELS x PIXELS RGBA that repeats without a seam, unless it says otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from worlds import Texture

PIXELS = 512
CANVAS = 1024
"""Pixels that are painted."""
_SEED = 20210
NET_MESHES = (24, 11)
"""Of a net, across a repetition and upwards; about 10 cm each."""
NET_THREAD = 0.12
"""How much of a mesh it covers."""
NET_TAPE = 0.06
"""How much of a net's height it covers, on top."""
NET_COLOURS = ((0.16, 0.18, 0.20), (0.96, 0.45, 0.05))
"""Of thread and tape."""

Picture = NDArray[np.uint8]
_Field = NDArray[np.float32]
_Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Paint:
    """A texture and how large it is in the world.

    Attributes:
        picture: (PIXELS, PIXELS, 4), uint8, first row on top.
        width_m: what one repetition measures; None fits the picture to each face.
        height_m: the same, upwards.
    """

    picture: Picture
    width_m: float | None
    height_m: float | None


@cache
def paint(texture: Texture) -> Paint:
    """The paint of a texture; the same one each time."""
    painter, width_m, height_m = _PAINTERS[texture]
    # A new one at the end leaves the others as they are.
    generator = np.random.default_rng([_SEED, list(_PAINTERS).index(texture)])
    # Painted finely, then averaged: what OpenGL reads most often must fit in a cache.
    picture = cv2.resize(painter(generator), (PIXELS, PIXELS), interpolation=cv2.INTER_AREA)
    return Paint(np.asarray(picture, np.uint8), width_m, height_m)


def noise(generator: np.random.Generator, cells: int, octaves: int) -> _Field:
    """Seamless cloudy noise in [0, 1], (CANVAS, CANVAS), from `cells` cells a side upwards."""
    total: _Field = np.zeros((CANVAS, CANVAS), np.float32)
    weight = 1.0
    for octave in range(octaves):
        side = min(CANVAS, cells << octave)
        grid = generator.random((side, side), dtype=np.float32)
        # A margin of the other side makes the enlarged picture meet itself.
        margin = min(4, side)
        wide = np.pad(grid, margin, mode="wrap")
        scale = CANVAS // side
        large = cv2.resize(wide, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        begin = margin * scale
        total += weight * large[begin : begin + CANVAS, begin : begin + CANVAS]
        weight *= 0.55
    low, high = np.percentile(total, [1.0, 99.0])
    return np.asarray(np.clip((total - low) / (high - low), 0.0, 1.0), np.float32)


def _blend(low: _Rgb, high: _Rgb, share: _Field) -> _Field:
    """The mix of two colours (0..1) by a field, (CANVAS, CANVAS, 3)."""
    begin, end = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return begin + (end - begin) * share[..., None]


def _picture(colour: _Field, alpha: _Field | None = None) -> Picture:
    opaque = np.ones((CANVAS, CANVAS), np.float32) if alpha is None else alpha
    whole = np.dstack([colour, opaque])
    return np.asarray(np.clip(whole * 255.0, 0.0, 255.0), np.uint8)


def _spots(
    generator: np.random.Generator, colour: _Field, count: int, radius: tuple[int, int], rgb: _Rgb
) -> None:
    """Scatter filled spots of a colour, each a little lighter or darker, over the seam too."""
    for _ in range(count):
        x, y = generator.integers(0, CANVAS, 2)
        size = int(generator.integers(radius[0], radius[1] + 1))
        shade = np.asarray(rgb) * generator.uniform(0.75, 1.25)
        for dx in (0, -CANVAS) if x + size >= CANVAS else (0,):
            for dy in (0, -CANVAS) if y + size >= CANVAS else (0,):
                cv2.circle(colour, (int(x) + dx, int(y) + dy), size, shade.tolist(), -1)


def _asphalt(generator: np.random.Generator) -> Picture:
    colour = _blend((0.21, 0.22, 0.24), (0.40, 0.41, 0.42), noise(generator, 8, 7))
    colour *= 0.8 + 0.4 * generator.random((CANVAS, CANVAS, 1), dtype=np.float32)
    # Stones of 1 to 4 cm, light and dark: what a camera 1 m above sees its motion by.
    _spots(generator, colour, 320, (2, 8), (0.56, 0.55, 0.52))
    _spots(generator, colour, 260, (2, 9), (0.12, 0.12, 0.13))
    _spots(generator, colour, 16, (10, 20), (0.47, 0.44, 0.40))
    for _ in range(2):
        heading = np.cumsum(generator.normal(0.0, 0.35, 60)) + generator.uniform(0.0, 6.28)
        points = np.cumsum(6.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        points += generator.integers(360, CANVAS - 360, 2)
        line = np.clip(points, 0, CANVAS - 1).astype(np.int32)
        cv2.polylines(colour, [line], False, (0.1, 0.1, 0.11), 2)
    return _picture(colour)


def _grass(generator: np.random.Generator) -> Picture:
    colour = _blend((0.17, 0.29, 0.09), (0.41, 0.53, 0.20), noise(generator, 8, 8))
    for _ in range(5000):
        x, y = generator.integers(0, CANVAS, 2)
        dx, dy = generator.integers(-18, 19, 2)
        green = generator.uniform(0.6, 1.4) * np.asarray((0.31, 0.45, 0.14))
        cv2.line(colour, (int(x), int(y)), (int(x + dx), int(y + dy)), green.tolist(), 2)
    _spots(generator, colour, 30, (4, 8), (0.85, 0.82, 0.55))
    _spots(generator, colour, 40, (6, 16), (0.33, 0.26, 0.16))
    return _picture(colour)


def _concrete(generator: np.random.Generator) -> Picture:
    colour = _blend((0.50, 0.50, 0.48), (0.72, 0.71, 0.68), noise(generator, 4, 8))
    _spots(generator, colour, 500, (1, 4), (0.38, 0.38, 0.37))
    # A warning band, as on the pillars of a car park.
    rows = np.arange(CANVAS)[:, None] + np.arange(CANVAS)[None, :]
    stripes = (rows // 128) % 2 == 0
    band = np.zeros((CANVAS, CANVAS), bool)
    band[640:896] = True
    colour[band & stripes] = (0.95, 0.75, 0.05)
    colour[band & ~stripes] = (0.08, 0.08, 0.08)
    return _picture(colour)


def _brick(generator: np.random.Generator) -> Picture:
    colour = _blend((0.60, 0.58, 0.54), (0.72, 0.70, 0.66), noise(generator, 16, 6))
    rows, columns = 16, 8
    height, width = CANVAS // rows, CANVAS // columns
    for row in range(rows):
        for column in range(columns + 1):
            x = column * width - (row % 2) * width // 2
            # The halves that meet over the seam are one brick.
            tone = np.random.default_rng([_SEED, row, column % columns]).uniform(0.75, 1.2)
            corner = (x + width - 5, (row + 1) * height - 5)
            red = tone * np.asarray((0.56, 0.26, 0.19))
            cv2.rectangle(colour, (x + 5, row * height + 5), corner, red.tolist(), -1)
    colour *= 0.75 + 0.5 * noise(generator, 32, 5)[..., None]
    # Windows: one a repetition of 4 m.
    cv2.rectangle(colour, (330, 300), (700, 720), (0.86, 0.85, 0.80), -1)
    cv2.rectangle(colour, (355, 325), (505, 695), (0.22, 0.30, 0.38), -1)
    cv2.rectangle(colour, (525, 325), (675, 695), (0.26, 0.35, 0.43), -1)
    return _picture(colour)


def _crate(generator: np.random.Generator) -> Picture:
    wide = cv2.resize(noise(generator, 32, 5), (CANVAS * 4, CANVAS))
    stretched = np.asarray(wide[:, :CANVAS], np.float32)
    colour = _blend((0.45, 0.30, 0.16), (0.78, 0.58, 0.34), stretched)
    for row in range(0, CANVAS, 128):
        colour[row : row + 128] *= generator.uniform(0.8, 1.15)
        colour[row : row + 8] *= 0.35
    frame = 90
    edge = np.zeros((CANVAS, CANVAS), np.uint8)
    cv2.rectangle(edge, (0, 0), (CANVAS - 1, CANVAS - 1), 1, frame * 2)
    cv2.line(edge, (0, CANVAS), (CANVAS, 0), 1, frame)
    colour[edge > 0] = colour[edge > 0] * 0.55 + np.asarray((0.38, 0.25, 0.12))
    outline = cv2.morphologyEx(edge, cv2.MORPH_GRADIENT, np.ones((9, 9), np.uint8))
    colour[outline > 0] *= 0.4
    return _picture(colour)


def _container(generator: np.random.Generator) -> Picture:
    wave = 0.5 + 0.5 * np.sin(np.arange(CANVAS) * (2.0 * np.pi * 20 / CANVAS))
    ribs = np.repeat((0.62 + 0.5 * wave)[None, :], CANVAS, axis=0).astype(np.float32)
    colour = _blend((0.05, 0.22, 0.38), (0.13, 0.38, 0.58), noise(generator, 8, 7))
    colour *= ribs[..., None]
    rust = noise(generator, 8, 7) > 0.87
    colour[rust] = colour[rust] * 0.4 + np.asarray((0.30, 0.14, 0.06))
    cv2.rectangle(colour, (0, 0), (CANVAS - 1, CANVAS - 1), (0.05, 0.14, 0.22), 40)
    letters = np.zeros((CANVAS, CANVAS), np.uint8)
    for text, y, size in (("AUTOCOMPLETE", 430, 3.4), ("ARD 420 530 2", 640, 2.4)):
        (wide, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, size, 10)
        cv2.putText(
            letters, text, ((CANVAS - wide) // 2, y), cv2.FONT_HERSHEY_DUPLEX, size, 255, 10
        )
    colour[letters > 0] = (0.90, 0.92, 0.92)
    return _picture(colour)


def _foliage(generator: np.random.Generator) -> Picture:
    colour = _blend((0.05, 0.14, 0.04), (0.20, 0.36, 0.11), noise(generator, 16, 6))
    for _ in range(5000):
        x, y = (int(each) for each in generator.integers(0, CANVAS, 2))
        axes = (int(generator.integers(5, 14)), int(generator.integers(3, 7)))
        green = generator.uniform(0.4, 1.7) * np.asarray((0.20, 0.37, 0.11))
        cv2.ellipse(
            colour, (x, y), axes, float(generator.uniform(0, 180)), 0, 360, green.tolist(), -1
        )
    return _picture(colour)


def _post(generator: np.random.Generator) -> Picture:
    colour = _blend((0.78, 0.78, 0.78), (0.92, 0.92, 0.92), noise(generator, 8, 5))
    for begin in range(0, CANVAS, 256):
        colour[begin : begin + 128] *= np.asarray((0.20, 0.21, 0.24), np.float32)
    return _picture(colour)


def _fence(generator: np.random.Generator) -> Picture:
    """A net with a tape on top, for its shadow; what is seen of it OpenGL draws by rule."""
    colour = np.empty((CANVAS, CANVAS, 3), np.float32)
    colour[:] = NET_COLOURS[0]
    steps = np.arange(CANVAS) / CANVAS
    across, up = (steps * meshes % 1.0 < NET_THREAD for meshes in NET_MESHES)
    tape = steps < NET_TAPE
    colour[tape] = NET_COLOURS[1]
    alpha = up[:, None] | across | tape[:, None]
    return _picture(colour, alpha.astype(np.float32))


def _board(generator: np.random.Generator) -> Picture:
    """A board 0.5 m high and 2.5 m long, of red and white fields, dirty."""
    colour = np.empty((CANVAS, CANVAS, 3), np.float32)
    # Slanted by 45 deg in the world, where a row is a fifth as high as a column is wide.
    slope = np.arange(CANVAS)[None, :] + 0.2 * np.arange(CANVAS)[:, None]
    red = (slope // 128) % 2 == 0
    colour[:] = np.where(red[..., None], (0.80, 0.08, 0.07), (0.93, 0.93, 0.91))
    colour *= (0.72 + 0.4 * noise(generator, 16, 6))[..., None]
    _spots(generator, colour, 160, (2, 8), (0.30, 0.27, 0.22))
    colour[:24] = 0.1
    return _picture(colour)


def _soil(generator: np.random.Generator) -> Picture:
    colour = _blend((0.20, 0.13, 0.08), (0.42, 0.30, 0.19), noise(generator, 8, 8))
    _spots(generator, colour, 700, (3, 14), (0.33, 0.23, 0.14))
    _spots(generator, colour, 200, (2, 7), (0.55, 0.47, 0.36))
    for _ in range(700):
        x, y = (int(each) for each in generator.integers(0, CANVAS, 2))
        dx, dy = (int(each) for each in generator.integers(-16, 17, 2))
        cv2.line(colour, (x, y), (x + dx, y + dy), (0.52, 0.45, 0.26), 2)
    return _picture(colour)


def _roof(generator: np.random.Generator) -> Picture:
    """Tiles in rows, each row half a tile on."""
    colour = np.full((CANVAS, CANVAS, 3), 0.12, np.float32)
    rows, columns = 16, 16
    side = CANVAS // rows
    for row in range(rows):
        for column in range(columns + 1):
            x = column * side - (row % 2) * side // 2
            tone = np.random.default_rng([_SEED, 7, row, column % columns]).uniform(0.6, 1.25)
            red = tone * np.asarray((0.58, 0.24, 0.15))
            centre, axes = (x + side // 2, row * side), (side // 2 - 2, side - 3)
            cv2.ellipse(colour, centre, axes, 0.0, 0.0, 180.0, red.tolist(), -1)
    colour *= (0.7 + 0.5 * noise(generator, 16, 6))[..., None]
    return _picture(colour)


def _wood(generator: np.random.Generator) -> Picture:
    """Upright planks with knots."""
    grain = cv2.resize(noise(generator, 32, 5), (CANVAS, CANVAS * 4))[:CANVAS]
    colour = _blend((0.36, 0.22, 0.12), (0.70, 0.50, 0.30), np.asarray(grain, np.float32))
    for column in range(0, CANVAS, 128):
        colour[:, column : column + 128] *= generator.uniform(0.75, 1.2)
        colour[:, column : column + 7] *= 0.3
        for _ in range(2):
            y, x = (
                int(generator.integers(60, CANVAS - 60)),
                column + int(generator.integers(30, 98)),
            )
            cv2.ellipse(colour, (x, y), (13, 22), 0.0, 0.0, 360.0, (0.22, 0.12, 0.06), -1)
            cv2.ellipse(colour, (x, y), (22, 36), 0.0, 0.0, 360.0, (0.30, 0.18, 0.10), 3)
    return _picture(colour)


def _metal(generator: np.random.Generator) -> Picture:
    """Galvanised sheets with rivets, labels and rust."""
    colour = _blend((0.55, 0.58, 0.60), (0.80, 0.82, 0.83), noise(generator, 16, 7))
    for at in range(0, CANVAS, 256):
        colour[at : at + 8] *= 0.45
        colour[:, at : at + 8] *= 0.45
        for other in range(32, CANVAS, 64):
            cv2.circle(colour, (other, at + 24), 7, (0.35, 0.36, 0.38), -1)
            cv2.circle(colour, (at + 24, other), 7, (0.35, 0.36, 0.38), -1)
    rust = noise(generator, 8, 7) > 0.85
    colour[rust] = colour[rust] * 0.4 + np.asarray((0.33, 0.17, 0.08))
    for x, y, rgb in ((330, 340, (0.95, 0.75, 0.05)), (820, 620, (0.75, 0.10, 0.08))):
        cv2.rectangle(colour, (x, y), (x + 110, y + 80), rgb, -1)
        cv2.line(colour, (x + 12, y + 66), (x + 98, y + 14), (0.1, 0.1, 0.1), 8)
    return _picture(colour)


_PAINTERS: dict[
    Texture, tuple[Callable[[np.random.Generator], Picture], float | None, float | None]
] = {
    "asphalt": (_asphalt, 2.0, 2.0),
    "brick": (_brick, 4.0, 4.0),
    "concrete": (_concrete, 2.0, 2.0),
    "container": (_container, None, None),
    "crate": (_crate, None, None),
    "fence": (_fence, 2.5, None),
    "foliage": (_foliage, 3.0, 3.0),
    "grass": (_grass, 2.0, 2.0),
    "post": (_post, 1.0, 0.8),
    "soil": (_soil, 2.0, 2.0),
    "roof": (_roof, 2.5, 2.5),
    "wood": (_wood, 2.0, 2.0),
    "metal": (_metal, 2.0, 2.0),
    "board": (_board, 2.5, None),
}


def patches() -> Picture:
    """Seamless cloudy light and dark, (PIXELS, PIXELS, 1)."""
    field = noise(np.random.default_rng(_SEED), 16, 6)
    return np.asarray(cv2.resize(field, (PIXELS, PIXELS)) * 255.0, np.uint8)[..., None]
