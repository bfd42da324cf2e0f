"""Paths are flown to centimetres, by a vehicle that lags, in noise and in wind."""

import math
from itertools import pairwise

import numpy as np
import pytest
from autopilot_worlds import PERIOD_S, LaggingVehicle, Rig, circle, line, pose, sine, suggestion
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from services.autopilot.config import Config
from services.autopilot.control import Controller, Reference
from services.autopilot.disturbance import Disturbance
from services.autopilot.follower import Follower
from services.autopilot.path import BadPathError, Path
from services.autopilot.pid import Gains, Pid
from services.autopilot.plants import PLANTS


def flown(rig: Rig, duration_s: float, skip_s: float = 0.0) -> np.ndarray:
    """Places x, y, z, yaw while engaged."""
    places = []
    for tick in range(round(duration_s / PERIOD_S)):
        rig.tick()
        if rig.autopilot.mode != "engaged":
            break
        if tick * PERIOD_S >= skip_s:
            places.append((rig.body.x, rig.body.y, rig.body.z, rig.body.yaw))
    return np.array(places)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("seed", range(3))
def test_a_line_is_flown_to_5_cm(seed):
    rig = Rig(LaggingVehicle(noise=1.0, seed=seed))
    rig.engage(line(20.0))
    places = flown(rig, 20.0)
    assert rms(places[:, 1]) < 0.05
    assert rms(places[:, 2] - 1.0) < 0.03
    assert rms(places[:, 3]) < math.radians(3)


@pytest.mark.parametrize("radius_m", [2.0, 3.0, 4.0])
@pytest.mark.parametrize("turn", [1, -1])
def test_a_circle_is_flown_to_10_cm_with_the_nose_along_it(radius_m, turn):
    rig = Rig(LaggingVehicle(noise=1.0))
    rig.engage(circle(radius_m, turn), closed=True)
    places = flown(rig, 30.0)
    x, y = places[:, 0], places[:, 1] - turn * radius_m
    assert rms(np.hypot(x, y) - radius_m) < 0.05
    tangent = np.arctan2(y, x) + turn * math.pi / 2
    off = (places[:, 3] - tangent + math.pi) % (2 * math.pi) - math.pi
    assert rms(off) < math.radians(4)
    assert rig.status.progress == pytest.approx(30.0 * 0.9, rel=0.05)


def test_a_helix_and_a_sine_are_flown_to_10_cm():
    for path in (circle(2.0, pitch_m=0.6, turns=2), sine()):
        rig = Rig(LaggingVehicle(noise=1.0))
        rig.engage(path)
        places = flown(rig, 40.0)
        assert rig.status.reason == "finished"
        gaps = [np.linalg.norm(np.array(path)[:, :3] - place[:3], axis=1).min() for place in places]
        assert rms(np.array(gaps)) < 0.10


def test_steady_wind_is_held_against():
    rig = Rig(LaggingVehicle(wind_mps=(0.0, 0.35)))
    rig.run(5.0)
    rig.body.x = rig.body.y = 0.0
    rig.run(0.04)
    rig.engage(line(20.0), speed=0.5)
    places = flown(rig, 30.0)
    assert rms(places[:, 1]) < 0.03


def test_a_start_beside_the_path_comes_back_without_swinging():
    rig = Rig(LaggingVehicle(y=0.8, yaw=0.5))
    rig.engage(line(20.0))
    places = flown(rig, 20.0)
    assert places[:, 1].min() > -0.15
    assert rms(places[250:, 1]) < 0.05


def test_the_nose_may_point_backward_at_the_start():
    rig = Rig(LaggingVehicle(yaw=math.pi))
    rig.engage(line(20.0))
    places = flown(rig, 25.0)
    assert places[-1, 0] > 19.5
    assert np.abs(places[:, 1]).max() < 0.4


def test_progress_never_goes_back_and_cannot_jump_to_another_branch():
    points = circle(1.5) + [(x, y, z, yaw) for x, y, z, yaw in circle(1.5, turn=-1)][1:]
    rig = Rig(LaggingVehicle(noise=1.0))
    rig.engage(points, closed=True)
    progress = []
    for _ in range(1200):
        rig.tick()
        progress.append(rig.autopilot._follower.progress_m)
    steps = [b - a for a, b in pairwise(progress)]
    assert min(steps) >= 0.0
    assert max(steps) < 0.1
    assert progress[-1] > 15.0


def follower_of(path, speed: float = 0.9, plant: str = "tum", closed: bool = False) -> Follower:
    config = Config()
    message = suggestion(path, closed, speed)
    return Follower(message, LaggingVehicle().pose(0), Controller(plant, config), config)


def test_the_speed_stays_within_what_the_vehicle_can_do():
    for path, limit in (
        (line(), 0.901),
        (circle(0.5), math.sqrt(0.5) + 0.01),
        ([(0.0, 0.0, 1.0 + 0.1 * i, 0.0) for i in range(50)], 0.451),
    ):
        profile = follower_of(path, speed=5.0)._plan_mps
        assert profile.max() <= limit
        assert profile[-1] <= 0.15 + 1e-9


@pytest.mark.parametrize("plant", PLANTS)
def test_no_speed_is_planned_that_the_wind_forbids(plant):
    follower = follower_of(circle(2.0), speed=1.0, plant=plant, closed=True)
    _, calm = follower._plan()
    assert calm.max() == pytest.approx(0.9 if plant == "tum" else 1.0, abs=0.03)
    # 80 % of what the sticks can do is spent on a wind from the east.
    plane = PLANTS[plant].plane
    push = 0.8 * plane.rate_ps * plane.top_speed
    follower._controller.disturbance.plane_mps2 = [-push, 0.0]
    _, windy = follower._plan()
    samples = np.arange(len(windy)) % (len(follower._path.points_m) - 1)
    tangents = follower._path.tangents[samples, :2]
    curvatures = follower._path.curvatures_1pm[samples, :2]
    needed = (
        windy[:, None] * tangents + (windy[:, None] ** 2 * curvatures + [push, 0.0]) / plane.rate_ps
    )
    eastward = tangents[:, 0]
    slowest = windy <= 0.151
    assert (np.linalg.norm(needed, axis=1) <= 0.93 * plane.top_speed)[~slowest].all()
    assert windy[eastward > 0.9].max() < windy[eastward < -0.9].min()


def test_speeds_fall_no_faster_than_the_vehicle_brakes():
    corner = line(5.0) + [(x + 4.9, y, z, 1.5) for x, y, z, _ in line(5.0, yaw=1.5)[1:]]
    follower = follower_of(corner)
    squares = follower._plan_mps**2
    assert np.diff(squares).min() >= -2.0 * 0.6 * follower._path.spacing_m - 1e-9
    assert follower._plan_mps[: len(squares) // 2 + 20].min() < 0.5


@pytest.mark.parametrize("where", ["up_mps2", "yaw_radps2", "plane_mps2"])
def test_what_is_no_number_is_left_to_the_guard_and_is_no_full_stick(where):
    controller = Controller("tum", Config())
    setattr(controller.disturbance, where, [math.nan] * 2 if where == "plane_mps2" else math.nan)
    sticks = controller.sticks(pose(1), 0.0, Reference((0.0, 0.0, 1.0), 0.0), PERIOD_S)
    assert any(map(math.isnan, (sticks.vx, sticks.vy, sticks.vz, sticks.wz)))


def test_yaws_however_large_are_angles():
    path = Path([(x, y, z, (-1.0) ** i * 1e308) for i, (x, y, z, _) in enumerate(line())], False)
    assert all(map(math.isfinite, (path.at(1.0).yaw_rad, path.at(1.0).yaw_rate_radpm)))


class TestDisturbance:
    @pytest.mark.parametrize("plant", PLANTS)
    @pytest.mark.parametrize("in_hand", [True, False])
    def test_wind_is_known_after_some_seconds_whoever_flies(self, plant, in_hand):
        wind_mps2 = 0.5
        known = Disturbance(PLANTS[plant])
        plane, speed_mps, asked_mps = PLANTS[plant].plane, 0.0, 0.0
        command = Rig().command
        for tick in range(400):
            vx = 0.2 * math.sin(0.02 * tick) if in_hand else 0.0
            share = PERIOD_S / plane.late_s if plane.late_s else 1.0
            asked_mps += share * (plane.speed * vx - asked_mps)
            speed_mps += PERIOD_S * (plane.rate_ps * (asked_mps - speed_mps) + wind_mps2)
            known.observe(
                pose(tick, velocity=(speed_mps, 0.0, 0.0)), replace(command, vx=vx), PERIOD_S
            )
        assert known.plane_mps2[0] == pytest.approx(wind_mps2, abs=0.05)
        assert known.plane_mps2[1] == pytest.approx(0.0, abs=0.01)

    def test_sticks_that_are_obeyed_are_no_wind(self):
        known = Disturbance(PLANTS["tum"])
        body = LaggingVehicle()
        command = replace(Rig().command, vx=0.8, vz=-0.4, wz=0.3)
        for tick in range(200):
            known.observe(body.pose(tick), command, PERIOD_S)
            body.fly(command)
        assert math.hypot(*known.plane_mps2) < 0.05
        assert abs(known.up_mps2) < 0.05
        assert abs(known.yaw_radps2) < 0.05

    def test_a_gap_in_the_poses_is_no_gust(self):
        known = Disturbance(PLANTS["tum"])
        command = Rig().command
        for tick in range(50):
            known.observe(pose(tick), command, PERIOD_S)
        known.pause()
        known.observe(pose(51, velocity=(0.9, 0.0, 0.0)), command, PERIOD_S)
        assert math.hypot(*known.plane_mps2) < 0.01

    def test_what_the_sticks_cannot_hold_is_not_believed(self):
        known = Disturbance(PLANTS["ardrone"])
        command = Rig().command
        for tick in range(1000):
            known.observe(pose(tick, velocity=(tick * 0.2, 0.0, 0.0)), command, PERIOD_S)
        plane = PLANTS["ardrone"].plane
        assert math.hypot(*known.plane_mps2) <= plane.rate_ps * plane.top_speed


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.floats(-1e3, 1e3)] * 3, st.floats(-10.0, 10.0)), min_size=2, max_size=30
    ),
    st.booleans(),
    st.floats(0.0, 100.0),
    st.floats(0.0, 0.3),
)
def test_whatever_path_comes_the_sticks_stay_within_full_stick(points, closed, speed, dt_s):
    body = LaggingVehicle(*points[0][:3], yaw=1.0)
    config = Config(min_height_m=0.0, max_height_m=1e6, fence_radius_m=1e6)
    points = [(x, y, abs(z), yaw) for x, y, z, yaw in points]
    body.z = points[0][2]
    try:
        controller = Controller("tum", config)
        follower = Follower(suggestion(points, closed, speed), body.pose(0), controller, config)
    except BadPathError:
        return
    for _ in range(5):
        sticks = follower.sticks(body.pose(0), 0.05, dt_s)
        for axis in (sticks.vx, sticks.vy, sticks.vz, sticks.wz):
            assert abs(axis) <= 1.0 + 1e-9


class TestPath:
    def test_positions_tangents_yaw_and_curvature_are_those_of_the_circle(self):
        path = Path(circle(2.0), closed=True)
        assert path.length_m == pytest.approx(4 * math.pi, rel=1e-3)
        assert np.linalg.norm(path.curvatures_1pm, axis=1) == pytest.approx(0.5, rel=0.05)
        for distance_m in np.linspace(0.0, 30.0, 200):
            here, angle = path.at(distance_m), distance_m / 2.0
            assert here.position_m[:2] == pytest.approx(
                (2 * math.sin(angle), 2 - 2 * math.cos(angle)), abs=0.02
            )
            assert here.tangent[:2] == pytest.approx((math.cos(angle), math.sin(angle)), abs=0.03)
            assert here.yaw_rad == pytest.approx(angle, abs=0.02)
            assert here.yaw_rate_radpm == pytest.approx(0.5, abs=0.02)
            assert here.curvature_1pm[:2] == pytest.approx(
                (-0.5 * math.sin(angle), 0.5 * math.cos(angle)), abs=0.03
            )

    def test_an_open_path_stays_at_its_ends(self):
        path = Path(line(2.0), closed=False)
        assert path.at(-1.0).position_m == (0.0, 0.0, 1.0)
        assert path.at(9.0).position_m == pytest.approx((2.0, 0.0, 1.0))
        assert path.advanced_m(2.0, (5.0, 0.0, 1.0)) == pytest.approx(2.0)

    def test_repeated_points_and_two_points_are_paths_too(self):
        twice = [point for point in line(1.0) for _ in range(2)]
        assert Path(twice, closed=False).length_m == pytest.approx(1.0)
        far = Path([(0.0, 0.0, 1.0, 0.0), (10.0, 0.0, 1.0, 0.0)], closed=False)
        assert far.at(5.0).position_m == pytest.approx((5.0, 0.0, 1.0))

    def test_a_path_starts_on_the_first_of_two_crossing_branches(self):
        eight = circle(2.0) + circle(2.0, turn=-1)[1:]
        path = Path(eight, closed=True)
        assert path.nearest_start_m((0.02, 0.0, 1.0), 1.0) == pytest.approx(0.02, abs=0.01)


class TestPid:
    def test_each_term_does_its_part(self):
        pid = Pid(Gains(2.0, 1.0, 0.5, 10.0), 2)
        assert pid.correction([1.0, 0.0], [0.0, 2.0], 0.1, False) == [2.0, 1.0]
        assert pid.correction([0.0, 0.0], [0.0, 0.0], 0.1, False) == pytest.approx([0.1, 0.0])

    def test_the_integral_does_not_wind_up(self):
        pid = Pid(Gains(1.0, 1.0, 0.0, 1.0), 1)
        for _ in range(1000):
            assert abs(pid.correction([5.0], [0.0], 0.1, False)[0]) <= 1.0
        assert pid.correction([0.0], [0.0], 0.1, False) == [0.0]
        for _ in range(1000):
            pid.correction([0.5], [0.0], 0.1, True)
        assert pid.correction([0.0], [0.0], 0.1, False) == [0.0]
        for _ in range(1000):
            pid.correction([0.4], [0.0], 0.1, False)
        assert pid.correction([0.0], [0.0], 0.1, False) == [pytest.approx(0.5)]

    def test_the_limit_keeps_the_direction(self):
        out = Pid(Gains(1.0, 0.0, 0.0, 1.0), 2).correction([3.0, 4.0], [0.0, 0.0], 0.1, False)
        assert out == pytest.approx([0.6, 0.8])
