"""Wiring of the operator: a device or a simulated person, the console's pad, `stick` at 50 Hz."""

from collections.abc import Callable
from typing import Protocol

from common import messages as m
from common.config import ConfigError
from common.node import Node
from common.topics import TOPICS
from services.operator.config import Config
from services.operator.decisions import Decisions
from services.operator.person import Person
from services.operator.pilot import Pilot
from services.operator.route import Route, route_of
from services.operator.sources import Output, Reading, Sources

STICK_RATE_HZ = TOPICS["stick"].rate_hz
assert STICK_RATE_HZ is not None
PERIOD_S = 1.0 / STICK_RATE_HZ

WAITING = 8
"""Sticks and poses kept for a step that is late: a neutral stick among them counts."""

HealthReport = tuple[m.HealthState, str]


class Device(Protocol):
    """The operator's own sticks, whoever holds them."""

    def poll(self, now_ns: int) -> Reading | None:
        """The hands now; None while there is no device."""
        ...

    def health(self) -> HealthReport:
        """State and detail for `health`."""
        ...


def wire(node: Node, config: Config) -> None:
    """Connect the operator to a node.

    Raises:
        ConfigError: if the source cannot be had on this machine.
    """
    sources = Sources()
    decisions = Decisions(node)
    last = Output()
    node.publishes("stick")
    node.on("console/stick", sources.console_stick, depth=WAITING)
    device = _device_of(node, config, decisions, lambda: last.is_console)

    def step(now_ns: int) -> None:
        nonlocal last
        last = sources.step(now_ns, device.poll(now_ns))
        sticks = last.sticks
        node.publish(
            "stick",
            m.Stick(
                stamp=node.clock.utc_ns(),
                seq=0,
                vx=sticks.vx,
                vy=sticks.vy,
                vz=sticks.vz,
                wz=sticks.wz,
                buttons=list(last.buttons) or None,
            ),
        )
        for action in last.decisions:
            decisions.put(action)

    def health() -> HealthReport:
        state, detail = device.health()
        return state, f"{detail}; the console's pad has the sticks" if last.is_console else detail

    node.every(PERIOD_S, step, timed=True)
    node.reports(health)


def _device_of(
    node: Node, config: Config, decisions: Decisions, is_overridden: Callable[[], bool]
) -> Device:
    if config.source == "scripted":
        return _Scripted(node, config, decisions, is_overridden)
    if config.source == "keyboard":
        return _Keyboard(node)
    if config.source == "console":
        return _Console()
    return _PadOrNone(node, config)


class _Console:
    """No device of one's own: the browser's pad alone."""

    def poll(self, now_ns: int) -> Reading | None:
        return None

    def health(self) -> HealthReport:
        return "ok", "source console"


class _PadOrNone:
    def __init__(self, node: Node, config: Config) -> None:
        # Here, so that operators without a pad need no SDL.
        from services.operator.pad import Pad

        self._pad = Pad(config.pad, config.dead_band)
        self._is_needed = config.source == "pad"
        node.on_close(self._pad.close)

    def poll(self, now_ns: int) -> Reading | None:
        return self._pad.poll()

    def health(self) -> HealthReport:
        if self._pad.name is not None:
            return "ok", f"source pad: {self._pad.name}"
        if self._is_needed:
            return "degraded", "source pad: none is plugged in"
        return "ok", "source console: no pad is plugged in"


class _Keyboard:
    def __init__(self, node: Node) -> None:
        from services.operator.keyboard import Keyboard

        self._keyboard = Keyboard()
        node.on_close(self._keyboard.close)

    def poll(self, now_ns: int) -> Reading | None:
        return self._keyboard.poll(PERIOD_S)

    def health(self) -> HealthReport:
        return "ok", "source keyboard"


class _Scripted:
    def __init__(
        self, node: Node, config: Config, decisions: Decisions, is_overridden: Callable[[], bool]
    ) -> None:
        person = Person(
            speed_mps=config.speed_mps,
            height_m=config.height_m,
            laps=config.laps,
            accepts=config.accepts,
            reaction_s=config.reaction_s,
            tremor=config.tremor,
            seed=config.seed,
        )
        self._pilot = Pilot(_route(config.world), person, PERIOD_S)
        self._decisions = decisions
        self._is_overridden = is_overridden
        node.on("truth", self._pilot.truth, depth=WAITING)
        node.on("autopilot", self._pilot.autopilot)
        node.on("suggestion", self._pilot.suggestion)
        node.on("vehicle", self._pilot.vehicle)

    def poll(self, now_ns: int) -> Reading | None:
        for answer in self._decisions.take():
            self._pilot.answered(answer.action, answer.ok)
        sticks, decision = self._pilot.step(now_ns, self._is_overridden())
        if decision is not None:
            self._decisions.put(decision.action, decision.suggestion)
        return Reading(sticks)

    def health(self) -> HealthReport:
        progress = self._pilot.progress
        return ("failed" if progress.phase.value == "failed" else "ok"), str(progress)


def _route(world: str) -> Route:
    import worlds

    try:
        return route_of(worlds.load(world))
    except (worlds.WorldError, ValueError) as error:
        raise ConfigError(f"operator: world: {error}") from None
