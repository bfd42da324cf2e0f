"""Wiring of the simulator: a clock drives its steps, commands go in, messages come out."""

from collections import deque

import worlds
from common import messages as m
from common.clock import seconds
from common.node import Node, RefusedError
from services.sim.config import Config
from services.sim.core import VIDEO_TOPICS, ResetError, Simulation, cameras_of
from services.sim.pace import Pace
from services.sim.studio import Studio
from services.sim.vehicle import WATCHDOG_S

TICK_S = 0.005
"""The period of the IMU, so that each sample leaves when it is due."""
COMMAND_DEPTH = 16
"""Commands between two ticks all count, since one of them may say take off or land."""
LOW_FACTOR = 0.95


def wire(node: Node, config: Config) -> None:
    """Connect the simulator to the node."""
    simulation = Simulation(config, node.clock.utc_ns())
    pace = Pace(node.clock.monotonic_ns())
    studio: Studio | None = None
    node.publishes("imu", "truth", "altimeter", "vehicle", *VIDEO_TOPICS)
    if config.renderer != "none":
        cameras = cameras_of(config)
        studio = Studio(config.renderer, cameras, config.jpeg_quality, node.publish)
        studio.load(simulation.scene())
        node.on_close(studio.close)
    heard: deque[tuple[m.Command, int]] = deque(maxlen=COMMAND_DEPTH)

    def tick(now_ns: int) -> None:
        for _ in range(pace.due(now_ns)):
            step = simulation.step(_next_fresh(heard, now_ns))
            for topic, message in step.messages:
                node.publish(topic, message)
            if step.shots and studio is not None:
                studio.take(step.shots)

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
        return m.WorldsReply(worlds=worlds.names())

    def health() -> tuple[m.HealthState, str]:
        factor = pace.real_time_factor
        detail = f"real-time factor {factor:.3f}, world {simulation.world}"
        if studio is None:
            return ("ok" if factor >= LOW_FACTOR else "degraded"), f"{detail}, no pictures"
        if studio.failure:
            return "failed", f"{detail}, no pictures: {studio.failure}"
        dropped = sum(studio.dropped.values())
        detail = f"{detail}, pictures by {studio.renderer}, {dropped} dropped"
        return ("ok" if factor >= LOW_FACTOR else "degraded"), detail

    def hear(command: m.Command, arrival_ns: int) -> None:
        heard.append((command, arrival_ns))

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
