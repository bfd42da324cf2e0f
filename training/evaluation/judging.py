"""One classifier on one fold: learn, answer every question, give all counts as a JSON map."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from common.clock import Clock, seconds
from services.classifier.model import OnnxModel
from training.dataset.primitive import Primitive
from training.evaluation.contender import Contender
from training.evaluation.distortions import DISTORTIONS, distorted
from training.evaluation.folds import Fold
from training.evaluation.hover import HOLD_S, LEAD_S, bothered
from training.evaluation.measures import tally
from training.evaluation.names import CALIBRATED, KNOWN, MOMENTS, WHOLE
from training.evaluation.ours import Ours
from training.evaluation.rejection import rejection
from training.evaluation.unusual import adaptation_study
from training.generator.dataset import holds
from training.windows import examples_of, seen_after

PERIODS_S = (1.0, 0.1)
"""The longest and the shortest T of the service."""

REPLAYED = 3000
"""So many performances of others are kept in mind meanwhile."""
DISTORTED = 240
"""So many performances are distorted in each way."""

Report = Callable[[str, int, int], None]


def _asked(contender: Contender, primitives: Sequence[Primitive], moment: str) -> dict[str, Any]:
    windows = seen_after(examples_of(primitives), MOMENTS[moment])
    scores = contender.scores(windows)
    return tally(windows.labels, scores, contender.has_probabilities).to_json()


def judge(
    contender: Contender, fold: Fold, seed: int, clock: Clock, report: Report
) -> dict[str, Any]:
    """Train and ask; the counts of every set of people at every moment.

    Args:
        contender: fresh.
        fold: people.
        seed: of the training.
        clock: to measure how long it takes.
        report: told what is done, and how many steps of how many.
    """
    begin_ns = clock.monotonic_ns()
    contender.fit(fold.lesson, seed, lambda done, of: report(f"{contender.name}: learns", done, of))
    result: dict[str, Any] = {"fit_s": seconds(clock.monotonic_ns() - begin_ns), "sets": {}}
    # People of families that are known are asked at the end only: others say more.
    questions = [
        (name, moment)
        for name in fold.tests
        for moment in MOMENTS
        if name != KNOWN or moment == WHOLE
    ]
    total = len(questions) + len(DISTORTIONS)
    for done, (name, moment) in enumerate(questions):
        report(f"{contender.name}: is asked", done, total)
        found = _asked(contender, fold.tests[name], moment)
        result["sets"].setdefault(name, {})[moment] = found
    result["distorted"] = {}
    order = np.random.default_rng(seed).permutation(len(fold.tests[CALIBRATED]))
    some = [fold.tests[CALIBRATED][place] for place in order[:DISTORTED]]
    for done, name in enumerate(DISTORTIONS):
        report(f"{contender.name}: is asked", len(questions) + done, total)
        changed = distorted(some, name, seed)
        result["distorted"][name] = _asked(contender, changed, WHOLE)
    history = getattr(contender, "history", None)
    if history:
        result["history"] = history
    if isinstance(contender, Ours):
        epochs = contender.fitted.history
        result["history"] = [(epoch.training_loss, epoch.validation_loss) for epoch in epochs]
        result |= rejection(contender, fold)
    report(f"{contender.name}: is asked", total, total)
    return result


def hovered(model_path: Path, seed: int, people: int) -> dict[str, Any]:
    """What people who only hold a place are bothered with, by period T in s."""
    model = OnnxModel(model_path)
    hold_seed = int(np.random.SeedSequence((seed, 9)).generate_state(1)[0])
    held = holds(people, LEAD_S + HOLD_S, hold_seed)
    return {str(period_s): vars(bothered(model, held, period_s)) for period_s in PERIODS_S}


def adapted(ours: Ours, fold: Fold, seed: int, odd: int, clumsy: int) -> list[dict[str, Any]]:
    """What a few performances of their own do for people with odd ways and for clumsy ones."""
    order = np.random.default_rng(seed).permutation(len(fold.lesson.training))
    replay = [fold.lesson.training[place] for place in order[:REPLAYED]]
    study = adaptation_study(
        ours.fitted,
        examples_of(replay),
        examples_of(fold.tests[KNOWN]),
        seed,
        odd,
        clumsy,
    )
    return [vars(person) for person in study]
