"""What a kept result follows from: people, windows and code. With another mark it is found anew."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from common.clock import ManualClock
from training.dataset.primitive import Primitive
from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.contenders import CODE
from training.evaluation.folds import Fold, Size, shown
from training.evaluation.human_trunk import WIDTH
from training.evaluation.judging import DISTORTED, judge
from training.evaluation.names import CALIBRATED, FAMILY, KNOWN, OURS
from training.evaluation.sources import code_of
from training.generator.dataset import THESIS, Population, counts_of, holds, populate
from training.generator.people import FAMILIES
from training.labels import NONE
from training.network import Trunk
from training.windows import Windows, examples_of, seen_after

QUESTIONS = ("training/evaluation/folds.py", "training/evaluation/distortions.py")
"""What every classifier is asked."""
FIRST_ANSWERS = "247a6e2b3200210d"
"""What the questions came to when marks began to tell it. Results from before are of these."""


class Marks:
    """The marks of one size of evaluation.

    People and windows are known by what they come to, not by how they are written: some are made,
    and their numbers are hashed. Source files are read at once: an evaluation takes hours, and they
    may be edited meanwhile.

    Args:
        size: of the folds.
    """

    def __init__(self, size: Size) -> None:
        made = [
            one
            for population in (THESIS, Population("wide", FAMILIES))
            for one in populate(
                population, len(population.families), {**counts_of(0.01), NONE: 6}, 0
            )
        ]
        # How long our network learns is its own affair.
        people = hashlib.sha256(repr(replace(size, budget=0)).encode())
        for one in made:
            people.update(one.family.encode() + one.times_s.tobytes() + one.sticks.tobytes())
        self._people = people.hexdigest()[:16]
        examples = examples_of([one for one in made if one.label != NONE])
        windows = hashlib.sha256()
        for drawn in (seen_after(examples, 1.0), seen_after(examples, None), shown(made, 0)):
            windows.update(drawn.sticks.tobytes() + drawn.lengths.tobytes())
        self._windows = windows.hexdigest()[:16]
        self._asked = code_of(*QUESTIONS)
        answers = _answers([one for one in made if one.label != NONE])
        self._answers = "" if answers == FIRST_ANSWERS else f" {answers}"
        self._budget = size.budget
        self._code = {name: code_of(*paths) for name, paths in CODE.items()}
        self._hover = code_of(
            "training/evaluation/hover.py",
            "training/evaluation/judging.py",
            "services/classifier/*.py",
            "services/synthesis/**/*.py",
        )
        self._adaptation = code_of(
            "training/adaptation.py",
            "training/evaluation/judging.py",
            "training/evaluation/unusual.py",
            "training/generator/*.py",
        )

    def classifier(self, name: str) -> str:
        """Of what a classifier answers."""
        budget = f" {self._budget}" if name == OURS else ""
        seen = f"{self._people} {self._windows} {self._asked}"
        return f"{seen} {self._code[name]}{budget}{self._answers}"

    def hover(self) -> str:
        """Of what our network suggests to who only holds a place."""
        held = hashlib.sha256()
        for hold, places in holds(2, 3.0, 0):
            held.update(hold.sticks.tobytes() + places.tobytes())
        return f"{self.classifier(OURS)} {held.hexdigest()[:16]} {self._hover}"

    def adaptation(self) -> str:
        """Of what a few performances of their own do for unusual people."""
        return f"{self.classifier(OURS)} {self._adaptation}"

    def machine(self) -> str:
        """Of the thesis' machine on its own task."""
        code = code_of("training/svm.py", "training/generator/calibration.py")
        return f"{self._people} {code}"


class _Anybody:
    """A classifier whose answers follow from the sticks alone."""

    name = "anybody"
    has_probabilities = True

    def fit(self, _lesson: Lesson, _seed: int, _tell: Tell) -> None:
        """There is nothing to learn."""

    def scores(self, windows: Windows) -> Scores:
        """Each stick stands for a primitive."""
        pushed = np.abs(windows.sticks.astype(np.float64)).sum(axis=1) + 1e-3
        return np.asarray(pushed / pushed.sum(axis=1, keepdims=True))


def _answers(primitives: Sequence[Primitive]) -> str:
    """What the counts of a made-up classifier come to: they change with what is asked and counted.

    So moments, samples of people and the counting itself are told without their source files.
    """
    # More than are distorted, so that it matters how many are.
    many = [primitives[k % len(primitives)] for k in range(DISTORTED + len(primitives))]
    tests = {CALIBRATED: many, KNOWN: [*primitives], FAMILY: [*primitives]}
    windows = shown(primitives, 0)
    lesson = Lesson([], [], windows, windows, 1.0, 0)
    found = judge(_Anybody(), Fold(0, lesson, tests, {}), 0, ManualClock(), lambda *_: None)
    del found["fit_s"]
    return hashlib.sha256(json.dumps(found).encode()).hexdigest()[:16]


def of_recordings() -> str:
    """The mark of trainings on recordings of people: their code, and what the trunk computes."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        trunk = Trunk(3, 4, WIDTH)
        said = trunk(torch.randn(4, 3, 100), torch.ones(4, 1, 100))
    told = np.round(said.detach().numpy(), 3).tobytes()
    code = code_of("training/evaluation/human*.py")
    return f"{code} {hashlib.sha256(told).hexdigest()[:16]}"
