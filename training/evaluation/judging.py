"""One classifier on one fold: learn, answer every question, give all counts as a JSON map."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.metrics import roc_auc_score

from common.clock import Clock, seconds
from services.classifier.model import OnnxModel
from training.dataset.primitive import Primitive
from training.evaluation.contender import Contender
from training.evaluation.distortions import DISTORTIONS, distorted
from training.evaluation.folds import Fold
from training.evaluation.hover import HOLD_S, bothered
from training.evaluation.measures import tally
from training.evaluation.names import CALIBRATED, KNOWN, MOMENTS, WHOLE
from training.evaluation.ours import Ours
from training.finetune import adaptation_study
from training.generator.dataset import holds
from training.windows import examples_of, seen_after

PERIODS_S = (1.0, 0.1)
"""The shortest and the longest T of the service."""

ADAPTED = 4
"""So many people a seed show five performances of each primitive of their own."""
REPLAYED = 1500
"""So many performances of others are kept in mind meanwhile."""
DISTORTED = 240
"""So many performances are distorted in each way."""

Report = Callable[[str, int, int], None]


def _asked(contender: Contender, primitives: Sequence[Primitive], moment: str) -> dict[str, Any]:
    windows = seen_after(examples_of(primitives), MOMENTS[moment])
    scores = contender.scores(windows)
    return tally(windows.labels, scores, contender.has_probabilities).to_json()


def judge(
    contender: Contender,
    fold: Fold,
    seed: int,
    hovering_people: int,
    clock: Clock,
    model_path: Path,
    report: Report,
) -> dict[str, Any]:
    """Train and ask; the counts of every set of people at every moment.

    Args:
        contender: fresh.
        fold: people.
        seed: of the training.
        hovering_people: how many hold a place for 60 s (our network only).
        clock: to measure how long it takes.
        model_path: where our network is exported to.
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
        result |= _of_ours(contender, fold, seed, hovering_people, model_path)
    report(f"{contender.name}: is asked", total, total)
    return result


def _of_ours(
    ours: Ours, fold: Fold, seed: int, hovering_people: int, model_path: Path
) -> dict[str, Any]:
    """What only a classifier with a rejection can be asked."""
    meant: dict[str, list[float]] = {}
    for moment, after in MOMENTS.items():
        for kind, people in (("four", fold.tests[KNOWN]), ("none", fold.none)):
            found = ours.meant(seen_after(examples_of(people), after)).tolist()
            meant.setdefault(kind, []).extend(found)
            meant[f"{kind} {moment}"] = found
    ours.export(model_path)
    model = OnnxModel(model_path)
    hold_seed = int(np.random.SeedSequence((seed, 9)).generate_state(1)[0])
    held = holds(hovering_people, HOLD_S, hold_seed)
    return {
        "history": [(epoch.training_loss, epoch.validation_loss) for epoch in ours.fitted.history],
        "none": {
            moment: _auroc(meant[f"four{moment}"], meant[f"none{moment}"])
            for moment in ("", *(f" {name}" for name in MOMENTS))
        },
        "hover": {str(period_s): vars(bothered(model, held, period_s)) for period_s in PERIODS_S},
    }


def adapted(ours: Ours, fold: Fold, seed: int) -> list[dict[str, Any]]:
    """What a few performances of their own do for unusual people, and for the others."""
    order = np.random.default_rng(seed).permutation(len(fold.lesson.training))
    replay = [fold.lesson.training[place] for place in order[:REPLAYED]]
    study = adaptation_study(
        ours.fitted,
        examples_of(replay),
        examples_of(fold.tests[KNOWN]),
        seed,
        people=ADAPTED,
        candidates=3 * ADAPTED,
    )
    return [vars(person) for person in study]


def _auroc(four: list[float], none: list[float]) -> dict[str, float]:
    """How well the four are told from nothing: area under the curve, and how many windows."""
    truth = [1] * len(four) + [0] * len(none)
    return {"auroc": float(roc_auc_score(truth, four + none)), "n": len(truth)}
