"""A lens bends as OpenCV's model says; what moves is smeared; noise grows with the light."""

import math
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from common.camera import FRONT, project, to_optical
from common.frames import quaternion_of, rotation_of
from services.sim.cameras import Camera, Shot, cameras_of, front_lens
from services.sim.config import Config
from services.sim.optics import Renderer, picture_of
from services.sim.renderer import GlRenderer, NoOpenGlError
from services.sim.stage import Scene, Stage
from services.sim.textures import Picture
from worlds import Body, World, load

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
HERE = Shot("camera/front", 0, (0.0, 0.0, 1.0), UPRIGHT)


@pytest.fixture(scope="module")
def gl() -> Iterator[Renderer]:
    try:
        made = GlRenderer()
    except NoOpenGlError as error:
        pytest.skip(f"no OpenGL here: {error}")
    yield made
    made.close()


class Grey:
    """Draws a grey that grows from left to right, moved as the camera turns."""

    name = "grey"

    def load(self, scene: Scene) -> None:
        pass

    def draw(self, camera: Camera, shot: Shot) -> Picture:
        ramp = np.linspace(20, 220, camera.lens.width, dtype=np.uint8)
        return np.dstack([np.tile(ramp, (camera.lens.height, 1))] * 3)

    def close(self) -> None:
        pass


def test_presets_have_the_views_that_they_are_named_for() -> None:
    def view_deg(lens: str, size: str) -> tuple[float, float]:
        made = front_lens(Config(front_lens=lens, front_size=size))  # type: ignore[arg-type]
        fx, fy, cx, cy = made.intrinsics
        return math.degrees(2.0 * math.atan(cx / fx)), math.degrees(2.0 * math.atan(cy / fy))

    assert view_deg("tum", "360p")[0] == pytest.approx(81.0)
    assert view_deg("ardrone", "480p") == pytest.approx((73.5, 58.5), abs=0.1)
    assert view_deg("ardrone", "720p") == pytest.approx((73.5, 45.6), abs=0.1)
    big = front_lens(Config(front_lens="measured", front_size="720p"))
    assert (big.width, big.height) == (1280, 720)
    assert big.intrinsics == pytest.approx((1139.8, 1136.0, 662.8, 271.8))
    assert big.distortion == (-0.527, 0.274, 0.0, 0.0)


@pytest.mark.parametrize("place", [(4.0, 0.0, 1.0), (4.0, 1.9, 0.4), (4.0, -1.8, 0.2)])
def test_the_measured_lens_shows_a_ball_where_opencvs_model_has_it(
    gl: Renderer, place: tuple[float, float, float]
) -> None:
    camera = cameras_of(Config(front_lens="measured"))[0]
    pictures = []
    for texture in ("container", "crate"):
        body = Body("sphere", (0.08,) * 3, place, UPRIGHT, texture)  # type: ignore[arg-type]
        world = World(
            "", "", (0, 0, 0), 0.0, None, False, (), np.empty((0, 3)), (body,), (), "grass"
        )
        stage = Stage(world, 0.005)
        gl.load(stage.scene())
        stage.close()
        pictures.append(picture_of(gl, camera, HERE).astype(int))
    assert pictures[0].shape == (360, 640, 3)
    rows, columns = np.nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 12)
    optical = to_optical(np.asarray([place]), np.asarray(HERE.position_m), np.eye(3), FRONT)
    pixel = project(optical, camera.lens)[0][0]
    assert (np.median(columns), np.median(rows)) == pytest.approx(tuple(pixel), abs=1.0)
    oracle, _ = cv2.projectPoints(
        optical,
        np.zeros(3),
        np.zeros(3),
        np.asarray([[569.9, 0.0, 331.4], [0.0, 568.0, 135.9], [0.0, 0.0, 1.0]]),
        np.asarray(camera.lens.distortion),
    )
    assert pixel == pytest.approx(oracle.ravel(), abs=1e-6)


def test_a_bent_picture_has_no_empty_corner(gl: Renderer) -> None:
    stage = Stage(load("track"), 0.005)
    gl.load(stage.scene())
    stage.close()
    camera = cameras_of(Config(front_lens="measured", front_size="720p"))[0]
    picture = picture_of(gl, camera, HERE)
    for corner in (picture[:9, :9], picture[:9, -9:], picture[-9:, :9], picture[-9:, -9:]):
        assert corner.reshape(-1, 3).max(axis=0).min() > 20


def test_what_moves_is_smeared_along_its_way(gl: Renderer) -> None:
    stage = Stage(load("track"), 0.005)
    gl.load(stage.scene())
    stage.close()
    camera = cameras_of(Config())[0]
    slow = replace(camera, exposure_s=0.02)
    turning = replace(HERE, angular_velocity_radps=(0.0, 0.0, 1.5))

    def sharpness(picture: Picture) -> tuple[float, float]:
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)[180:]
        across, down = (cv2.Sobel(grey, cv2.CV_64F, *axis).std() for axis in ((1, 0), (0, 1)))
        return float(across), float(down)

    sharp = sharpness(picture_of(gl, camera, turning))
    still = sharpness(picture_of(gl, slow, HERE))
    smeared = sharpness(picture_of(gl, slow, turning))
    assert still == pytest.approx(sharp, rel=0.01)
    assert smeared[0] < 0.6 * sharp[0]
    assert smeared[1] > smeared[0]


def test_noise_is_that_of_the_seed_and_grows_with_the_light() -> None:
    camera = replace(cameras_of(Config())[0], noise=1.0)
    clean = picture_of(Grey(), replace(camera, noise=0.0), HERE).astype(float)
    first = picture_of(Grey(), camera, HERE)
    assert np.array_equal(first, picture_of(Grey(), camera, HERE))
    assert np.array_equal(first, picture_of(Grey(), camera, replace(HERE, stamp_ns=1)))
    assert not np.array_equal(first, picture_of(Grey(), camera, replace(HERE, seed=(1,))))
    means, deviations = [], []
    for number in range(40):
        noisy = picture_of(Grey(), camera, replace(HERE, seed=(number,))).astype(float)
        means.append(noisy.mean() / clean.mean())
        rest = noisy - clean * means[-1]
        deviations.append((rest[:, :60].std(), rest[:, -60:].std()))
    assert np.std(means) == pytest.approx(0.04, rel=0.4)
    dark, light = np.mean(deviations, axis=0)
    assert dark == pytest.approx(3.0 * math.sqrt(1.0 + 3.0 * 30 / 255), rel=0.1)
    assert light == pytest.approx(3.0 * math.sqrt(1.0 + 3.0 * 210 / 255), rel=0.1)


def test_a_smear_reaches_back_to_where_the_camera_was() -> None:
    seen: list[Shot] = []

    class Watch(Grey):
        def draw(self, camera: Camera, shot: Shot) -> Picture:
            seen.append(shot)
            return super().draw(camera, shot)

    turn = quaternion_of(0.0, 0.0, 1.0)
    moving = Shot("", 0, (1.0, 2.0, 3.0), turn, (10.0, 0.0, 0.0), (0.0, 0.0, 5.0))  # type: ignore[arg-type]
    picture_of(Watch(), replace(cameras_of(Config())[0], exposure_s=0.01), moving)
    places = [shot.position_m[0] for shot in seen]
    assert (min(places), max(places)) == pytest.approx((0.9, 1.0))
    earliest = min(seen, key=lambda shot: shot.position_m[0])
    ahead = rotation_of(earliest.orientation)[:, 0]
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx(0.95)
