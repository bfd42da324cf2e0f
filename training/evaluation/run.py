"""Runs an evaluation: every classifier and seed, then people, speed and the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from common.clock import Clock, seconds
from services.classifier.config import SHIPPED_MODEL
from services.classifier.model import OnnxModel
from training.evaluation.cache import Cache
from training.evaluation.contenders import contender
from training.evaluation.folds import SEEDS, SIZES, Fold, fingerprint, fold
from training.evaluation.human import HUMAN_SETS, HumanSet, judge_human
from training.evaluation.judging import adapted, judge
from training.evaluation.latency import latency
from training.evaluation.ours import Ours
from training.evaluation.report import write
from training.evaluation.results import Results
from training.evaluation.tables import Table
from training.generator.calibration import machine_f1
from training.generator.dataset import THESIS

ALL_SEEDS = tuple(range(SEEDS))
OWN_SPLITS = {"full": 20, "quick": 1}
"""So many sets of people on whom the thesis' machine does what it did in the thesis."""
LATENCY_WINDOWS = {"full": 5000, "quick": 500}
NOT_RUN = {
    "InceptionTime, LITETime": "aeon's need TensorFlow, and more than the five core-minutes a fold"
    " that all peers share"
}

Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Order:
    """What is to be evaluated.

    Attributes:
        out: folder of results and report.
        seeds: of people and training.
        models: classifiers by name.
        size: of `SIZES`.
        people: whether to train on recordings of real people.
    """

    out: Path
    seeds: tuple[int, ...] = ALL_SEEDS
    models: tuple[str, ...] = ()
    size: str = "full"
    people: bool = True


def _judged(
    order: Order, cache: Cache, clock: Clock, report: Report
) -> tuple[dict[str, dict[int, dict[str, Any]]], dict[str, str]]:
    """Results by classifier and seed, and why some classifiers have none."""
    size = SIZES[order.size]
    mark = fingerprint(size)
    judged: dict[str, dict[int, dict[str, Any]]] = {}
    not_run: dict[str, str] = {}
    for seed in order.seeds:
        made: Fold | None = None
        for name in order.models:
            found = cache.find(mark, name, seed)
            if found is None and name not in not_run:
                try:
                    fresh = contender(name)
                except ModuleNotFoundError as error:
                    not_run[name] = f"{error.name} is not installed"
                    continue
                if made is None:
                    made = fold(seed, size, partial(_seed(report, seed), "people"))
                path = order.out / "models" / f"{name}-{seed}.onnx"
                found = judge(
                    fresh, made, seed, size.hovering_people, clock, path, _seed(report, seed)
                )
                cache.keep(found, mark, name, seed)
                if isinstance(fresh, Ours):
                    report(f"seed {seed}, {name}: adapts", 0, 1)
                    found["adapted"] = adapted(fresh, made, seed)
                    cache.keep(found, mark, name, seed)
            if found is not None:
                judged.setdefault(name, {})[seed] = found
    return judged, not_run


def _seed(report: Report, seed: int) -> Report:
    return lambda text, done, of: report(f"seed {seed}, {text}", done, of)


def _human(
    order: Order, cache: Cache, clock: Clock, report: Report
) -> dict[str, dict[int, dict[str, float]]]:
    """Results by data set and seed."""
    found: dict[str, dict[int, dict[str, float]]] = {}

    def one(human: HumanSet, seed: int) -> dict[str, float]:
        mark = f"{human.steps} {order.size}"
        kept = cache.find(mark, "people", human.name, seed)
        if kept is None:
            steps = human.steps if order.size == "full" else 20
            begin_ns = clock.monotonic_ns()
            kept = judge_human(human, steps, seed, partial(_seed(report, seed), human.name))
            kept["took_s"] = seconds(clock.monotonic_ns() - begin_ns)
            cache.keep(kept, mark, "people", human.name, seed)
        return kept

    for human in HUMAN_SETS:
        found[human.name] = {seed: one(human, seed) for seed in order.seeds}
    return found


def _latency(order: Order, clock: Clock) -> dict[str, float]:
    return vars(latency(OnnxModel(SHIPPED_MODEL), clock, LATENCY_WINDOWS[order.size]))


def evaluate(order: Order, clock: Clock, report: Report) -> Sequence[Table]:
    """Find what is not found yet, write the report, give its tables.

    Args:
        order: what to evaluate.
        clock: to say how long trainings take.
        report: told what is done, and how many steps of how many.

    Raises:
        ValueError: on an unknown classifier.
    """
    cache = Cache(order.out / "results")
    judged, not_run = _judged(order, cache, clock, report)
    human: dict[str, dict[int, dict[str, float]]] = {}
    if order.people:
        try:
            human = _human(order, cache, clock, report)
        except ModuleNotFoundError as error:
            not_run["recordings of people"] = f"{error.name} is not installed"
    own = tuple(machine_f1(THESIS.difficulty, seed) for seed in range(OWN_SPLITS[order.size]))
    results = Results(judged, human, not_run | NOT_RUN, _latency(order, clock), own)
    return write(results, order.out)
