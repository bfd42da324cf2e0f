"""All that an evaluation found, by classifier and seed, and the figures that follow from it."""

import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

from training.evaluation.measures import Estimate, Tally, estimate
from training.evaluation.names import FAMILY, OURS, WHOLE


@dataclass(frozen=True)
class Results:
    """Counts of every classifier and seed.

    Attributes:
        judged: by classifier, then by seed, what `judging.judge` gave.
        human: by data set, then by seed: `ours`, `padded`, `stretched`, `n`.
        not_run: classifiers without results, and why.
        latency: `p50_s`, `p99_s`, `count` of the shipped model; empty if there is none.
        human_not_run: data sets of people without results, and why.
        own_split: F1 of the thesis' machine on its own split of 794 vectors, of several sets.
    """

    judged: dict[str, dict[int, dict[str, Any]]]
    human: dict[str, dict[int, dict[str, float]]]
    not_run: dict[str, str]
    latency: dict[str, float]
    own_split: tuple[float, ...]
    human_not_run: dict[str, str] = field(default_factory=dict)

    @property
    def models(self) -> tuple[str, ...]:
        """Classifiers with results, ours first if it is there."""
        return tuple(self.judged)

    @property
    def peers(self) -> tuple[str, ...]:
        """The others."""
        return tuple(name for name in self.judged if name != OURS)

    @property
    def families(self) -> tuple[str, ...]:
        """Every family that was left out of some seed's training."""
        found: dict[str, None] = {}
        for seeds in self.judged.values():
            for result in seeds.values():
                found |= {name: None for name in result["sets"] if name.startswith(FAMILY)}
        return tuple(name.removeprefix(FAMILY) for name in found)

    def beside(self, peer: str) -> "Results":
        """Ours and one of the others, of the seeds that both have."""
        ours, other = self.judged[OURS], self.judged[peer]
        seeds = [seed for seed in ours if seed in other]
        common = {name: {seed: self.judged[name][seed] for seed in seeds} for name in (OURS, peer)}
        return replace(self, judged=common)

    def titled(self, model: str) -> str:
        """A classifier's name in tables, with its seeds if others have more."""
        seeds, most = len(self.judged[model]), max(map(len, self.judged.values()))
        return model if seeds == most else f"{model} ({seeds} of {most} seeds)"

    def tallies(self, model: str, people: str, moment: str) -> list[Tally]:
        """Counts, one a seed that has this set of people."""
        return [
            Tally.from_json(result["sets"][people][moment])
            for result in self.judged[model].values()
            if people in result["sets"]
        ]

    def f1(self, model: str, people: str, moment: str = "whole") -> Estimate:
        """Weighted F1 over seeds."""
        return estimate(tally.f1 for tally in self.tallies(model, people, moment))

    def of_families(
        self, model: str, moment: str = "whole", of: Callable[[Tally], float] = lambda t: t.f1
    ) -> Estimate:
        """A figure over families left out: each family is one value."""
        return estimate(
            of(tally)
            for family in self.families
            for tally in self.tallies(model, FAMILY + family, moment)
        )

    def pooled(self, model: str, people: str, moments: Sequence[str]) -> Tally:
        """Counts of all sets whose names begin so, at these moments, of all seeds together."""
        return add(
            Tally.from_json(asked[moment])
            for result in self.judged[model].values()
            for name, asked in result["sets"].items()
            if name.startswith(people)
            for moment in moments
        )

    def count(self, people: str) -> int:
        """Performances, in all seeds, that the classifier was judged on that has most of them."""
        return max(
            sum(tally.count for tally in self.tallies(model, people, WHOLE))
            for model in self.models
        )

    def answered(self, people: str, moment: str) -> tuple[Estimate, Estimate]:
        """Of ours, the share of windows that are answered, and of those the share that is right.

        Args:
            people: calibrated ones (over seeds) or families left out (each is one value).
            moment: when.
        """
        counts = [
            asked[moment]
            for result in self.judged[OURS].values()
            for name, asked in result["answered"].items()
            if name.startswith(people)
        ]
        return (
            estimate(some / windows for windows, some, _ in counts),
            estimate(right / some for _, some, right in counts if some),
        )

    def nothing(self, kind: str, moment: str, figure: str) -> Estimate:
        """Of ours, `auroc` or `answered` of a kind of nothing at a moment, over seeds."""
        return self.each(OURS, lambda result: result["none"][kind][moment][figure])

    def each(self, model: str, of: Callable[[dict[str, Any]], float]) -> Estimate:
        """Anything of a classifier's results, over seeds."""
        return estimate(of(result) for result in self.judged[model].values())


def add(tallies: Iterable[Tally]) -> Tally:
    """Counts of all together; at least one."""
    return reduce(operator.add, tallies)


def pooled(result: dict[str, Any], people: Sequence[str], moments: Sequence[str]) -> Tally:
    """Counts of some sets of one seed's result at some moments together."""
    sets = result["sets"]
    return add(Tally.from_json(sets[name][moment]) for name in people for moment in moments)
