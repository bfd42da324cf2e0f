from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
import pytest

from training.dataset.primitive import Primitive
from training.generator import observer
from training.generator.dataset import (
    LONGEST_SAMPLES,
    SHORTEST_S,
    THESIS,
    THESIS_COUNTS,
    generate,
    holds,
    populate,
)
from training.generator.people import FAMILIES, TRAITS, People, Style, draw_people
from training.generator.shapes import ask
from training.labels import CLASSES, NONE, PRIMITIVES

COUNTS = dict.fromkeys(CLASSES, 48)


@pytest.fixture(scope="module")
def primitives() -> list[Primitive]:
    return generate(24, COUNTS, seed=5)


@pytest.fixture(scope="module")
def thesis() -> list[Primitive]:
    return populate(THESIS, 20, {label: n // 4 for label, n in THESIS_COUNTS.items()}, seed=1)


def test_the_thesis_counts_are_2399() -> None:
    assert sum(THESIS_COUNTS.values()) == 2399
    assert tuple(THESIS_COUNTS) == PRIMITIVES


def test_a_set_holds_what_was_asked_for(primitives: list[Primitive]) -> None:
    labels = [p.label for p in primitives]
    assert {label: labels.count(label) for label in CLASSES} == COUNTS
    assert len({p.operator for p in primitives}) == 24
    assert {p.family for p in primitives} == {family.name for family in FAMILIES}
    assert {p.source for p in primitives} == {"generator wide seed 5"}


def test_the_same_seed_gives_the_same_set(primitives: list[Primitive]) -> None:
    for one, other in zip(primitives, generate(24, COUNTS, seed=5), strict=True):
        assert one.operator == other.operator
        assert np.array_equal(one.times_s, other.times_s)
        assert np.array_equal(one.sticks, other.sticks)
    different = generate(24, {"line": 24}, seed=6)
    assert any(
        len(a.times_s) != len(b.times_s) for a, b in zip(primitives, different, strict=False)
    )


def test_what_cannot_be_made_is_refused() -> None:
    with pytest.raises(ValueError, match="spiral"):
        generate(2, {"spiral": 2}, seed=0)
    with pytest.raises(ValueError, match="operator"):
        generate(0, {"line": 2}, seed=0)


def test_sticks_are_those_of_a_pad(primitives: list[Primitive]) -> None:
    for primitive in primitives:
        assert np.abs(primitive.sticks).max() <= 1.0
        assert np.isfinite(primitive.sticks).all()
        # 8 bits an axis.
        assert np.allclose(primitive.sticks * 127.0, np.round(primitive.sticks * 127.0))
        assert (np.diff(primitive.times_s) > 0.0).all()
        assert primitive.times_s[0] == 0.0
        assert primitive.times_s[-1] >= SHORTEST_S
        assert len(primitive.times_s) <= LONGEST_SAMPLES
    rates = [len(p.times_s) / p.times_s[-1] for p in primitives]
    assert 42.0 < np.mean(rates) < 50.0
    intervals = np.concatenate([np.diff(p.times_s) for p in primitives])
    assert np.std(intervals) > 0.001


def _path_m(primitive: Primitive) -> np.ndarray:
    grid_s = np.arange(0.0, primitive.times_s[-1], observer.STEP_S)
    sticks = np.stack(
        [np.interp(grid_s, primitive.times_s, axis) for axis in primitive.sticks.T], 1
    )
    return observer.seen(observer.flown_m(sticks[None]), np.array([len(grid_s)]))


def test_a_helix_climbs_and_an_arc_does_not(primitives: list[Primitive]) -> None:
    """Their sticks are flown again, without the air and the vehicle of the pilots."""
    slopes: dict[str, list[float]] = {"arc": [], "helix": []}
    for primitive in primitives:
        if primitive.label in slopes:
            path = _path_m(primitive)[0]
            way = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum()
            slopes[primitive.label].append(abs(path[-1, 2] - path[0, 2]) / way)
    assert np.mean(np.array(slopes["helix"]) > 0.1) > 0.95
    # A few arcs lie in vertical planes, and come back down.
    assert np.mean(np.array(slopes["arc"]) < 0.15) > 0.9


def test_hover_corrections_stay_where_they_are() -> None:
    for primitive, places in holds(12, 20.0, seed=2):
        assert primitive.label == NONE
        assert primitive.duration_s == pytest.approx(20.0, abs=0.3)
        assert places.shape == (20.0 / observer.STEP_S + 1, 4)
        assert np.abs(places[:, :3]).max() < 2.5
        assert np.abs(primitive.sticks[:, :3]).max() > 0.1
        # Pushes to both sides: nobody flies away.
        assert np.abs(primitive.sticks[:, :3].mean(axis=0)).max() < 0.4


def test_every_family_does_nothing_in_every_way(primitives: list[Primitive]) -> None:
    idle = [p for p in primitives if p.label == NONE]
    assert {p.family for p in idle} == {family.name for family in FAMILIES}
    rests = [p for p in idle if np.abs(p.sticks).max() < 0.2]
    turns = [
        p
        for p in idle
        if np.abs(p.sticks[:, 3]).mean() > 0.2 and np.abs(p.sticks[:, :2]).max() < 0.2
    ]
    assert rests
    assert turns


def test_people_of_a_family_have_its_traits() -> None:
    rng = np.random.default_rng(0)
    for family in FAMILIES:
        person = asdict(draw_people([family], rng))
        ranges = {}
        for trait in family.traits:
            ranges |= TRAITS[trait]
        for name, (low, high) in ranges.items():
            assert low <= person[name][0] <= high


def test_no_trait_is_only_one_familys() -> None:
    """Whoever is left out of training has habits that others have too."""
    rng = np.random.default_rng(0)
    for family in FAMILIES:
        others = [other for other in FAMILIES if other is not family] * 60
        people = draw_people(others, rng)
        for trait in family.traits:
            has = np.ones(len(others), dtype=bool)
            for name, (low, high) in TRAITS[trait].items():
                values = getattr(people, name)
                has &= (values >= low) & (values <= high)
            assert has.sum() >= 5, f"only {family.name} is {trait}"


def test_every_habit_has_a_unit_a_range_and_a_source() -> None:
    for habit in fields(People):
        low, high = habit.metadata["range"]
        assert low <= high
        assert habit.metadata["unit"]
        assert habit.metadata["source"]


def test_the_page_about_people_says_what_the_code_has() -> None:
    page = (Path(__file__).parents[3] / "docs" / "people.md").read_text()
    for habit in fields(People):
        low, high = habit.metadata["range"]
        span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        ending = f"| {habit.metadata['unit']} | {span} | {habit.metadata['source']} |"
        assert [
            line
            for line in page.splitlines()
            if line.startswith(f"| `{habit.name}` |") and line.endswith(ending)
        ], habit.name
    for name, trait in TRAITS.items():
        spans = ", ".join(f"`{key}` {low:g} to {high:g}" for key, (low, high) in trait.items())
        assert f"| {name} | {spans} |" in page
    for family in FAMILIES:
        assert f"| {family.name} | {family.style.value} | {', '.join(family.traits)}" in page
    assert f"difficulty {THESIS.difficulty}" in page


def test_there_are_hands_and_pilots() -> None:
    assert {family.style for family in FAMILIES} == set(Style)
    assert len({family.name for family in FAMILIES}) >= 10


@pytest.mark.parametrize("label", PRIMITIVES)
def test_shapes_well_done_are_called_by_their_name_and_no_other(label: str) -> None:
    """The shape as it was asked for, without hands: the observer's rules exclude each other."""
    rng = np.random.default_rng(3)
    people = draw_people([FAMILIES[0]] * 200, rng).worse(0.0)
    shapes = ask(label, people, Style.HAND, rng, scatter=0.2)
    progress = np.linspace(0.0, 1.0, 200)[None].repeat(200, axis=0)
    direction, speed = shapes.direction(progress), shapes.speed(progress) / 40.0
    flat = [speed * np.cos(direction), speed * np.sin(direction), speed * shapes.climb[:, None]]
    path = np.cumsum(np.stack(flat, axis=2), axis=1)
    seen = observer.seen(path, np.full(200, 200))
    level = np.zeros(200, dtype=bool)
    for other in PRIMITIVES:
        called = observer.looks_like(other, seen, level, np.zeros(200)).mean()
        assert called > 0.95 if other == label else called < 0.02


def test_thesis_lengths_are_those_of_its_histograms(thesis: list[Primitive]) -> None:
    """Sines: 229 samples on average, 375 at most; all: median 149, 28 % over 200."""
    samples = np.array([len(p) for p in thesis])
    sines = np.array([len(p) for p in thesis if p.label == "sine"])
    assert np.mean(sines) == pytest.approx(229, abs=20)
    assert np.median(samples) == pytest.approx(149, abs=15)
    assert np.mean(samples > 200) == pytest.approx(0.28, abs=0.07)


def test_nobody_of_the_thesis_turns_the_vehicle(thesis: list[Primitive]) -> None:
    assert max(np.abs(p.sticks[:, 3]).max() for p in thesis) == 0.0
