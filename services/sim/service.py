"""Wiring of the simulator: a clock or the commands drive its steps, messages come out."""

from collections import deque

from common import messages as m
from common.clock import seconds
from common.node import Node, RefusedError
from services.sim.cameras import VIDEO_TOPICS, cameras_of
from services.sim.config import Config
from services.sim.core import PHYSICS_HZ, ResetError, Simulation
from services.sim.pace import Pace
from services.sim.studio import Studio
from services.sim.vehicle import WATCHDOG_S

TICK_S = 0.005
"""The period of the IMU, so that each sample leaves when it is due."""
COMMAND_DEPTH = 16
"""Commands between two ticks all count, since one of them may say take off or land."""
STEPS_A_COMMAND = PHYSICS_HZ // 50
"""In lock-step each command is that of the next 20 ms, its period."""
IDLE_S = 0.5
"""In lock-step, the period at which the vehicle says that it is there, whoever waits for whom."""
LOW_FACTOR = 0.95


def wire(node: Node, config: Config) -> None:
    """Connect the simulator to the node."""
    in_lockstep = config.clock == "lockstep"
    simulation = Simulation(config, 0 if in_lockstep else node.clock.utc_ns())
    pace = Pace(node.clock.monotonic_ns())
    studio: Studio | None = None
    node.publishes("imu", "truth", "altimeter", "vehicle", *VIDEO_TOPICS)
    if config.renderer != "none":
        cameras = cameras_of(config)
        studio = Studio(config.renderer, cameras, config.jpeg_quality, node.publish)
        studio.load(simulation.scene())
        node.on_close(studio.close)
    heard: deque[tuple[m.Command, int]] = deque(maxlen=COMMAND_DEPTH)

    def advance(command: m.Command | None) -> None:
        step = simulation.step(command)
        for topic, message in step.messages:
            node.publish(topic, message)
        if step.shots and studio is not None:
            studio.take(step.shots)
            if in_lockstep:
                studio.finish()

    def tick(now_ns: int) -> None:
        for _ in range(pace.due(now_ns)):
            advance(_next_fresh(heard, now_ns))

    def hear(command: m.Command, arrival_ns: int) -> None:
        heard.append((command, arrival_ns))

    def obey(command: m.Command, arrival_ns: int) -> None:
        pace.note(arrival_ns, STEPS_A_COMMAND)
        advance(command)
        for _ in range(STEPS_A_COMMAND - 1):
            advance(None)

    def wait(_now_ns: int) -> None:
        node.publish("vehicle", simulation.status())

    def reset(request: m.ResetRequest, _now_ns: int) -> m.VehicleStatus:
        try:
            status = simulation.reset(request)
        except ResetError as error:
            raise RefusedError(str(error), error.field) from None
        heard.clear()
        if studio is not None:
            studio.load(simulation.scene())
        return status

    def names(_request: m.WorldsRequest, _now_ns: int) -> m.WorldsReply:
        return m.WorldsReply(worlds=simulation.worlds())

    def health() -> tuple[m.HealthState, str]:
        factor = pace.real_time_factor
        detail = f"real-time factor {factor:.3f}, world {simulation.world}"
        is_late = factor < LOW_FACTOR and not in_lockstep
        if studio is None:
            return ("degraded" if is_late else "ok"), f"{detail}, no pictures"
        if studio.failure:
            return "failed", f"{detail}, no pictures: {studio.failure}"
        dropped = sum(studio.dropped.values())
        detail = f"{detail}, pictures by {studio.renderer}, {dropped} dropped"
        return ("degraded" if is_late else "ok"), detail

    if in_lockstep:
        node.on("command", obey, depth=COMMAND_DEPTH, timed=True)
        node.every(IDLE_S, wait)
    else:
        node.on("command", hear, depth=COMMAND_DEPTH)
        node.every(TICK_S, tick, timed=True)
    node.answer("sim/reset", reset)
    node.answer("sim/worlds", names)
    node.reports(health)
    node.on_close(simulation.close)


def _next_fresh(heard: deque[tuple[m.Command, int]], now_ns: int) -> m.Command | None:
    """The oldest command that is not worthless yet."""
    while heard:
        command, arrival_ns = heard.popleft()
        if seconds(now_ns - arrival_ns) <= WATCHDOG_S:
            return command
    return None
