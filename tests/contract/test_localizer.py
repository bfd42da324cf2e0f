"""The localizer as a black box: what the instruments say in, poses out."""

import itertools
import math
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from conftest import (
    Client,
    Launch,
    Process,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    start_service,
)
from payloads import GOOD, assert_bad_input_is_dropped_and_counted

IMU_HZ = 200
START_X_M, START_Y_M = 3.0, -1.0
HEIGHT_M = 1.0
FOCAL_PX = 300.0
CAMERA_BELOW_M = 0.03
BAD_INPUTS = {
    "imu": "Imu",
    "altimeter": "Range",
    "camera/down": "Image",
    "vehicle": "VehicleStatus",
}

_epochs = itertools.count(1)


def _texture() -> np.ndarray:
    noise = np.random.default_rng(3).random((150, 150)).astype(np.float32)
    large = cv2.resize(noise, (900, 900), interpolation=cv2.INTER_CUBIC)
    return cv2.normalize(large, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


TEXTURE = _texture()


class Vehicle:
    """A level vehicle at a constant height, on a time of its own, told in real time.

    Args:
        client: where it is told.
        yaw_rad: where it looks, by the magnetic field.
        origin_ns: its first stamp.
    """

    def __init__(self, client: Client, yaw_rad: float = 0.0, origin_ns: int | None = None) -> None:
        self._client = client
        self._yaw_rad = yaw_rad
        # Every vehicle lives later than the one before: the jump is a new start.
        self.origin_ns = origin_ns or time.time_ns() + next(_epochs) * 1_000_000_000_000
        self._step = 0
        self.forward_m = 0.0
        self.forward_mps = 0.0
        self.silent: set[str] = set()
        self.height_told_m = HEIGHT_M

    @property
    def stamp_ns(self) -> int:
        return self.origin_ns + self._step * 1_000_000_000 // IMU_HZ

    def say(self, state: str) -> None:
        self._tell("vehicle", {**GOOD["VehicleStatus"], "state": state})

    def live(self, seconds: float, forward_mps2: float = 0.0) -> None:
        """Go on for a while, with an acceleration."""
        begin_s, dt_s = time.monotonic(), 1.0 / IMU_HZ
        for tick in range(round(seconds * IMU_HZ)):
            self._step += 1
            self.forward_m += self.forward_mps * dt_s + forward_mps2 * dt_s**2 / 2
            self.forward_mps += forward_mps2 * dt_s
            # The field points north, along world y, and down; here in body coordinates.
            north = (math.sin(self._yaw_rad), math.cos(self._yaw_rad))
            self._tell(
                "imu",
                {
                    "angular_velocity": [0.0, 0.0, 0.0],
                    "linear_acceleration": [forward_mps2, 0.0, 9.81],
                    "magnetic_field": [0.5 * north[0], 0.5 * north[1], -0.8],
                },
            )
            if self._step % 8 == 0:
                self._tell("altimeter", {"range": self.height_told_m, "min": 0.01, "max": 3.0})
            if self._step % 4 == 0:
                self._tell("camera/down", {**self._picture(), "capture": self.stamp_ns})
            ahead_s = begin_s + (tick + 1) * dt_s - time.monotonic()
            if ahead_s > 0:
                time.sleep(ahead_s)

    def _tell(self, topic: str, message: dict[str, Any]) -> None:
        if topic not in self.silent:
            message = {k: v for k, v in message.items() if k != "seq"}
            self._client.publish(topic, {**message, "stamp": self.stamp_ns})

    def _picture(self) -> dict[str, Any]:
        """The picture's top is ahead: flying forward, the floor runs down through it."""
        ran_px = self.forward_m * FOCAL_PX / (HEIGHT_M - CAMERA_BELOW_M)
        shift = np.array([[1.0, 0.0, -200.0], [0.0, 1.0, ran_px - 600.0]])
        grey = cv2.warpAffine(TEXTURE, shift, (320, 240))
        return {
            **GOOD["Image"],
            "width": 320,
            "height": 240,
            "data": cv2.imencode(".jpg", grey)[1].tobytes(),
            "intrinsics": [FOCAL_PX, FOCAL_PX, 159.5, 119.5],
        }


@pytest.fixture(scope="module")
def service(launch: Launch, client: Client) -> Process:
    process = start_service(
        launch, client, "localizer", "--start-x-m", str(START_X_M), "--start-y-m", str(START_Y_M)
    )
    client.collect("pose")
    return process


def taken_off(client: Client, yaw_rad: float = 0.0) -> Vehicle:
    vehicle = Vehicle(client, yaw_rad)
    vehicle.say("landed")
    vehicle.live(0.5)
    vehicle.say("flying")
    return vehicle


def pose_of(client: Client, vehicle: Vehicle) -> dict[str, Any]:
    """The first pose that knows the vehicle's last sample (later ones tell of its silence)."""
    poses = client.collect("pose")
    deadline_s = time.monotonic() + 5.0
    while time.monotonic() < deadline_s:
        for pose in list(poses):
            if abs(pose["stamp"] - vehicle.stamp_ns) <= 1_000_000_000 // IMU_HZ:
                return pose
        time.sleep(0.005)
    raise AssertionError("no pose at the end")


def yaw_of(pose: dict[str, Any]) -> float:
    x, y, z, w = pose["orientation"]
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def test_on_the_mark_it_says_where_it_stands(service: Process, client: Client) -> None:
    poses = client.collect("pose")
    vehicle = Vehicle(client)
    vehicle.say("landed")
    vehicle.live(0.5)
    before = len(poses)
    vehicle.live(1.0)
    told = poses[before : poses.index(pose_of(client, vehicle)) + 1]
    # A busy machine may hold the samples up for so long that their silence is told.
    told = [pose for pose in told if pose["status"] != "lost"]
    assert len(told) >= 50
    assert poses.encodings[-1] == "application/msgpack;Pose/1"
    assert all(a["seq"] < b["seq"] for a, b in itertools.pairwise(poses))
    assert all(a["stamp"] < b["stamp"] for a, b in itertools.pairwise(told))
    for pose in told:
        assert pose["status"] == "ok"
        assert pose["source"]
        assert pose["position"] == pytest.approx([START_X_M, START_Y_M, HEIGHT_M], abs=0.03)
        assert pose["velocity"] == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
        assert pose["angular_velocity"] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
        assert math.hypot(*pose["orientation"]) == pytest.approx(1.0, abs=1e-6)
        assert yaw_of(pose) == pytest.approx(0.0, abs=0.02)
        assert all(0.0 < variance < 0.1 for variance in pose["covariance"])

    health = client.next("health/localizer")
    assert health["service"] == "localizer"
    assert set(health["rates"]) >= set(BAD_INPUTS)
    assert 0.0 <= health["latency_p50"] <= health["latency_p99"] < 0.1
    assert client.collect("health/localizer").encodings[-1] == "application/msgpack;Health/1"


@pytest.mark.parametrize(("yaw", "way"), [(0.0, (1.0, 0.0)), (math.pi / 2, (0.0, 1.0))])
def test_in_flight_it_follows(
    service: Process, client: Client, yaw: float, way: tuple[float, float]
) -> None:
    """Forward is where the compass says."""
    vehicle = taken_off(client, yaw)
    vehicle.live(0.5, forward_mps2=1.0)
    vehicle.live(0.7)
    pose = pose_of(client, vehicle)
    assert pose["status"] == "ok"
    assert yaw_of(pose) == pytest.approx(yaw, abs=0.05)
    assert pose["velocity"] == pytest.approx([0.5 * way[0], 0.5 * way[1], 0.0], abs=0.05)
    moved = (pose["position"][0] - START_X_M, pose["position"][1] - START_Y_M)
    expected = [vehicle.forward_m * part for part in way]
    assert moved == pytest.approx(expected, abs=0.05)


def test_a_jump_of_the_altimeter_is_not_believed(service: Process, client: Client) -> None:
    poses = client.collect("pose")
    vehicle = taken_off(client)
    before = len(poses)
    vehicle.height_told_m = 0.4
    vehicle.live(0.12)
    vehicle.height_told_m = HEIGHT_M
    vehicle.live(0.3)
    pose_of(client, vehicle)
    assert all(abs(pose["position"][2] - HEIGHT_M) < 0.05 for pose in poses[before:])


def test_without_flow_it_is_degraded_and_without_imu_lost(service: Process, client: Client) -> None:
    poses = client.collect("pose")
    vehicle = taken_off(client)
    vehicle.live(0.3)
    assert pose_of(client, vehicle)["status"] == "ok"
    vehicle.silent.add("camera/down")
    vehicle.live(0.8)
    assert pose_of(client, vehicle)["status"] == "degraded"
    silent_s = time.monotonic()
    health = client.next("health/localizer", lambda h: "no IMU" in h["detail"])
    assert health["state"] == "degraded"
    time.sleep(0.6)
    late = [i for i, at in enumerate(poses.arrival_s) if at > silent_s + 0.15]
    assert late
    assert {poses[i]["status"] for i in late} == {"lost"}
    # Seldom: who judges by the age alone must see it go stale.
    assert np.diff([poses.arrival_s[i] for i in late]).min(initial=1.0) > 0.3


def test_when_time_goes_back_it_starts_again_at_the_mark(service: Process, client: Client) -> None:
    vehicle = taken_off(client)
    vehicle.live(0.5, forward_mps2=1.0)
    vehicle.live(0.3)
    assert pose_of(client, vehicle)["position"][0] > START_X_M + 0.2
    again = Vehicle(client, origin_ns=vehicle.origin_ns - 10_000_000_000)
    again.say("landed")
    again.live(0.5)
    assert pose_of(client, again)["position"][0] == pytest.approx(START_X_M, abs=0.05)


def test_bad_input_is_dropped_and_counted(service: Process, client: Client) -> None:
    client.collect("health/localizer")
    with ThreadPoolExecutor(len(BAD_INPUTS)) as pool:
        for result in [
            pool.submit(assert_bad_input_is_dropped_and_counted, client, "localizer", *row)
            for row in BAD_INPUTS.items()
        ]:
            result.result()


def test_a_picture_that_is_none_stops_nothing(
    service: Process, client: Client, streams: Streams
) -> None:
    streams.add("camera/down", 20.0, lambda _t: {**GOOD["Image"], "data": b"no picture"})
    streams.add("camera/down", 20.0, lambda _t: {**GOOD["Image"], "width": 999})
    vehicle = Vehicle(client)
    vehicle.silent.add("camera/down")
    vehicle.say("landed")
    vehicle.live(0.6)
    assert pose_of(client, vehicle)["status"] == "ok"


def test_it_starts_before_its_router(tmp_path: Path) -> None:
    assert_starts_before_its_router("localizer", tmp_path=tmp_path)


def test_it_stops_without_a_router(tmp_path: Path) -> None:
    assert_stops_without_a_router("localizer", tmp_path=tmp_path)


def test_it_ends_on_sigterm_with_0(service: Process, client: Client) -> None:
    assert "localizer" in client.alive()
    assert service.stop() == 0
