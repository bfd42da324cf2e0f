"""The autopilot's place on the network."""

from common.messages import DecideReply, DecideRequest, Pose, Stick, Suggestion, VehicleStatus
from common.node import Node
from services.autopilot.config import Config
from services.autopilot.core import Autopilot, Output

STREAM_DEPTH = 8
"""Kept for a step that is late: of the sticks a short deflection takes over too."""


def wire(node: Node, config: Config) -> None:
    """Connect the core to its topics, its query and its period."""
    clock = node.clock
    autopilot = Autopilot(config, clock.monotonic_ns())

    def send(output: Output) -> None:
        if output.command is not None:
            node.publish("command", output.command)
        if output.status is not None:
            node.publish("autopilot", output.status)

    def on_stick(stick: Stick, arrival_ns: int) -> None:
        send(autopilot.on_stick(stick, arrival_ns, clock.utc_ns()))

    def on_pose(pose: Pose, arrival_ns: int) -> None:
        autopilot.on_pose(pose, arrival_ns)

    def on_suggestion(suggestion: Suggestion, arrival_ns: int) -> None:
        autopilot.on_suggestion(suggestion, arrival_ns)

    def on_vehicle(vehicle: VehicleStatus, arrival_ns: int) -> None:
        autopilot.on_vehicle(vehicle, arrival_ns)

    def decide(request: DecideRequest, now_ns: int) -> DecideReply:
        reply = autopilot.decide(request, now_ns)
        send(autopilot.settle(now_ns, clock.utc_ns()))
        return reply

    def step(now_ns: int) -> None:
        send(autopilot.step(now_ns, clock.utc_ns()))

    node.publishes("command", "autopilot")
    # The sticks come first: nothing else that waits may delay them.
    node.on("stick", on_stick, depth=STREAM_DEPTH)
    node.on("pose", on_pose, depth=STREAM_DEPTH)
    node.on("vehicle", on_vehicle)
    node.on("suggestion", on_suggestion)
    node.answer("autopilot/decide", decide)
    node.every(config.step_period_s, step, timed=True)
    node.reports(lambda: autopilot.health(clock.monotonic_ns()))
