"""Whose sticks count."""

from hypothesis import given
from hypothesis import strategies as st

from common.messages import Stick
from services.operator.sources import NEUTRAL, Deflection, Reading, Sources

TICK_NS = 20_000_000
MAX_AGE_NS = 200_000_000

axis = st.floats(-1.0, 1.0)
deflections = st.one_of(st.just(NEUTRAL), st.builds(Deflection, axis, axis, axis, axis))
readings = st.one_of(st.none(), st.builds(Reading, deflections))


def stick(sticks: Deflection, buttons: list[str] | None = None) -> Stick:
    return Stick(
        stamp=1,
        seq=0,
        vx=sticks.vx,
        vy=sticks.vy,
        vz=sticks.vz,
        wz=sticks.wz,
        buttons=buttons,
    )


FORWARD = Deflection(vx=0.8)
LEFT = Deflection(vy=0.7)


def test_a_device_counts_once_it_has_been_neutral() -> None:
    sources = Sources()
    assert sources.step(0, Reading(FORWARD)).sticks == NEUTRAL
    assert sources.step(TICK_NS, Reading()).sticks == NEUTRAL
    assert sources.step(2 * TICK_NS, Reading(FORWARD)).sticks == FORWARD


def test_a_device_that_is_unplugged_is_neutral_at_once_and_must_pass_neutral_again() -> None:
    sources = Sources()
    sources.step(0, Reading())
    assert sources.step(1, Reading(FORWARD)).sticks == FORWARD
    assert sources.step(2, None).sticks == NEUTRAL
    assert sources.step(3, Reading(FORWARD)).sticks == NEUTRAL
    sources.step(4, Reading())
    assert sources.step(5, Reading(FORWARD)).sticks == FORWARD


def test_a_fresh_deflected_console_stick_beats_the_device() -> None:
    sources = Sources()
    sources.step(0, Reading())
    sources.console_stick(stick(NEUTRAL), 0)
    assert sources.step(1, Reading(FORWARD)).sticks == FORWARD
    sources.console_stick(stick(LEFT, ["a"]), 2)
    output = sources.step(2, Reading(FORWARD))
    assert (output.sticks, output.buttons, output.is_console) == (LEFT, ("a",), True)
    sources.console_stick(stick(NEUTRAL), 3)
    output = sources.step(3, Reading(FORWARD))
    assert (output.sticks, output.is_console) == (FORWARD, False)


def test_an_old_console_stick_is_neutral_and_must_pass_neutral_again() -> None:
    sources = Sources()
    sources.console_stick(stick(NEUTRAL), 0)
    sources.console_stick(stick(LEFT), 1)
    assert sources.step(1 + MAX_AGE_NS, None).sticks == LEFT
    assert sources.step(2 + MAX_AGE_NS, None).sticks == NEUTRAL
    again_ns = 10 * MAX_AGE_NS
    sources.console_stick(stick(LEFT), again_ns)
    assert sources.step(again_ns, None).sticks == NEUTRAL


def test_a_console_that_was_silent_counts_from_its_first_stick() -> None:
    sources = Sources()
    sources.step(0, None)
    sources.step(2 * MAX_AGE_NS, None)
    sources.console_stick(stick(LEFT), 3 * MAX_AGE_NS)
    assert sources.step(3 * MAX_AGE_NS, None).sticks == LEFT
    sources.console_stick(stick(NEUTRAL), 4 * MAX_AGE_NS)
    assert sources.step(4 * MAX_AGE_NS, None).sticks == NEUTRAL
    # It says nothing while nobody holds its sticks.
    sources.step(9 * MAX_AGE_NS, None)
    sources.console_stick(stick(FORWARD), 10 * MAX_AGE_NS)
    assert sources.step(10 * MAX_AGE_NS, None).sticks == FORWARD


def test_a_console_whose_sticks_are_held_when_the_operator_starts_must_pass_neutral() -> None:
    sources = Sources()
    for tick in range(50):
        sources.console_stick(stick(LEFT), tick * TICK_NS)
        assert sources.step(tick * TICK_NS, None).sticks == NEUTRAL


def test_neutral_between_two_steps_is_enough_for_the_console() -> None:
    sources = Sources()
    sources.console_stick(stick(NEUTRAL), 0)
    sources.console_stick(stick(LEFT), 1)
    assert sources.step(2, None).sticks == LEFT


def test_a_decision_is_made_when_its_button_goes_down() -> None:
    sources = Sources()
    held = Reading(decisions=frozenset({"accept"}))
    assert sources.step(0, held).decisions == ("accept",)
    assert sources.step(1, held).decisions == ()
    assert sources.step(2, Reading()).decisions == ()
    assert sources.step(3, held).decisions == ("accept",)


@given(st.lists(st.tuples(readings, st.one_of(st.none(), deflections)), max_size=60))
def test_only_what_is_held_now_is_ever_sent(steps: list) -> None:
    sources = Sources()
    now_ns, console, console_ns = 0, None, 0
    own_open = False
    for own, theirs in steps:
        now_ns += TICK_NS
        if theirs is not None:
            sources.console_stick(stick(theirs), now_ns)
            console, console_ns = theirs, now_ns
        output = sources.step(now_ns, own)
        if own is None:
            own_open = False
        elif own.sticks.is_neutral:
            own_open = True
        allowed = []
        if own is None or not own_open:
            allowed.append(NEUTRAL)
        else:
            allowed.append(own.sticks)
        if console is not None and now_ns - console_ns <= MAX_AGE_NS:
            allowed.append(console)
        assert output.sticks in allowed
        assert output.is_console == (output.sticks is not NEUTRAL and output.is_console)


def test_a_mark_of_the_console_goes_with_whatever_sticks_count() -> None:
    sources = Sources()
    sources.step(0, Reading())
    sources.console_stick(stick(NEUTRAL, ["end"]), 1)
    output = sources.step(1, Reading(FORWARD, ("a",)))
    assert (output.sticks, output.buttons, output.is_console) == (FORWARD, ("a", "end"), False)
    assert sources.step(2 + MAX_AGE_NS, Reading(FORWARD)).buttons == ()
