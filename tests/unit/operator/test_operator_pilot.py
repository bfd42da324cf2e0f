"""Whole flights of the simulated person, in lock step with a vehicle of a few lines."""

import itertools
import math

import numpy as np
import pytest
from operator_flight import STEP_S, Flight
from operator_offers import GoodOffers, circle_from, line_from, suggestion_of

import worlds
from common.messages import Suggestion
from services.operator.person import Person, Phase
from services.operator.route import route_of
from services.operator.sources import NEUTRAL

TRACK = route_of(worlds.load("track"))
LANE_M = 1.2
"""Half of 3 m without half of the vehicle's 0.52 m is 1.24 m."""
LIMIT_S = 150.0


def actions(flight: Flight) -> list[str]:
    return [decision.action for _, decision in flight.decisions]


@pytest.mark.parametrize("seed", range(5))
def test_a_lap_by_hand_stays_in_the_lane(seed: int) -> None:
    flight = Flight(TRACK, Person(seed=seed))
    flight.run(LIMIT_S)
    progress = flight.pilot.progress
    assert progress.phase is Phase.DONE
    assert str(progress).startswith("mission done: laps 1 suggestions 0 accepted 0 takeovers 0")
    assert flight.offsets_m().max() <= LANE_M
    assert actions(flight) == ["takeoff", "land"]
    assert flight.vehicle.state == "landed"
    assert TRACK.length_m - 1.0 < progress.distance_m < 1.15 * TRACK.length_m
    heights_m = np.array(flight.track)[round(8.0 / STEP_S) : -200, 2]
    assert heights_m.min() > 0.7
    assert heights_m.max() < 1.3


@pytest.mark.parametrize("seed", range(4))
def test_good_suggestions_are_accepted_and_taken_over_from(seed: int) -> None:
    flight = Flight(TRACK, Person(seed=seed), GoodOffers(seed))
    flight.run(LIMIT_S)
    progress = flight.pilot.progress
    assert progress.phase is Phase.DONE
    assert progress.accepted >= 3
    assert progress.takeovers >= 1
    assert {primitive for _, primitive in flight.engaged} == {"line", "arc"}
    assert flight.offsets_m().max() <= LANE_M
    assert flight.refusals == 0


def test_the_localizers_drift_is_not_seen() -> None:
    flight = Flight(TRACK, Person(seed=3), lambda _: None)
    flight.run(LIMIT_S, lambda f: f.vehicle.x_m > 3.0)
    drifted = GoodOffers(1, drift_m=(5.0, -4.0, 0.8))(flight)
    assert drifted is not None
    flight.pilot.suggestion(drifted, flight.now_ns)
    flight._offered[drifted.id] = drifted
    flight.run(flight.time_s + 2.0)
    assert flight.pilot.progress.accepted == 1


def test_sticks_are_let_go_before_accepting() -> None:
    flight = Flight(TRACK, Person(seed=2), GoodOffers(2))
    flight.run(LIMIT_S, lambda f: f.pilot.progress.accepted >= 2)
    for time_s, decision in flight.decisions:
        if decision.action == "accept":
            tick = round(time_s / STEP_S) - 1
            assert all(sticks == NEUTRAL for sticks in flight.sticks[tick - 2 : tick + 1])


def test_sticks_that_are_not_obeyed_are_let_go_and_taken_up_again() -> None:
    flight = Flight(TRACK, Person(seed=4))
    flight.run(LIMIT_S, lambda f: f.vehicle.x_m > 5.0)
    flight.hovers = True
    flight.run(flight.time_s + 3.0)
    assert not flight.hovers
    flight.run(LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE
    assert flight.offsets_m().max() <= LANE_M


def test_hands_stay_off_while_the_autopilot_flies() -> None:
    flight = Flight(TRACK, Person(seed=2), GoodOffers(2))
    flight.run(LIMIT_S, lambda f: f.is_engaged)
    flight.run(flight.time_s + 3.0)
    assert flight.is_engaged
    assert all(sticks == NEUTRAL for sticks in flight.sticks[-140:])


class WrongOffers:
    """Shapes that do not fit, under the right name."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._numbers = itertools.count(1)

    def __call__(self, flight: Flight) -> Suggestion | None:
        vehicle = flight.vehicle
        leg, _ = TRACK.leg_at(flight.pilot._lane.place.along_m)
        x, y, z, yaw = vehicle.x_m, vehicle.y_m, vehicle.z_m, vehicle.yaw_rad
        number = next(self._numbers)
        if self._kind == "aside":
            points = line_from(x, y, z, yaw - math.radians(35.0))
        elif self._kind == "backwards":
            points = line_from(x, y, z, yaw + math.pi)
        elif self._kind == "climbing":
            points = (
                line_from(x, y, z, yaw)
                if leg.primitive == "line"
                else circle_from(x, y, z, yaw, 4.0)
            )
            points[:, 2] += np.linspace(0.0, 0.4 * len(points) * 0.1, len(points))
        elif self._kind == "tight":
            points = circle_from(x, y, z, yaw, 0.6)
        else:
            points = circle_from(x, y, z, yaw, 3.0, side=-1.0)
        return suggestion_of(number, leg.primitive, points, self._kind in ("tight", "right"))


@pytest.mark.parametrize("kind", ["aside", "backwards", "climbing", "tight", "right"])
def test_wrong_shapes_are_not_accepted(kind: str) -> None:
    flight = Flight(TRACK, Person(seed=4), WrongOffers(kind))
    flight.run(36.0)
    assert flight.pilot.progress.suggestions > 20
    assert flight.pilot.progress.accepted == 0
    assert flight.offsets_m().max() <= LANE_M


def test_another_primitive_than_the_planned_one_is_not_accepted() -> None:
    numbers = itertools.count(1)

    def offer(flight: Flight) -> Suggestion | None:
        good = GoodOffers(1)(flight)
        if good is None:
            return None
        points = np.array(good.path)
        return suggestion_of(next(numbers), "helix", points, good.closed)

    flight = Flight(TRACK, Person(seed=4), offer)
    flight.run(25.0)
    assert flight.pilot.progress.suggestions > 10
    assert flight.pilot.progress.accepted == 0


def test_an_operator_who_accepts_nothing_asks_for_nothing() -> None:
    flight = Flight(TRACK, Person(seed=4, accepts=False), GoodOffers(4))
    flight.run(LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE
    assert actions(flight) == ["takeoff", "land"]


def test_a_refused_accept_is_flown_on_by_hand() -> None:
    flight = Flight(TRACK, Person(seed=5), GoodOffers(5))
    flight._offered = _Nothing()
    flight.run(50.0)
    progress = flight.pilot.progress
    assert progress.laps == 0
    assert progress.refused >= 3
    assert progress.accepted == progress.takeovers == 0
    assert flight.offsets_m().max() <= LANE_M


class _Nothing(dict):  # type: ignore[type-arg]
    """Forgets every suggestion at once."""

    def __setitem__(self, key: int, value: Suggestion) -> None:
        pass


def test_an_unanswered_accept_is_given_up() -> None:
    flight = Flight(TRACK, Person(seed=5), GoodOffers(5))
    answered = flight.pilot.answered
    flight.pilot.answered = lambda action, ok: None if action == "accept" else answered(action, ok)
    flight._offered = _Nothing()
    flight.run(LIMIT_S, lambda f: f.pilot.progress.refused >= 2)
    assert flight.pilot.progress.refused == 2
    assert flight.pilot.progress.phase is Phase.STEERING


def test_a_course_that_turns_wrong_after_accepting_is_cancelled() -> None:
    flight = Flight(TRACK, Person(seed=6), GoodOffers(6))
    flight.run(LIMIT_S, lambda f: f.is_engaged)
    # The autopilot flies something else than was drawn.
    vehicle = flight.vehicle
    flight._following = suggestion_of(
        flight._following.id,
        "line",
        line_from(vehicle.x_m, vehicle.y_m, vehicle.z_m, vehicle.yaw_rad + 1.2),
        False,
    )
    flight.run(flight.time_s + 4.0)
    assert not flight.is_engaged
    assert flight.pilot.progress.cancelled + flight.pilot.progress.takeovers == 1
    flight.offer = None
    flight.run(LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE
    assert flight.offsets_m().max() <= LANE_M


def test_when_the_autopilot_gives_up_the_person_flies_on() -> None:
    flight = Flight(TRACK, Person(seed=6), GoodOffers(6))
    flight.run(LIMIT_S, lambda f: f.is_engaged)
    flight.offer = None
    flight.run(flight.time_s + 2.0)
    flight._following = None
    flight.run(flight.time_s + 1.0)
    assert flight.pilot.progress.phase is Phase.STEERING
    assert flight.pilot.progress.takeovers == 0
    flight.run(LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE


def test_without_a_picture_nothing_is_held() -> None:
    flight = Flight(TRACK, Person(seed=1))
    flight.run(LIMIT_S, lambda f: f.vehicle.x_m > 5.0)
    pilot = flight.pilot
    flight.pilot.truth = lambda pose, arrival_ns: None
    flight.run(flight.time_s + 1.5)
    assert flight.sticks[-1] == NEUTRAL
    assert not pilot.is_over


def test_somebody_elses_sticks_are_given_way_to() -> None:
    flight = Flight(TRACK, Person(seed=1))
    flight.run(LIMIT_S, lambda f: f.vehicle.x_m > 5.0)
    for _ in range(50):
        flight.now_ns += round(STEP_S * 1e9)
        flight.pilot.truth(flight.vehicle.pose(flight.now_ns), flight.now_ns)
        sticks, _ = flight.pilot.step(flight.now_ns, overridden=True)
    assert sticks == NEUTRAL
    flight.run(flight.time_s + 1.5)
    assert flight.sticks[-1] == NEUTRAL
    flight.run(flight.time_s + 2.5)
    assert not flight.sticks[-1].is_neutral
    flight.run(LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE


def test_a_vehicle_that_comes_down_ends_the_mission() -> None:
    flight = Flight(TRACK, Person(seed=1))
    flight.run(LIMIT_S, lambda f: f.vehicle.x_m > 5.0)
    flight.vehicle.state = "emergency"
    flight.run(flight.time_s + 1.0)
    assert flight.pilot.progress.phase is Phase.FAILED
    assert str(flight.pilot.progress).startswith("mission failed")
    for _ in range(5):
        flight.step()
    assert flight.sticks[-1] == NEUTRAL


def test_laps_are_counted() -> None:
    flight = Flight(TRACK, Person(seed=1, laps=2))
    flight.run(2.0 * LIMIT_S)
    assert flight.pilot.progress.phase is Phase.DONE
    assert flight.pilot.progress.laps == 2
    assert flight.offsets_m().max() <= LANE_M


def test_the_same_seed_flies_the_same_mission() -> None:
    one, two = (Flight(TRACK, Person(seed=7), GoodOffers(7)) for _ in range(2))
    one.run(25.0)
    two.run(25.0)
    assert one.sticks == two.sticks
    assert one.decisions == two.decisions


def test_nothing_begins_before_vehicle_autopilot_and_picture_are_there() -> None:
    flight = Flight(TRACK, Person(seed=1))
    for tick in range(100):
        flight.pilot.truth(flight.vehicle.pose(tick * 20_000_000), tick * 20_000_000)
        sticks, decision = flight.pilot.step(tick * 20_000_000)
        assert sticks == NEUTRAL
        assert decision is None
    assert "no vehicle, autopilot" in str(flight.pilot.progress)


def test_what_cannot_climb_or_move_sideways_is_left_alone_and_told_of() -> None:
    flight = Flight(TRACK, Person(seed=1))
    flight.vehicle.state = "flying"
    flight.full_stick = (1.0, 0.0, 0.0, 0.0, 1.5)
    flight.run(5.0)
    assert set(flight.sticks) == {NEUTRAL}
    assert flight.decisions == []
    assert "cannot move every way" in str(flight.pilot.progress)
    flight.full_stick = None
    flight.run(10.0)
    assert flight.pilot.progress.phase is not Phase.WAITING
