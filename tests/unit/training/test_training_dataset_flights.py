"""What becomes of a suggestion says what its sticks meant."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from dataset_samples import STEP_NS, UTC_NS, circle, stick, write_recording
from msgspec.structs import replace

from common import messages as m
from training.dataset.flights import SOON_S, read_flight

S = 1_000_000_000
Logged = tuple[str, m.Message, int]


def intent(label: str, begin_s: float, end_s: float) -> Logged:
    end_ns = UTC_NS + round(end_s * S)
    message = m.Intent(
        stamp=end_ns,
        seq=0,
        label=label,
        probabilities={"line": 0.1, "arc": 0.7, "sine": 0.1, "helix": 0.1},
        confidence=0.7,
        window_start=UTC_NS + round(begin_s * S),
        window_end=end_ns,
        samples=100,
        model="test",
    )
    return "intent", message, end_ns + S // 100


def suggestion(number: int, primitive: str, at_s: float) -> Logged:
    # Its stamp is the simulator's, which says nothing about when it was published.
    message = m.Suggestion(
        stamp=7,
        seq=0,
        id=number,
        primitive=primitive,
        params={},
        path=[(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 1.0, 0.0)],
        closed=False,
        speed=1.0,
        fit_rms=0.1,
        confidence=0.7,
        heading_sector=0,
    )
    return "suggestion", message, UTC_NS + round(at_s * S)


def status(mode: m.FlightMode, number: int, reason: str, at_s: float) -> Logged:
    message = m.AutopilotStatus(
        stamp=UTC_NS + round(at_s * S),
        seq=0,
        mode=mode,
        suggestion=number,
        progress=0.0,
        cross_track=0.0,
        reason=reason,
    )
    return "autopilot", message, UTC_NS + round(at_s * S)


def flight(path: Path, events: Sequence[Logged], seconds: float = 20.0) -> Path:
    sticks = circle(round(seconds * S / STEP_NS))
    messages: list[Logged] = [("stick", stick(n, row), 0) for n, row in enumerate(sticks)]
    messages = [(topic, each, each.stamp + S // 1000) for topic, each, _ in messages]
    return write_recording(path, sorted([*messages, *events], key=lambda each: each[2]))


def shown(number: int, at_s: float = 4.0) -> list[Logged]:
    return [intent("arc", at_s - 3.0, at_s), suggestion(number, "arc", at_s + 0.05)]


def flown(number: int, seconds: float, reason: str, at_s: float = 5.0) -> list[Logged]:
    return [
        status("engaged", number, "accepted", at_s),
        status("manual", 0, reason, at_s + seconds),
    ]


@pytest.mark.parametrize(
    ("events", "label", "fate"),
    [
        (flown(1, 5.0, "stick"), "arc", "accepted"),
        (flown(1, 0.5, "finished"), "arc", "accepted"),
        (flown(1, SOON_S - 0.1, "stick"), "none", "overridden"),
        (flown(1, 0.5, "cancelled"), "none", "overridden"),
        (flown(1, 0.5, "pose_lost"), None, "unclear"),
        ([status("engaged", 1, "accepted", 5.0)], None, "unclear"),
        ([], None, "ignored"),
    ],
)
def test_the_fate_of_a_suggestion_labels_the_sticks_of_its_window(
    tmp_path: Path, events: list[Logged], label: str | None, fate: str
) -> None:
    path = flight(tmp_path / "f.mcap", [*shown(1), *events])
    found, fates, problems = read_flight(path, "ana", "")
    assert not problems
    assert {name: n for name, n in fates.items() if n} == {fate: 1}
    assert [p.label for p in found] == ([label] if label else [])
    for primitive in found:
        assert primitive.source == f"f.mcap suggestion 1 {fate}"
        assert primitive.utc_ns == UTC_NS + S
        np.testing.assert_allclose(primitive.sticks, circle(1000)[50:201])


def test_what_was_ignored_is_none_only_where_asked_and_where_nothing_else_was_taken(
    tmp_path: Path,
) -> None:
    events = [*shown(1), *shown(2, 4.5), *flown(2, 6.0, "finished"), *shown(3, 15.0)]
    path = flight(tmp_path / "f.mcap", events)
    found, fates, _ = read_flight(path, "ana", "", ignored_is_none=True)
    # 1 shares its sticks with 2, which was taken: it says nothing.
    assert (fates["accepted"], fates["ignored"]) == (1, 1)
    assert [(p.label, p.source.split()[2]) for p in found] == [("arc", "2"), ("none", "3")]
    assert len(read_flight(path, "ana", "")[0]) == 1


def test_taking_another_suggestion_says_nothing_against_the_one_before(tmp_path: Path) -> None:
    events = [*shown(1), *shown(2, 4.5), status("engaged", 1, "accepted", 5.0)]
    path = flight(tmp_path / "f.mcap", [*events, *flown(2, 5.0, "stick", 5.5)])
    _, fates, _ = read_flight(path, "ana", "")
    assert (fates["accepted"], fates["overridden"], fates["unclear"]) == (1, 0, 1)


def test_a_suggestion_that_reached_the_recorder_before_its_intent_has_it_all_the_same(
    tmp_path: Path,
) -> None:
    topic, message, at_ns = intent("arc", 1.0, 4.0)
    events = [suggestion(1, "arc", 4.005), (topic, message, at_ns), *flown(1, 5.0, "stick")]
    found, _, _ = read_flight(flight(tmp_path / "f.mcap", events), "ana", "")
    assert [len(p) for p in found] == [151]


def test_of_a_suggestion_sent_again_the_newest_window_before_it_was_accepted_counts(
    tmp_path: Path,
) -> None:
    again = [*shown(1, 3.0), *shown(1, 4.0), *flown(1, 6.0, "stick", 4.5), *shown(1, 5.0)]
    found, fates, _ = read_flight(flight(tmp_path / "f.mcap", again), "ana", "")
    assert sum(fates.values()) == 1
    assert [p.utc_ns for p in found] == [UTC_NS + S]
    twice = [*shown(1), *flown(1, 1.0, "stick"), *flown(1, 5.0, "finished", 8.0)]
    _, fates, _ = read_flight(flight(tmp_path / "g.mcap", twice), "ana", "")
    assert (fates["overridden"], fates["accepted"]) == (0, 1)


def test_a_suggestion_of_its_own_mind_keeps_its_primitive(tmp_path: Path) -> None:
    events = [intent("arc", 1.0, 4.0), suggestion(1, "line", 4.05), *flown(1, 5.0, "stick")]
    found, _, _ = read_flight(flight(tmp_path / "f.mcap", events), "ana", "")
    assert [p.label for p in found] == ["line"]


def test_stamps_of_a_simulated_clock_are_no_utc(tmp_path: Path) -> None:
    def restamped(message: m.Message) -> m.Message:
        times = {"stamp", "window_start", "window_end"} & set(message.__struct_fields__)
        return replace(message, **{name: getattr(message, name) - UTC_NS for name in times})

    sticks = [("stick", stick(n, row), UTC_NS + n * STEP_NS) for n, row in enumerate(circle(1000))]
    events = [*sticks, *shown(1), *flown(1, 5.0, "stick")]
    events = [(topic, restamped(each), at_ns) for topic, each, at_ns in events]
    path = write_recording(tmp_path / "f.mcap", sorted(events, key=lambda each: each[2]))
    (primitive,) = read_flight(path, "ana", "")[0]
    assert (primitive.utc_ns, len(primitive)) == (0, 151)


def test_what_a_flight_lacks_is_told(tmp_path: Path) -> None:
    path = flight(tmp_path / "f.mcap", [])
    assert "holds no suggestion" in str(read_flight(path, "ana", "")[2][0])
    early = [*shown(1), *flown(1, 5.0, "stick")]
    path = write_recording(tmp_path / "g.mcap", early)
    assert "its sticks are not in the recording" in str(read_flight(path, "ana", "")[2][0])
    path = flight(
        tmp_path / "h.mcap",
        [intent("arc", 1.0, 4.0), suggestion(1, "loop", 4.05), *flown(1, 5.0, "stick")],
    )
    assert "'loop' is no known class" in str(read_flight(path, "ana", "")[2][0])
    path.write_bytes(path.read_bytes()[:3000])
    assert "cannot be read to its end" in str(read_flight(path, "ana", "")[2][0])
