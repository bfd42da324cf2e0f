"""Takes the pictures on threads of its own; what it cannot take in time is dropped."""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import cv2

from common import messages as m
from common.camera import Lens
from common.clock import NS_PER_S
from services.sim.cameras import Camera, Shot
from services.sim.optics import Renderer, exposed, noisy
from services.sim.renderer import GlRenderer, NoOpenGlError, jpeg_of
from services.sim.stage import Scene
from services.sim.textures import Picture

log = logging.getLogger(__name__)

PICTURES = 2
"""Of one lens; renderers have so many places for them."""
LONGEST_WAIT_NS = 50_000_000
"""Of shots: a front picture and those from below that fall due while it is drawn, and a moment in
which others have the processor."""

Choice = Literal["auto", "gl", "tiny", "none"]


def open_renderer(choice: Choice, aside: bool = False) -> Renderer:
    """The renderer of a choice; auto is OpenGL where there is any.

    Args:
        choice: what draws.
        aside: whether one that keeps Python's lock while it draws gets a process of its own.

    Raises:
        NoOpenGlError: if OpenGL was asked for and there is none.
    """
    if choice != "tiny":
        try:
            return GlRenderer()
        except NoOpenGlError as error:
            if choice == "gl":
                raise
            log.warning("no OpenGL (%s): pictures are drawn slowly by pybullet", error)
    from services.sim.aside import Aside
    from services.sim.tiny import TinyRenderer

    return Aside() if aside else TinyRenderer()


def photograph(renderer: Renderer, camera: Camera, shot: Shot, quality: int) -> m.Image:
    """The message of one picture."""
    return developed(exposed(renderer, camera, shot), camera, shot, quality)


def developed(picture: Picture, camera: Camera, shot: Shot, quality: int) -> m.Image:
    """The message of a picture that was exposed."""
    return m.Image(
        stamp=shot.stamp_ns,
        seq=0,
        width=camera.lens.width,
        height=camera.lens.height,
        format="jpeg",
        data=jpeg_of(noisy(picture, camera, shot), quality),
        intrinsics=camera.lens.intrinsics,
        distortion=camera.lens.distortion,
        capture=shot.stamp_ns,
    )


class Studio:
    """Cameras that never hold up physics: shots that wait too long are dropped.

    One thread draws, for all cameras of all vehicles, and another one encodes what it has drawn.

    Args:
        choice: of the renderer.
        cameras: of all vehicles.
        quality: of the JPEG.
        publish: called on the encoding thread with each shot and its picture.
    """

    def __init__(
        self,
        choice: Choice,
        cameras: Iterable[Camera],
        quality: int,
        publish: Callable[[Shot, m.Image], None],
    ) -> None:
        self._choice = choice
        self._cameras = _by_owner(cameras)
        self._quality = quality
        self._publish = publish
        self._wake = threading.Condition()
        self._shots: list[Shot] = []
        self._scene: Scene | None = None
        self._stopping = False
        self._ready = False
        self._drawing = False
        self._encoding: Counter[Lens] = Counter()
        self._drawn_ns: dict[tuple[int, str], int] = {}
        self.dropped: Counter[str] = Counter()
        self.renderer = "a renderer that is being opened"
        self.failure = ""
        self._thread = threading.Thread(target=self._run, name="studio", daemon=True)
        self._thread.start()

    def load(self, scene: Scene) -> None:
        """Take pictures of this scene from now on."""
        with self._wake:
            self._scene = scene
            self._shots.clear()
            self._drawn_ns.clear()
            self._wake.notify_all()

    def equip(self, cameras: Iterable[Camera], vehicle: int) -> None:
        """Take pictures by these cameras from now on; one vehicle's that wait are of its past."""
        with self._wake:
            self._cameras = _by_owner(cameras)
            self._shots = [shot for shot in self._shots if shot.vehicle != vehicle]
            self._wake.notify_all()

    def take(self, shots: Sequence[Shot]) -> None:
        """Have pictures taken soon, or not at all if they wait too long."""
        with self._wake:
            for shot in shots:
                self._shots.append(shot)
                self._drop_before(shot)
            self._wake.notify_all()

    def finish(self) -> None:
        """Wait until all pictures that were asked for are taken."""
        with self._wake:
            while (
                self._shots or self._scene or self._drawing or self._encoding.total()
            ) and not self.failure:
                self._wake.wait()

    def close(self) -> None:
        """Stop, after the picture that is being taken."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        self._thread.join()

    def _run(self) -> None:
        # More threads would only take turns with physics and with other services.
        cv2.setNumThreads(1)
        try:
            log.info("opening what draws; there are no pictures before")
            renderer = open_renderer(self._choice, aside=True)
            self.renderer = renderer.name
            log.info("pictures are drawn by %s", renderer.name)
            self._ready = True
            with ThreadPoolExecutor(1, "darkroom") as encoder:
                while self._take_next(renderer, encoder):
                    pass
            renderer.close()
        except Exception as error:
            self._fail(error)

    def _take_next(self, renderer: Renderer, encoder: ThreadPoolExecutor) -> bool:
        """Wait for work and do it; False when it is time to stop."""
        with self._wake:
            self._drawing = False
            self._wake.notify_all()
            while True:
                if self._stopping or self.failure:
                    return False
                free = [shot for shot in self._shots if self._has_place(shot)]
                if free or self._scene:
                    break
                self._wake.wait()
            scene, self._scene = self._scene, None
            shot = max(free, key=self._gap_periods) if free else None
            if shot is not None:
                camera = self._camera_of(shot)
                self._drawn_ns[shot.vehicle, shot.topic] = shot.stamp_ns
                self._shots.remove(shot)
                self._encoding[camera.lens] += 1
            self._drawing = True
        if scene is not None:
            renderer.load(scene)
        if shot is not None:
            picture = exposed(renderer, camera, shot)
            encoder.submit(self._hand_out, picture, camera, shot)
        return True

    def _hand_out(self, picture: Picture, camera: Camera, shot: Shot) -> None:
        try:
            self._publish(shot, developed(picture, camera, shot, self._quality))
        except Exception as error:
            self._fail(error)
        finally:
            with self._wake:
                self._encoding[camera.lens] -= 1
                self._wake.notify_all()

    def _fail(self, error: Exception) -> None:
        log.error("no more pictures", exc_info=error)
        with self._wake:
            self.failure = str(error) or type(error).__name__
            self._wake.notify_all()

    def _camera_of(self, shot: Shot) -> Camera:
        return self._cameras[shot.vehicle, shot.topic]

    def _has_place(self, shot: Shot) -> bool:
        """Whether its picture would not overwrite one that is still to be encoded."""
        return self._encoding[self._camera_of(shot).lens] < PICTURES

    def _gap_periods(self, shot: Shot) -> tuple[float, int]:
        """How many of its periods ago a camera's last picture is of; then the oldest shot.

        So no camera starves when not all pictures can be drawn: what is due first would give all
        to the fastest camera.
        """
        before_ns = self._drawn_ns.get((shot.vehicle, shot.topic), 0)
        gap_s = (self._newest_ns() - before_ns) / NS_PER_S
        return gap_s * self._camera_of(shot).fps, -shot.stamp_ns

    def _newest_ns(self) -> int:
        return max(shot.stamp_ns for shot in self._shots)

    def _drop_before(self, newest: Shot) -> None:
        """Drop what has waited too long for the camera of the newest shot."""
        for shot in tuple(self._shots):
            if (shot.vehicle, shot.topic) == (
                newest.vehicle,
                newest.topic,
            ) and shot.stamp_ns < newest.stamp_ns - LONGEST_WAIT_NS:
                self._shots.remove(shot)
                if self._ready:
                    self.dropped[shot.topic] += 1


def _by_owner(cameras: Iterable[Camera]) -> dict[tuple[int, str], Camera]:
    return {(camera.vehicle, camera.topic): camera for camera in cameras}
