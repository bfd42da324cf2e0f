"""What a training run was asked for, and what came of it."""

from dataclasses import dataclass
from pathlib import Path

from training.fit import Budget, Fitted
from training.people import Share
from training.scores import Score


@dataclass(frozen=True)
class Preset:
    """How much to train on.

    Attributes:
        training: people to learn from.
        validation: people to choose and calibrate by.
        test: people to judge on.
        budget: how long.
    """

    training: Share
    validation: Share
    test: Share
    budget: Budget


@dataclass(frozen=True)
class Judged:
    """The model's scores on people of one population, whom it has not learned from.

    Attributes:
        name: of the population.
        whole: at the end of each primitive.
        early: (seconds since the motion began, score).
        calibration: expected calibration error, over the end and all early moments.
        auroc: of `meant`, primitives against none, at the end.
        families: weighted F1 by kind of people, at the end.
    """

    name: str
    whole: Score
    early: tuple[tuple[float, Score], ...]
    calibration: float
    auroc: float
    families: dict[str, float]


@dataclass(frozen=True)
class Run:
    """All that a training run found; the card and the printed table are made of it.

    Attributes:
        preset_name: of the preset.
        preset: how much was trained on.
        seed: of people and weights.
        sizes: performances by set.
        judged: scores by population.
        fitted: the network.
        sha256: of the model file.
        path: of the model file.
        parity: largest difference between the file's answers and torch's.
    """

    preset_name: str
    preset: Preset
    seed: int
    sizes: dict[str, int]
    judged: tuple[Judged, ...]
    fitted: Fitted
    sha256: str
    path: Path
    parity: float
