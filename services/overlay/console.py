"""The console's web server: one page, one WebSocket a viewer, on a thread of its own.

A slow or frozen viewer slows nobody: each has its own task, which sends the newest picture, and at
most three before the page has shown the first of them. Decisions are asked on worker threads, so
that an autopilot that does not answer freezes nothing.
"""

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
from aiohttp import WSMsgType, web

from common.clock import Clock, seconds
from services.overlay import protocol
from services.overlay.lease import PadLease, Standing

PAGE = Path(__file__).parent / "console" / "dist"
PLAIN_PAGE = Path(__file__).parent / "console" / "plain.html"
STATE_PERIOD_S = 0.1
IN_FLIGHT = 3
"""Pictures on their way to a page: with one alone, 60 ms of network would halve the rate."""
SHOWN_TIMEOUT_S = 1.0
"""A page that does not say it has shown a picture gets the next one after this."""
URGENT = ("emergency", "cancel")
"""These never wait behind other decisions."""
OPEN_DECISIONS = 2
"""Other decisions that a page may have open."""
DECISION_MAX_AGE_S = 0.2
"""A button pressed longer ago than this, before the autopilot could be asked, means nothing now."""
NO_ANSWER = "the autopilot does not answer"
MAX_MESSAGE_BYTES = 4096
START_TIMEOUT_S = 10.0

Ask = Callable[[protocol.Decided], protocol.Answer]

log = logging.getLogger(__name__)


class Viewer:
    """One page that is connected."""

    def __init__(self, number: int, socket: web.WebSocketResponse) -> None:
        self.number = number
        self.socket = socket
        self.picture: bytes | None = None
        self.news = asyncio.Event()
        self.shown = asyncio.Event()
        self.in_flight = 0
        self.open_decisions = 0

    def offer(self, picture: bytes) -> None:
        """Have the newest picture sent next."""
        self.picture = picture
        self.news.set()


class Console:
    """The server; its public methods may be called from any thread.

    Args:
        host: address to listen on.
        port: port to listen on.
        state_of: what to show, given what the pad is to that page.
        ask: decides; may block.
        lease: whose sticks count.
        clock: for the lease.
    """

    def __init__(
        self,
        host: str,
        port: int,
        state_of: Callable[[Standing], protocol.State],
        ask: Ask,
        lease: PadLease,
        clock: Clock,
    ) -> None:
        self._host = host
        self._port = port
        self._state_of = state_of
        self._ask = ask
        self._lease = lease
        self._clock = clock
        self._viewers: dict[int, Viewer] = {}
        self._numbers = 0
        self._asked: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._stop: asyncio.Event | None = None
        self._started = threading.Event()
        self._error: OSError | None = None
        self._workers = ThreadPoolExecutor(max_workers=2, thread_name_prefix="decide")
        self._urgent_workers = ThreadPoolExecutor(max_workers=2, thread_name_prefix="urgent")
        self._thread = threading.Thread(target=self._serve, name="console", daemon=True)

    def start(self) -> None:
        """Listen.

        Raises:
            OSError: if the port cannot be listened on.
        """
        self._thread.start()
        self._started.wait(START_TIMEOUT_S)
        if self._error is not None:
            raise self._error

    def show(self, picture: bytes) -> None:
        """Send a picture to every viewer who is ready for one."""
        if self._viewers:
            self._loop.call_soon_threadsafe(self._offer, picture)

    def close(self) -> None:
        """Close every connection and stop listening."""
        if self._stop is not None:
            with contextlib.suppress(RuntimeError):  # its loop is closed already
                self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(START_TIMEOUT_S)
        for workers in (self._workers, self._urgent_workers):
            workers.shutdown(wait=False, cancel_futures=True)

    # --- on the console's thread -----------------------------------------------------------------

    def _offer(self, picture: bytes) -> None:
        for viewer in self._viewers.values():
            viewer.offer(picture)

    def _serve(self) -> None:
        try:
            # A runner also ends the decisions that still wait for their answers.
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._run())
        except OSError as error:
            self._error = error
        except UnicodeError as error:
            # A host that is no name: asyncio encodes it before anybody is asked for it.
            self._error = OSError(f"{self._host!r} is no host: {error}")
        finally:
            self._started.set()

    async def _run(self) -> None:
        self._stop = asyncio.Event()
        app = web.Application()
        app.router.add_get("/ws", self._talk)
        app.router.add_get("/", self._page)
        app.router.add_get("/plain", self._plain_page)
        if (PAGE / "assets").is_dir():
            app.router.add_static("/assets", PAGE / "assets")
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5)
        await runner.setup()
        try:
            await web.TCPSite(runner, self._host, self._port).start()
            self._started.set()
            await self._stop.wait()
            for viewer in tuple(self._viewers.values()):
                await viewer.socket.close()
        finally:
            await runner.cleanup()

    async def _page(self, request: web.Request) -> web.FileResponse:
        built = PAGE / "index.html"
        return _file(built) if built.is_file() else await self._plain_page(request)

    async def _plain_page(self, _request: web.Request) -> web.FileResponse:
        return _file(PLAIN_PAGE)

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        # Browsers let any site open a socket to any address; only our own pages may fly.
        origin = request.headers.get("Origin")
        if origin is not None and origin.partition("://")[2] != request.host:
            raise web.HTTPForbidden(text="this socket is for the console's own page")
        socket = web.WebSocketResponse(
            heartbeat=5.0,
            max_msg_size=MAX_MESSAGE_BYTES,
            compress=False,  # JPEG does not get smaller, and trying costs 4 % of a core a viewer
        )
        await socket.prepare(request)
        self._numbers += 1
        viewer = Viewer(self._numbers, socket)
        self._viewers[viewer.number] = viewer
        tasks = [
            asyncio.create_task(self._send_pictures(viewer)),
            asyncio.create_task(self._send_state(viewer)),
        ]
        try:
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    await self._hear(viewer, message.data)
                elif message.type is WSMsgType.BINARY:
                    problem = protocol.Problem("only text messages are understood")
                    await viewer.socket.send_str(protocol.encode(problem))
        finally:
            del self._viewers[viewer.number]
            self._lease.leave(viewer.number, self._clock.monotonic_ns())
            for task in tasks:
                task.cancel()
        return socket

    async def _send_pictures(self, viewer: Viewer) -> None:
        with contextlib.suppress(ConnectionError):
            while not viewer.socket.closed:
                await viewer.news.wait()
                viewer.news.clear()
                if viewer.picture is None:
                    continue
                while viewer.in_flight >= IN_FLIGHT:
                    viewer.shown.clear()
                    try:
                        await asyncio.wait_for(viewer.shown.wait(), SHOWN_TIMEOUT_S)
                    except TimeoutError:
                        viewer.in_flight = 0
                viewer.news.clear()
                viewer.in_flight += 1
                await viewer.socket.send_bytes(viewer.picture)

    async def _send_state(self, viewer: Viewer) -> None:
        with contextlib.suppress(ConnectionError):
            while not viewer.socket.closed:
                standing = self._lease.standing(viewer.number, self._clock.monotonic_ns())
                await viewer.socket.send_str(protocol.encode(self._state_of(standing)))
                await asyncio.sleep(STATE_PERIOD_S)

    async def _hear(self, viewer: Viewer, text: str) -> None:
        try:
            said = protocol.decode(text)
        except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
            await viewer.socket.send_str(protocol.encode(protocol.Problem(str(error))))
            return
        match said:
            case protocol.Shown():
                viewer.in_flight = max(0, viewer.in_flight - 1)
                viewer.shown.set()
            case protocol.StickMoved(vx, vy, vz, wz):
                self._lease.move(viewer.number, (vx, vy, vz, wz), self._clock.monotonic_ns())
            case protocol.Released():
                self._lease.release(viewer.number, self._clock.monotonic_ns())
            case protocol.Marked():
                self._lease.mark(viewer.number, self._clock.monotonic_ns())
            case protocol.Decided():
                task = asyncio.create_task(self._decide(viewer, said))
                # The loop keeps only a weak reference to a task.
                self._asked.add(task)
                task.add_done_callback(self._asked.discard)

    async def _answer_to(self, viewer: Viewer, decided: protocol.Decided) -> protocol.Answer:
        if decided.action in URGENT:
            return await self._loop.run_in_executor(self._urgent_workers, self._ask, decided)
        refusal = protocol.Answer(decided.nonce, False, NO_ANSWER)
        if viewer.open_decisions >= OPEN_DECISIONS:
            return refusal
        pressed_ns = self._clock.monotonic_ns()

        def ask() -> protocol.Answer:
            waited_s = seconds(self._clock.monotonic_ns() - pressed_ns)
            return refusal if waited_s > DECISION_MAX_AGE_S else self._ask(decided)

        viewer.open_decisions += 1
        try:
            return await self._loop.run_in_executor(self._workers, ask)
        finally:
            viewer.open_decisions -= 1

    async def _decide(self, viewer: Viewer, decided: protocol.Decided) -> None:
        answer = await self._answer_to(viewer, decided)
        with contextlib.suppress(ConnectionError):
            await viewer.socket.send_str(protocol.encode(answer))


def _file(path: Path) -> web.FileResponse:
    return web.FileResponse(path, headers={"Cache-Control": "no-cache"})
