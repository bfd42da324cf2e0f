"""What five performances of each primitive do for one unusual person, and cost everybody else."""

from dataclasses import dataclass

import numpy as np

from training.adaptation import Adaptation
from training.dataset.primitive import Primitive
from training.fit import Fitted
from training.generator.dataset import Population, populate
from training.generator.people import FAMILIES
from training.generator.unusual import unusual
from training.labels import PRIMITIVES
from training.scores import weighted_f1
from training.windows import NONE_INDEX, Examples, examples_of, seen_after

PEOPLE = {"full": (12, 4), "quick": (2, 1)}
"""So many with odd ways and clumsy ones, by size of the evaluation."""
SHOWN, JUDGED = 5, 20
"""Performances of each primitive and person: to learn from, to judge on."""
CLUMSY = Population("clumsy", FAMILIES, difficulty=2.0)
"""People who execute everything twice as badly: noise, of which nothing can be learned."""


@dataclass(frozen=True)
class Adapted:
    """One person's F1 before and after, and everybody else's.

    Attributes:
        kind: `odd` (odd but steady ways) or `clumsy` (ordinary ways, twice the noise).
        operator: who.
        of_use: whether the performances shown were enough to change anything.
        own_before: F1 on the person's other performances.
        own_after: likewise.
        others_before: F1 on other people.
        others_after: likewise.
    """

    kind: str
    operator: str
    of_use: bool
    own_before: float
    own_after: float
    others_before: float
    others_after: float


def f1_of(fitted: Fitted, examples: Examples) -> float:
    """Weighted F1 of primitives at their end."""
    shapes = examples.rows(np.flatnonzero(examples.labels != NONE_INDEX))
    return weighted_f1(shapes.labels, fitted.probabilities(seen_after(shapes, None)).argmax(1))


def adaptation_study(
    fitted: Fitted, replay: Examples, others: Examples, seed: int, odd: int, clumsy: int
) -> tuple[Adapted, ...]:
    """Adapt to each of some people that nobody has learned from; no score chooses them.

    Args:
        fitted: the network to begin with.
        replay: performances of people that it learned from.
        others: people who have been used for nothing yet.
        seed: of the people and of the adaptation.
        odd: how many people with odd ways.
        clumsy: how many twice as clumsy.
    """
    each = SHOWN + JUDGED
    counts = dict.fromkeys(PRIMITIVES, clumsy * each)
    performed = {"odd": unusual(odd, each, seed), "clumsy": populate(CLUMSY, clumsy, counts, seed)}
    adaptation = Adaptation(fitted, replay, seed)
    others_before = f1_of(fitted, others)
    found = []
    for kind, primitives in performed.items():
        for name in dict.fromkeys(one.operator for one in primitives):
            own, test = shown_and_judged([one for one in primitives if one.operator == name])
            learned = adaptation.to(own)
            own_before = f1_of(fitted, test)
            found.append(
                Adapted(
                    kind,
                    name,
                    learned.of_use,
                    own_before,
                    f1_of(learned.fitted, test) if learned.of_use else own_before,
                    others_before,
                    f1_of(learned.fitted, others) if learned.of_use else others_before,
                )
            )
    return tuple(found)


def shown_and_judged(primitives: list[Primitive]) -> tuple[Examples, Examples]:
    """The first `SHOWN` performances of each primitive, and the others."""
    shown, judged = [], []
    for label in PRIMITIVES:
        performed = [one for one in primitives if one.label == label]
        shown += performed[:SHOWN]
        judged += performed[SHOWN:]
    return examples_of(shown), examples_of(judged)
