"""Who flies: one state machine, a table of every mode and every event.

The human is master: a stick beyond the dead band or `cancel` ends whatever else is going on, and
losses end in a hover, then on the ground. Guards (is there a fresh pose, a live stick, ...) live in
core.py; here is only what follows.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import get_args

from common.messages import CommandAction, FlightMode

MODES: tuple[FlightMode, ...] = get_args(FlightMode)


class Event(StrEnum):
    """What can happen. The value is the `reason` that `autopilot` gives for it."""

    STICK = "stick"
    """A live stick that counts is beyond the dead band."""
    ACCEPT = "accepted"
    CANCEL = "cancelled"
    TAKEOFF = "takeoff"
    LAND = "land"
    EMERGENCY = "emergency"

    VEHICLE_FLYING = "vehicle_flying"
    """It took off, or already flew."""
    VEHICLE_LANDING = "vehicle_landing"
    """It lands, whoever told it to."""
    VEHICLE_LANDED = "vehicle_landed"
    VEHICLE_EMERGENCY = "vehicle_emergency"
    """It cut its motors."""
    VEHICLE_CHANGED = "vehicle_changed"
    """It is of another plant now, or says otherwise how it follows its stick: it was reset."""
    BATTERY_EMPTY = "battery_empty"
    TAKEOFF_FAILED = "takeoff_failed"
    """It did not obey in time."""

    STICK_LOST = "stick_lost"
    STICK_GONE = "stick_gone"
    """Lost for so long that nobody may come back."""
    STICK_STUCK = "stick_stuck"
    """Deflected, and not moved at all for longer than a hand can."""
    POSE_LOST = "pose_lost"
    POSE_GONE = "pose_gone"

    FINISHED = "finished"
    """The end of an open path."""
    OFF_PATH = "off_path"
    """Too far from the path to come back to it."""
    GEOFENCE = "geofence"


_M: FlightMode = "manual"
_E: FlightMode = "engaged"
_H: FlightMode = "hover"
_L: FlightMode = "landed"
_X: FlightMode = "emergency"

# The next mode by event and present mode; None: refused if it was asked for, else without effect.
# In `landed` a stick, cancel or land calls off a take-off that the vehicle has not begun.
_ROWS: dict[Event, tuple[FlightMode | None, ...]] = {
    # present mode:         manual engaged hover landed emergency
    Event.STICK: (_M, _M, _M, _L, None),
    Event.ACCEPT: (_E, _E, _E, None, None),
    Event.CANCEL: (_M, _M, _M, _L, None),
    Event.TAKEOFF: (_L, None, _L, _L, _L),
    Event.LAND: (_H, _H, _H, _L, None),
    Event.EMERGENCY: (_X, _X, _X, _X, _X),
    Event.VEHICLE_FLYING: (None, None, None, _H, None),
    Event.VEHICLE_LANDING: (None, _H, None, None, None),
    Event.VEHICLE_LANDED: (_L, _L, _L, None, None),
    Event.VEHICLE_EMERGENCY: (_X, _X, _X, _X, None),
    Event.VEHICLE_CHANGED: (None, _H, None, None, None),
    Event.BATTERY_EMPTY: (_H, _H, _H, None, None),
    Event.TAKEOFF_FAILED: (None, None, None, _H, None),
    Event.STICK_LOST: (_H, _H, None, None, None),
    Event.STICK_GONE: (_H, _H, _H, None, None),
    Event.STICK_STUCK: (_H, None, None, None, None),
    Event.POSE_LOST: (None, _H, None, None, None),
    Event.POSE_GONE: (None, _H, _H, None, None),
    Event.FINISHED: (None, _H, None, None, None),
    Event.OFF_PATH: (None, _H, None, None, None),
    Event.GEOFENCE: (None, _H, None, None, None),
}

TABLE: Mapping[tuple[FlightMode, Event], FlightMode | None] = {
    (mode, event): row[column] for event, row in _ROWS.items() for column, mode in enumerate(MODES)
}
"""Every pair of mode and event; the docs' drawing is made from it."""

ACTIONS: dict[Event, CommandAction] = {
    Event.TAKEOFF: "takeoff",
    Event.LAND: "land",
    Event.BATTERY_EMPTY: "land",
    Event.STICK_GONE: "land",
    Event.POSE_GONE: "land",
    Event.EMERGENCY: "emergency",
    Event.VEHICLE_EMERGENCY: "emergency",
}
"""What the vehicle is told after an event; `fly` after all others."""


@dataclass(frozen=True)
class State:
    """Who flies, why, and what the vehicle is told to do."""

    mode: FlightMode = "hover"
    reason: str = "start"
    action: CommandAction = "fly"

    def allows(self, event: Event) -> bool:
        """Whether the event has an effect in this mode."""
        return TABLE[self.mode, event] is not None

    def after(self, event: Event) -> "State":
        """The state that follows; this one if the event has no effect.

        The reason changes with the mode, with the action, and with a newly accepted path.
        """
        mode = TABLE[self.mode, event]
        if mode is None:
            return self
        action = ACTIONS.get(event, "fly")
        if (mode, action) == (self.mode, self.action) and event is not Event.ACCEPT:
            return self
        return State(mode, event.value, action)
