"""The autopilot: links and poses watched, decisions answered, and who flies commands the vehicle.

Pure: every method gets the receiver's monotonic time `now_ns`, and the stamp for what goes out.
"""

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from common import messages as m
from common.clock import NS_PER_S, nanoseconds, seconds
from common.topics import TOPICS
from services.autopilot.arbitration import Event, State
from services.autopilot.config import Config
from services.autopilot.control import NEUTRAL, Controller, Sticks
from services.autopilot.fence import Fence
from services.autopilot.follower import Follower, PathFollower
from services.autopilot.guard import Guard
from services.autopilot.hold import Hold
from services.autopilot.link import StickLink
from services.autopilot.path import BadPathError
from services.autopilot.plants import PLANTS, plant_of

NONCES = 1024
"""Answers that are remembered."""
SUGGESTIONS = 8
"""Suggestions that are remembered: an operator may accept the one before the newest."""

MAX_DT_S = 0.1
"""Longest time that one step of the follower integrates over."""

FARTHEST_M = 1e5
FASTEST_MPS = 100.0
FASTEST_RADPS = 100.0
"""Poses beyond these are those of an estimator that diverged, and count as none."""

STANDSTILL_S = 1.0
"""After so long without a step nobody knows how long a question has waited."""

DEFAULT_PLANT: m.Plant = "tum"
"""Until the vehicle says what it is."""

_Description = tuple[m.Plant, m.FullStickSpeeds | None, m.FollowingRates | None]
"""What a vehicle says of how it follows its stick."""

Follow = Callable[[m.Suggestion, m.Pose, Controller, Config], PathFollower]
"""Makes what flies an accepted suggestion; raises BadPathError if it cannot be flown from here."""

_AIRBORNE = ("taking_off", "flying", "landing")
_DECISIONS: dict[m.DecideAction, Event] = {
    "accept": Event.ACCEPT,
    "cancel": Event.CANCEL,
    "takeoff": Event.TAKEOFF,
    "land": Event.LAND,
    "emergency": Event.EMERGENCY,
}


@dataclass(frozen=True)
class Output:
    """What is to be published now."""

    command: m.Command | None = None
    status: m.AutopilotStatus | None = None


class Autopilot:
    """Arbitration, failsafes and path following of one vehicle.

    Args:
        config: limits and gains.
        now_ns: the monotonic time of the start.
        follow: how accepted paths are flown.
    """

    def __init__(self, config: Config, now_ns: int, follow: Follow = Follower) -> None:
        self._config = config
        self._follow = follow
        self._fence = Fence(config)
        self._state = State()
        self._link = StickLink(config.stick_loss_s, config.dead_band, config.stuck_s)
        self._guard = Guard(config.slew_ps)
        self._controller = Controller(DEFAULT_PLANT, config)
        self._described: _Description = (DEFAULT_PLANT, None, None)
        self._is_known = True
        """Whether there is a model of the vehicle; else it is steered by hand alone."""
        self._pose: m.Pose | None = None
        self._pose_ns: int | None = None
        self._poses_since_ns = now_ns
        self._vehicle: m.VehicleStatus | None = None
        self._vehicle_ns: int | None = None
        self._suggestions: OrderedDict[int, tuple[m.Suggestion, int]] = OrderedDict()
        self._answers: OrderedDict[int, m.DecideReply] = OrderedDict()
        self._follower: PathFollower | None = None
        self._hold: Hold | None = None
        self._stepped_ns = now_ns
        self._observed_ns = now_ns
        self._took_off_ns = now_ns
        self._airborne_ns = now_ns
        self._status_due_ns = now_ns
        self._sent_ns = now_ns
        self._announced: tuple[State, int] | None = None
        self._commanded: State | None = None
        self._command: m.Command | None = None

    @property
    def mode(self) -> m.FlightMode:
        """Who flies now."""
        return self._state.mode

    # --- what arrives ----------------------------------------------------------------------------

    def on_stick(self, stick: m.Stick, now_ns: int, stamp_ns: int) -> Output:
        """Take a stick in; what it commands goes out at once if the operator flies."""
        self._watch(now_ns)
        if not self._link.receive(stick, now_ns):
            return Output()
        if self._link.commands(now_ns):
            self._happen(Event.STICK, now_ns)
        return self._output(now_ns, stamp_ns, due=self._state.mode == "manual")

    def on_pose(self, pose: m.Pose, now_ns: int) -> None:
        """Take a pose in; a lost, an impossible one, or one older than the newest, is none."""
        fresh = self._pose_is_fresh(now_ns)
        if pose.status == "lost" or (fresh and self._pose and pose.seq < self._pose.seq):
            return
        if (
            math.hypot(*pose.position) > FARTHEST_M
            or math.hypot(*pose.velocity) > FASTEST_MPS
            or math.hypot(*pose.angular_velocity) > FASTEST_RADPS
        ):
            return
        if not fresh:
            self._poses_since_ns = now_ns
            self._controller.disturbance.pause()
        self._pose, self._pose_ns = pose, now_ns

    def on_suggestion(self, suggestion: m.Suggestion, now_ns: int) -> None:
        """Remember what may be accepted; nothing flies by it yet."""
        self._suggestions.pop(suggestion.id, None)
        self._suggestions[suggestion.id] = (suggestion, now_ns)
        if len(self._suggestions) > SUGGESTIONS:
            self._suggestions.popitem(last=False)

    def on_vehicle(self, vehicle: m.VehicleStatus, now_ns: int) -> None:
        """Take the vehicle's own state in."""
        self._vehicle, self._vehicle_ns = vehicle, now_ns
        described = (vehicle.plant, vehicle.full_stick, vehicle.rates)
        if described != self._described:
            self._described = described
            model = plant_of(vehicle)
            self._is_known = model is not None
            self._controller = Controller(
                vehicle.plant, self._config, model or PLANTS[DEFAULT_PLANT]
            )
            self._hold = None
            self._happen(Event.VEHICLE_CHANGED, now_ns)
        self._watch(now_ns)

    def decide(self, request: m.DecideRequest, now_ns: int) -> m.DecideReply:
        """Answer a decision; the same nonce gets the same answer and has no second effect."""
        if request.nonce in self._answers:
            return self._answers[request.nonce]
        self._watch(now_ns)
        event = _DECISIONS[request.action]
        refusal = self._refusal_of(event, request.suggestion, now_ns)
        if refusal is None:
            self._happen(event, now_ns)
        reply = m.DecideReply(
            ok=refusal is None, reason=refusal or event.value, mode=self._state.mode
        )
        self._answers[request.nonce] = reply
        if len(self._answers) > NONCES:
            self._answers.popitem(last=False)
        return reply

    # --- what goes out ---------------------------------------------------------------------------

    def step(self, now_ns: int, stamp_ns: int) -> Output:
        """One period: failsafes, then the command, unless a stick just made one; the status."""
        self._watch(now_ns)
        self._observe(now_ns)
        silent = now_ns - self._sent_ns >= nanoseconds(self._config.step_period_s)
        return self._output(now_ns, stamp_ns, due=self._state.mode != "manual" or silent)

    def settle(self, now_ns: int, stamp_ns: int) -> Output:
        """What a decision changed, to go out before the next period."""
        return self._output(now_ns, stamp_ns, due=False)

    def health(self, now_ns: int) -> tuple[m.HealthState, str]:
        """What is missing to fly a path, for `health`."""
        missing = []
        if not self._link.is_live(now_ns):
            missing.append("no sticks")
        if not self._pose_is_fresh(now_ns):
            missing.append("no pose")
        if self._older(self._vehicle_ns, now_ns, TOPICS["vehicle"].max_age_s):
            missing.append("no vehicle")
        if self._battery <= self._config.battery_low:
            missing.append(f"battery {self._battery:.0%}")
        still_s = self._link.still_s(now_ns)
        if still_s > self._config.stuck_s / 2.0:
            missing.append(f"the sticks have not moved for {still_s:.0f} s")
        if self._guard.repaired:
            missing.append(f"{self._guard.repaired} commands repaired")
        detail = ", ".join([f"{self._state.mode}: {self._state.reason}", *missing])
        return ("degraded" if missing else "ok"), detail

    # --- inside ----------------------------------------------------------------------------------

    def _happen(self, event: Event, now_ns: int) -> None:
        before = self._state
        self._state = before.after(event)
        if self._state is before:
            return
        if event is Event.TAKEOFF:
            self._took_off_ns = now_ns
        if before.mode == "landed" and self._state.mode == "hover":
            self._airborne_ns = now_ns
        if self._state.mode != "engaged":
            self._follower = None
        if self._state.mode in ("manual", "landed", "emergency"):
            self._controller.relax()
        self._hold = None

    def _watch(self, now_ns: int) -> None:
        """The failsafes, and what the vehicle says of itself; every entry passes here first."""
        config, state = self._config, self._state
        told = self._vehicle.state if self._vehicle else None
        if state.action == "takeoff" and self._older(
            self._took_off_ns, now_ns, config.takeoff_timeout_s
        ):
            self._happen(Event.TAKEOFF_FAILED, now_ns)
        if told == "emergency":
            self._happen(Event.VEHICLE_EMERGENCY, now_ns)
        elif told == "landed":
            self._happen(Event.VEHICLE_LANDED, now_ns)
        elif told == "landing":
            self._happen(Event.VEHICLE_LANDING, now_ns)
        elif told is not None and self._state.mode == "landed":
            self._happen(Event.VEHICLE_FLYING, now_ns)
        if not self._link.is_live(now_ns):
            self._happen(Event.STICK_LOST, now_ns)
        elif self._link.is_stuck(now_ns):
            self._happen(Event.STICK_STUCK, now_ns)
        # Whoever still steers may choose where it comes down.
        if self._battery <= config.battery_empty and not self._link.commands(now_ns):
            self._happen(Event.BATTERY_EMPTY, now_ns)
        if self._older(self._pose_ns, now_ns, config.hold_s):
            self._happen(Event.POSE_LOST, now_ns)
        if self._state.mode == "hover":
            since_ns = max(self._link.counted_ns or 0, self._airborne_ns)
            if self._older(since_ns, now_ns, config.land_after_s):
                self._happen(Event.STICK_GONE, now_ns)
            elif self._state.reason == Event.POSE_LOST and self._older(
                self._pose_ns, now_ns, config.land_after_s
            ):
                self._happen(Event.POSE_GONE, now_ns)

    def _refusal_of(self, event: Event, suggestion: int | None, now_ns: int) -> str | None:
        """Why a decision cannot be granted; None if it can. An accepted path is made ready here."""
        mode, told = self._state.mode, self._vehicle.state if self._vehicle else None
        if not self._state.allows(event):
            return mode
        if event in (Event.CANCEL, Event.EMERGENCY):
            return None
        if event is Event.TAKEOFF:
            if told in _AIRBORNE:
                return str(told)
            if mode == "emergency" and told != "landed":
                return mode
        if event in (Event.TAKEOFF, Event.ACCEPT):
            if self._older(self._observed_ns, now_ns, STANDSTILL_S):
                return "late"
            if self._battery <= self._config.battery_low:
                return "battery_low"
        # The operator lets go first: a stick still held would take over in the same step. Sticks
        # that do not count cannot, so they keep nobody from landing.
        accepting = event is Event.ACCEPT
        if self._link.commands(now_ns) or (accepting and self._link.is_deflected(now_ns)):
            return Event.STICK.value
        return self._refusal_of_path(suggestion, now_ns) if accepting else None

    def _refusal_of_path(self, suggestion: int | None, now_ns: int) -> str | None:
        told = self._vehicle.state if self._vehicle else None
        if told is not None and told != "flying":
            return told
        if not self._is_known:
            return "plant"
        if self._state.action != "fly":
            return self._state.action
        if not self._link.is_live(now_ns):
            return Event.STICK_LOST.value
        if suggestion is None:
            suggestion = next(reversed(self._suggestions), 0)
        if suggestion not in self._suggestions:
            return "unknown"
        accepted, arrival_ns = self._suggestions[suggestion]
        if self._older(arrival_ns, now_ns, self._config.suggestion_age_s):
            return "stale"
        if self._pose is None or not self._pose_is_fresh(now_ns):
            return Event.POSE_LOST.value
        try:
            self._follower = self._follow(accepted, self._pose, self._controller, self._config)
            self._stepped_ns = now_ns
        except BadPathError as error:
            return str(error)
        return None

    def _output(self, now_ns: int, stamp_ns: int, *, due: bool) -> Output:
        command = None
        if due or self._state != self._commanded:
            sticks = self._sticks(now_ns)
            self._commanded = self._state
            self._sent_ns = now_ns
            command = self._command = self._guard.command(
                sticks,
                self._action(),
                self._state.mode,
                stamp_ns,
                now_ns=now_ns,
                live=self._link.is_live(now_ns),
            )
        return Output(command, self._status(now_ns, stamp_ns))

    def _observe(self, now_ns: int) -> None:
        """Let the controller see what came of the last command."""
        dt_s = min(seconds(now_ns - self._observed_ns), MAX_DT_S)
        self._observed_ns = now_ns
        flies = self._vehicle is not None and self._vehicle.state == "flying"
        if self._command is None or self._pose is None or not self._pose_is_fresh(now_ns):
            return
        if flies:
            self._controller.observe(self._pose, self._command, dt_s)
        else:
            self._controller.disturbance.pause()

    def _action(self) -> m.CommandAction:
        """What the vehicle is told; once it has cut its motors, it may say that it lies still."""
        told = self._vehicle.state if self._vehicle else None
        if self._state.mode == "emergency" and told in ("emergency", "landed"):
            return "land"
        return self._state.action

    def _sticks(self, now_ns: int) -> Sticks:
        """The operator's sticks in manual; the follower's while engaged; a place kept in hover."""
        stick = self._link.newest
        if self._state.mode == "manual" and stick is not None and self._link.commands(now_ns):
            return Sticks(stick.vx, stick.vy, stick.vz, stick.wz)
        pose, arrival_ns = self._pose, self._pose_ns
        if pose is None or arrival_ns is None or not self._pose_is_fresh(now_ns):
            return NEUTRAL
        age_s = seconds(now_ns - arrival_ns)
        dt_s = min(seconds(now_ns - self._stepped_ns), MAX_DT_S)
        self._stepped_ns = now_ns
        if self._follower is not None:
            sticks = self._follower.sticks(pose, age_s, dt_s)
            self._watch_flight(self._follower, pose, now_ns)
            if self._state.mode == "engaged":
                return sticks
        if self._state.mode == "hover" and self._may_hold(now_ns):
            self._hold = self._hold or Hold(pose, self._controller)
            return self._hold.sticks(pose, age_s, dt_s)
        self._hold = None
        return NEUTRAL

    def _watch_flight(self, follower: PathFollower, pose: m.Pose, now_ns: int) -> None:
        if follower.finished:
            self._happen(Event.FINISHED, now_ns)
        elif follower.cross_track_m > self._config.leave_path_m:
            self._happen(Event.OFF_PATH, now_ns)
        elif self._fence.is_left(pose.position):
            self._happen(Event.GEOFENCE, now_ns)

    def _may_hold(self, now_ns: int) -> bool:
        """Whether a place may be kept: in flight, hands off, links steady: what is new may jump."""
        since_ns = self._link.steady_since_ns(now_ns)
        return (
            self._state.action == "fly"
            and self._is_known
            and not self._link.is_deflected(now_ns)
            and self._vehicle is not None
            and self._vehicle.state == "flying"
            and since_ns is not None
            and self._older(max(since_ns, self._poses_since_ns), now_ns, self._config.steady_s)
        )

    @property
    def _battery(self) -> float:
        return 1.0 if self._vehicle is None else self._vehicle.battery

    def _status(self, now_ns: int, stamp_ns: int) -> m.AutopilotStatus | None:
        follower = self._follower
        suggestion = follower.suggestion.id if follower else 0
        if now_ns < self._status_due_ns and self._announced == (self._state, suggestion):
            return None
        self._announced = (self._state, suggestion)
        period_ns = nanoseconds(self._config.status_period_s)
        missed = max(0, now_ns - self._status_due_ns) // period_ns
        self._status_due_ns += (missed + 1) * period_ns if now_ns >= self._status_due_ns else 0
        return m.AutopilotStatus(
            stamp=stamp_ns,
            seq=0,
            mode=self._state.mode,
            suggestion=suggestion,
            progress=follower.progress_m if follower else 0.0,
            cross_track=follower.cross_track_m if follower else 0.0,
            reason=self._state.reason,
        )

    def _pose_is_fresh(self, now_ns: int) -> bool:
        return not self._older(self._pose_ns, now_ns, self._config.pose_loss_s)

    @staticmethod
    def _older(arrival_ns: int | None, now_ns: int, age_s: float) -> bool:
        return arrival_ns is None or now_ns - arrival_ns > age_s * NS_PER_S
