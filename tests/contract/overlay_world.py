"""What the overlay sees and who looks at it: a stretch of straight path, and console pages."""

import asyncio
import json
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import aiohttp
import cv2
import numpy as np
from payloads import GOOD

WIDTH, HEIGHT, FOCAL_PX = 640, 360, 430.0
PICTURE_HZ = 30.0


def grey_picture() -> np.ndarray:
    rows = np.linspace(150, 90, HEIGHT, dtype=np.uint8)[:, None, None]
    return np.broadcast_to(rows, (HEIGHT, WIDTH, 3)).copy()


def jpeg_of(picture: np.ndarray) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])[1])


def picture_of(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def _body(message: str, **more: Any) -> dict[str, Any]:
    return {k: v for k, v in {**GOOD[message], **more}.items() if k not in ("stamp", "seq")}


class World:
    """Publishes what flies, at its rates, until its streams are closed.

    Attributes:
        pose: more fields of each pose; likewise of the others.
        suggests: whether there is a suggestion, number `number`.
    """

    def __init__(self, client: Any, streams: Any) -> None:
        self.pose: dict[str, Any] = {}
        self.status: dict[str, Any] = {}
        self.suggests = True
        self.number = 1
        self.captures: list[int] = []
        self._client = client
        self._grey = jpeg_of(grey_picture())
        streams.add("pose", 50.0, lambda _t: _body("Pose", **self.pose))
        streams.add("autopilot", 20.0, lambda _t: _body("AutopilotStatus", **self.status))
        streams.add("vehicle", 10.0, lambda _t: _body("VehicleStatus"))
        streams.add("stick", 50.0, lambda _t: _body("Stick", vx=0.0, wz=0.0))
        streams.add("intent", 2.0, lambda _t: _body("Intent"))
        streams.add("camera/front", PICTURE_HZ, self._picture)
        streams.add("health/sim", 5.0, self._suggest)

    def _picture(self, t_s: float) -> dict[str, Any]:
        capture = time.time_ns()
        self.captures.append(capture)
        return _body(
            "Image",
            width=WIDTH,
            height=HEIGHT,
            data=self._grey,
            intrinsics=[FOCAL_PX, FOCAL_PX, WIDTH / 2, HEIGHT / 2],
            capture=capture,
        )

    def _suggest(self, _t_s: float) -> dict[str, Any]:
        if self.suggests:
            path = [[0.1 * i, 0.0, 1.0, 0.0] for i in range(200)]
            self._client.publish("suggestion", _body("Suggestion", id=self.number, path=path))
        return _body("Health")


def arrow_pixels(picture: np.ndarray) -> int:
    """Pixels below the strip of text that are coloured; the world is grey."""
    spread = np.ptp(picture[30:].astype(int), axis=2)
    return int((spread > 60).sum())


def on_path_px(ahead_m: float, below_m: float = 0.3, camera_m: float = 0.21) -> tuple[int, int]:
    """Row and column of a point on the arrows of a path straight ahead."""
    row = HEIGHT / 2 + FOCAL_PX * below_m / (ahead_m - camera_m)
    return math.floor(row), WIDTH // 2


class Page:
    """A console page without a browser: shows pictures as they come and remembers the rest.

    Args:
        port: of the console.
        origin: the site whose page it is.
        shows: whether it says that it has shown a picture.
    """

    def __init__(self, port: int, origin: str | None = None, shows: bool = True) -> None:
        self.pictures: list[bytes] = []
        self.states: list[dict[str, Any]] = []
        self.answers: list[dict[str, Any]] = []
        self.arrival_s: list[float] = []
        self.refused = False
        self._shows = shows
        self._url = f"http://127.0.0.1:{port}/ws"
        self._headers = {"Origin": origin} if origin else {}
        self._socket: aiohttp.ClientWebSocketResponse | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_until_complete, args=(self._live(),), daemon=True
        )
        self._thread.start()
        self.wait(lambda: self._socket is not None or self.refused)

    async def _live(self) -> None:
        async with aiohttp.ClientSession(headers=self._headers) as session:
            try:
                socket = await session.ws_connect(self._url)
            except aiohttp.WSServerHandshakeError:
                self.refused = True
                return
            self._socket = socket
            async for message in socket:
                if message.type is aiohttp.WSMsgType.BINARY:
                    self.pictures.append(message.data)
                    self.arrival_s.append(time.monotonic())
                    if self._shows:
                        await socket.send_str('{"type":"shown"}')
                elif message.type is aiohttp.WSMsgType.TEXT:
                    heard = json.loads(message.data)
                    (self.states if heard["type"] == "state" else self.answers).append(heard)

    def say(self, message: dict[str, Any] | str) -> None:
        assert self._socket is not None
        text = message if isinstance(message, str) else json.dumps(message)
        asyncio.run_coroutine_threadsafe(self._socket.send_str(text), self._loop).result(5.0)

    def push(self, duration_s: float, **sticks: float) -> None:
        """Hold the sticks somewhere, as a page tells it."""
        end_s = time.monotonic() + duration_s
        while time.monotonic() < end_s:
            self.say({"type": "stick", "vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0, **sticks})
            time.sleep(0.02)

    def release(self) -> None:
        self.say({"type": "release"})

    def wait(self, condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, f"not within {timeout_s} s"
            time.sleep(0.005)

    def next_state(self, accept: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        seen = len(self.states)
        self.wait(lambda: any(accept(state) for state in self.states[seen:]))
        return next(state for state in self.states[seen:] if accept(state))

    def leave(self) -> None:
        if self._socket is not None and self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._socket.close(), self._loop).result(5.0)
        self._thread.join(5.0)
        if not self._loop.is_running():
            self._loop.close()
