"""Wires the overlay: pictures in, pictures out, and the console beside them."""

from common import messages as m
from common.bus import QueryFailedError
from common.config import ConfigError
from common.node import Node, RefusedError
from common.sticks import END_BUTTON
from common.topics import alive_key_of
from services.overlay import protocol
from services.overlay.config import Config
from services.overlay.console import Console
from services.overlay.core import Overlay
from services.overlay.lease import PadLease, Standing

STICK_PERIOD_S = 0.02
AGES_SHOWN = ("camera/front", "pose", "stick", "autopilot", "vehicle")


def wire(node: Node, config: Config) -> None:
    """Connect the overlay to the network, and its console to both."""
    core = Overlay(config)
    node.on("pose", core.on_pose, depth=16)
    node.on("stick", core.on_stick)
    node.on("intent", core.on_intent)
    node.on("suggestion", core.on_suggestion)
    node.on("refusal", core.on_refusal)
    node.on("autopilot", core.on_autopilot)
    node.on("vehicle", core.on_vehicle)
    node.publishes("overlay/front")
    node.reports(lambda: core.health(node.clock.monotonic_ns()))
    console = _console(node, core, config) if config.console_port else None

    def on_picture(image: m.Image, _arrival_ns: int) -> None:
        drawn = core.draw(image, node.clock.monotonic_ns())
        if drawn is None:
            return
        node.publish("overlay/front", drawn)
        if console is not None:
            console.show(drawn.data)

    node.on("camera/front", on_picture, timed=True)


def _console(node: Node, core: Overlay, config: Config) -> Console:
    alive: set[str] = set()
    lease = PadLease()

    def on_alive(key: str, is_alive: bool) -> None:
        (alive.add if is_alive else alive.discard)(key.rsplit("/", 1)[1])

    def ask(decided: protocol.Decided) -> protocol.Answer:
        request = m.DecideRequest(
            action=decided.action, nonce=decided.nonce, suggestion=decided.suggestion
        )
        try:
            reply = node.ask("autopilot/decide", request)
        except (QueryFailedError, RefusedError, m.InvalidPayloadError) as error:
            return protocol.Answer(decided.nonce, False, str(error))
        assert isinstance(reply, m.DecideReply)
        return protocol.Answer(decided.nonce, reply.ok, reply.reason)

    def publish_sticks(now_ns: int) -> None:
        sticks = lease.due(now_ns)
        if sticks is not None:
            vx, vy, vz, wz = sticks
            stamp_ns = node.clock.utc_ns()
            buttons = [END_BUTTON] if lease.is_marked(now_ns) else None
            node.publish(
                "console/stick",
                m.Stick(stamp=stamp_ns, seq=0, vx=vx, vy=vy, vz=vz, wz=wz, buttons=buttons),
            )

    def state_of(pad: Standing) -> protocol.State:
        return _state(node, core, sorted(alive.copy()), pad)

    console = Console(config.console_host, config.console_port, state_of, ask, lease, node.clock)
    try:
        console.start()
    except OSError as error:
        where = f"{config.console_host}:{config.console_port}"
        reason = error.strerror or error
        raise ConfigError(
            f"overlay: console_host, console_port: cannot listen on {where}: {reason}"
        ) from None
    node.on_close(console.close)
    node.bus.watch(alive_key_of(node.vehicle, "*"), on_alive)
    node.publishes("console/stick")
    node.every(STICK_PERIOD_S, publish_sticks)
    return console


def _state(node: Node, core: Overlay, alive: list[str], pad: Standing) -> protocol.State:
    now_ns = node.clock.monotonic_ns()
    status, vehicle, intent = core.status, core.vehicle, core.intent
    shown = core.shown(now_ns)
    offer = None
    if shown is not None:
        offer = protocol.Offer(
            shown.id, shown.primitive, shown.confidence, shown.speed, shown.fit_rms
        )
    fresh_intent = intent if core.is_fresh("intent", now_ns) else None
    return protocol.State(
        vehicle_name=node.vehicle,
        mode=status.mode if status and core.is_fresh("autopilot", now_ns) else "unknown",
        reason=status.reason if status else "",
        progress_m=status.progress if status else 0.0,
        cross_track_m=status.cross_track if status else 0.0,
        offer=offer,
        advice=core.advice(now_ns),
        label=fresh_intent.label if fresh_intent else m.NONE_LABEL,
        probabilities=fresh_intent.probabilities if fresh_intent else {},
        vehicle_state=vehicle.state if vehicle else "unknown",
        battery=vehicle.battery if vehicle else None,
        collisions=vehicle.collisions if vehicle else 0,
        world=vehicle.world if vehicle else "",
        pose_status=core.pose_status(now_ns),
        ages_s={topic: core.age_s(topic, now_ns) for topic in AGES_SHOWN},
        stale=[topic for topic in AGES_SHOWN if not core.is_fresh(topic, now_ns)],
        alive=alive,
        linked=node.bus.linked(),
        pad=pad,
    )
