"""Where a primitive ends: ours keeps motion along one axis, the thesis' parser throws it away."""

import numpy as np
from dataset_samples import FORWARD, REST, circle, performed
from hypothesis import given
from hypothesis import strategies as st

from training.dataset.segmentation import Segment, as_thesis, at_buttons
from training.dataset.track import Track


def track_of(rows: list, rate_hz: float = 50.0) -> Track:
    sticks = np.array([row for row, _ in rows], dtype=np.float64)
    held = tuple((button,) if button else () for _, button in rows)
    return Track(np.arange(len(rows)) / rate_hz, sticks, held)


def test_pure_forward_is_kept_by_ours_and_thrown_away_by_the_thesis() -> None:
    track = track_of(performed(([FORWARD] * 120, "cross")))
    assert at_buttons(track) == [Segment(10, 130, "cross")]
    assert as_thesis(track) == []


def test_the_thesis_keeps_runs_of_90_rows_and_cuts_them() -> None:
    oblique = (0.3, 0.4, 0.0, 0.0)
    rows = performed(([oblique] * 200, "circle"), ([oblique] * 89, "cross"))
    assert as_thesis(track_of(rows)) == [Segment(10, 100, "circle")]


def test_a_button_pressed_after_the_stick_came_back_marks_the_motion_before_it() -> None:
    rows = performed((circle(), "triangle"))
    late = rows[:160] + [(REST, "")] * 200 + [(REST, "square")] * 3
    assert [s.button for s in at_buttons(track_of(late))] == ["square"]


def test_a_button_pressed_in_motion_ends_it_there_and_the_way_back_is_no_motion() -> None:
    rows = [(FORWARD, "")] * 100 + [(FORWARD, "cross")] * 5 + [(FORWARD, "")] * 15
    rows += [(REST, "")] * 20 + [(FORWARD, "")] * 80 + [(REST, "circle")] * 5
    segments = at_buttons(track_of(rows))
    assert segments == [Segment(0, 100, "cross"), Segment(140, 220, "circle")]


def test_motion_that_goes_on_after_the_button_is_the_next_one() -> None:
    rows = [(FORWARD, "")] * 100 + [(FORWARD, "cross")] * 5 + [(FORWARD, "")] * 90
    rows += [(REST, "circle")] * 5
    assert [(s.begin, s.end) for s in at_buttons(track_of(rows))] == [(0, 100), (105, 195)]


def test_a_long_rest_or_gap_ends_a_motion_and_a_short_one_does_not() -> None:
    hesitant = [(FORWARD, "")] * 60 + [(REST, "")] * 30 + [(FORWARD, "")] * 60
    assert len(at_buttons(track_of(hesitant))) == 1
    rested = [(FORWARD, "")] * 60 + [(REST, "")] * 60 + [(FORWARD, "")] * 60
    assert len(at_buttons(track_of(rested))) == 2
    assert len(at_buttons(track_of(rested), idle_s=2.0)) == 1
    silent = track_of([(FORWARD, "")] * 120)
    times_s = silent.times_s.copy()
    times_s[60:] += 1.5
    assert len(at_buttons(Track(times_s, silent.sticks, silent.held))) == 2


rows = st.lists(
    st.tuples(st.sampled_from([REST, FORWARD, (0.3, -0.4, 0.0, 0.0)]), st.sampled_from(["", "a"])),
    min_size=1,
    max_size=300,
)


@given(rows)
def test_segments_follow_one_another_begin_and_end_in_motion_and_hold_no_button(rows: list) -> None:
    track = track_of(rows, rate_hz=5.0)
    before = 0
    for segment in at_buttons(track):
        assert before <= segment.begin < segment.end
        before = segment.end
        assert track.sticks[segment.begin].any()
        assert track.sticks[segment.end - 1].any()
        assert not any(track.held[segment.begin : segment.end])
    for segment in as_thesis(track):
        assert (track.sticks[segment.begin : segment.end, :2] != 0.0).all()
