"""The difficulty of the thesis' operators, judged by the thesis' SVM only."""

from collections.abc import Callable

import pytest

from training.generator.calibration import AIM, COUNTS, OPERATORS, TOLERANCE, features, measure
from training.generator.dataset import THESIS, populate

FRESH_SEEDS = range(1000, 1020)
"""Not those by which the difficulty was found."""


def test_the_machines_vectors_are_the_thesis_794_of_200() -> None:
    assert sum(COUNTS.values()) == 794
    people = populate(THESIS, OPERATORS, dict.fromkeys(COUNTS, 2), seed=0)
    assert {features(primitive).shape for primitive in people} == {(200,)}


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_thesis_machine_scores_as_in_the_thesis(record_property: Callable[..., None]) -> None:
    found = measure(THESIS.difficulty, FRESH_SEEDS)
    record_property("weighted F1", f"{found.mean:.3f} ± {found.half_width:.3f}, n = {found.seeds}")
    assert found.mean == pytest.approx(AIM, abs=TOLERANCE), found
