"""What is seen is what collides, where the lens says it is."""

import math
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pybullet
import pytest

from common.camera import DOWN, FRONT, Lens, Mount, project, to_optical
from common.frames import quaternion_of, rotation_of
from services.sim.cameras import Camera, Figure, Shot
from services.sim.optics import Renderer
from services.sim.renderer import GlRenderer, NoOpenGlError, jpeg_of
from services.sim.shaders import SUN
from services.sim.stage import Scene, Stage
from services.sim.tiny import TinyRenderer
from worlds import Body, Texture, World, load

LENS = Lens.of_view(640, 360, math.radians(81.0))
# What a view that is symmetric for pybullet is for OpenCV: it samples pixels at their lower left
# corners (half a pixel off in x and y gives three times as many pixels that differ).
SYMMETRIC = Lens(640, 360, (*LENS.intrinsics[:2], 320.0, 179.0))
FRONT_CAMERA = Camera("camera/front", SYMMETRIC, FRONT, 30.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
SHAPES = (
    ("box", (1.0, 0.6, 1.4), (4.0, 0.9, 0.7), quaternion_of(0.0, 0.0, 0.5)),
    ("box", (0.5, 0.5, 0.5), (3.0, -1.2, 0.9), quaternion_of(0.4, 0.3, 0.2)),
    ("cylinder", (0.4, 0.4, 2.0), (6.0, -0.8, 1.0), UPRIGHT),
    ("sphere", (0.7, 0.7, 0.7), (3.5, 0.0, 1.5), UPRIGHT),
)


@pytest.fixture(scope="module")
def gl() -> Iterator[Renderer]:
    try:
        made = GlRenderer()
    except NoOpenGlError as error:
        pytest.skip(f"no OpenGL here: {error}")
    yield made
    made.close()


@pytest.fixture(scope="module")
def tiny() -> Iterator[Renderer]:
    made = TinyRenderer()
    yield made
    made.close()


def world_of(texture: Texture) -> World:
    bodies = tuple(Body(s, size, at, turn, texture) for s, size, at, turn in SHAPES)  # type: ignore[arg-type]
    return World("test", "", (0, 0, 0), 0.0, None, False, (), np.empty((0, 3)), bodies, (), "grass")


def shot_at(position: tuple[float, float, float], roll: float, pitch: float, yaw: float) -> Shot:
    x, y, z, w = quaternion_of(roll, pitch, yaw)
    return Shot("camera/front", 0, position, (x, y, z, w))


def silhouette(renderer: Renderer, worlds: list[World], camera: Camera, shot: Shot) -> np.ndarray:
    """Pixels whose colour depends on what the bodies are made of."""
    pictures = []
    for world in worlds:
        stage = Stage(world, 0.001)
        renderer.load(stage.scene())
        pictures.append(renderer.draw(camera, shot).astype(int))
        stage.close()
    mask = (np.abs(pictures[0] - pictures[1]).max(axis=2) > 12).astype(np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), bool)


def seen_by_pybullet(world: World, shot: Shot) -> np.ndarray:
    """The bodies' pixels by pybullet's own camera, its matrices made by its own functions."""
    client = pybullet.connect(pybullet.DIRECT)
    stage = Stage(world, 0.001)
    try:
        turn = rotation_of(shot.orientation)
        eye = np.asarray(shot.position_m) + turn @ np.asarray(FRONT.position_m)
        view = pybullet.computeViewMatrix(eye, eye + turn[:, 0], turn[:, 2])
        upright = math.degrees(2.0 * math.atan(180.0 / LENS.intrinsics[1]))
        projection = pybullet.computeProjectionMatrixFOV(upright, 640 / 360, 0.05, 100.0)
        numbers = pybullet.getCameraImage(
            640,
            360,
            view,
            projection,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=stage.client,
        )[4]
        return np.asarray(np.reshape(numbers, (360, 640)) > 0)
    finally:
        stage.close()
        pybullet.disconnect(client)


def off_edge_px(renderer: Renderer, shot: Shot, least: float = 0.05) -> np.ndarray:
    """How far from an edge those pixels are on which ours and pybullet's camera disagree.

    Bodies are to fill more than `least` of the picture.
    """
    ours = silhouette(renderer, [world_of("container"), world_of("crate")], FRONT_CAMERA, shot)
    theirs = seen_by_pybullet(world_of("crate"), shot)
    assert theirs.mean() > least
    edge = cv2.morphologyEx(theirs.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    return np.asarray(cv2.distanceTransform(1 - edge, cv2.DIST_L2, 5)[ours != theirs])


@pytest.mark.parametrize(
    "pose",
    [
        ((0.0, 0.0, 1.0), 0.0, 0.0, 0.0),
        ((0.3, 0.2, 0.8), 0.25, 0.0, -0.1),
        ((0.0, -0.4, 1.4), -0.1, 0.2, 0.15),
    ],
)
def test_edges_are_where_pybullets_own_camera_has_them(
    gl: Renderer, pose: tuple[tuple[float, float, float], float, float, float]
) -> None:
    off_px = off_edge_px(gl, shot_at(*pose))
    # Of 230400; a ball has flat facets here and there.
    assert off_px.size < 600
    assert np.sum(off_px > 1.0) <= 10
    assert off_px.max() <= 2.0


def test_edges_of_what_is_far_and_has_fewer_sides_are_there_too(gl: Renderer) -> None:
    for away_m in (8.0, 14.0, 20.0):
        off_px = off_edge_px(gl, shot_at((-away_m, 0.1, 1.1), 0.1, 0.0, 0.0), least=0.0005)
        assert np.sum(off_px > 1.0) == 0


def test_edges_of_the_fallback_are_where_pybullets_own_camera_has_them(tiny: Renderer) -> None:
    off_px = off_edge_px(tiny, shot_at((0.3, 0.2, 0.8), 0.25, 0.1, -0.1))
    assert off_px.max() <= 2.0


@pytest.mark.parametrize(
    ("mount", "ball"), [(FRONT, (4.0, 0.7, 1.3)), (DOWN, (0.2, -0.3, 0.2))], ids=["front", "down"]
)
@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_a_ball_is_seen_where_the_lens_projects_it(
    gl: Renderer, mount: Mount, ball: tuple[float, float, float], tilt: float
) -> None:
    worlds = [
        replace(world_of(texture), bodies=(Body("sphere", (0.08,) * 3, ball, UPRIGHT, texture),))
        for texture in ("container", "crate")
    ]
    shot = shot_at((0.0, 0.0, 1.6), tilt, tilt, 0.1)
    camera = Camera("camera/front", LENS, mount, 30.0)
    rows, columns = np.nonzero(silhouette(gl, worlds, camera, shot))
    optical = to_optical(
        np.asarray([ball]), np.asarray(shot.position_m), rotation_of(shot.orientation), mount
    )
    pixel = project(optical, LENS)[0][0]
    # Pixel centres are whole numbers, as in OpenCV.
    assert (columns.mean(), rows.mean()) == pytest.approx(tuple(pixel), abs=0.6)


@pytest.mark.parametrize("height_m", [1.0, 2.0])
def test_a_vehicles_shade_lies_where_the_shadow_of_a_thing_in_its_place_would(
    gl: Renderer, height_m: float
) -> None:
    disc = Body("cylinder", (0.6, 0.6, 0.05), (0.0, 0.0, 0.0), UPRIGHT, "crate")
    place = (0.4, -0.3, height_m)
    sun_x, sun_y, sun_z = SUN
    # Right above the shadow.
    x, y = 0.4 - sun_x / sun_z * height_m, -0.3 - sun_y / sun_z * height_m
    shot = shot_at((x, y, 4.0), 0.0, 0.0, 0.2)
    camera = Camera("camera/down", LENS, DOWN, 60.0)

    def light(bodies: tuple[Body, ...], others: tuple[Figure, ...]) -> np.ndarray:
        stage = Stage(replace(world_of("crate"), bodies=bodies), 0.001)
        gl.load(stage.scene())
        stage.close()
        middle = gl.draw(camera, replace(shot, others=others))[140:220, 280:360]
        return np.asarray(middle.astype(float).sum(axis=2))

    bare = light((), ())
    cast = (
        # Someone's own file may have lists and arrays.
        light((), (Figure([replace(disc, size_m=np.asarray(disc.size_m))], place, UPRIGHT),)),
        light((replace(disc, position_m=place),), ()),
    )
    spot, shadow = (np.argwhere(each < 0.85 * bare) for each in cast)
    assert spot.mean(axis=0) == pytest.approx(shadow.mean(axis=0), abs=1.0)
    assert 0.7 < len(spot) / len(shadow) < 1.0


def test_the_ground_of_the_track_has_corners_everywhere(gl: Renderer) -> None:
    stage = Stage(load("track"), 0.001)
    gl.load(stage.scene())
    down = Camera("camera/down", Lens.of_view(320, 240, math.radians(53.13)), DOWN, 60.0)
    for x, y in ((1.0, 0.3), (7.0, -0.6), (18.0, 2.0), (12.0, 8.2), (-2.0, 5.5), (5.0, -3.0)):
        picture = gl.draw(down, shot_at((x, y, 1.0), 0.0, 0.0, 0.3))
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        corners = cv2.goodFeaturesToTrack(grey, 200, 0.01, 8)
        assert corners is not None
        # In every quarter of the picture.
        quarters = set(map(tuple, (corners[:, 0] // (160, 120)).astype(int)))
        assert len(corners) >= 60
        assert len(quarters) == 4
    stage.close()


def test_the_ground_goes_on_as_far_as_a_vehicle_may_be_put(gl: Renderer) -> None:
    stage = Stage(load("track"), 0.001)
    gl.load(stage.scene())
    stage.close()
    down = Camera("camera/down", Lens.of_view(320, 240, math.radians(53.13)), DOWN, 60.0)
    for place in ((270.0, -20.0, 10.0), (1000.0, -1000.0, 2.0), (-1000.0, 340.0, 20.0)):
        below = gl.draw(down, shot_at(place, 0.0, 0.0, 0.0)).reshape(-1, 3)
        # Grass rather than haze: greener than it is blue.
        assert (below[:, 1] > below[:, 0]).mean() > 0.8, place
        ahead = gl.draw(FRONT_CAMERA, shot_at(place, 0.0, 0.0, 0.0))
        # Down from what is 180 m away.
        fy, _, cy = LENS.intrinsics[1:]
        row = round(cy + fy * place[2] / 180.0)
        below_horizon = ahead[row + 3 :].astype(int)
        assert (below_horizon[..., 1] > below_horizon[..., 0]).mean() > 0.8, place


def test_pictures_of_one_scene_after_the_other_leave_no_error_in_opengl() -> None:
    try:
        renderer = GlRenderer()
    except NoOpenGlError as error:
        pytest.skip(f"no OpenGL here: {error}")
    for name, size in (("track", (64, 48)), ("empty", (32, 24)), ("track", (64, 48))):
        stage = Stage(load(name), 0.001)
        renderer.load(stage.scene())
        stage.close()
        camera = Camera("camera/front", Lens.of_view(*size, 1.0), FRONT, 30.0)
        renderer.draw(camera, shot_at((0.0, 0.0, 1.0), 0.0, 0.0, 0.0))
        assert renderer._gl.error == "GL_NO_ERROR"
    renderer.close()


def test_a_picture_survives_its_jpeg() -> None:
    ramp = np.tile(np.linspace(0, 255, 64, dtype=np.uint8), (48, 1))
    picture = np.dstack([ramp, ramp, ramp])
    back = cv2.imdecode(np.frombuffer(jpeg_of(picture, 90), np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(back.astype(int) - picture).max() <= 6


def test_a_scene_is_read_back_from_pybullet_as_the_world_has_it() -> None:
    world = world_of("brick")
    stage = Stage(world, 0.001)
    scene: Scene = stage.scene()
    for seen, meant in zip(scene.bodies, world.bodies, strict=True):
        assert (seen.shape, seen.texture) == (meant.shape, meant.texture)
        assert seen.size_m == pytest.approx(meant.size_m)
        assert seen.position_m == pytest.approx(meant.position_m)
        assert seen.orientation == pytest.approx(meant.orientation, abs=1e-6)
    stage.close()
