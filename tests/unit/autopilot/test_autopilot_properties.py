"""Whatever happens in whatever order: the human wins, losses end in a hover, nothing is replayed.

A machine feeds the autopilot random events and watches it with rules of its own, written from the
contract, not from the code.
"""

import pytest
from autopilot_worlds import line, pose, stick, suggestion, vehicle
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from common import messages as m
from common.sticks import is_neutral
from services.autopilot.config import Config
from services.autopilot.core import Autopilot, Output

S = 1_000_000_000
STEPS = 60
FEW, MANY = 100, 1700
"""Examples: 6 000 steps every time, 10^5 in `make properties`."""
SLEW_PS = 5.0
STUCK_S = 20.0
STEADY_S = 1.0

axis = st.sampled_from([-1.0, -0.3, -0.05, 0.0, 0.05, 0.06, 0.8])
deflection = st.sampled_from([-1.0, -0.06, 0.06, 0.5, 1.0])
STATES = ["landed", "taking_off", "flying", "flying", "flying", "landing", "emergency"]
ACTIONS = ["accept", "accept", "accept", "cancel", "takeoff", "land", "emergency"]


def axes_of(message: m.Command | m.Stick) -> tuple[float, float, float, float]:
    return message.vx, message.vy, message.vz, message.wz


def moves(command: m.Command) -> bool:
    return any(axes_of(command))


class Flight(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.now_ns = 5 * S
        self.autopilot = Autopilot(Config(), self.now_ns)
        self.status: m.AutopilotStatus | None = None
        # What an onlooker knows.
        self.stick: m.Stick | None = None
        self.stick_ns = -S
        self.counts = True
        self.moved_ns = 0
        self.steady_ns = self.now_ns
        self.pose_ns = self.poses_since_ns = -S
        self.state: m.VehicleState = "flying"
        self.battery = 1.0
        self.last: tuple[int, tuple[float, float, float, float]] | None = None
        self.heard: dict[int, int] = {}
        self.engaged_by_accept = False
        self.answers: dict[int, m.DecideReply] = {}
        self.seq = 0

    # --- what happens --------------------------------------------------------------------------

    @initialize(flying=st.booleans())
    def start(self, flying: bool) -> None:
        self.vehicle_says("flying" if flying else "landed", 1.0)

    @rule(ms=st.sampled_from([1, 5, 20, 20, 20, 100, 190, 250, 600, 3100, 5200]))
    def time_passes(self, ms: int) -> None:
        self.now_ns += ms * 1_000_000

    @rule(count=st.integers(1, 40), neutral=st.booleans())
    def a_calm_while(self, count: int, neutral: bool) -> None:
        """Sticks and poses stream as they should, so that deep states are reached often."""
        for _ in range(count):
            self.now_ns += 20_000_000
            self.pose_arrives("ok", 0.3 + 0.001 * count)
            if neutral:
                self.sticks_arrive((0.0, 0.0, 0.0, 0.0))
            self.step()

    @rule(accept=st.booleans(), drift=st.floats(-0.3, 0.3))
    def all_is_well(self, accept: bool, drift: float) -> None:
        """In the air, hands off, a path on offer: so that paths and kept places come often too."""
        if self.autopilot.mode == "emergency":
            self.vehicle_says("landed", 1.0)
            self.decide("takeoff", 1000 + len(self.answers), None)
        self.vehicle_says("flying", 1.0)
        for tick in range(70):
            self.now_ns += 20_000_000
            self.pose_arrives("ok", drift * tick / 70.0)
            self.sticks_arrive((0.0, 0.0, 0.0, 0.0))
            self.step()
        if accept:
            self.suggestion_arrives(1, 0.0, False)
            self.decide("accept", 1000 + len(self.answers), None)

    @rule(axes=st.tuples(axis, axis, axis, axis))
    def sticks_arrive(self, axes: tuple[float, float, float, float]) -> None:
        self.seq += 1
        message = stick(self.seq, *axes)
        deflected = max(map(abs, axes)) > 0.05
        lost = self.now_ns - self.stick_ns > 0.2 * S
        if lost and self.stick is not None:
            self.counts = False
        if lost or not deflected or self.stick is None or axes_of(self.stick) != axes:
            self.moved_ns = self.now_ns
        if lost or (not deflected and not self.counts):
            self.steady_ns = self.now_ns
        if self.now_ns - self.moved_ns > STUCK_S * S:
            self.counts = False
        self.counts = self.counts or not deflected
        self.stick, self.stick_ns = message, self.now_ns
        output = self.autopilot.on_stick(message, self.now_ns, self.now_ns)
        self.watch(output)
        if deflected and self.counts and self.autopilot.mode not in ("landed", "emergency"):
            command = output.command
            assert command is not None
            assert (command.mode, command.action) == ("manual", "fly")
            assert axes_of(command) == axes

    @rule(value=deflection, duration_s=st.sampled_from([1, 5, 19, 22, 27]))
    def a_stick_is_held(self, value: float, duration_s: int) -> None:
        """As no hand can, but a broken pad does."""
        for _ in range(8 * duration_s):
            self.now_ns += 125_000_000
            self.sticks_arrive((value, 0.0, 0.0, 0.0))
            self.step()

    @rule(value=deflection, which=st.integers(0, 3))
    def one_axis_is_pushed(self, value: float, which: int) -> None:
        axes = [0.0, 0.0, 0.0, 0.0]
        axes[which] = value
        self.sticks_arrive((axes[0], axes[1], axes[2], axes[3]))

    @rule(back=st.integers(1, 5))
    def an_old_stick_comes_again(self, back: int) -> None:
        if self.stick is None or self.now_ns - self.stick_ns > 0.2 * S or self.stick.seq < back:
            return
        old = stick(self.stick.seq - back, vx=1.0)
        mode = self.autopilot.mode
        self.watch(self.autopilot.on_stick(old, self.now_ns, self.now_ns))
        assert self.autopilot.mode in (mode, "hover", "landed")

    @rule(status=st.sampled_from(["ok", "ok", "degraded", "lost"]), x=st.floats(-3.0, 3.0))
    def pose_arrives(self, status: m.PoseStatus, x: float) -> None:
        self.seq += 1
        if status != "lost":
            if self.now_ns - self.pose_ns > 0.11 * S:
                self.poses_since_ns = self.now_ns
            self.pose_ns = self.now_ns
        self.autopilot.on_pose(pose(self.seq, (x, 0.0, 1.0), status=status), self.now_ns)

    @rule(id_=st.integers(1, 4), y=st.sampled_from([0.0, 0.0, 0.3, 7.0]), closed=st.booleans())
    def suggestion_arrives(self, id_: int, y: float, closed: bool) -> None:
        path = [(x, y, z, yaw) for x, _, z, yaw in line(5.0)]
        self.autopilot.on_suggestion(suggestion(path, closed, id_=id_), self.now_ns)
        self.heard[id_] = self.now_ns

    @rule(state=st.sampled_from(STATES), battery=st.sampled_from([1.0, 1.0, 0.21, 0.15, 0.03]))
    def vehicle_says(self, state: m.VehicleState, battery: float) -> None:
        self.state, self.battery = state, battery
        self.autopilot.on_vehicle(vehicle(state, battery=battery), self.now_ns)

    @rule(
        action=st.sampled_from(ACTIONS),
        nonce=st.integers(0, 30),
        id_=st.one_of(st.none(), st.integers(0, 5)),
    )
    def decide(self, action: m.DecideAction, nonce: int, id_: int | None) -> None:
        before, flown = self.autopilot.mode, self.status
        request = m.DecideRequest(action=action, nonce=nonce, suggestion=id_)
        reply = self.autopilot.decide(request, self.now_ns)
        if nonce in self.answers:
            assert reply == self.answers[nonce]
            assert self.autopilot.mode == before
            self.watch(self.autopilot.settle(self.now_ns, self.now_ns))
            return
        self.answers[nonce] = reply
        assert reply.mode == self.autopilot.mode
        if action == "emergency":
            assert reply.ok
            assert reply.mode == "emergency"
        if action == "accept" and reply.ok:
            assert reply.mode == "engaged"
            assert self.now_ns - self.stick_ns <= 0.2 * S
            assert self.now_ns - self.pose_ns <= 0.11 * S
            assert any(self.now_ns - at <= 3 * S for at in self.heard.values())
            assert id_ is None or self.now_ns - self.heard[id_] <= 3 * S
            assert self.battery > 0.2
            self.engaged_by_accept = True
        if action == "cancel" and reply.ok and before in ("engaged", "hover"):
            assert reply.mode in ("manual", "landed")
        output = self.autopilot.settle(self.now_ns, self.now_ns)
        if action == "accept" and reply.ok and flown is not None and flown.mode != "engaged":
            assert output.status is not None
        self.watch(output)

    @rule(action=st.sampled_from(["cancel", "accept"]))
    def decide_anew(self, action: m.DecideAction) -> None:
        self.decide(action, 1000 + len(self.answers), None)

    @rule()
    def step(self) -> None:
        self.watch(self.autopilot.step(self.now_ns, self.now_ns))

    # --- what must hold ------------------------------------------------------------------------

    def watch(self, output: Output) -> None:
        if output.status is not None:
            self.status = output.status
            assert (output.status.mode == "engaged") == (output.status.suggestion != 0)
        command = output.command
        if command is None:
            return
        live = self.now_ns - self.stick_ns <= 0.2 * S
        if moves(command):
            assert live
            assert command.action == "fly"
            assert command.mode in ("manual", "engaged", "hover")
        if moves(command) and command.mode != "manual":
            self.watch_own_motion(command)
        self.last = self.now_ns, axes_of(command)
        if command.mode == "manual" and moves(command):
            assert self.counts
            assert self.stick is not None
            assert axes_of(command) == axes_of(self.stick)
        if command.mode == "engaged":
            assert self.engaged_by_accept
        if command.mode == "emergency":
            assert command.action in ("emergency", "land")

    def watch_own_motion(self, command: m.Command) -> None:
        """What no stick commands: a path or a place, by a fresh pose, with the hands off."""
        assert self.now_ns - self.pose_ns <= 0.11 * S
        assert self.stick is not None
        assert is_neutral(self.stick)
        before_ns, before = self.last or (self.now_ns - S, (0.0,) * 4)
        room = SLEW_PS * min((self.now_ns - before_ns) / S, 0.1) + 1e-9
        assert max(abs(a - b) for a, b in zip(axes_of(command), before, strict=True)) <= room
        if command.mode == "hover":
            assert self.state == "flying"
            assert self.counts
            assert self.now_ns - max(self.steady_ns, self.poses_since_ns) > STEADY_S * S

    @invariant()
    def nothing_engages_by_itself(self) -> None:
        if self.autopilot.mode != "engaged":
            self.engaged_by_accept = False
        else:
            assert self.engaged_by_accept

    def teardown(self) -> None:
        """Left alone, whatever flew hovers at once and lands within 5 s."""
        mode = self.autopilot.mode
        self.now_ns += round(0.21 * S)
        self.step()
        assert self.autopilot.mode not in ("manual", "engaged")
        self.now_ns += 5 * S
        output = self.autopilot.step(self.now_ns, self.now_ns)
        assert output.command is not None
        if self.autopilot.mode == "hover":
            assert output.command.action == "land", mode


def runs(examples: int) -> settings:
    return settings(
        max_examples=examples,
        stateful_step_count=STEPS,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    )


class TestFlight(Flight.TestCase):
    settings = runs(FEW)


@pytest.mark.slow
@pytest.mark.timeout(1800)
class TestLongFlight(Flight.TestCase):
    settings = runs(MANY)
