import math
from dataclasses import asdict

import numpy as np
import pytest

from training.dataset.primitive import Primitive
from training.generator.dataset import (
    LONGEST_SAMPLES,
    SHORTEST_S,
    THESIS_COUNTS,
    generate,
)
from training.generator.hands import slow_noise
from training.generator.operators import FAMILIES, Style, draw_operator
from training.generator.shapes import PATH_STEP_M, path_plan
from training.labels import PRIMITIVES

COUNTS = {"line": 40, "arc": 40, "sine": 40, "helix": 40}


@pytest.fixture(scope="module")
def primitives() -> list[Primitive]:
    return generate(20, COUNTS, seed=5)


def test_the_thesis_counts_are_2399() -> None:
    assert sum(THESIS_COUNTS.values()) == 2399
    assert tuple(THESIS_COUNTS) == PRIMITIVES


def test_a_set_holds_what_was_asked_for(primitives: list[Primitive]) -> None:
    labels = [p.label for p in primitives]
    assert {label: labels.count(label) for label in PRIMITIVES} == COUNTS
    assert len({p.operator for p in primitives}) == 20
    assert {p.family for p in primitives} == {family.name for family in FAMILIES}


def test_the_same_seed_gives_the_same_set(primitives: list[Primitive]) -> None:
    for one, other in zip(primitives, generate(20, COUNTS, seed=5), strict=True):
        assert np.array_equal(one.times_s, other.times_s)
        assert np.array_equal(one.sticks, other.sticks)
    different = generate(20, COUNTS, seed=6)
    assert any(len(a.times_s) != len(b.times_s) for a, b in zip(primitives, different, strict=True))


def test_sticks_are_those_of_a_pad(primitives: list[Primitive]) -> None:
    for primitive in primitives:
        assert primitive.sticks.shape == (len(primitive.times_s), 4)
        assert np.abs(primitive.sticks).max() <= 1.0
        assert np.isfinite(primitive.sticks).all()
        assert (np.diff(primitive.times_s) > 0.0).all()
        assert primitive.times_s[0] == 0.0
        assert primitive.times_s[-1] >= SHORTEST_S
        assert len(primitive.times_s) <= LONGEST_SAMPLES
    rates = [len(p.times_s) / p.times_s[-1] for p in primitives]
    assert 42.0 < np.mean(rates) < 52.0
    intervals = np.concatenate([np.diff(p.times_s) for p in primitives])
    assert np.std(intervals) > 0.001


def test_only_helices_and_climbing_lines_climb(primitives: list[Primitive]) -> None:
    climb = {label: [] for label in PRIMITIVES}
    for p in primitives:
        climb[p.label].append(abs(float(p.sticks[:, 2].mean())))
    assert np.median(climb["helix"]) > 0.15
    for level in ("arc", "sine"):
        assert np.median(climb[level]) < 0.05


def test_pilots_who_yaw_hold_the_side_stick_still(primitives: list[Primitive]) -> None:
    for p in primitives:
        if p.family.startswith("pilot-yaw"):
            assert np.abs(p.sticks[:, 1]).mean() < 0.1
        else:
            assert np.abs(p.sticks[:, 3]).max() == 0.0


def test_people_of_a_family_stay_in_its_ranges() -> None:
    rng = np.random.default_rng(0)
    for family in FAMILIES:
        person = asdict(draw_operator(family, rng))
        for name, (low, high) in family.ranges.items():
            assert low <= person[name] <= high


def test_there_are_hands_and_pilots() -> None:
    assert {family.style for family in FAMILIES} == set(Style)


@pytest.mark.parametrize("label", PRIMITIVES)
def test_paths_are_evenly_sampled_from_the_origin(label: str) -> None:
    for seed in range(20):
        plan = path_plan(label, np.random.default_rng(seed))
        steps = np.linalg.norm(np.diff(plan.points_m, axis=0), axis=1)
        assert plan.points_m[0] == pytest.approx([0.0, 0.0], abs=1e-9)
        # A sine is sampled along its axis, so its slopes are somewhat longer.
        assert steps.min() >= PATH_STEP_M * 0.99
        assert steps.max() <= PATH_STEP_M * 2.4
        heading = math.atan2(*plan.points_m[3][::-1])
        assert abs(heading) < 0.8


def test_slow_noise_has_unit_deviation() -> None:
    noise = slow_noise(200_000, 0.5, np.random.default_rng(0))
    assert np.std(noise) == pytest.approx(1.0, abs=0.05)
