"""Pictures for flights in lock-step: drawn by processes of their own while the flight goes on.

Not by threads: Mesa draws for all contexts of a process in turn, and Python's lock is the flight's.
Who draws a picture makes no difference to it, and it is asked for when it is due, so a seed stays a
flight to the bit.
"""

import multiprocessing
import os
import signal
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

from common import messages as m
from services.sim.cameras import Camera, Shot
from services.sim.config import Config
from services.sim.core import Simulation
from services.sim.stage import Scene
from services.sim.studio import open_renderer, photograph

PAINTERS = 2
"""Of the AR.Drone's two cameras hardly more pictures are asked for before the first is due."""

LLVMPIPE_THREADS = "2"
"""Of each who draws: while one waits for the other's picture, its processor helps with that one."""

Answer = m.Image | Exception | None


@dataclass(frozen=True, eq=False)
class Stand:
    """What is before the cameras, and the cameras."""

    scene: Scene
    cameras: list[Camera]


class Order:
    """A picture that was asked for, or a stand that was given.

    Attributes:
        painter: who draws it.
        pixels: how much there is to draw.
    """

    def __init__(self, painter: "_Painter", pixels: int) -> None:
        self.painter = painter
        self._answer: Answer = None
        self._is_done = False
        self.pixels = pixels

    def done(self, answer: Answer) -> None:
        """Take the answer."""
        self._answer, self._is_done = answer, True

    def result(self) -> m.Image:
        """The picture, when it is done.

        Raises:
            Exception: what went wrong where it was drawn.
        """
        self.wait()
        assert isinstance(self._answer, m.Image)
        return self._answer

    def wait(self) -> None:
        """Wait until it is done."""
        while not self._is_done:
            self.painter.receive()
        if isinstance(self._answer, Exception):
            raise self._answer


class Darkroom:
    """Develops what the simulator's cameras take.

    Args:
        simulation: in whose present world, by whose vehicles' cameras, pictures are taken; after a
            change of either, `load`.
        config: of its renderer.

    Raises:
        NoOpenGlError: if OpenGL was asked for and there is none.
    """

    def __init__(self, simulation: Simulation, config: Config) -> None:
        self._simulation = simulation
        self._config = config
        self._painters = [_Painter(config)]
        self.load()

    def load(self) -> None:
        """Take pictures of the simulator's present world from now on."""
        cameras = self._simulation.cameras()
        self._stand = Stand(self._simulation.scene(), cameras)
        self._pixels = {
            (camera.vehicle, camera.topic): camera.lens.width * camera.lens.height
            for camera in cameras
        }
        for order in [painter.ask(self._stand, 0) for painter in self._painters]:
            order.wait()

    def develop(self, shot: Shot) -> Order:
        """Have the picture of a shot drawn, by who has the least to do."""
        painter = min(self._painters, key=_Painter.pixels_to_draw)
        if painter.pixels_to_draw() and len(self._painters) < PAINTERS:
            painter = _Painter(self._config)
            painter.ask(self._stand, 0)
            self._painters.append(painter)
        return painter.ask(shot, self._pixels[shot.vehicle, shot.topic])

    def close(self) -> None:
        """End the processes."""
        for painter in self._painters:
            painter.close()


class _Painter:
    """A process with a renderer. It answers in the order in which it is asked."""

    def __init__(self, config: Config) -> None:
        # Forked, it would lack the threads of the libraries that its parent has used.
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_paint, args=(theirs, config), daemon=True)
        self._process.start()
        theirs.close()
        self._orders: deque[Order] = deque()

    def pixels_to_draw(self) -> int:
        """Of all that it has been asked for and has not answered."""
        while self._orders and self._pipe.poll():
            self.receive()
        return sum(order.pixels for order in self._orders)

    def ask(self, what: Stand | Shot, pixels: int) -> Order:
        """Give it a stand or a shot."""
        order = Order(self, pixels)
        self._orders.append(order)
        # One that has ended says so where its answer is wanted.
        with suppress(OSError):
            self._pipe.send(what)
        return order

    def receive(self) -> None:
        """Wait for its next answer."""
        try:
            answer = self._pipe.recv()
        except (EOFError, OSError):
            answer = RuntimeError("the process that draws has ended")
        self._orders.popleft().done(answer)

    def close(self) -> None:
        """End the process, after what it draws now."""
        self._pipe.close()
        self._process.join()


def _paint(pipe: Connection, config: Config) -> None:
    """Answer stands and shots until the other end is closed."""
    # The key goes to all processes; the flight's end closes the pipe.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cameras: dict[tuple[int, str], Camera] = {}
    os.environ.setdefault("LP_NUM_THREADS", LLVMPIPE_THREADS)
    try:
        renderer = open_renderer(config.renderer)
        while True:
            answer: Answer = None
            asked = pipe.recv()
            if isinstance(asked, Stand):
                cameras = {(camera.vehicle, camera.topic): camera for camera in asked.cameras}
                renderer.load(asked.scene)
            else:
                try:
                    camera = cameras[asked.vehicle, asked.topic]
                    answer = photograph(renderer, camera, asked, config.jpeg_quality)
                except Exception as error:
                    # It is this picture's; the next ones are drawn.
                    answer = error
            pipe.send(answer)
    except (EOFError, OSError):
        return
    except Exception as error:
        pipe.send(error)
