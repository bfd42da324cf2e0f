"""The autopilot's rules one by one, in scenes that a person could fly."""

import msgspec
import pytest
from autopilot_worlds import LaggingVehicle, Rig, circle, line, pose, suggestion, vehicle

from common import messages as m
from services.autopilot.config import Config

NEUTRAL = (0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_manual_passes_the_sticks_through_unchanged(rig):
    rig.deflect(vx=0.5, vy=-0.25, vz=0.125, wz=1.0)
    assert rig.velocity_command == (0.5, -0.25, 0.125, 1.0)
    assert (rig.command.action, rig.command.mode) == ("fly", "manual")


def test_sticks_within_the_dead_band_are_neutral(rig):
    rig.deflect(vx=0.5)
    rig.deflect(vx=0.05, vy=-0.05)
    assert rig.velocity_command == NEUTRAL
    assert rig.command.mode == "manual"


def test_an_accepted_path_is_flown_while_the_sticks_stream_neutral(rig):
    rig.engage(line())
    assert rig.command.mode == "engaged"
    rig.run(5.0)
    assert rig.status is not None
    assert (rig.status.mode, rig.status.suggestion) == ("engaged", 1)
    assert rig.status.progress == pytest.approx(rig.body.x, abs=0.1)
    assert rig.status.progress > 3.0


@pytest.mark.parametrize("axis", ["vx", "vy", "vz", "wz"])
@pytest.mark.parametrize("value", [-1.0, -0.051, 0.051, 1.0])
def test_any_stick_beyond_the_dead_band_takes_over_at_once(rig, axis, value):
    rig.engage(line())
    rig.run(1.0)
    rig.deflect(**{axis: value})
    assert (rig.command.mode, rig.status.reason) == ("manual", "stick")
    assert getattr(rig.command, axis) == value
    assert sum(map(abs, rig.velocity_command)) == abs(value)


def test_cancel_gives_control_back_at_once(rig):
    rig.engage(line())
    rig.run(1.0)
    assert rig.decide("cancel") == m.DecideReply(ok=True, reason="cancelled", mode="manual")
    assert (rig.command.mode, rig.velocity_command) == ("manual", NEUTRAL)


def test_the_end_of_an_open_path_is_a_hover_near_it(rig):
    rig.engage(line(4.0))
    rig.run(8.0)
    assert (rig.command.mode, rig.status.reason) == ("hover", "finished")
    assert rig.body.x == pytest.approx(4.0, abs=0.15)


def test_a_closed_path_is_flown_again_until_cancelled(rig):
    rig.engage(circle(1.5), closed=True)
    rig.run(30.0)
    assert rig.command.mode == "engaged"
    assert rig.status.progress > 2 * 9.42


class TestAccept:
    @pytest.mark.parametrize("action", ["accept", "takeoff"])
    def test_after_a_standstill_what_was_asked_meanwhile_is_not_done(self, rig, action):
        rig.now_ns += 2_000_000_000
        if action == "takeoff":
            rig.autopilot.on_vehicle(vehicle("landed"), rig.now_ns)
        rig.autopilot.on_pose(rig.body.pose(1000), rig.now_ns)
        rig._seq = 1000
        rig.deflect()
        rig.suggest(suggestion(line()))
        assert rig.decide(action).reason == "late"
        rig.run(0.1)
        assert rig.decide(action).ok

    def test_after_a_standstill_an_emergency_is_one(self, rig):
        rig.now_ns += 2_000_000_000
        assert rig.decide("emergency").ok

    def test_the_same_nonce_gets_the_same_answer_and_no_second_effect(self, rig):
        rig.suggest(suggestion(line()))
        first = rig.decide("accept", nonce=77, suggestion=1)
        rig.deflect(vx=0.5)
        assert rig.decide("accept", nonce=77, suggestion=1) == first
        assert first.ok
        assert rig.autopilot.mode == "manual"

    def test_without_an_id_the_newest_is_accepted(self, rig):
        rig.suggest(suggestion(line(), id_=3))
        rig.suggest(suggestion(line(), id_=4))
        assert rig.decide("accept").ok
        assert rig.status.suggestion == 4

    def test_the_one_before_the_newest_may_still_be_meant(self, rig):
        rig.suggest(suggestion(line(), id_=3))
        rig.suggest(suggestion(line(), id_=4))
        assert rig.decide("accept", suggestion=3).ok
        assert rig.status.suggestion == 3

    def test_an_unknown_one_is_refused(self, rig):
        assert rig.decide("accept").reason == "unknown"
        rig.suggest(suggestion(line(), id_=3))
        assert rig.decide("accept", suggestion=9).reason == "unknown"
        assert rig.autopilot.mode == "hover"

    def test_a_stale_one_is_refused(self, rig):
        rig.suggest(suggestion(line()))
        rig.run(3.1)
        reply = rig.decide("accept", suggestion=1)
        assert (reply.ok, reply.reason) == (False, "stale")

    def test_a_held_stick_refuses(self, rig):
        rig.suggest(suggestion(line()))
        rig.deflect(vx=0.3)
        assert rig.decide("accept").reason == "stick"

    def test_no_live_stick_refuses(self, rig):
        rig.suggest(suggestion(line()))
        rig.sticks = False
        rig.run(0.3)
        assert rig.decide("accept").reason == "stick_lost"

    @pytest.mark.parametrize("lost", ["silent", "says so"])
    def test_no_fresh_pose_refuses(self, rig, lost):
        rig.suggest(suggestion(line()))
        rig.poses = False
        for seq in range(1000, 1010):
            rig.run(0.02)
            if lost == "says so":
                rig.autopilot.on_pose(pose(seq, status="lost"), rig.now_ns)
        assert rig.decide("accept").reason == "pose_lost"

    @pytest.mark.parametrize("state", ["landed", "taking_off", "landing", "emergency"])
    def test_a_vehicle_that_does_not_fly_refuses(self, rig, state):
        rig.suggest(suggestion(line()))
        rig.autopilot.on_vehicle(vehicle(state), rig.now_ns)
        reply = rig.decide("accept")
        assert (reply.ok, reply.reason) == (False, state)

    def test_a_path_that_is_far_away_refuses(self, rig):
        rig.suggest(suggestion([(x, y + 1.2, z, yaw) for x, y, z, yaw in line()]))
        assert rig.decide("accept").reason == "too_far"

    @pytest.mark.parametrize("z", [0.1, 10.5])
    def test_a_path_beyond_the_height_limits_refuses(self, rig, z):
        rig.body.z = z
        rig.run(0.1)
        rig.suggest(suggestion(line(z=z)))
        assert rig.decide("accept").reason == "geofence"

    def test_a_path_of_one_place_refuses(self, rig):
        rig.suggest(suggestion([(0.0, 0.0, 1.0, 0.0)] * 3))
        assert rig.decide("accept").reason == "bad_path"

    def test_a_refused_one_leaves_the_flight_as_it_is(self, rig):
        rig.engage(line())
        rig.run(1.0)
        rig.suggest(suggestion([(0.0, 50.0, 1.0, 0.0), (1.0, 50.0, 1.0, 0.0)], id_=2))
        assert not rig.decide("accept", suggestion=2).ok
        rig.run(1.0)
        assert (rig.status.mode, rig.status.suggestion) == ("engaged", 1)
        assert rig.status.progress > 0.5

    def test_another_one_may_be_accepted_while_one_is_flown(self, rig):
        rig.engage(line())
        rig.run(2.0)
        rig.suggest(suggestion(circle(2.0), True, id_=2))
        rig.body.x = rig.body.y = 0.0
        rig.run(0.04)
        assert rig.decide("accept", suggestion=2).ok
        assert (rig.status.mode, rig.status.suggestion) == ("engaged", 2)


class TestLosses:
    def test_without_sticks_for_0_2_s_manual_becomes_a_hover(self, rig):
        rig.deflect(vx=0.5)
        rig.sticks = False
        rig.run(0.2)
        assert rig.autopilot.mode == "manual"
        rig.run(0.02)
        assert (rig.command.mode, rig.status.reason) == ("hover", "stick_lost")
        assert rig.velocity_command == NEUTRAL

    def test_without_sticks_an_engaged_path_is_given_up_and_stays_so(self, rig):
        rig.engage(line())
        rig.sticks = False
        rig.run(0.24)
        assert (rig.command.mode, rig.status.reason) == ("hover", "stick_lost")
        rig.sticks = True
        rig.run(1.0)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)

    def test_after_a_loss_the_sticks_pass_neutral_before_they_count(self, rig):
        rig.deflect(vx=0.5)
        rig.sticks = False
        rig.run(0.3)
        rig.deflect(vx=0.5)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)
        rig.run(0.1)
        rig.deflect(vx=0.5)
        assert rig.command.mode == "hover"
        rig.deflect()
        rig.deflect(vx=0.5)
        assert (rig.command.mode, rig.command.vx) == ("manual", 0.5)

    def test_a_loss_counts_even_if_no_step_saw_it(self, rig):
        rig.deflect(vx=0.5)
        rig.now_ns += 300_000_000
        rig.deflect(vx=0.5)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)

    def test_an_older_stick_of_the_same_link_does_not_count(self, rig):
        rig.run(0.2)
        output = rig.autopilot.on_stick(
            m.Stick(stamp=0, seq=2, vx=0.9, vy=0.0, vz=0.0, wz=0.0), rig.now_ns, rig.now_ns
        )
        assert output.command is None
        assert rig.autopilot.mode == "hover"

    def test_a_new_operator_counts_from_its_first_neutral(self, rig):
        rig.sticks = False
        rig.run(0.3)
        rig._seq = 0
        rig.deflect()
        rig.deflect(vx=0.7)
        assert (rig.command.mode, rig.command.vx) == ("manual", 0.7)

    def test_without_a_pose_for_0_11_s_the_vehicle_holds_and_then_goes_on(self, rig):
        rig.engage(line())
        rig.run(2.0)
        rig.poses = False
        rig.run(0.1)
        assert rig.velocity_command != NEUTRAL
        rig.run(0.04)
        assert (rig.command.mode, rig.velocity_command) == ("engaged", NEUTRAL)
        rig.poses = True
        rig.run(0.2)
        assert rig.command.mode == "engaged"
        assert rig.command.vx > 0.3

    def test_without_a_pose_for_0_5_s_it_hovers_and_stays_so(self, rig):
        rig.engage(line())
        rig.run(2.0)
        rig.poses = False
        rig.run(0.54)
        assert (rig.command.mode, rig.status.reason) == ("hover", "pose_lost")
        rig.poses = True
        rig.run(1.0)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)

    @pytest.mark.parametrize("what", ["sticks", "poses"])
    def test_a_loss_of_5_s_lands(self, rig, what):
        rig.engage(line())
        setattr(rig, what, False)
        rig.run(4.9)
        assert rig.command.action == "fly"
        rig.run(0.2)
        assert (rig.command.mode, rig.command.action) == ("hover", "land")
        assert rig.velocity_command == NEUTRAL
        rig.autopilot.on_vehicle(vehicle("landed"), rig.now_ns)
        rig.run(0.02)
        assert (rig.command.mode, rig.command.action) == ("landed", "fly")

    def test_a_human_who_comes_back_stops_the_landing(self, rig):
        rig.sticks = False
        rig.run(6.0)
        assert rig.command.action == "land"
        rig.deflect()
        assert rig.command.action == "land"
        rig.deflect(vz=0.4)
        assert (rig.command.mode, rig.command.action, rig.command.vz) == ("manual", "fly", 0.4)

    def test_a_human_without_a_pose_may_fly_on(self, rig):
        rig.poses = False
        for _ in range(400):
            rig.run(0.02)
            rig.deflect(vx=0.2)
        assert (rig.command.mode, rig.command.action) == ("manual", "fly")

    @pytest.mark.parametrize(
        "wild",
        [
            {"position": (1e200, 0.0, 1.0)},
            {"velocity": (0.0, 0.0, 1e308)},
            {"velocity": (0.0, 0.0, -1e308)},
            {"yaw_rate": 1e308},
        ],
    )
    def test_poses_of_an_estimator_that_diverged_are_none(self, rig, wild):
        rig.engage(line())
        rig.run(1.0)
        rig.poses = False
        for seq in range(1000, 1030):
            rig.autopilot.on_pose(pose(seq, **wild), rig.now_ns)
            rig.run(0.02)
        assert (rig.command.mode, rig.status.reason) == ("hover", "pose_lost")
        rig.poses = True
        rig.run(3.0)
        assert max(map(abs, rig.velocity_command)) < 0.1

    def test_far_from_the_path_it_is_given_up(self, rig):
        rig.engage(line())
        rig.run(1.0)
        rig.body.y = 2.5
        rig.run(0.04)
        assert (rig.command.mode, rig.status.reason) == ("hover", "off_path")

    def test_beyond_the_height_limits_it_is_given_up(self):
        rig = Rig(LaggingVehicle(z=1.0), Config(max_height_m=1.05))
        rig.engage(line())
        rig.body.z = 1.6
        rig.run(0.04)
        assert (rig.command.mode, rig.status.reason) == ("hover", "geofence")

    def test_beyond_the_fence_it_is_given_up(self):
        rig = Rig(config=Config(fence_radius_m=3.0, leave_path_m=5.0))
        rig.engage(line(2.9))
        rig.body.y = 3.2
        rig.run(0.04)
        assert rig.command.mode == "engaged"
        rig.body.y = -3.6
        rig.run(0.04)
        assert (rig.command.mode, rig.status.reason) == ("hover", "geofence")

    def test_a_path_that_leaves_the_fence_refuses(self):
        rig = Rig(config=Config(fence_radius_m=10.0))
        rig.suggest(suggestion(line(11.0)))
        assert rig.decide("accept").reason == "geofence"


class TestHover:
    def arrived(self, rig: Rig) -> None:
        rig.engage(line(2.0))
        rig.run(6.0)
        assert (rig.command.mode, rig.status.reason) == ("hover", "finished")

    def test_it_keeps_its_place_in_wind(self):
        rig = Rig(LaggingVehicle(noise=1.0, wind_mps=(0.0, 0.3)))
        self.arrived(rig)
        place = (rig.body.x, rig.body.y, rig.body.z, rig.body.yaw)
        rig.run(30.0)
        assert (rig.body.x, rig.body.y, rig.body.z) == pytest.approx(place[:3], abs=0.1)
        assert rig.body.yaw == pytest.approx(place[3], abs=0.1)
        assert rig.velocity_command != NEUTRAL

    def test_pushed_away_it_keeps_the_new_place(self, rig):
        self.arrived(rig)
        rig.run(2.0)
        rig.body.y += 3.0
        rig.run(5.0)
        assert rig.body.y == pytest.approx(3.0, abs=0.2)

    @pytest.mark.parametrize("what", ["sticks", "poses"])
    def test_without_sticks_or_poses_it_is_neutral_and_holds_again_only_when_they_are_steady(
        self, what
    ):
        rig = Rig(LaggingVehicle(wind_mps=(0.0, 0.3)))
        self.arrived(rig)
        rig.run(2.0)
        assert rig.velocity_command != NEUTRAL
        setattr(rig, what, False)
        rig.run(0.24)
        assert rig.velocity_command == NEUTRAL
        setattr(rig, what, True)
        rig.run(0.9)
        assert rig.velocity_command == NEUTRAL
        rig.run(0.5)
        assert rig.velocity_command != NEUTRAL
        assert rig.command.mode == "hover"

    @pytest.mark.parametrize("state", ["taking_off", "landing", "landed"])
    def test_only_what_flies_is_held(self, state):
        rig = Rig(LaggingVehicle(wind_mps=(0.0, 0.3)))
        rig.run(3.0)
        assert rig.velocity_command != NEUTRAL
        rig.autopilot.on_vehicle(vehicle(state), rig.now_ns)
        rig.run(0.04)
        assert rig.velocity_command == NEUTRAL

    def test_it_does_not_work_against_a_stick_that_is_still_held(self):
        rig = Rig(LaggingVehicle(wind_mps=(0.0, 0.3)))
        rig.run(3.0)
        rig.deflect(vx=-1.0)
        rig.autopilot.on_vehicle(vehicle("landed"), rig.now_ns)
        rig.autopilot.on_vehicle(vehicle("flying"), rig.now_ns)
        rig.sticks = False
        rig.run(0.1)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)

    def test_the_change_from_path_to_place_is_smooth(self):
        rig = Rig(LaggingVehicle(noise=0.0, wind_mps=(0.2, 0.3)))
        rig.run(5.0)
        rig.body.x = rig.body.y = 0.0
        rig.run(0.1)
        rig.engage(line(4.0))
        before, largest = rig.velocity_command, 0.0
        for _ in range(500):
            rig.tick()
            steps = [abs(a - b) for a, b in zip(rig.velocity_command, before, strict=True)]
            largest, before = max(largest, *steps), rig.velocity_command
        assert rig.status.reason == "finished"
        assert largest <= 5.0 * 0.02 + 1e-9


class TestBattery:
    def charge(self, rig: Rig, battery: float, state: m.VehicleState = "flying") -> None:
        rig.autopilot.on_vehicle(vehicle(state, battery=battery), rig.now_ns)

    def test_a_low_one_refuses_to_begin_and_lets_go_on(self, rig):
        rig.engage(line())
        self.charge(rig, 0.2)
        rig.run(1.0)
        assert rig.command.mode == "engaged"
        rig.suggest(suggestion(line(), id_=2))
        assert rig.decide("accept", suggestion=2).reason == "battery_low"
        assert "battery 20%" in rig.autopilot.health(rig.now_ns)[1]
        self.charge(rig, 0.2, "landed")
        assert rig.decide("takeoff").reason == "battery_low"

    @pytest.mark.parametrize("engaged", [True, False])
    def test_an_empty_one_lands(self, rig, engaged):
        if engaged:
            rig.engage(line())
        self.charge(rig, 0.05)
        rig.run(0.02)
        assert (rig.command.mode, rig.command.action) == ("hover", "land")
        assert rig.status.reason == "battery_empty"

    def test_whoever_steers_chooses_where_it_comes_down(self, rig):
        rig.deflect(vx=0.4)
        self.charge(rig, 0.03)
        rig.deflect(vx=0.5)
        assert (rig.command.mode, rig.command.action, rig.command.vx) == ("manual", "fly", 0.5)
        rig.deflect()
        rig.run(0.02)
        assert rig.command.action == "land"
        rig.deflect(vx=0.5)
        assert (rig.command.mode, rig.command.action, rig.command.vx) == ("manual", "fly", 0.5)


class TestStuckPad:
    def hold(self, rig: Rig, duration_s: float, tremor: float = 0.0) -> None:
        rig.sticks = False
        for tick in range(round(duration_s / 0.02)):
            rig.tick()
            rig.deflect(vx=0.5 + tremor * (tick % 2))

    def test_it_is_told_then_it_counts_no_more(self, rig):
        self.hold(rig, 10.5)
        assert rig.command.vx == 0.5
        state, detail = rig.autopilot.health(rig.now_ns)
        assert state == "degraded"
        assert "the sticks have not moved for 10 s" in detail
        self.hold(rig, 10.0)
        assert (rig.command.mode, rig.velocity_command) == ("hover", NEUTRAL)
        assert rig.status.reason == "stick_stuck"
        self.hold(rig, 5.2)
        assert (rig.command.mode, rig.command.action) == ("hover", "land")

    def test_it_counts_again_after_neutral(self, rig):
        self.hold(rig, 21.0)
        rig.deflect(vx=0.7)
        assert rig.velocity_command == NEUTRAL
        rig.deflect()
        rig.deflect(vx=0.7)
        assert (rig.command.mode, rig.command.vx) == ("manual", 0.7)

    def test_a_hand_that_trembles_may_hold_for_ever(self, rig):
        self.hold(rig, 60.0, tremor=0.004)
        assert rig.command.mode == "manual"
        assert "sticks" not in rig.autopilot.health(rig.now_ns)[1]


def test_an_accepted_path_does_not_change_when_its_suggestion_does(rig):
    rig.engage(line())
    rig.run(1.0)
    rig.suggest(suggestion(line(yaw=1.0)))
    rig.run(3.0)
    assert abs(rig.body.y) < 0.1
    assert rig.status.cross_track < 0.1


def test_the_newest_path_of_a_suggestion_is_accepted(rig):
    rig.suggest(suggestion(line()))
    rig.run(1.0)
    rig.suggest(suggestion(line(yaw=1.0)))
    rig.run(2.5)
    assert rig.decide("accept", suggestion=1).ok
    rig.run(4.0)
    assert rig.body.y > 1.5


def test_another_plant_ends_the_path(rig):
    rig.engage(line())
    rig.run(1.0)
    rig.autopilot.on_vehicle(vehicle("flying", plant="ardrone"), rig.now_ns)
    rig.run(0.02)
    assert (rig.command.mode, rig.status.reason) == ("hover", "vehicle_changed")


def test_a_plant_that_follows_its_stick_otherwise_than_before_has_another_model(rig):
    described = {"full_stick": (1.0, 1.0, 0.5, 0.5, 1.0), "rates": (2.0, 2.0, 2.0)}
    for rates in ((2.0, 2.0, 2.0), (1.0, 1.0, 1.0)):
        told = msgspec.structs.replace(
            vehicle("flying", plant="mine"), **described | {"rates": rates}
        )
        rig.autopilot.on_vehicle(told, rig.now_ns)
        assert rig.autopilot._controller.plant.plane.rate_ps == rates[0]


def test_another_plant_is_held_by_its_own_model(rig):
    rig.run(3.0)
    assert rig.autopilot._hold is not None
    rig.autopilot.on_vehicle(vehicle("flying", plant="ardrone"), rig.now_ns)
    rig.run(0.02)
    assert rig.autopilot._hold._controller.plant_name == "ardrone"


class TestTakeoffLandEmergency:
    def tell(self, rig: Rig, state: m.VehicleState) -> None:
        rig.autopilot.on_vehicle(vehicle(state), rig.now_ns)
        rig.run(0.02)

    def test_takeoff_is_sent_until_the_vehicle_obeys(self, rig):
        self.tell(rig, "landed")
        assert rig.command.mode == "landed"
        assert rig.decide("takeoff") == m.DecideReply(ok=True, reason="takeoff", mode="landed")
        assert rig.command.action == "takeoff"
        rig.run(0.5)
        assert rig.command.action == "takeoff"
        self.tell(rig, "taking_off")
        assert (rig.command.mode, rig.command.action) == ("hover", "fly")

    def test_a_vehicle_that_does_not_take_off_is_not_told_for_ever(self, rig):
        self.tell(rig, "landed")
        rig.decide("takeoff")
        rig.run(3.1)
        assert (rig.command.mode, rig.command.action) == ("landed", "fly")

    @pytest.mark.parametrize("state", ["taking_off", "flying", "landing"])
    def test_takeoff_of_what_flies_is_refused(self, rig, state):
        self.tell(rig, state)
        assert rig.decide("takeoff").reason == state

    def test_takeoff_with_a_held_stick_is_refused(self, rig):
        self.tell(rig, "landed")
        rig.deflect(vz=1.0)
        assert rig.decide("takeoff").reason == "stick"

    def test_sticks_do_nothing_on_the_ground(self, rig):
        self.tell(rig, "landed")
        rig.deflect(vx=1.0)
        rig.run(0.02)
        assert (rig.command.mode, rig.velocity_command) == ("landed", NEUTRAL)

    def test_land_ends_a_path(self, rig):
        rig.engage(line())
        rig.run(1.0)
        assert rig.decide("land") == m.DecideReply(ok=True, reason="land", mode="hover")
        assert (rig.command.action, rig.velocity_command) == ("land", NEUTRAL)
        rig.suggest(suggestion(line(), id_=2))
        assert rig.decide("accept").reason == "land"

    def test_emergency_wins_over_held_sticks_and_a_path(self, rig):
        rig.engage(line())
        rig.deflect(vx=1.0)
        assert rig.decide("emergency") == m.DecideReply(
            ok=True, reason="emergency", mode="emergency"
        )
        assert (rig.command.action, rig.velocity_command) == ("emergency", NEUTRAL)
        rig.deflect(vx=1.0)
        rig.run(0.1)
        assert (rig.command.action, rig.velocity_command) == ("emergency", NEUTRAL)
        for action in ("cancel", "land", "accept", "takeoff"):
            reply = rig.decide(action)
            assert not reply.ok
            assert reply.mode == "emergency"

    def test_takeoff_ends_an_emergency_once_the_vehicle_has_landed(self, rig):
        rig.decide("emergency")
        self.tell(rig, "emergency")
        assert (rig.command.mode, rig.command.action) == ("emergency", "land")
        assert not rig.decide("takeoff").ok
        self.tell(rig, "landed")
        assert rig.command.mode == "emergency"
        assert rig.decide("takeoff").ok
        assert (rig.command.mode, rig.command.action) == ("landed", "takeoff")

    def test_a_vehicle_in_emergency_ends_everything(self, rig):
        rig.engage(line())
        self.tell(rig, "emergency")
        assert (rig.command.mode, rig.status.reason) == ("emergency", "vehicle_emergency")

    def test_a_vehicle_that_lands_by_itself_ends_a_path(self, rig):
        rig.engage(line())
        self.tell(rig, "landing")
        assert (rig.command.mode, rig.status.reason) == ("hover", "vehicle_landing")


def test_the_status_comes_20_times_a_second(rig):
    count = 0
    for _ in range(500):
        rig.status = None
        rig.tick()
        count += rig.status is not None
    assert count == pytest.approx(200, abs=2)


def test_the_command_comes_50_times_a_second_in_hover_and_once_a_stick_in_manual(rig):
    def commands(act) -> int:  # type: ignore[no-untyped-def]
        count = 0
        for _ in range(50):
            rig.now_ns += 20_000_000
            count += act().command is not None
        return count

    def stick(vx: float):  # type: ignore[no-untyped-def]
        rig._seq += 1
        message = m.Stick(stamp=0, seq=rig._seq, vx=vx, vy=0.0, vz=0.0, wz=0.0)
        output = rig.autopilot.on_stick(message, rig.now_ns, 0)
        step = rig.autopilot.step(rig.now_ns, 0)
        assert output.command is None or step.command is None
        return output if output.command else step

    assert commands(lambda: stick(0.0)) == 50
    assert rig.autopilot.mode == "hover"
    assert commands(lambda: stick(0.5)) == 50
    assert rig.autopilot.mode == "manual"


def test_health_says_what_is_missing():
    rig = Rig()
    assert rig.autopilot.health(rig.now_ns) == ("ok", "hover: start")
    rig.poses = rig.sticks = False
    rig.run(0.8)
    assert rig.autopilot.health(rig.now_ns) == ("degraded", "hover: start, no sticks, no pose")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("step_period_s", 0.0),
        ("dead_band", 1.0),
        ("plane_p", -1.0),
        ("max_speed_fraction", 1.0),
        ("max_height_m", 0.1),
        ("hold_s", 0.05),
    ],
)
def test_a_configuration_that_cannot_be_used_names_its_field(field, value):
    with pytest.raises(ValueError, match=field):
        Config(**{field: value})


def test_health_tells_that_the_vehicle_is_silent(rig):
    assert "no vehicle" not in rig.autopilot.health(rig.now_ns)[1]
    rig.run(1.1)
    assert "no vehicle" in rig.autopilot.health(rig.now_ns)[1]
