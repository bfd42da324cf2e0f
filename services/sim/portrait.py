"""Pictures of a world for people: from above, and a view, both with its ideal path."""

import math

import cv2
import numpy as np

from common.camera import Lens, Mount, project, to_optical
from common.frames import Array, quaternion_of, rotation_of
from services.sim.cameras import Camera, Shot
from services.sim.core import STEP_S
from services.sim.optics import Renderer
from services.sim.shaders import HAZE, HAZE_PER_M
from services.sim.stage import Stage
from services.sim.textures import Picture
from worlds import World

_AHEAD = Mount((0.0, 0.0, 0.0), ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""A camera at the body's origin that looks along x."""
_PATH_BGR, _START_BGR = (255, 60, 230), (40, 40, 255)
_MARGIN_M = 3.0
_SMALLEST_M = 8.0
_PLAN_LENS_RAD = math.radians(12.0)
"""Of the plan's lens, from far above, so that walls do not lean."""
_VIEW_LENS_RAD = math.radians(60.0)
_VIEW_YAW_RAD, _VIEW_DOWN_RAD = math.radians(60.0), math.radians(24.0)


def plan_of(world: World, renderer: Renderer, width: int, height: int) -> Picture:
    """The world from above, north on top, (height, width, 3) in BGR."""
    low, high = _extent_m(world)
    centre = (low + high) / 2.0
    lens = Lens.of_view(width, height, _PLAN_LENS_RAD)
    focal = lens.intrinsics[0]
    far_m = focal * max((high[0] - low[0]) / width, (high[1] - low[1]) / height)
    # Nose down, then turned so that the picture's top is north.
    shot = _shot_from(np.append(centre, far_m), math.pi / 2.0, math.pi / 2.0)
    camera = Camera("plan", lens, _AHEAD, 1.0, near_m=far_m / 3.0)
    picture = _without_haze(_taken(world, renderer, camera, shot), far_m)
    _draw_path(picture, world.ideal_path_m, camera, shot)
    return _with_scale(picture, focal / far_m)


def view_of_world(world: World, renderer: Renderer, width: int, height: int) -> Picture:
    """The world as one sees it from a hill, (height, width, 3) in BGR."""
    low, high = _extent_m(world)
    path_m = world.ideal_path_m
    height_m = float(path_m[:, 2].mean()) if len(path_m) else 1.0
    centre = np.append((low + high) / 2.0, height_m)
    lens = Lens.of_view(width, height, _VIEW_LENS_RAD)
    away_m = 0.62 * float(np.hypot(*(high - low))) / math.tan(_VIEW_LENS_RAD / 2.0)
    ahead = rotation_of(quaternion_of(0.0, _VIEW_DOWN_RAD, _VIEW_YAW_RAD))[:, 0]
    shot = _shot_from(centre - away_m * ahead, _VIEW_DOWN_RAD, _VIEW_YAW_RAD)
    camera = Camera("view", lens, _AHEAD, 1.0, near_m=0.5)
    picture = _taken(world, renderer, camera, shot)
    _draw_path(picture, path_m, camera, shot)
    return picture


def _shot_from(eye: Array, pitch_rad: float, yaw_rad: float) -> Shot:
    x, y, z = (float(each) for each in eye)
    qx, qy, qz, qw = quaternion_of(0.0, pitch_rad, yaw_rad)
    return Shot("", 0, (x, y, z), (qx, qy, qz, qw))


def _extent_m(world: World) -> tuple[Array, Array]:
    """South-west and north-east corners of what matters: the path and the start."""
    places = np.vstack([world.ideal_path_m[:, :2], world.start_position_m[:2]])
    low, high = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
    short = np.maximum(_SMALLEST_M - (high - low), 0.0) / 2.0
    return low - short, high + short


def _taken(world: World, renderer: Renderer, camera: Camera, shot: Shot) -> Picture:
    stage = Stage(world, STEP_S)
    renderer.load(stage.scene())
    stage.close()
    return renderer.draw(camera, shot).copy()


def _without_haze(picture: Picture, depth_m: float) -> Picture:
    """The picture of things at a depth, as they are near by."""
    left = 1.0 / (1.0 + HAZE_PER_M * depth_m)
    haze = 255.0 * np.asarray(HAZE[::-1])
    return np.asarray(np.clip((picture - (1.0 - left) * haze) / left, 0.0, 255.0), np.uint8)


def _draw_path(picture: Picture, path_m: Array, camera: Camera, shot: Shot) -> None:
    if not len(path_m):
        return
    place, turn = np.asarray(shot.position_m), rotation_of(shot.orientation)
    pixels, in_front = project(to_optical(path_m, place, turn, camera.mount), camera.lens)
    line = np.rint(pixels[in_front] * 16.0).astype(np.int32)
    cv2.polylines(picture, [line], False, (60, 0, 60), 5, cv2.LINE_AA, 4)
    cv2.polylines(picture, [line], False, _PATH_BGR, 2, cv2.LINE_AA, 4)
    begin = tuple(int(each) for each in line[0])
    cv2.circle(picture, begin, 5 * 16, _START_BGR, -1, cv2.LINE_AA, 4)
    ahead = tuple(int(each) for each in line[min(len(line) - 1, 20)])
    cv2.arrowedLine(picture, begin, ahead, _START_BGR, 2, cv2.LINE_AA, 4, 0.5)


def _with_scale(picture: Picture, pixels_per_m: float) -> Picture:
    """The picture with a bar of a round length."""
    length_m = max(m for m in (1, 2, 5, 10, 20, 50) if m * pixels_per_m < picture.shape[1] / 3)
    y, x = picture.shape[0] - 14, 12
    end = (x + round(length_m * pixels_per_m), y)
    cv2.line(picture, (x, y), end, (0, 0, 0), 5)
    cv2.line(picture, (x, y), end, (255, 255, 255), 3)
    for colour, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(
            picture,
            f"{length_m} m",
            (x, y - 8),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.5,
            colour,
            thickness,
            cv2.LINE_AA,
        )
    return picture
