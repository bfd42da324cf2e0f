"""The table of the state machine: complete, and the human in it master."""

import pytest

from services.autopilot.arbitration import MODES, TABLE, Event, State

AIR = ("manual", "engaged", "hover")
LOSSES = (Event.STICK_LOST, Event.STICK_GONE, Event.POSE_LOST, Event.POSE_GONE)


def test_every_pair_of_mode_and_event_is_defined():
    assert set(TABLE) == {(mode, event) for mode in MODES for event in Event}
    assert {after for after in TABLE.values() if after is not None} <= set(MODES)


@pytest.mark.parametrize("mode", AIR)
@pytest.mark.parametrize("event", [Event.STICK, Event.CANCEL])
@pytest.mark.parametrize("action", ["fly", "takeoff", "land"])
def test_a_stick_or_cancel_gives_the_human_control_of_whatever_flies(mode, event, action):
    state = State(mode, "whatever", action).after(event)
    assert (state.mode, state.action) == ("manual", "fly")


@pytest.mark.parametrize("mode", MODES)
def test_emergency_wins_from_every_mode(mode):
    state = State(mode).after(Event.EMERGENCY)
    assert (state.mode, state.action) == ("emergency", "emergency")


def test_only_takeoff_ends_an_emergency():
    ends = {
        event
        for event in Event
        if State("emergency", "emergency", "emergency").after(event).mode != "emergency"
    }
    assert ends == {Event.TAKEOFF}


def test_only_accept_engages():
    engages = {
        (mode, event)
        for (mode, event), after in TABLE.items()
        if after == "engaged" and mode != "engaged"
    }
    assert engages == {("manual", Event.ACCEPT), ("hover", Event.ACCEPT)}


@pytest.mark.parametrize("event", LOSSES)
def test_no_loss_gives_control_to_anyone(event):
    for mode in MODES:
        assert State(mode).after(event).mode in (mode, "hover")


def test_only_a_stick_or_cancel_leads_to_manual():
    leads = {event for (mode, event), after in TABLE.items() if after == "manual"}
    assert leads == {Event.STICK, Event.CANCEL}


def test_an_event_without_effect_changes_nothing():
    state = State("landed", "vehicle_landed")
    assert state.after(Event.FINISHED) is state
    assert not state.allows(Event.ACCEPT)


def test_the_reason_is_of_the_last_change():
    state = State("engaged", "accepted").after(Event.STICK)
    assert (state.mode, state.reason) == ("manual", "stick")
    assert State("manual", "cancelled").after(Event.STICK).reason == "cancelled"
    assert State("engaged", "old").after(Event.ACCEPT).reason == "accepted"
