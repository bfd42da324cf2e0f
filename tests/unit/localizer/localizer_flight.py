"""A made-up flight: the sensors of a body on a known trajectory over a textured floor."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from common.camera import DOWN, Lens
from common.messages import Image, Imu, Pose, Range, VehicleState, VehicleStatus
from services.localizer.config import Config
from services.localizer.core import Localizer

IMU_PERIOD_NS = 5_000_000
ALTIMETER_EVERY = 8
PICTURE_EVERY = 4
"""50 Hz: a whole number of IMU samples keeps the made-up flight simple."""
LENS = Lens.of_view(320, 240, math.radians(60.0))
FIELD = np.array([0.0, 0.45, -0.89])
"""North and down, 63 degrees of dip."""
TEXEL_M = 0.004
GRAVITY_MPS2 = 9.81

Trajectory = Callable[[float], tuple[float, float, float, float, float, float]]
"""Time in s to x y z in m and roll pitch yaw in rad."""


def _texture() -> np.ndarray:
    rng = np.random.default_rng(5)
    size = 1024
    grey = np.zeros((size, size))
    for cell, weight in ((4, 0.3), (16, 0.4), (64, 0.3)):
        coarse = rng.random((size // cell, size // cell)).astype(np.float32)
        grey += weight * cv2.resize(coarse, (size, size), interpolation=cv2.INTER_CUBIC)
    return cv2.normalize(grey, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


TEXTURE = _texture()


def see_floor(position_m: np.ndarray, rotation: np.ndarray, lens: Lens = LENS) -> np.ndarray:
    """The grey picture of a floor at z = 0 from the downward camera of a body at a pose."""
    fx, fy, cx, cy = lens.intrinsics
    camera = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    centre = position_m + rotation @ np.array(DOWN.position_m)
    optical = (rotation @ np.array(DOWN.body_from_optical)).T
    # Floor (x, y, 1) to pixels; the texture repeats, so that it has no end.
    floor_to_pixel = camera @ np.column_stack([optical[:, 0], optical[:, 1], -optical @ centre])
    floor_to_texel = np.diag([1 / TEXEL_M, 1 / TEXEL_M, 1.0])
    pixel_to_texel = floor_to_texel @ np.linalg.inv(floor_to_pixel)
    return cv2.warpPerspective(
        TEXTURE,
        pixel_to_texel,
        (lens.width, lens.height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_WRAP,
    )


def image_of(grey: np.ndarray, stamp_ns: int, lens: Lens = LENS) -> Image:
    data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
    return Image(
        stamp=stamp_ns,
        seq=0,
        width=lens.width,
        height=lens.height,
        format="jpeg",
        data=data,
        intrinsics=lens.intrinsics,
        distortion=lens.distortion,
        capture=stamp_ns,
    )


def vehicle(state: VehicleState, stamp_ns: int = 0, world: str = "track") -> VehicleStatus:
    return VehicleStatus(
        stamp=stamp_ns, seq=0, state=state, battery=0.9, world=world, plant="tum", collisions=0
    )


@dataclass(frozen=True)
class Noises:
    """Standard deviations of one sample, offsets, and how late pictures come."""

    accel: float = 0.1
    gyro: float = 0.005
    field: float = 0.01
    altimeter: float = 0.02
    accel_bias: float = 0.03
    gyro_bias: float = 0.005
    picture_delay_steps: int = 4


QUIET = Noises(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True)
class Truth:
    stamp_ns: int
    position_m: np.ndarray
    velocity_mps: np.ndarray
    rotation: np.ndarray

    @property
    def yaw_rad(self) -> float:
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])


class Flight:
    """Feeds a localizer with a trajectory, step by step.

    `alter` may change or swallow (None) a message on its way: (topic, message, time in s).
    """

    def __init__(
        self,
        trajectory: Trajectory,
        config: Config | None = None,
        noises: Noises = QUIET,
        seed: int = 0,
        alter: Callable[[str, object, float], object] = lambda _topic, message, _t: message,
        state: VehicleState | None = "flying",
    ) -> None:
        self.trajectory = trajectory
        x, y, _, _, _, yaw = trajectory(0.0)
        config = config or Config()
        self.localizer = Localizer(replace(config, start_x_m=x, start_y_m=y, start_yaw_rad=yaw))
        self._noises = noises
        self._rng = np.random.default_rng(seed)
        self._alter = alter
        self._late: list[Image] = []
        self._step = 0
        rng = self._rng
        self._accel_bias = noises.accel_bias * rng.standard_normal(3)
        self._gyro_bias = noises.gyro_bias * rng.standard_normal(3)
        if state is not None:
            # The start is known exactly, as if the vehicle had just left the ground.
            self.localizer.on_vehicle(vehicle("landed"), 0)
            self._state_after = vehicle(state)
        else:
            self._state_after = None

    def truth(self, t_s: float) -> Truth:
        h = 1e-4
        pose = np.array(self.trajectory(t_s))
        before, after = np.array(self.trajectory(t_s - h)), np.array(self.trajectory(t_s + h))
        return Truth(
            round(t_s * 1e9),
            pose[:3],
            (after[:3] - before[:3]) / (2 * h),
            Rotation.from_euler("ZYX", pose[:2:-1]).as_matrix(),
        )

    def run(self, duration_s: float) -> Iterator[tuple[Pose, Truth]]:
        """Poses as they come, each with the truth at its stamp."""
        for _ in range(round(duration_s / (IMU_PERIOD_NS * 1e-9))):
            self._step += 1
            pose = self._advance(self._step * IMU_PERIOD_NS)
            if self._state_after is not None and self._step == 45:
                self.localizer.on_vehicle(self._state_after, self._step * IMU_PERIOD_NS)
            if pose is not None:
                yield pose, self.truth(pose.stamp * 1e-9)

    def last(self, duration_s: float) -> tuple[Pose, Truth]:
        return list(self.run(duration_s))[-1]

    def _advance(self, now_ns: int) -> Pose | None:
        t_s, dt_s, noises = now_ns * 1e-9, IMU_PERIOD_NS * 1e-9, self._noises
        here, before = self.truth(t_s), self.truth(t_s - dt_s)
        rate = Rotation.from_matrix(before.rotation.T @ here.rotation).as_rotvec() / dt_s
        acceleration = (here.velocity_mps - before.velocity_mps) / dt_s
        middle = before.rotation @ Rotation.from_rotvec(rate * dt_s / 2).as_matrix()
        force = middle.T @ (acceleration + np.array([0.0, 0.0, GRAVITY_MPS2]))
        imu = Imu(
            stamp=now_ns,
            seq=0,
            angular_velocity=self._noisy(rate + self._gyro_bias, noises.gyro),
            linear_acceleration=self._noisy(force + self._accel_bias, noises.accel),
            magnetic_field=self._noisy(here.rotation.T @ FIELD, noises.field),
        )
        pose = None
        altered = self._alter("imu", imu, t_s)
        if altered is not None:
            pose = self.localizer.on_imu(altered, now_ns)
        if self._step % ALTIMETER_EVERY == 0:
            distance = (
                here.position_m[2] / here.rotation[2, 2]
                + noises.altimeter * self._rng.standard_normal()
            )
            reading = Range(stamp=now_ns, seq=0, range=float(distance), min=0.01, max=3.0)
            altered = self._alter("altimeter", reading, t_s)
            if altered is not None:
                self.localizer.on_altimeter(altered, now_ns)
        if self._step % PICTURE_EVERY == 0:
            self._late.append(image_of(see_floor(here.position_m, here.rotation), now_ns))
        if self._late and now_ns - self._late[0].capture >= (
            noises.picture_delay_steps * IMU_PERIOD_NS
        ):
            altered = self._alter("camera/down", self._late.pop(0), t_s)
            if altered is not None:
                self.localizer.on_picture(altered, now_ns)
        return pose

    def _noisy(self, value: np.ndarray, sigma: float) -> tuple[float, float, float]:
        x, y, z = (value + sigma * self._rng.standard_normal(3)).tolist()
        return x, y, z


def still(height_m: float = 1.0, yaw_rad: float = 0.0) -> Trajectory:
    return lambda _t: (0.0, 0.0, height_m, 0.0, 0.0, yaw_rad)


def eased(t_s: float, begin_s: float, ramp_s: float = 1.0) -> float:
    """Way gone at time t by something that gets smoothly up to a speed of 1."""
    t = t_s - begin_s
    if t <= 0:
        return 0.0
    if t >= ramp_s:
        return t - ramp_s / 2
    turn = 2 * math.pi * t / ramp_s
    return ramp_s * (0.5 * (t / ramp_s) ** 2 - (1 - math.cos(turn)) / (4 * math.pi**2))


def straight(
    vx_mps: float, vy_mps: float, *, height_m: float = 1.0, yaw_rad: float = 0.0
) -> Trajectory:
    """Rest for half a second, then get to a speed (of the world) within a second."""

    def trajectory(t_s: float) -> tuple[float, float, float, float, float, float]:
        way = eased(t_s, 0.5)
        return vx_mps * way, vy_mps * way, height_m, 0.0, 0.0, yaw_rad

    return trajectory
