"""Runs an evaluation: every classifier and seed, then people, speed and the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import torch

from common.clock import Clock, seconds
from services.classifier.config import SHIPPED_MODEL
from services.classifier.model import OnnxModel
from training.evaluation.cache import Cache
from training.evaluation.contenders import CONTENDERS, contender
from training.evaluation.folds import SEEDS, SIZES, Fold, fold
from training.evaluation.human import HUMAN_SETS, HumanSet, judge_human
from training.evaluation.human_trunk import STEPS
from training.evaluation.judging import adapted, hovered, judge
from training.evaluation.latency import latency
from training.evaluation.marks import Marks, of_recordings
from training.evaluation.names import OURS
from training.evaluation.ours import Ours
from training.evaluation.report import write
from training.evaluation.results import Results
from training.evaluation.tables import Table
from training.evaluation.unusual import PEOPLE
from training.fit import THREADS
from training.generator.calibration import machine_f1
from training.generator.dataset import THESIS

ALL_SEEDS = tuple(range(SEEDS))
OWN_SPLITS = {"full": 20, "quick": 1}
"""So many sets of people on whom the thesis' machine does what it did in the thesis."""
LATENCY_WINDOWS = {"full": 5000, "quick": 500}
HOVER, ADAPTATION = "hover", "adapted"
"""What is asked of our network besides, and kept by itself."""

Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Order:
    """What is to be evaluated.

    Attributes:
        out: folder of results and report; of another size than full a folder in it, so that a
            quick run writes over nothing that took hours.
        seeds: of people and training.
        models: classifiers by name; of none, only what is there is reported.
        size: of `SIZES`.
        people: whether to train on recordings of real people.
        page: of docs, whose tables and figures are renewed too.
    """

    out: Path
    seeds: tuple[int, ...] = ALL_SEEDS
    models: tuple[str, ...] = CONTENDERS
    size: str = "full"
    people: bool = True
    page: Path | None = None

    @property
    def folder(self) -> Path:
        """Where everything goes."""
        return self.out if self.size == "full" else self.out / self.size


class Evaluation:
    """Finds what is ordered and not found yet; each result is kept as soon as it is there.

    Args:
        order: what to evaluate.
        clock: to say how long trainings take.
        report: told what is done, and how many steps of how many.
    """

    def __init__(self, order: Order, clock: Clock, report: Report) -> None:
        self._order, self._clock, self._report = order, clock, report
        self._size = SIZES[order.size]
        self._cache = Cache(order.folder / "results")
        self._models = order.folder / "models"
        self._not_run: dict[str, str] = {}
        self._marks = Marks(self._size)
        self._recordings = f"{of_recordings()} {order.size}"

    def find(self) -> None:
        """Train and ask whatever is ordered and not kept."""
        # Set here, so that a classifier learns the same alone and after others.
        torch.set_num_threads(THREADS)
        torch.use_deterministic_algorithms(True)
        for seed in self._order.seeds:
            self._seed(seed)
        if not self._order.people:
            return
        for human in HUMAN_SETS:
            try:
                for seed in self._order.seeds:
                    self._person(human, seed)
            except ModuleNotFoundError as error:
                self._not_run[human.name] = why_not(error)

    def results(self) -> Results:
        """All that is kept and not stale, of whatever run it is."""
        judged: dict[str, dict[int, dict[str, Any]]] = {}
        for name in CONTENDERS:
            for seed in ALL_SEEDS:
                found = self._kept(name, seed)
                if found is not None:
                    judged.setdefault(name, {})[seed] = found
        human: dict[str, dict[int, dict[str, float]]] = {}
        for one in HUMAN_SETS:
            for seed in ALL_SEEDS:
                said = self._cache.find(self._recordings, "people", one.name, seed)
                if said is not None:
                    human.setdefault(one.name, {})[seed] = said
        missing = {name: "not asked for yet" for name in CONTENDERS if name not in judged}
        not_run = {name: self._not_run.get(name, why) for name, why in missing.items()}
        count = LATENCY_WINDOWS[self._order.size]
        fast = vars(latency(OnnxModel(SHIPPED_MODEL), self._clock, count))
        lacking = {name: why for name, why in self._not_run.items() if name not in CONTENDERS}
        return Results(judged, human, not_run, fast, self._own_split(), lacking)

    def _seed(self, seed: int) -> None:
        """All classifiers that are ordered on one fold, which is made only if it is wanted."""
        tell = self._telling(seed)
        made: Fold | None = None

        def people() -> Fold:
            nonlocal made
            if made is None:
                made = fold(seed, self._size, partial(tell, "people"))
            return made

        for name in self._order.models:
            mark = self._marks.classifier(name)
            is_kept = self._cache.find(mark, name, seed) is not None
            if name in self._not_run or (is_kept and name != OURS):
                continue
            try:
                fresh = contender(name)
            except ModuleNotFoundError as error:
                self._not_run[name] = why_not(error)
                continue
            path = self._models / f"{name}-{seed}.onnx"
            if isinstance(fresh, Ours) and is_kept:
                # Its other questions are asked of the weights.
                is_kept = _loaded(fresh, path)
            if not is_kept:
                found = judge(fresh, people(), seed, self._clock, tell)
                if isinstance(fresh, Ours):
                    fresh.save(path)
                self._cache.keep(found, mark, name, seed)
            if isinstance(fresh, Ours):
                self._besides(fresh, path, seed, people)

    def _besides(self, ours: Ours, path: Path, seed: int, people: Callable[[], Fold]) -> None:
        """What is asked of our network only, and may become stale by itself."""
        tell = self._telling(seed)
        hover, adaptation = self._marks.hover(), self._marks.adaptation()
        if self._cache.find(hover, OURS, HOVER, seed) is None:
            tell(f"{OURS}: hovers", 0, 1)
            held = hovered(path, seed, self._size.hovering_people)
            self._cache.keep(held, hover, OURS, HOVER, seed)
        if self._cache.find(adaptation, OURS, ADAPTATION, seed) is None:
            tell(f"{OURS}: adapts", 0, 1)
            study = adapted(ours, people(), seed, *PEOPLE[self._order.size])
            self._cache.keep(study, adaptation, OURS, ADAPTATION, seed)

    def _kept(self, name: str, seed: int) -> dict[str, Any] | None:
        """All that is known of a classifier and seed."""
        found: dict[str, Any] | None = self._cache.find(self._marks.classifier(name), name, seed)
        if found is None or name != OURS:
            return found
        for part, mark in ((HOVER, self._marks.hover()), (ADAPTATION, self._marks.adaptation())):
            besides = self._cache.find(mark, OURS, part, seed)
            if besides is not None:
                found[part] = besides
        return found

    def _person(self, human: HumanSet, seed: int) -> None:
        """One set of recordings and one seed."""
        if self._cache.find(self._recordings, "people", human.name, seed) is not None:
            return
        # MiniRocket comes last and would be missed only after minutes of training.
        import_module("aeon")
        steps = STEPS if self._order.size == "full" else 20
        begin_ns = self._clock.monotonic_ns()
        found = judge_human(human, steps, seed, partial(self._telling(seed), human.name))
        found["took_s"] = seconds(self._clock.monotonic_ns() - begin_ns)
        self._cache.keep(found, self._recordings, "people", human.name, seed)

    def _own_split(self) -> tuple[float, ...]:
        """F1 of the thesis' machine on its own task, of several sets of people."""
        mark, name = self._marks.machine(), "thesis-machine"
        found: list[float] = self._cache.find(mark, name) or []
        wanted = OWN_SPLITS[self._order.size]
        if self._order.models:
            for seed in range(len(found), wanted):
                self._report("the thesis' machine on its own task", seed, wanted)
                found.append(machine_f1(THESIS.difficulty, seed))
                self._cache.keep(found, mark, name)
        return tuple(found)

    def _telling(self, seed: int) -> Report:
        return lambda text, done, of: self._report(f"seed {seed}, {text}", done, of)


def why_not(error: ModuleNotFoundError) -> str:
    """What is missing and how to get it."""
    how = "pip install tensorflow-cpu" if error.name == "tensorflow" else "make evaluate"
    return f"{error.name} is not installed; {how} installs it"


def _loaded(ours: Ours, path: Path) -> bool:
    """Whether a network's weights are there."""
    try:
        ours.load(path)
    except OSError:
        return False
    return path.exists()


def evaluate(order: Order, clock: Clock, report: Report) -> Sequence[Table]:
    """Find what is not found yet, write the report of all there is, give its tables.

    Args:
        order: what to evaluate.
        clock: to say how long trainings take.
        report: told what is done, and how many steps of how many.

    Raises:
        ValueError: on an unknown classifier, or a page without a place for the report.
    """
    evaluation = Evaluation(order, clock, report)
    evaluation.find()
    return write(evaluation.results(), order.folder, order.page)
