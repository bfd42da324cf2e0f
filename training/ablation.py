"""What each idea in the network is worth: one change each, all else alike.

Two families are in nobody's training.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import mean

import numpy as np

from training.fit import Budget, Training
from training.generator.dataset import Population
from training.generator.people import FAMILIES
from training.network import Architecture
from training.people import Share, Tell, people_of
from training.scores import weighted_f1
from training.windows import Examples, examples_of, seen_after

LEFT_OUT = ("novice", "pilot-both")
SEEDS = (0, 1)
PEOPLE_SEED = 30_000
BUDGET = Budget(windows=40_000)
TRAINING = Share(wide_people=120, wide=1.2, thesis_people=40, thesis=0.5)
VALIDATION = Share(wide_people=40, wide=0.2, thesis_people=20, thesis=0.1)
TEST = Share(wide_people=60, wide=0.4, thesis_people=40, thesis=0.4, none=0.0)
STRANGERS = Share(wide_people=40, wide=0.4, thesis_people=0, thesis=0.0, none=0.0)
MOMENTS_S = (1.0, 2.0, None)
COLUMNS: tuple[tuple[str, str, float | None], ...] = (
    ("calibrated, end", "calibrated", None),
    ("wide, end", "wide", None),
    ("left out, end", "left out", None),
    ("calibrated, 1 s", "calibrated", 1.0),
    ("calibrated, 2 s", "calibrated", 2.0),
    ("left out, 2 s", "left out", 2.0),
)


@dataclass(frozen=True)
class Variant:
    """One change.

    Attributes:
        name: in the table.
        architecture: of the network.
        cuts: whether it is trained on windows cut at random times.
        augment: whether they are spliced, mirrored and scaled.
    """

    name: str
    architecture: Architecture = field(default_factory=Architecture)
    cuts: bool = True
    augment: bool = True


HALF = Architecture(width=Architecture.width // 2, summary=Architecture.summary // 2)
VARIANTS = (
    Variant("as shipped"),
    Variant("no features of the whole window", Architecture(summary=0)),
    Variant("convolutions see sticks, no geometry", Architecture(geometry=False)),
    Variant("neither: sticks alone", Architecture(summary=0, geometry=False)),
    Variant("no convolutions and GRUs", Architecture(width=0)),
    Variant("one softmax, no decisions", Architecture(decisions=False)),
    Variant("last state only, no pooling", Architecture(pooling=("last",))),
    Variant("half the width", HALF),
    Variant("GRUs see twice the steps", Architecture(strides=(2, 2, 2, 1))),
    Variant("no noise on the features", Architecture(noise=0.0)),
    Variant("series are never absent", Architecture(absent=0.0)),
    Variant("whole primitives only, no cuts", cuts=False),
    Variant("no splices, mirrors and scales", augment=False),
)


@dataclass(frozen=True)
class Row:
    """A variant's figures, each by seed.

    Attributes:
        name: of the variant.
        parameters: of its network.
        f1: by set of people and moment.
    """

    name: str
    parameters: int
    f1: dict[tuple[str, float | None], list[float]]


def sets_of(tell: Tell) -> dict[str, Examples]:
    """The people to learn from, to choose by, and three sets to judge on."""
    known = Population("wide", tuple(f for f in FAMILIES if f.name not in LEFT_OUT))
    strange = Population("wide", tuple(f for f in FAMILIES if f.name in LEFT_OUT))
    seeds = [int(s) for s in np.random.SeedSequence(PEOPLE_SEED).generate_state(4)]

    def examples(name: str, share: Share, number: int, wide: Population) -> Examples:
        return examples_of(people_of(name, share, seeds[number], tell=tell, wide=wide))

    test = examples("test", TEST, 2, known)
    is_wide = np.char.find(test.operators, "test-wide") == 0
    return {
        "training": examples("training", TRAINING, 0, known),
        "validation": examples("validation", VALIDATION, 1, known),
        "calibrated": test.rows(np.flatnonzero(~is_wide)),
        "wide": test.rows(np.flatnonzero(is_wide)),
        "left out": examples("left out", STRANGERS, 3, strange),
    }


def ablate(
    sets: dict[str, Examples],
    tell: Tell,
    variants: tuple[Variant, ...] = VARIANTS,
    seeds: tuple[int, ...] = SEEDS,
    budget: Budget = BUDGET,
) -> Iterator[Row]:
    """Trains and judges each variant; gives its figures as soon as they are there.

    Args:
        sets: of `sets_of`.
        tell: told how many of how many trainings are done.
        variants: to compare.
        seeds: each variant is trained with each.
        budget: the same for each.
    """
    training, validation = sets["training"], sets["validation"]
    judged = {name: sets[name] for name in ("calibrated", "wide", "left out")}
    done = 0
    for variant in variants:
        found: dict[tuple[str, float | None], list[float]] = {}
        parameters = 0
        for seed in seeds:
            run = Training(
                training,
                validation,
                seed,
                budget,
                variant.architecture,
                cuts=variant.cuts,
                augment=variant.augment,
            )
            while not run.is_over:
                run.epoch()
            fitted = run.fitted()
            parameters = sum(weights.numel() for weights in fitted.network.parameters())
            for name, examples in judged.items():
                for after_s in MOMENTS_S:
                    windows = seen_after(examples, after_s)
                    said = fitted.probabilities(windows).argmax(1)
                    f1 = weighted_f1(windows.labels, said)
                    found.setdefault((name, after_s), []).append(f1)
            done += 1
            tell("variants", done, len(variants) * len(seeds))
        yield Row(variant.name, parameters, found)


def table_of(rows: Sequence[Row]) -> str:
    """The figures as Markdown: each mean over seeds, and how far seeds are apart."""
    heads = " | ".join(head for head, _, _ in COLUMNS)
    lines = [f"| variant | parameters | {heads} |", "|---" * (2 + len(COLUMNS)) + "|"]
    for row in rows:
        cells = []
        for _, people, after_s in COLUMNS:
            values = row.f1[people, after_s]
            cells.append(f"{mean(values):.3f} ± {(max(values) - min(values)) / 2.0:.3f}")
        lines.append(f"| {row.name} | {row.parameters} | {' | '.join(cells)} |")
    return "\n".join(lines)


def page_of(rows: Sequence[Row], counts: dict[str, int]) -> str:
    """docs/ablation.md."""
    return f"""# What each idea in the network is worth

Written by `autocomplete train --ablation`. Each row changes one thing, is trained on the same
{counts["training"]} performances for the same {BUDGET.windows} windows (the shipped model sees more
of both) with seeds {", ".join(map(str, SEEDS))}, and is judged on the same people, whom none has
seen: {counts["calibrated"]} primitives of the calibrated population, {counts["wide"]} of the wide
one, and {counts["left out"]} of two families in nobody's training ({", ".join(LEFT_OUT)}).
Figures are weighted F1, mean over seeds ± half of what is between them.

{table_of(rows)}
"""
