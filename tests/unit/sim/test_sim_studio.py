"""Pictures are taken beside physics: old shots are dropped, what draws them is chosen openly."""

import os
import threading
from dataclasses import replace

import numpy as np
import pytest

from common.camera import Lens
from common.messages import Image, Message
from services.sim import studio
from services.sim.aside import Aside
from services.sim.cameras import Camera, Shot, cameras_of
from services.sim.config import Config
from services.sim.optics import Renderer
from services.sim.renderer import NoOpenGlError
from services.sim.stage import Scene
from services.sim.textures import Picture

CAMERAS = cameras_of(Config())


class SlowRenderer:
    """Draws nothing, when it is let."""

    name = "slow"

    def __init__(self) -> None:
        self.drawing = threading.Event()
        self.go_on = threading.Semaphore(0)

    def load(self, scene: Scene) -> None:
        pass

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        self.drawing.set()
        assert self.go_on.acquire(timeout=5.0)
        return np.zeros((camera.lens.height, camera.lens.width, 3), np.uint8)

    def close(self) -> None:
        pass


FRONT_NS, DOWN_NS = 33_333_333, 16_666_667


def front_at(stamp_ns: int) -> tuple[Shot, ...]:
    return (Shot("camera/front", stamp_ns, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)),)


def down_at(stamp_ns: int) -> tuple[Shot, ...]:
    return (Shot("camera/down", stamp_ns, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)),)


def test_a_slow_renderer_drops_pictures_and_holds_up_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    renderer = SlowRenderer()
    monkeypatch.setattr(studio, "open_renderer", lambda _choice, aside: renderer)
    taken: list[Message] = []
    arrived = threading.Event()

    def publish(_shot: Shot, message: Image) -> None:
        taken.append(message)
        if len(taken) == 2:
            arrived.set()

    cameras = studio.Studio("gl", CAMERAS, 80, publish)
    cameras.take(front_at(FRONT_NS))
    assert renderer.drawing.wait(5.0)
    for count in range(2, 10):
        cameras.take(front_at(count * FRONT_NS))
    renderer.go_on.release(2)
    assert arrived.wait(5.0)
    cameras.close()
    assert [message.stamp for message in taken] == [FRONT_NS, 8 * FRONT_NS]
    assert cameras.dropped["camera/front"] == 6
    first = taken[0]
    assert isinstance(first, Image)
    assert (first.width, first.height, first.capture) == (640, 360, FRONT_NS)


def test_shots_from_below_wait_while_a_front_picture_is_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    renderer = SlowRenderer()
    monkeypatch.setattr(studio, "open_renderer", lambda _choice, aside: renderer)
    taken: list[Message] = []
    cameras = studio.Studio("gl", CAMERAS, 80, lambda _shot, message: taken.append(message))
    cameras.take(front_at(0))
    assert renderer.drawing.wait(5.0)
    for count in range(1, 6):
        cameras.take(down_at(count * DOWN_NS))
    renderer.go_on.release(4)
    cameras.finish()
    cameras.close()
    assert [message.stamp for message in taken] == [0, 3 * DOWN_NS, 4 * DOWN_NS, 5 * DOWN_NS]
    assert cameras.dropped["camera/down"] == 2


def test_no_camera_starves_where_not_all_pictures_can_be_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three shots come in each 33 ms, one can be drawn."""
    renderer = SlowRenderer()
    monkeypatch.setattr(studio, "open_renderer", lambda _choice, aside: renderer)
    taken: list[str] = []
    arrived = threading.Semaphore(0)

    def publish(shot: Shot, _picture: Image) -> None:
        taken.append(shot.topic)
        arrived.release()

    cameras = studio.Studio("gl", CAMERAS, 80, publish)
    periods = 60
    for period in range(periods):
        begin_ns = period * FRONT_NS
        cameras.take(down_at(begin_ns))
        cameras.take((*front_at(begin_ns + DOWN_NS), *down_at(begin_ns + DOWN_NS)))
        renderer.go_on.release()
        assert arrived.acquire(timeout=5.0)
    renderer.go_on.release(10)
    cameras.close()
    drawn = taken[:periods]
    assert drawn.count("camera/front") > periods / 8
    assert drawn.count("camera/down") > periods / 3


def test_what_waits_of_a_vehicle_that_is_reset_is_not_drawn_that_of_others_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    renderer = SlowRenderer()
    monkeypatch.setattr(studio, "open_renderer", lambda _choice, aside: renderer)
    taken: list[tuple[int, int]] = []
    fleet = (*CAMERAS, *cameras_of(Config(), 1))
    cameras = studio.Studio("gl", fleet, 80, lambda s, _: taken.append((s.vehicle, s.stamp_ns)))
    cameras.take(front_at(0))
    assert renderer.drawing.wait(5.0)
    for shot in (*down_at(1), *front_at(2)):
        cameras.take((shot, replace(shot, vehicle=1)))
    cameras.equip(fleet, 0)
    cameras.take(down_at(3))
    renderer.go_on.release(4)
    cameras.finish()
    cameras.close()
    assert sorted(taken) == [(0, 0), (0, 3), (1, 1), (1, 2)]
    assert not cameras.dropped


def test_a_picture_that_cannot_be_published_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    renderer = SlowRenderer()
    monkeypatch.setattr(studio, "open_renderer", lambda _choice, aside: renderer)

    def refuse(_shot: Shot, _picture: Image) -> None:
        raise OSError("no network")

    cameras = studio.Studio("gl", CAMERAS, 80, refuse)
    renderer.go_on.release()
    cameras.take(down_at(0))
    cameras.finish()
    cameras.close()
    assert cameras.failure == "no network"


def test_without_opengl_pybullet_draws_unless_opengl_was_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail() -> None:
        raise NoOpenGlError("none here")

    monkeypatch.setattr(studio, "GlRenderer", fail)
    fallback = studio.open_renderer("auto")
    assert "TinyRenderer" in fallback.name
    fallback.close()
    with pytest.raises(NoOpenGlError):
        studio.open_renderer("gl")


def test_the_fallback_draws_the_same_in_a_process_of_its_own() -> None:
    """It keeps Python's lock while it draws, which physics would wait for."""
    scene = Scene((), (), "grass")
    camera = replace(CAMERAS[0], lens=Lens.of_view(64, 48, 1.0))
    (shot,) = front_at(0)
    near = studio.open_renderer("tiny")
    aside = studio.open_renderer("tiny", aside=True)
    for renderer in (near, aside):
        renderer.load(scene)
    assert aside.name == near.name
    assert np.array_equal(aside.draw(camera, shot), near.draw(camera, shot))
    assert isinstance(aside, Aside)
    assert aside._process.pid != os.getpid()
    # What cannot be drawn is said, and the next picture is drawn.
    with pytest.raises(KeyError):
        aside.load(replace(scene, ground="snow"))  # type: ignore[arg-type]
    aside.load(scene)
    assert aside.draw(camera, shot).shape == (48, 64, 3)
    aside._process.kill()
    with pytest.raises(RuntimeError, match="has ended"):
        aside.draw(camera, shot)
    aside.close()
    near.close()


def test_a_renderer_that_fails_is_told_and_ends_only_the_pictures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_choice: str, aside: bool) -> Renderer:
        raise NoOpenGlError("none here")

    monkeypatch.setattr(studio, "open_renderer", fail)
    cameras = studio.Studio("gl", CAMERAS, 80, lambda _shot, _message: None)
    cameras.close()
    assert cameras.failure == "none here"
    cameras.take(front_at(1))
