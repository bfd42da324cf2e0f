"""A simulated person who flies a route by the sticks and uses suggestions that fit it. Pure.

What he knows he has seen (eyes.py), what he does he does by hand (hands.py); his thinking is the
state machine here. He lets go of the sticks before he accepts, watches while the autopilot flies,
and takes over by the sticks when a primitive ends or the course is about to leave the lane.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from common.clock import nanoseconds, seconds
from common.messages import AutopilotStatus, DecideAction, Pose, Suggestion, VehicleStatus
from common.sticks import FULL_STICK, full_stick_of
from common.topics import TOPICS
from services.operator.attention import Attention
from services.operator.eyes import Eyes, Sight
from services.operator.hands import Hands
from services.operator.judgement import Drawing, ahead_of, compare, drawing_of
from services.operator.lane import Lane
from services.operator.person import IN_THE_AIR, Decision, Person, Phase, Progress
from services.operator.route import Route
from services.operator.sources import Deflection
from services.operator.steering import LOOK_AHEAD_M, Climb, foreseen, pursue

GLANCE_S = 0.1
"""The picture is taken in ten times a second."""
JUDGE_S = 0.35
"""From seeing a drawing to having compared it with the lane."""
OLD_S = 2.2
"""A suggestion seen longer ago than this is not worth deciding on; it is refused after 3 s."""
COMPARED_M = 5.0
ASIDE_M = 0.7
"""A drawing within this of the midline fits a lane of 3 m for a vehicle of 0.5 m."""
LEVEL_M = 0.5
WORTHWHILE_M = 3.0
"""With less of the primitive left, accepting is more work than flying."""
FOLLOWED = 0.8
"""A drawing that fits leads at least this much of its length along the lane."""
WATCHED_S = 1.8
"""How far ahead the drawing is watched while the autopilot follows it."""
COURSE_S = 1.0
"""How far ahead the course is watched, whatever is drawn."""
LEAVING_M = 0.85
OUT_M = 0.75
"""Takes over when the vehicle is this far from the midline, or is about to be at LEAVING_M."""
END_S = 0.6
"""Takes over this long before a primitive seems to end; half of it is the delay of his eyes."""
WRONG_S = 2.5
"""Leaving the lane this soon after accepting was a wrong suggestion, and is cancelled."""
NEUTRAL_STEPS = 3
"""Neutral sticks sent before asking: accepting is refused while they are deflected."""
ANSWER_S = 2.5
SETTLE_S = 0.8
UNHEEDED_S = 0.5
"""After so long of hovering against his sticks he notices, and lets go of them."""
YIELD_S = 2.0
"""How long he keeps his hands off after somebody else has flown."""
AGAIN_S = 3.0
CLIMB_LIMIT = 0.6
TRIM_LIMIT = 0.3
SEARCH_RADPS = 0.3
OUT_OF_SIGHT = 1e4
"""m and m/s."""


class Pilot:
    """The person, stepped at the rate of his sticks.

    Args:
        route: his plan.
        person: his skill and his task.
        period_s: between two steps.
    """

    def __init__(self, route: Route, person: Person, period_s: float = 0.02) -> None:
        self._route = route
        self._person = person
        self._period_s = period_s
        rng = np.random.default_rng(person.seed)
        eyes_rng, hands_rng = rng.spawn(2)
        self._eyes = Eyes(route, person.reaction_s, eyes_rng)
        self._hands = Hands(person.tremor, hands_rng)
        self._lane = Lane(route)
        self._climb = Climb()
        self.progress = Progress()
        self._sight: Sight | None = None
        self._sight_ns = 0
        self._lost = True
        self._wanted: Deflection | None = None
        self._neutral_steps = 0
        # What his hands did that he has not seen yet, in rad a step.
        self._turns: deque[float] = deque(maxlen=max(1, round(person.reaction_s / period_s)))
        self._since_ns = 0
        self._begin_ns: int | None = None
        self._last_true_m: np.ndarray | None = None
        self._statuses = Attention[AutopilotStatus](person.reaction_s)
        self._suggestions = Attention[Suggestion](person.reaction_s)
        self._vehicles = Attention[VehicleStatus](person.reaction_s)
        self._drawing: Drawing | None = None
        self._drawing_arrival_ns = 0
        self._accepting: Drawing | None = None
        self._answer: bool | None = None
        self._full = FULL_STICK["tum"]

    # --- what reaches him ------------------------------------------------------------------------

    def truth(self, pose: Pose, arrival_ns: int) -> None:
        """Where the vehicle truly is; he will see it late, through his eyes.

        What is out of any world he can see is left out.
        """
        if max(map(abs, (*pose.position, *pose.velocity))) > OUT_OF_SIGHT:
            return
        self._eyes.truth(pose, arrival_ns)
        # For the report only: no decision depends on it.
        position_m = np.asarray(pose.position)
        if self._last_true_m is None:
            self._last_true_m = position_m
        step_m = float(np.linalg.norm(position_m - self._last_true_m))
        if step_m > 0.05:
            self._last_true_m = position_m
            if self._begin_ns is not None and not self.is_over:
                self._note(distance_m=self.progress.distance_m + step_m)

    def autopilot(self, status: AutopilotStatus, arrival_ns: int) -> None:
        """Who flies, as shown beside the picture."""
        self._statuses.show(status, arrival_ns)

    def suggestion(self, suggestion: Suggestion, arrival_ns: int) -> None:
        """A path that is drawn into the picture from now on."""
        self._suggestions.show(suggestion, arrival_ns)

    def vehicle(self, status: VehicleStatus, arrival_ns: int) -> None:
        """The vehicle's state, as shown beside the picture."""
        self._vehicles.show(status, arrival_ns)

    def answered(self, action: DecideAction, ok: bool) -> None:
        """What became of a decision."""
        if action == "accept":
            self._answer = ok

    @property
    def is_over(self) -> bool:
        """Whether there is nothing more to do."""
        return self.progress.phase in (Phase.DONE, Phase.FAILED)

    # --- what he does ----------------------------------------------------------------------------

    def step(self, now_ns: int, overridden: bool = False) -> tuple[Deflection, Decision | None]:
        """His sticks now, and the button he presses, if any.

        Args:
            now_ns: monotonic time.
            overridden: whether somebody else's sticks count at the moment.
        """
        self._perceive(now_ns)
        if overridden and self.progress.phase in IN_THE_AIR:
            self._enter(Phase.SETTLING, now_ns, "somebody else flies")
            # The pause begins when the other one lets go.
            self._since_ns = now_ns + nanoseconds(YIELD_S)
        decision = self._think(now_ns)
        sticks = self._hands.step(self._wanted, self._period_s)
        self._neutral_steps = self._neutral_steps + 1 if sticks.is_neutral else 0
        self._turns.append(sticks.wz * self._full.yaw_radps * self._period_s)
        return sticks, decision

    def _think(self, now_ns: int) -> Decision | None:
        phase = self.progress.phase
        if self._begin_ns is not None and not self.is_over:
            self._note(time_s=seconds(now_ns - self._begin_ns))
        if phase in IN_THE_AIR and self._has_come_down():
            self._enter(Phase.FAILED, now_ns, "the vehicle came down")
        act = {
            Phase.WAITING: self._wait,
            Phase.TAKING_OFF: self._take_off,
            Phase.CLIMBING: self._gain_height,
            Phase.SETTLING: self._settle,
            Phase.STEERING: self._steer,
            Phase.RELEASING: self._release,
            Phase.ASKING: self._await_answer,
            Phase.WATCHING: self._watch,
            Phase.STOPPING: self._stop,
            Phase.LANDING: self._land,
        }.get(self.progress.phase)
        if act is None:
            self._wanted = None
            return None
        return act(now_ns)

    def _wait(self, now_ns: int) -> Decision | None:
        self._wanted = None
        missing = [
            name
            for name, known in (
                ("vehicle", self._is_fresh(self._vehicles.newest, "vehicle", now_ns)),
                ("autopilot", self._is_fresh(self._statuses.newest, "autopilot", now_ns)),
                ("truth", self._sight is not None),
            )
            if not known
        ]
        vehicle = self._vehicle
        if missing or vehicle is None:
            self._note(note=f"no {', '.join(missing)}")
            return None
        if vehicle.world != self._route.world:
            self._note(note=f"the vehicle is in world {vehicle.world}")
            return None
        full = full_stick_of(vehicle)
        if not full.moves_every_way:
            self._note(note=f"a {vehicle.plant} cannot move every way as a drone does")
            return None
        self._full = full
        self._begin_ns = now_ns
        if vehicle.state == "flying":
            self._enter(Phase.CLIMBING, now_ns)
            return None
        self._enter(Phase.TAKING_OFF, now_ns)
        return Decision("takeoff")

    def _take_off(self, now_ns: int) -> Decision | None:
        if self._vehicle is not None and self._vehicle.state == "flying":
            self._enter(Phase.CLIMBING, now_ns)
        elif self._lasted_s(now_ns) > AGAIN_S and self._has_come_down():
            self._enter(Phase.TAKING_OFF, now_ns)
            return Decision("takeoff")
        return None

    def _gain_height(self, now_ns: int) -> Decision | None:
        if self._sight is None:
            self._wanted = None
            return None
        up = self._climb.stick(self._height_error_m(), CLIMB_LIMIT, self._full)
        if up == 0.0 and self._lasted_s(now_ns) > 1.0:
            self._enter(Phase.SETTLING, now_ns)
        else:
            self._wanted = Deflection(vz=up) if up else None
        return None

    def _settle(self, now_ns: int) -> Decision | None:
        if self._is_engaged_since(self._since_ns):
            # Somebody has accepted at the console.
            self._enter(Phase.WATCHING, now_ns)
        elif self._lasted_s(now_ns) > SETTLE_S and not self._lost:
            self._enter(Phase.STEERING, now_ns)
        return None

    def _steer(self, now_ns: int) -> Decision | None:
        sight = self._sight
        if sight is None:
            self._wanted = None
            return None
        if self._sight_ns != now_ns and self._wanted is not None:
            # Nothing new since the last look.
            return None
        if self._is_not_obeyed():
            # After a gap the autopilot wants to see neutral sticks before it obeys again.
            self._enter(Phase.SETTLING, now_ns, "the sticks do nothing")
            return None
        if self._is_at_the_end():
            self._enter(Phase.STOPPING, now_ns)
            return None
        _, points_m = self._lane.known(now_ns, 0.5, LOOK_AHEAD_M)
        if self._lost or len(points_m) == 0:
            side = math.copysign(SEARCH_RADPS, self._wanted.wz if self._wanted else 1.0)
            self._wanted = Deflection(wz=side / self._full.yaw_radps)
            return None
        now = foreseen(sight, sum(self._turns), self._person.reaction_s)
        steer = pursue(now, self._lane.place, points_m[-1], self._person.speed_mps, self._full)
        up = self._climb.stick(self._height_error_m(), TRIM_LIMIT, self._full)
        self._wanted = replace(steer, vz=up)
        drawing = self._drawing
        if (
            self._person.accepts
            and drawing is not None
            and seconds(now_ns - drawing.seen_ns) >= JUDGE_S
        ):
            self._drawing = None
            if seconds(now_ns - self._drawing_arrival_ns) < OLD_S and self._fits(drawing, now_ns):
                self._accepting = drawing
                self._enter(Phase.RELEASING, now_ns)
        return None

    def _release(self, now_ns: int) -> Decision | None:
        if self._neutral_steps < NEUTRAL_STEPS or self._accepting is None:
            return None
        self._answer = None
        self._enter(Phase.ASKING, now_ns)
        return Decision("accept", self._accepting.suggestion)

    def _await_answer(self, now_ns: int) -> Decision | None:
        if self._answer:
            self._note(accepted=self.progress.accepted + 1)
            self._enter(Phase.WATCHING, now_ns)
        elif self._answer is not None or self._lasted_s(now_ns) > ANSWER_S:
            self._note(refused=self.progress.refused + 1)
            self._enter(Phase.STEERING, now_ns)
        return None

    def _watch(self, now_ns: int) -> Decision | None:
        # What he sees now may still be from before the autopilot took over.
        settled_ns = self._since_ns + nanoseconds(self._person.reaction_s + 0.2)
        status = self._status_since(settled_ns)
        if status is not None and status.mode != "engaged":
            self._enter(Phase.STEERING, now_ns, f"autopilot: {status.reason}")
            return None
        sight = self._sight
        if sight is None or self._sight_ns != now_ns:
            return None
        if self._is_at_the_end():
            self._enter(Phase.STOPPING, now_ns)
            return Decision("cancel")
        leg, left_m = self._route.leg_at(self._lane.place.along_m)
        if self._is_about_to_leave(sight, now_ns):
            if self._lasted_s(now_ns) < WRONG_S:
                self._note(cancelled=self.progress.cancelled + 1)
                self._enter(Phase.STEERING, now_ns, "cancelled")
                return Decision("cancel")
            self._take_over(now_ns, "leaving the lane")
        elif left_m < max(sight.speed_mps, 0.3) * END_S and not self._is_last(leg.end_m):
            self._take_over(now_ns, f"end of the {leg.primitive}")
        return None

    def _stop(self, now_ns: int) -> Decision | None:
        if self._lasted_s(now_ns) < 1.5:
            return None
        self._enter(Phase.LANDING, now_ns)
        return Decision("land")

    def _land(self, now_ns: int) -> Decision | None:
        state = None if self._vehicle is None else self._vehicle.state
        if state == "landed":
            self._enter(Phase.DONE, now_ns)
        elif state == "emergency":
            self._enter(Phase.FAILED, now_ns, "emergency")
        elif state == "flying" and self._lasted_s(now_ns) > AGAIN_S:
            self._enter(Phase.LANDING, now_ns)
            return Decision("land")
        return None

    # --- what he thinks --------------------------------------------------------------------------

    def _perceive(self, now_ns: int) -> None:
        self._vehicles.notice(now_ns)
        self._statuses.notice(now_ns)
        if now_ns - self._sight_ns >= nanoseconds(GLANCE_S - self._period_s / 2.0):
            self._sight_ns = now_ns
            self._sight = self._eyes.look(now_ns, self._lane.place.along_m)
            self._lost = self._sight is None or not self._lane.remember(self._sight, now_ns)
            laps = int((self._lane.place.along_m + self._slack_m()) / self._route.length_m)
            if laps > self.progress.laps:
                self._note(laps=laps)
        for arrival_ns, suggestion in self._suggestions.notice(now_ns):
            self._note(suggestions=self.progress.suggestions + 1)
            if self._sight is not None:
                self._drawing = drawing_of(suggestion, self._sight, now_ns)
                self._drawing_arrival_ns = arrival_ns

    def _fits(self, drawing: Drawing, now_ns: int) -> bool:
        leg, left_m = self._route.leg_at(self._lane.place.along_m)
        if drawing.primitive != leg.primitive or left_m < WORTHWHILE_M or self._sight is None:
            return False
        compared_m = min(COMPARED_M, left_m)
        drawn_m = ahead_of(drawing, self._sight.position_m, compared_m)
        along_m, lane_m = self._lane.known(now_ns, -1.0, compared_m + 2.0)
        if len(drawn_m) < 2 or len(lane_m) < 2:
            return False
        fit = compare(drawn_m, along_m, lane_m, self._height_m())
        return (
            fit.aside_m <= ASIDE_M
            and fit.looked_m >= 0.8 * compared_m
            and fit.gain_m >= FOLLOWED * fit.looked_m - self._route.step_m
            and fit.height_m <= LEVEL_M
        )

    def _is_about_to_leave(self, sight: Sight, now_ns: int) -> bool:
        if abs(self._lane.place.left_m) > OUT_M:
            return True
        reach_m = max(sight.speed_mps, 0.3) * WATCHED_S
        along_m, lane_m = self._lane.known(now_ns, -1.0, reach_m + 2.0)
        if len(lane_m) < 2:
            return False
        ahead_m = sight.position_m[:2] + COURSE_S * sight.velocity_mps
        if float(np.min(np.linalg.norm(lane_m - ahead_m, axis=1))) > LEAVING_M:
            return True
        drawing = self._accepting
        if drawing is None:
            return False
        _, left_m = self._route.leg_at(self._lane.place.along_m)
        drawn_m = ahead_of(drawing, sight.position_m, min(reach_m, max(left_m, 0.3)))
        if len(drawn_m) < 2:
            return False
        # The autopilot flies from where the vehicle is, parallel to the drawing at first.
        drawn_m = drawn_m - drawn_m[0] + sight.position_m
        return compare(drawn_m, along_m, lane_m, self._height_m()).aside_m > LEAVING_M

    def _height_m(self) -> float:
        index = self._route.index_of(self._lane.place.along_m)
        return float(self._route.points_m[index, 2]) + self._person.height_m

    def _height_error_m(self) -> float:
        return 0.0 if self._sight is None else self._height_m() - float(self._sight.position_m[2])

    def _slack_m(self) -> float:
        """What the vehicle will have flown on when his hands move."""
        speed_mps = self._sight.speed_mps if self._sight is not None else 0.0
        return max(speed_mps, 0.0) * self._person.reaction_s

    def _is_at_the_end(self) -> bool:
        laps = self._person.laps if self._route.is_closed else 1
        total_m = laps * self._route.length_m
        return laps > 0 and self._lane.place.along_m + self._slack_m() >= total_m

    def _is_last(self, leg_end_m: float) -> bool:
        """Whether the leg that ends there is the mission's last."""
        if leg_end_m < self._route.length_m - 1e-6:
            return False
        laps = self._person.laps if self._route.is_closed else 1
        return laps > 0 and self._lane.place.along_m > (laps - 1) * self._route.length_m

    def _is_engaged_since(self, since_ns: int) -> bool:
        status = self._status_since(since_ns)
        return status is not None and status.mode == "engaged"

    def _is_not_obeyed(self) -> bool:
        """Whether he sees that somebody else flies though he has been steering for a while."""
        settled_ns = self._since_ns + nanoseconds(self._person.reaction_s + UNHEEDED_S)
        status = self._status_since(settled_ns)
        return status is not None and status.mode == "hover"

    def _has_come_down(self) -> bool:
        return self._vehicle is not None and self._vehicle.state in ("landed", "emergency")

    @property
    def _vehicle(self) -> VehicleStatus | None:
        """The vehicle's state as far as he has noticed."""
        newest = self._vehicles.newest
        return None if newest is None else newest[1]

    def _status_since(self, since_ns: int) -> AutopilotStatus | None:
        """Who flies as far as he has noticed; None if the newest he knows was shown before then."""
        newest = self._statuses.newest
        return newest[1] if newest is not None and newest[0] > since_ns else None

    def _is_fresh(self, seen: tuple[int, object] | None, topic: str, now_ns: int) -> bool:
        max_age_s = TOPICS[topic].max_age_s + self._person.reaction_s
        return seen is not None and seconds(now_ns - seen[0]) <= max_age_s

    def _take_over(self, now_ns: int, note: str) -> None:
        self._note(takeovers=self.progress.takeovers + 1)
        self._enter(Phase.STEERING, now_ns, note)

    def _lasted_s(self, now_ns: int) -> float:
        return seconds(now_ns - self._since_ns)

    def _enter(self, phase: Phase, now_ns: int, note: str = "") -> None:
        self._since_ns = now_ns
        self._note(phase=phase, note=note)
        if phase is Phase.STEERING:
            self._accepting = None
        else:
            self._wanted = None

    def _note(self, **changes: Any) -> None:
        """Change fields of the progress, each of its own type."""
        self.progress = replace(self.progress, **changes)
