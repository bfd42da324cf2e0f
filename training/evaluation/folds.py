"""Folds: who is learned from, who is chosen by, and who is judged on; no person is in two.

Of the wide population some families are left out of each seed's training altogether; over
`SEEDS` seeds each family is left out once. The calibrated population, on which the thesis' machine
scores as in the thesis, is in training too, by people who are not judged on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from common.sticks import FULL_STICK
from services.classifier.window import WINDOW_SAMPLES
from training.dataset.primitive import Primitive
from training.evaluation.contender import Lesson
from training.evaluation.names import CALIBRATED, FAMILY, KNOWN
from training.fit import EVALUATION
from training.generator.dataset import THESIS, Population, counts_of, populate
from training.generator.nothing import KINDS
from training.generator.people import FAMILIES
from training.labels import NONE
from training.windows import Cuts, Windows, examples_of, padded, random_tracks

SEEDS = 5
PLANT = "tum"
"""The vehicle of the simulated people."""


@dataclass(frozen=True)
class Size:
    """How much is in a fold: people, and performances as multiples of the thesis' 2399.

    Attributes:
        wide: of the wide population, to learn from; a sixth as many to choose by.
        thesis: of the calibrated one, likewise.
        none: performances of nothing, as a share of those of primitives.
        tested: of each population that is judged on; of each family left out half as many people,
            and a third as many performances.
        hovering_people: who hold a place for 60 s.
        budget: windows that our network is shown in all.
    """

    wide_people: int
    wide: float
    thesis_people: int
    thesis: float
    none: float
    tested_people: int
    tested: float
    hovering_people: int
    budget: int


SIZES = {
    "full": Size(200, 3.0, 80, 1.2, 0.25, 24, 0.25, 20, EVALUATION.windows),
    "quick": Size(24, 0.08, 12, 0.05, 0.25, 8, 0.04, 2, 10_000),
}
VALIDATION_SHARE = 1 / 6
PEERS_CUTS = Cuts(whole=0.3, early=0.2, headless=0.2, spliced=0.15)
"""Of the windows that all are shown but our network, which cuts its own."""


@dataclass(frozen=True)
class Fold:
    """One seed's people.

    Attributes:
        seed: of all of them.
        lesson: what to learn from.
        tests: performances to judge on by name: `calibrated`, `known` (wide population, families
            learned from) and `family <name>` for each family left out.
        none: performances of nothing by kind, of people who are not learned from.
    """

    seed: int
    lesson: Lesson
    tests: dict[str, list[Primitive]]
    none: dict[str, list[Primitive]]

    @property
    def left_out(self) -> tuple[str, ...]:
        """Families that nobody in the training is of."""
        return tuple(name.removeprefix(FAMILY) for name in self.tests if name.startswith(FAMILY))


def _of(
    name: str,
    people: int,
    multiple: float,
    seed: int,
    population: Population,
    none: float = 0.0,
) -> list[Primitive]:
    """A set of people whose names no other set has."""
    counts = counts_of(multiple)
    if none:
        counts[NONE] = round(none * sum(counts.values()))
    made = populate(population, people, counts, seed)
    return [replace(one, operator=f"{name}-{one.operator}") for one in made]


def shown(primitives: Sequence[Primitive], seed: int) -> Windows:
    """Windows of the four primitives: each performance whole, and cut at a random time."""
    examples = examples_of([one for one in primitives if one.label != NONE])
    whole = [track[-WINDOW_SAMPLES:] for track in examples.tracks]
    cut = random_tracks(examples, np.random.default_rng(seed), cuts=PEERS_CUTS)
    return padded([*whole, *cut], np.concatenate([examples.labels, examples.labels]))


def fold(seed: int, size: Size, tell: Callable[[int, int], None]) -> Fold:
    """The fold of a seed; `tell` hears how many of how many sets are made."""
    out = FAMILIES[seed % SEEDS :: SEEDS]
    inside = tuple(family for family in FAMILIES if family not in out)
    wide = Population("wide", inside)
    # The calibrated people's families are among the wide ones: those left out are left out here
    # too, and each is there in four of five seeds, so that all seeds together are as calibrated.
    names = [family.name for family in out]
    kinds = tuple(family for family in THESIS.families if family.name not in names)
    thesis = replace(THESIS, families=kinds)
    part = len(kinds) / len(THESIS.families)
    # A seed for each set: people of different sets are different people.
    seeds = iter(int(s) for s in np.random.SeedSequence((seed, 7)).generate_state(9 + len(out)))
    total = 7 + len(out)
    done = 0

    def made(
        name: str, people: int, multiple: float, population: Population, none: float = 0.0
    ) -> list[Primitive]:
        nonlocal done
        primitives = _of(name, people, multiple, next(seeds), population, none)
        done += 1
        tell(done, total)
        return primitives

    share = VALIDATION_SHARE
    training = made("t", size.wide_people, size.wide, wide, size.none)
    training += made("c", round(size.thesis_people * part), size.thesis * part, thesis)
    validation = made(
        "v", max(8, round(size.wide_people * share)), size.wide * share, wide, size.none
    )
    validation += made(
        "w", round(size.thesis_people * part * share), size.thesis * part * share, thesis
    )
    tests = {CALIBRATED: made("k", round(size.tested_people * part), size.tested * part, thesis)}
    tests[KNOWN] = made("o", size.tested_people, size.tested, wide)
    for family in out:
        tests[FAMILY + family.name] = made(
            "f", size.tested_people // 2, size.tested / 3, Population("wide", (family,))
        )
    own_seeds = np.random.SeedSequence(next(seeds)).generate_state(len(KINDS))
    none = {
        kind: populate(
            Population("wide", FAMILIES, nothing={kind: 1.0}),
            size.tested_people,
            {NONE: max(1, round(kind_share * len(tests[KNOWN])))},
            int(own),
        )
        for (kind, kind_share), own in zip(KINDS.items(), own_seeds, strict=True)
    }
    tell(total, total)
    lesson = Lesson(
        training,
        validation,
        shown(training, seed),
        shown(validation, seed + 1),
        FULL_STICK[PLANT].yaw_radps,
        size.budget,
    )
    return Fold(seed, lesson, tests, none)
