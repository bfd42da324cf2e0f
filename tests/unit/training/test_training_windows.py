import numpy as np
import pytest

from services.classifier.model import SHORTEST_SAMPLES
from services.classifier.window import WINDOW_SAMPLES
from training.generator.dataset import generate
from training.labels import NONE, PRIMITIVES
from training.windows import (
    NONE_INDEX,
    Examples,
    examples_of,
    random_windows,
    seen_after,
    spliced,
)


@pytest.fixture(scope="module")
def examples() -> Examples:
    return examples_of(generate(10, dict.fromkeys((*PRIMITIVES, NONE), 25), seed=1))


def test_early_windows_end_where_asked(examples: Examples) -> None:
    windows = seen_after(examples, 1.5)
    assert windows.lengths.max() == 75
    assert windows.sticks.shape[1:] == (75, 4)
    assert windows.times_s[0, 50] == pytest.approx(1.0)
    for row, length in zip(windows.sticks, windows.lengths, strict=True):
        assert not row[length:].any()


def test_the_window_at_the_end_is_the_newest_seconds(examples: Examples) -> None:
    windows = seen_after(examples, None)
    for row, length, track in zip(windows.sticks, windows.lengths, examples.tracks, strict=True):
        assert length == min(WINDOW_SAMPLES, len(track))
        assert np.array_equal(row[:length], track[-length:])


def test_random_windows_are_seeded_and_long_enough(examples: Examples) -> None:
    one = random_windows(examples, np.random.default_rng(4))
    other = random_windows(examples, np.random.default_rng(4))
    assert np.array_equal(one.sticks, other.sticks)
    assert one.lengths.min() >= SHORTEST_SAMPLES
    assert one.lengths.max() <= WINDOW_SAMPLES
    assert len(set(one.lengths.tolist())) > 20


def test_without_augmentation_windows_are_pieces_of_their_own_track(examples: Examples) -> None:
    windows = random_windows(examples, np.random.default_rng(5), augment=False)
    for row, length, track in zip(windows.sticks, windows.lengths, examples.tracks, strict=True):
        pieces = np.lib.stride_tricks.sliding_window_view(track, length, axis=0)
        assert (pieces.transpose(0, 2, 1) == row[:length]).all(axis=(1, 2)).any()


def test_mirroring_turns_the_yaw_stick_with_the_others(examples: Examples) -> None:
    windows = random_windows(examples, np.random.default_rng(6))
    assert np.abs(windows.sticks[:, :, 3]).max() <= 1.0
    rows = examples.rows(np.flatnonzero(examples.labels == NONE_INDEX))
    drawn = random_windows(rows, np.random.default_rng(6))
    sizes = [np.abs(track[:, 3]).max() for track in rows.tracks]
    found = np.abs(drawn.sticks[:, :, 3]).max(axis=1)
    assert (found <= np.array(sizes) + 1e-6).all()


def test_one_primitive_is_flown_into_the_next_without_a_turn() -> None:
    """A line to the left, then an arc: joined where the arc begins, in its direction."""
    t = np.arange(0.0, 4.0, 0.02)
    still = 0.0 * t
    line = np.stack([still, 0.4 + still, still, still], 1).astype(np.float32)
    arc = np.stack([0.8 * np.cos(0.5 * t), 0.8 * np.sin(0.5 * t), still, still], 1)
    arc = arc.astype(np.float32)
    for seed in range(10):
        window = spliced(line, arc, np.random.default_rng(seed))
        assert window is not None
        assert len(window) <= WINDOW_SAMPLES
        assert np.hypot(window[:, 0], window[:, 1]) == pytest.approx(0.8, rel=0.01)
        heading = np.unwrap(np.arctan2(window[:, 1], window[:, 0]))
        assert np.abs(np.diff(heading)).max() < 0.1
        assert heading[-1] - heading[0] > 0.4
    assert spliced(line, arc[:50], np.random.default_rng(0)) is None
    assert spliced(0.0 * line, arc, np.random.default_rng(0)) is None
