"""Wiring of the simulator: a clock or the commands drive its steps, messages come out."""

from functools import partial

from common import messages as m
from common.clock import nanoseconds
from common.node import Node, RefusedError
from services.sim.cameras import VIDEO_TOPICS, Shot
from services.sim.config import Config
from services.sim.core import PHYSICS_HZ, ResetError, Simulation
from services.sim.crew import crew_of, names_of
from services.sim.inbox import Inbox
from services.sim.pace import Pace
from services.sim.studio import Studio
from services.sim.vehicle import WATCHDOG_S

TICK_S = 0.005
"""The period of the IMU, so that each sample leaves when it is due."""
COMMAND_DEPTH = 64
"""Commands between two ticks all count, since one of them may say take off or land."""
BACKLOG = 3000
"""In lock-step, commands of a minute may wait for those of another vehicle."""
STEPS_A_COMMAND = PHYSICS_HZ // 50
"""In lock-step each command is that of the next 20 ms, its period."""
IDLE_S = 0.5
"""In lock-step, the period at which a vehicle says that it is there, whoever waits for whom."""
LOW_FACTOR = 0.95


def check(config: Config, vehicle: str) -> None:
    """See whether the vehicles can have the names that are asked for, and stand where they start.

    Raises:
        ValueError: if they cannot, which is wrong usage.
    """
    try:
        names_of(crew_of(config.vehicles, config.plant), vehicle)
    except ValueError as error:
        raise ValueError(f"vehicles: {error}") from None
    try:
        Simulation(config).close()
    except ResetError as error:
        raise ValueError(f"{error.field}: {error}") from None


def wire(node: Node, config: Config) -> None:
    """Connect the simulator to the node; vehicles but the first get nodes beside it."""
    in_lockstep = config.clock == "lockstep"
    names = names_of(crew_of(config.vehicles, config.plant), node.vehicle)
    nodes = [node, *(node.beside(name) for name in names[1:])]
    # Both clocks at once, or stamps would stay behind by what it takes to build the world.
    pace = Pace(node.clock.monotonic_ns())
    simulation = Simulation(config, 0 if in_lockstep else node.clock.utc_ns())
    depth = BACKLOG if in_lockstep else COMMAND_DEPTH
    heard = [Inbox(depth) for _ in nodes]
    studio: Studio | None = None

    def show(shot: Shot, picture: m.Image) -> None:
        nodes[shot.vehicle].publish(shot.topic, picture)

    if config.renderer != "none":
        studio = Studio(config.renderer, simulation.cameras(), config.jpeg_quality, show)
        studio.load(simulation.scene())
        node.on_close(studio.close)

    def advance(commands: list[m.Command | None]) -> None:
        shots: list[Shot] = []
        for each, step in zip(nodes, simulation.step_all(commands), strict=True):
            for topic, message in step.messages:
                each.publish(topic, message)
            shots += step.shots
        if shots and studio is not None:
            studio.take(shots)
            if in_lockstep:
                studio.finish()

    def tick(now_ns: int) -> None:
        since_ns = now_ns - nanoseconds(WATCHDOG_S)
        for _ in range(pace.due(now_ns)):
            advance([waiting.newest(since_ns) for waiting in heard])

    def hear(index: int, command: m.Command, arrival_ns: int) -> None:
        heard[index].put(command, arrival_ns)

    def obey(index: int, command: m.Command, arrival_ns: int) -> None:
        hear(index, command, arrival_ns)
        while all(heard):
            pace.note(arrival_ns, STEPS_A_COMMAND)
            advance([waiting.next() for waiting in heard])
            for _ in range(STEPS_A_COMMAND - 1):
                advance([None] * len(nodes))

    def wait(_now_ns: int) -> None:
        for each, actor in zip(nodes, simulation.actors, strict=True):
            each.publish("vehicle", actor.status())

    def reset(index: int, request: m.ResetRequest, _now_ns: int) -> m.VehicleStatus:
        before = simulation.world
        try:
            status = simulation.reset(request, index)
        except ResetError as error:
            raise RefusedError(str(error), error.field) from None
        for other, waiting in enumerate(heard):
            if other == index or simulation.world != before:
                waiting.clear()
        if studio is not None:
            studio.equip(simulation.cameras(), index)
            if simulation.world != before:
                studio.load(simulation.scene())
        return status

    def names_worlds(_request: m.WorldsRequest, _now_ns: int) -> m.WorldsReply:
        return m.WorldsReply(worlds=simulation.worlds())

    def health() -> tuple[m.HealthState, str]:
        factor = pace.real_time_factor
        detail = f"real-time factor {factor:.3f}, world {simulation.world}"
        if len(nodes) > 1:
            detail = f"{detail}, {len(nodes)} vehicles"
        silent = [name for name, waiting in zip(names, heard, strict=True) if not waiting]
        if in_lockstep and 0 < len(silent) < len(nodes):
            detail = f"{detail}, waiting for a command of {', '.join(silent)}"
        lost = sum(waiting.dropped for waiting in heard)
        if lost:
            detail = f"{detail}, {lost} commands dropped: too many at once"
        is_late = factor < LOW_FACTOR and not in_lockstep
        if studio is None:
            return ("degraded" if is_late else "ok"), f"{detail}, no pictures"
        if studio.failure:
            return "failed", f"{detail}, no pictures: {studio.failure}"
        dropped = sum(studio.dropped.values())
        detail = f"{detail}, pictures by {studio.renderer}, {dropped} dropped"
        return ("degraded" if is_late else "ok"), detail

    for index, each in enumerate(nodes):
        each.publishes("imu", "truth", "altimeter", "vehicle", *VIDEO_TOPICS)
        if in_lockstep:
            # Their time is the steps': however long these take, a command is that of the next ones.
            each.on("command", partial(obey, index), depth=BACKLOG, timed=True, ages=False)
        else:
            # The box before the inbox drops without looking, so it has to be the roomier one.
            each.on("command", partial(hear, index), depth=BACKLOG)
        each.answer("sim/reset", partial(reset, index))
        each.answer("sim/worlds", names_worlds)
        each.reports(health)
    if in_lockstep:
        node.every(IDLE_S, wait)
    else:
        node.every(TICK_S, tick, timed=True)
    node.on_close(simulation.close)
