"""The one table of topics and queries.

Publishers, subscribers, the recorder's list, `autocomplete topics` and the contract's page are
derived from it.
"""

import re
from dataclasses import dataclass
from enum import Enum

from common import messages as m

ROOT = "autocomplete"
DEFAULT_VEHICLE = "drone0"
VEHICLE_PATTERN = re.compile(r"[a-z0-9_-]{1,32}")

SERVICES = (
    "operator",
    "sim",
    "localizer",
    "classifier",
    "synthesis",
    "autopilot",
    "overlay",
    "recorder",
)


class Delivery(Enum):
    """How the bus treats a topic's payloads."""

    STREAM = "stream"
    """Dropped rather than delayed."""
    COMMAND = "command"
    """A stream at real-time priority, worthless after 0.2 s."""
    EVENT = "event"
    """Reliable, in order, small."""


@dataclass(frozen=True)
class Topic:
    """One row of the contract's table; `rate_hz` is None where it has no fixed rate."""

    name: str
    message: type[m.Message]
    publisher: str
    subscribers: tuple[str, ...]
    rate_hz: float | None
    delivery: Delivery
    max_age_s: float
    recorded: bool = True

    @property
    def is_video(self) -> bool:
        """Whether its payloads are pictures, which travel on a session of their own."""
        return self.message is m.Image


@dataclass(frozen=True)
class Query:
    """One row of the contract's table of queries."""

    name: str
    request: type[m.Payload]
    reply: type[m.Payload]
    server: str


_S, _C, _E = Delivery.STREAM, Delivery.COMMAND, Delivery.EVENT

_ROWS = (
    Topic("stick", m.Stick, "operator", ("classifier", "autopilot", "overlay"), 50.0, _C, 0.2),
    # The browser's pad: the operator service decides whose sticks become `stick`.
    Topic("console/stick", m.Stick, "overlay", ("operator",), 50.0, _C, 0.2, recorded=False),
    Topic("intent", m.Intent, "classifier", ("synthesis", "overlay"), 1.0, _E, 3.0),
    Topic(
        "suggestion",
        m.Suggestion,
        "synthesis",
        ("autopilot", "overlay", "operator"),
        None,
        _E,
        3.0,
    ),
    Topic("refusal", m.Refusal, "synthesis", ("overlay",), None, _E, 3.0),
    Topic("autopilot", m.AutopilotStatus, "autopilot", ("overlay", "operator"), 20.0, _E, 0.5),
    Topic("command", m.Command, "autopilot", ("sim",), 50.0, _C, 0.2),
    Topic("pose", m.Pose, "localizer", ("synthesis", "autopilot", "overlay"), 50.0, _S, 0.11),
    Topic("truth", m.Pose, "sim", ("operator",), 100.0, _S, 0.11),
    Topic("imu", m.Imu, "sim", ("localizer",), 200.0, _S, 0.1),
    Topic("altimeter", m.Range, "sim", ("localizer",), 25.0, _S, 0.2),
    Topic("camera/front", m.Image, "sim", ("localizer", "overlay"), 30.0, _S, 0.2),
    Topic("camera/down", m.Image, "sim", ("localizer",), 60.0, _S, 0.2, recorded=False),
    Topic("overlay/front", m.Image, "overlay", (), 30.0, _S, 0.2),
    Topic("vehicle", m.VehicleStatus, "sim", SERVICES, 10.0, _E, 1.0),
)

TOPICS: dict[str, Topic] = {row.name: row for row in _ROWS} | {
    f"health/{service}": Topic(f"health/{service}", m.Health, service, (), 1.0, _E, 3.0)
    for service in SERVICES
}

QUERIES: dict[str, Query] = {
    row.name: row
    for row in (
        Query("autopilot/decide", m.DecideRequest, m.DecideReply, "autopilot"),
        Query("classifier/classify", m.ClassifyRequest, m.Intent, "classifier"),
        Query("synthesis/fit", m.FitRequest, m.Suggestion, "synthesis"),
        Query("sim/reset", m.ResetRequest, m.VehicleStatus, "sim"),
        Query("sim/worlds", m.WorldsRequest, m.WorldsReply, "sim"),
    )
}


def key_of(vehicle: str, name: str) -> str:
    """The Zenoh key of a topic or query of one vehicle.

    Raises:
        ValueError: if the vehicle's name is not allowed in a key.
    """
    if not VEHICLE_PATTERN.fullmatch(vehicle):
        raise ValueError(f"vehicle {vehicle!r}: use 1 to 32 of a-z 0-9 _ -")
    return f"{ROOT}/{vehicle}/{name}"


def alive_key_of(vehicle: str, service: str) -> str:
    """The liveliness token of one vehicle's service; `*` asks for all of them."""
    return key_of(vehicle, f"alive/{service}")
