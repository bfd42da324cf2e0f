"""The stop button takes what was performed; pressed again it gives it back."""

import numpy as np
from dataset_samples import REST, Row, circle, performed, sticks_of

from training.dataset.collection import Collection, Event


def events_of(rows: list[Row], label: str = "arc") -> list[Event]:
    collection = Collection(label, "ana", "", "test")
    events = [collection.add(stick) for stick in sticks_of(rows)]
    return [event for event in events if event is not None]


def test_each_press_takes_the_motion_before_it_without_its_rest() -> None:
    events = events_of(performed((circle(), "end"), (0.5 * circle(100), "a")))
    assert [event.verdict for event in events] == ["taken", "taken"]
    one, two = (event.primitive for event in events)
    assert one is not None
    assert two is not None
    np.testing.assert_allclose(one.sticks, circle())
    np.testing.assert_allclose(two.sticks, 0.5 * circle(100))
    assert (one.label, one.operator, one.times_s[0]) == ("arc", "ana", 0.0)


def test_a_second_press_without_motion_takes_the_last_one_back() -> None:
    rows = [*performed((circle(), "end")), *[(REST, "end")] * 5, *[(REST, "")] * 5]
    assert [event.verdict for event in events_of(rows)] == ["taken", "taken back"]


def test_a_press_without_motion_takes_nothing_but_what_the_press_before_it_took() -> None:
    again = [*[(REST, "end")] * 5, *[(REST, "")] * 20]
    rows = [*performed((circle(), "end"), (circle(), "end")), *again, *again]
    events = events_of([*again, *rows])
    assert [event.verdict for event in events] == [
        *("refused", "taken", "taken", "taken back", "refused")
    ]
    assert "no motion before the button" in events[-1].reason
    events = events_of([*performed((circle(), "end"), (circle(30), "end")), *again])
    assert [event.verdict for event in events] == ["taken", "refused", "refused"]


def test_a_bouncing_button_is_pressed_once() -> None:
    rows = [*performed((circle(), "end"))]
    rows = [*rows[:-10], (REST, ""), (REST, "end"), (REST, ""), (REST, "end"), (REST, "")]
    assert [event.verdict for event in events_of(rows)] == ["taken"]


def test_what_is_too_short_is_refused_with_the_reason() -> None:
    (event,) = events_of(performed((circle(30), "end")))
    assert event.verdict == "refused"
    assert "shorter than 1 s" in event.reason


def test_only_the_last_motion_before_the_press_counts() -> None:
    practice = [(tuple(row), "") for row in circle(80)] + [(REST, "")] * 100
    (event,) = events_of([*practice, *performed((circle(), "end"))])
    assert event.primitive is not None
    assert len(event.primitive) == 150


def test_sticks_of_a_long_wait_are_forgotten() -> None:
    collection = Collection("arc", "ana", "", "test")
    rows = [(REST, "")] * 8000
    for stick in sticks_of(rows):
        collection.add(stick)
    assert len(collection._sticks) <= 65 * 50 + 1
