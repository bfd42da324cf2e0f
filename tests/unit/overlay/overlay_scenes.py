"""Suggestions, poses and pictures that the overlay's tests share."""

import math
from typing import Any

import cv2
import numpy as np

from common import messages as m
from common.camera import Lens
from common.frames import quaternion_of

LENS = Lens.of_view(640, 360, math.radians(73.5))
NOW_NS = 5_000_000_000
STAMP_NS = 1_700_000_000_000_000_000


def pose(x: float = 0.0, y: float = 0.0, z: float = 1.0, **more: Any) -> m.Pose:
    roll, pitch, yaw = more.pop("angles", (0.0, 0.0, 0.0))
    fields: dict[str, Any] = {
        "stamp": STAMP_NS,
        "seq": 0,
        "position": (x, y, z),
        "orientation": quaternion_of(roll, pitch, yaw),
        "velocity": (0.0, 0.0, 0.0),
        "angular_velocity": (0.0, 0.0, 0.0),
        "covariance": (0.01,) * 6,
        "status": "ok",
        "source": "test",
    }
    return m.Pose(**(fields | more))


def suggestion(points_m: Any, *, closed: bool = False, **more: Any) -> m.Suggestion:
    path = [(float(x), float(y), float(z), 0.0) for x, y, z in points_m]
    fields: dict[str, Any] = {
        "stamp": STAMP_NS,
        "seq": 0,
        "id": 1,
        "primitive": "arc",
        "params": {},
        "path": path,
        "closed": closed,
        "speed": 0.8,
        "fit_rms": 0.02,
        "confidence": 0.9,
        "heading_sector": 0,
    }
    return m.Suggestion(**(fields | more))


def refusal(reason: str) -> m.Refusal:
    return m.Refusal(stamp=STAMP_NS, seq=0, label="arc", reason=reason)


def line(length_m: float = 20.0) -> list[tuple[float, float, float]]:
    return [(0.1 * i, 0.0, 1.0) for i in range(round(10 * length_m))]


def circle(radius_m: float, *, left: bool, turns: float = 1.0, pitch_m: float = 0.0) -> np.ndarray:
    """From the origin at 1 m, heading along x; `pitch_m` is the climb of one turn."""
    angle = np.linspace(0.0, 2.0 * math.pi * turns, round(80 * turns))
    side = 1.0 if left else -1.0
    return np.stack(
        [
            radius_m * np.sin(angle),
            side * radius_m * (1.0 - np.cos(angle)),
            1.0 + pitch_m * angle / (2.0 * math.pi),
        ],
        axis=1,
    )


def status(mode: m.FlightMode = "manual", flown: int = 0) -> m.AutopilotStatus:
    return m.AutopilotStatus(
        stamp=STAMP_NS, seq=0, mode=mode, suggestion=flown, progress=0.0, cross_track=0.0, reason=""
    )


def background() -> np.ndarray:
    """Sky over ground, with tiles on it."""
    rows, columns = np.mgrid[0:360, 0:640]
    picture = np.empty((360, 640, 3), dtype=np.uint8)
    picture[:] = (200, 170, 140)
    below = rows > 180
    tiles = ((columns // 40 + rows // 40) % 2).astype(bool)
    picture[below & tiles] = (90, 100, 95)
    picture[below & ~tiles] = (70, 80, 75)
    return picture


def image(picture: np.ndarray | None = None, **more: Any) -> m.Image:
    drawn = background() if picture is None else picture
    data = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    fields: dict[str, Any] = {
        "stamp": STAMP_NS + 3,
        "seq": 0,
        "width": 640,
        "height": 360,
        "format": "jpeg",
        "data": data,
        "intrinsics": LENS.intrinsics,
        "distortion": LENS.distortion,
        "capture": STAMP_NS,
    }
    return m.Image(**(fields | more))


def pixels(drawn: m.Image) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(drawn.data, np.uint8), cv2.IMREAD_COLOR)
