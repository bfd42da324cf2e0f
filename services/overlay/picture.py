"""Draws arrows and a line of text into a picture (BGR, in place). Pure."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.overlay.arrows import Arrow

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

SUGGESTED: Colour = (40, 190, 255)
ENGAGED: Colour = (110, 220, 70)
WARNING: Colour = (70, 90, 255)
TEXT: Colour = (245, 245, 245)
EDGE: Colour = (20, 20, 20)
RIM = 0.65
"""How far an arrow's rim is from its colour to white."""
EDGED_PX = 7.0
"""Lower arrows have no edges: little else would be left of them."""

STRIP_PX = 24
EDGE_PX = 8
FONT, FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.42
_SUBPIXEL_BITS = 4


def draw_arrow(picture: Picture, arrow: Arrow, colour: Colour) -> None:
    """Blend one arrow into the picture with its opacity."""
    height, width = picture.shape[:2]
    low = np.floor(arrow.outline_px.min(axis=0)).astype(int) - 2
    high = np.ceil(arrow.outline_px.max(axis=0)).astype(int) + 3
    x0, y0 = max(0, int(low[0])), max(0, int(low[1]))
    x1, y1 = min(width, int(high[0])), min(height, int(high[1]))
    if x0 >= x1 or y0 >= y1:
        return
    region = picture[y0:y1, x0:x1]
    painted = region.copy()
    outline = np.round((arrow.outline_px - (x0, y0)) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    # Dark outside, light inside: one of the two shows on any ground.
    is_edged = float(np.ptp(arrow.outline_px[:, 1])) >= EDGED_PX
    if is_edged:
        cv2.polylines(painted, [outline], True, EDGE, 3, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.fillPoly(painted, [outline], colour, cv2.LINE_AA, _SUBPIXEL_BITS)
    if is_edged:
        rim = tuple(round(part + RIM * (255 - part)) for part in colour)
        cv2.polylines(painted, [outline], True, rim, 1, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.addWeighted(painted, arrow.opacity, region, 1.0 - arrow.opacity, 0.0, region)


def draw_strip(picture: Picture, parts: list[tuple[str, Colour]]) -> None:
    """Write texts side by side on a darkened strip at the picture's top."""
    _write(picture[:STRIP_PX], parts)


def draw_foot(picture: Picture, text: str, colour: Colour) -> None:
    """Write as much of a text as there is room for on a darkened strip at the picture's foot."""
    room_px, width_px = max(0, picture.shape[1] - 2 * EDGE_PX), _width_px(text)
    if width_px > room_px:
        text = text[: max(0, len(text) * room_px // width_px - 3)] + "..."
    _write(picture[-STRIP_PX:], [(text, colour)])


def _write(strip: Picture, parts: list[tuple[str, Colour]]) -> None:
    cv2.addWeighted(strip, 0.35, strip, 0.0, 0.0, strip)
    x = EDGE_PX
    for text, colour in parts:
        cv2.putText(strip, text, (x, 16), FONT, FONT_SCALE, colour, 1, cv2.LINE_AA)
        x += _width_px(text) + 18


def _width_px(text: str) -> int:
    (width, _), _ = cv2.getTextSize(text, FONT, FONT_SCALE, 1)
    return int(width)


def decode(data: bytes) -> Picture | None:
    """A JPEG as BGR, or None if it is none."""
    if not data:
        return None
    try:
        decoded = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # a header that claims more pixels than OpenCV reads
        return None
    return None if decoded is None else np.asarray(decoded, dtype=np.uint8)


def encode(picture: Picture, quality: int) -> bytes:
    """A BGR picture as JPEG."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data.tobytes())
