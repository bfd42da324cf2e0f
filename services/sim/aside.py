"""A renderer in a process of its own, since pybullet keeps Python's lock while it draws.

At 640x360 TinyRenderer takes 45 ms a picture of `track`: beside physics in one process it left that
a fifth of the time it needs.
"""

import multiprocessing
import signal
from multiprocessing.connection import Connection

from services.sim.cameras import Camera, Shot
from services.sim.stage import Scene
from services.sim.textures import Picture
from services.sim.tiny import TinyRenderer


class Aside:
    """TinyRenderer, drawing in another process.

    Raises:
        RuntimeError: from any method, if that process has ended.
    """

    name = TinyRenderer.name

    def __init__(self) -> None:
        # Forked, it would lack the threads of the libraries that its parent has used.
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()

    def load(self, scene: Scene) -> None:
        """Draw this scene from now on."""
        self._ask(scene)

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        """The picture (height, width, 3) in BGR."""
        picture = self._ask((camera, shot))
        assert picture is not None
        return picture

    def close(self) -> None:
        """End the process."""
        self._pipe.close()
        self._process.join()

    def _ask(self, what: Scene | tuple[Camera, Shot]) -> Picture | None:
        try:
            self._pipe.send(what)
            answer: Picture | Exception | None = self._pipe.recv()
        except (EOFError, OSError):
            raise RuntimeError("the process that draws has ended") from None
        if isinstance(answer, Exception):
            raise answer
        return answer


def _serve(pipe: Connection) -> None:
    """Load scenes and draw shots until the other end is closed."""
    # The key goes to all processes; the simulator's end closes the pipe.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        renderer = TinyRenderer()
        while True:
            asked = pipe.recv()
            answer: Picture | Exception | None = None
            try:
                if isinstance(asked, Scene):
                    renderer.load(asked)
                else:
                    answer = renderer.draw(*asked)
            except Exception as error:
                answer = error
            pipe.send(answer)
    except (EOFError, OSError):
        return
