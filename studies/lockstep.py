"""The chain in one process: cores stepped together on the simulator's time, as fast as they go.

No network, no clock, no threads: what one core says, the others hear within the same step of
physics, and the same seeds give the same flight. Messages all have `seq` 0 but sticks, which are
numbered.
"""

from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any, Protocol

from common import messages as m
from common.clock import nanoseconds
from common.topics import TOPICS
from services.autopilot.core import Autopilot, Output
from services.classifier.core import Classifier
from services.localizer.core import Localizer
from services.operator.person import Decision
from services.operator.pilot import Pilot
from services.operator.sources import Deflection
from services.sim.core import PHYSICS_HZ, Simulation
from services.synthesis.core import Synthesizer
from studies.darkroom import Darkroom, Order

CONTROL_HZ = 50
"""Sticks and steps of the autopilot."""
PICTURE_DELAY_S = {"camera/down": 0.02, "camera/front": 0.04}
"""From capture to who looks: drawing, JPEG and network. In real time 10 and 16 ms in the mean at
640x360, 28 and 39 ms at 720p (2 cores, all services)."""

Listener = Callable[[Any, int], None]
"""Called with a message and the time in ns, as the handlers of a `Node` are."""


class Operator(Protocol):
    """Whose hands are on the sticks."""

    def step(self, now_ns: int) -> tuple[Deflection, Decision | None]:
        """The sticks now, and the button pressed, if any."""
        ...

    def answered(self, action: m.DecideAction, ok: bool) -> None:
        """What became of a decision."""
        ...


class Lockstep:
    """The cores of one vehicle, wired as the services are.

    Args:
        simulation: the vehicle.
        operator: the sticks, 50 times a second.
        autopilot: without one, the sticks go to the vehicle as they are.
        localizer: without one, `pose` is the truth.
        classifier: with a synthesizer, makes suggestions of the sticks.
        synthesizer: makes suggestions of intents.
        darkroom: without one there are no pictures. The front camera's are drawn only for a
            listener.
        intent_period_s: the prediction period T.
    """

    def __init__(
        self,
        simulation: Simulation,
        operator: Operator,
        *,
        autopilot: Autopilot | None = None,
        localizer: Localizer | None = None,
        classifier: Classifier | None = None,
        synthesizer: Synthesizer | None = None,
        darkroom: Darkroom | None = None,
        intent_period_s: float = 1.0,
    ) -> None:
        self.simulation = simulation
        self.operator = operator
        self._autopilot = autopilot
        self._classifier = classifier
        self._darkroom = darkroom
        self._listeners: dict[str, list[Listener]] = defaultdict(list)
        self._commands: deque[m.Command] = deque()
        self._pictures: dict[str, deque[tuple[int, Order]]] = {
            topic: deque() for topic in PICTURE_DELAY_S
        }
        self._count = 0
        self._nonce = 0
        self._control_every = PHYSICS_HZ // CONTROL_HZ
        self._intent_every = round(intent_period_s * PHYSICS_HZ)
        if localizer is not None:
            self._wire_localizer(localizer)
        else:
            self.listen("truth", self._truth_is_the_pose)
        if classifier is not None:
            self.listen("stick", classifier.on_stick)
            self.listen("vehicle", classifier.on_vehicle)
        if synthesizer is not None:
            self._wire_synthesizer(synthesizer)
        if autopilot is not None:
            self.listen("vehicle", autopilot.on_vehicle)
            self.listen("pose", autopilot.on_pose)
            self.listen("suggestion", autopilot.on_suggestion)
        self.listen("command", lambda command, _now_ns: self._commands.append(command))

    @property
    def now_ns(self) -> int:
        """Simulated time; arrivals and stamps are both of it."""
        return self.simulation.now_ns

    def listen(self, topic: str, listener: Listener) -> None:
        """Have a topic's messages brought to `listener` too, after the cores'."""
        assert topic in TOPICS, topic
        self._listeners[topic].append(listener)

    def seat(self, pilot: Pilot) -> None:
        """Give the sticks to a simulated person, and show him what people see."""
        self.operator = pilot
        self.listen("truth", pilot.truth)
        self.listen("vehicle", pilot.vehicle)
        self.listen("autopilot", pilot.autopilot)
        self.listen("suggestion", pilot.suggestion)

    def say(self, topic: str, message: m.Message) -> None:
        """Bring a message to all who listen, now."""
        now_ns = self.now_ns
        for listener in self._listeners[topic]:
            listener(message, now_ns)

    def decide(self, action: m.DecideAction, suggestion: int | None = None) -> m.DecideReply:
        """Press a button.

        Raises:
            ValueError: if there is no autopilot to answer.
        """
        if self._autopilot is None:
            raise ValueError("decisions need an autopilot")
        self._nonce += 1
        request = m.DecideRequest(action=action, nonce=self._nonce, suggestion=suggestion)
        now_ns = self.now_ns
        reply = self._autopilot.decide(request, now_ns)
        self._send(self._autopilot.settle(now_ns, now_ns))
        return reply

    def run(self, duration_s: float) -> None:
        """Go on for a time."""
        for _ in range(round(duration_s * PHYSICS_HZ)):
            self.step()

    def run_until(self, done: Callable[[], bool], limit_s: float) -> bool:
        """Go on until `done`, asked 50 times a second; False if it is not by then."""
        for _ in range(round(limit_s * CONTROL_HZ)):
            self.run(1.0 / CONTROL_HZ)
            if done():
                return True
        return False

    def step(self) -> None:
        """One step of physics and what it brings about."""
        step = self.simulation.step(self._commands.popleft() if self._commands else None)
        self._count += 1
        for topic, message in step.messages:
            self.say(topic, message)
        if self._darkroom is not None:
            for shot in step.shots:
                if self._listeners[shot.topic]:
                    due_ns = shot.stamp_ns + nanoseconds(PICTURE_DELAY_S[shot.topic])
                    self._pictures[shot.topic].append((due_ns, self._darkroom.develop(shot)))
            for topic, pictures in self._pictures.items():
                while pictures and pictures[0][0] <= self.now_ns:
                    self.say(topic, pictures.popleft()[1].result())
        if self._count % self._control_every == 0:
            self._control()
        if self._classifier is not None and self._count % self._intent_every == 0:
            self.say("intent", self._classifier.intent(self.now_ns, self.now_ns))

    # --- inside ----------------------------------------------------------------------------------

    def _control(self) -> None:
        now_ns = self.now_ns
        sticks, decision = self.operator.step(now_ns)
        stick = m.Stick(
            stamp=now_ns,
            seq=self._count // self._control_every,
            vx=sticks.vx,
            vy=sticks.vy,
            vz=sticks.vz,
            wz=sticks.wz,
        )
        self.say("stick", stick)
        if self._autopilot is None:
            self.say("command", _as_command(stick))
            return
        self._send(self._autopilot.on_stick(stick, now_ns, now_ns))
        if decision is not None:
            reply = self.decide(decision.action, decision.suggestion)
            self.operator.answered(decision.action, reply.ok)
        self._send(self._autopilot.step(now_ns, now_ns))

    def _send(self, output: Output) -> None:
        if output.command is not None:
            self.say("command", output.command)
        if output.status is not None:
            self.say("autopilot", output.status)

    def _truth_is_the_pose(self, truth: m.Pose, _now_ns: int) -> None:
        self.say("pose", truth)

    def _wire_localizer(self, localizer: Localizer) -> None:
        def on_imu(imu: m.Imu, now_ns: int) -> None:
            pose = localizer.on_imu(imu, now_ns)
            if pose is not None:
                self.say("pose", pose)

        self.listen("vehicle", localizer.on_vehicle)
        self.listen("imu", on_imu)
        self.listen("altimeter", localizer.on_altimeter)
        self.listen("camera/down", localizer.on_picture)

    def _wire_synthesizer(self, synthesizer: Synthesizer) -> None:
        def on_intent(intent: m.Intent, now_ns: int) -> None:
            answer = synthesizer.on_intent(intent, now_ns)
            if answer is not None:
                self.say("refusal" if isinstance(answer, m.Refusal) else "suggestion", answer)

        self.listen("pose", synthesizer.on_pose)
        self.listen("vehicle", lambda vehicle, _now_ns: synthesizer.on_vehicle(vehicle))
        self.listen("intent", on_intent)


class HandsOff:
    """An operator whose sticks rest."""

    def step(self, now_ns: int) -> tuple[Deflection, Decision | None]:
        """Neutral, and no button."""
        return _RESTING, None

    def answered(self, action: m.DecideAction, ok: bool) -> None:
        """Nobody asked."""


_RESTING = Deflection()


def _as_command(stick: m.Stick) -> m.Command:
    return m.Command(
        stamp=stick.stamp,
        seq=stick.seq,
        vx=stick.vx,
        vy=stick.vy,
        vz=stick.vz,
        wz=stick.wz,
        action="fly",
        mode="manual",
    )
