"""The people that a shipped model learns from, is chosen by, and is judged on; nobody is in two."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from training.dataset.primitive import Primitive
from training.generator.dataset import THESIS, Population, counts_of, populate
from training.generator.people import FAMILIES
from training.labels import NONE

WIDE = Population("wide", FAMILIES)
PART_PEOPLE = 25
"""Made at a time; the same parts whatever the number of processes, so the same people."""

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Share:
    """So many people and performances of both populations.

    Attributes:
        wide_people: of the wide population.
        wide: their primitives as a multiple of the thesis' 2399.
        thesis_people: of the calibrated population.
        thesis: likewise.
        none: performances of nothing, as a share of those of primitives.
    """

    wide_people: int
    wide: float
    thesis_people: int
    thesis: float
    none: float = 0.25

    @property
    def people(self) -> int:
        """Of both."""
        return self.wide_people + self.thesis_people


@dataclass(frozen=True)
class _Part:
    population: Population
    people: int
    counts: dict[str, int]
    seed: int
    name: str


def _made(part: _Part) -> list[Primitive]:
    made = populate(part.population, part.people, part.counts, part.seed)
    return [replace(one, operator=f"{part.name}-{one.operator}") for one in made]


def _parts(
    name: str, population: Population, people: int, multiple: float, none: float, seed: int
) -> list[_Part]:
    if people == 0:
        return []
    count = -(-people // PART_PEOPLE)
    seeds = np.random.SeedSequence(seed).generate_state(count)
    shares = [len(part) for part in np.array_split(np.arange(people), count)]
    parts = []
    for number, (share, own) in enumerate(zip(shares, seeds, strict=True)):
        counts = counts_of(multiple * share / people)
        if none:
            counts[NONE] = max(1, round(none * sum(counts.values())))
        label = f"{name}-{population.name}{number}"
        parts.append(_Part(population, share, counts, int(own), label))
    return parts


def people_of(
    name: str,
    share: Share,
    seed: int,
    processes: int = 1,
    tell: Tell = lambda *_: None,
    wide: Population = WIDE,
) -> list[Primitive]:
    """A set of people, of whom none is in a set of another seed; the name makes no difference.

    Args:
        name: of the set, in the names of its operators.
        share: how many.
        seed: the same seed gives the same set, in any number of processes.
        processes: that make it side by side.
        tell: told the name, how many of how many parts are done.
        wide: the wide population, or some of its families.
    """
    seeds = np.random.SeedSequence(seed).generate_state(2)
    parts = _parts(name, wide, share.wide_people, share.wide, share.none, int(seeds[0]))
    parts += _parts(name, THESIS, share.thesis_people, share.thesis, share.none, int(seeds[1]))
    primitives: list[Primitive] = []
    if processes == 1:
        for done, part in enumerate(parts, 1):
            primitives += _made(part)
            tell(name, done, len(parts))
        return primitives
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done, made in enumerate(pool.map(_made, parts), 1):
            primitives += made
            tell(name, done, len(parts))
    return primitives
