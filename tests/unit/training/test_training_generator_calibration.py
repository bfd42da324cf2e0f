"""The difficulty of the thesis' operators, judged by the thesis' SVM only."""

from collections.abc import Callable

import pytest

from training.generator import calibration
from training.generator.calibration import (
    AIM,
    COUNTS,
    OPERATORS,
    TOLERANCE,
    Found,
    calibrate,
    features,
    measure,
)
from training.generator.dataset import THESIS, populate

FRESH_SEEDS = range(1000, 1020)
"""Not those by which the difficulty was found."""


def test_the_machines_vectors_are_the_thesis_794_of_200() -> None:
    assert sum(COUNTS.values()) == 794
    people = populate(THESIS, OPERATORS, dict.fromkeys(COUNTS, 2), seed=0)
    assert {features(primitive).shape for primitive in people} == {(200,)}


def test_the_difficulty_is_found_by_halving(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, ...]] = []

    def easier(difficulty: float, seeds: tuple[int, ...]) -> Found:
        asked.append(seeds)
        return Found(1.0 - 0.1 * difficulty, 0.01, len(seeds))

    monkeypatch.setattr(calibration, "measure", easier)
    assert calibrate(0.5, 4.0, iter((3, 4)), rounds=10) == pytest.approx(2.0, abs=0.01)
    assert set(asked) == {(3, 4)}
    with pytest.raises(ValueError, match=r"F1 is 0\.700 at 3\.0 and 0\.600 at 4\.0"):
        calibrate(3.0, 4.0, (3, 4))


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_thesis_machine_scores_as_in_the_thesis(record_property: Callable[..., None]) -> None:
    found = measure(THESIS.difficulty, FRESH_SEEDS)
    record_property("weighted F1", f"{found.mean:.3f} ± {found.half_width:.3f}, n = {found.seeds}")
    assert found.mean == pytest.approx(AIM, abs=TOLERANCE), found
