"""From nothing to a model file: generate people, train, judge on others, export, write the card."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from services.classifier.model import OnnxModel
from training.card import card_of
from training.dataset.primitive import Primitive
from training.export import export
from training.fit import Epoch, Fitted, fit
from training.generator.dataset import THESIS_COUNTS, counts_of, generate
from training.labels import PRIMITIVES
from training.scores import Score, calibration_error, score, weighted_f1
from training.svm import features, fit_svm
from training.windows import Examples, Windows, examples_of, seen_after

MODEL_NAME = "intent"
EARLY_S = (1.0, 1.5, 2.0, 3.0)


@dataclass(frozen=True)
class Preset:
    """How much to train on; sets are multiples of the thesis' 2399 primitives.

    Attributes:
        operators: people to train on; `people` of validation and test are others.
        multiple: of the thesis' counts to train on.
        epochs: at most.
    """

    operators: int
    multiple: float
    epochs: int
    validation_operators: int = 40
    validation_multiple: float = 0.5
    test_operators: int = 50
    test_multiple: float = 1.0


PRESETS = {
    "shipped": Preset(operators=400, multiple=6.0, epochs=45),
    "quick": Preset(
        operators=40,
        multiple=0.4,
        epochs=6,
        validation_operators=10,
        validation_multiple=0.1,
        test_operators=20,
        test_multiple=0.2,
    ),
}


class Progress(Protocol):
    """Where a run tells how far it is."""

    def generating(self, name: str, done: int, total: int) -> None:
        """So many primitives of a set are made."""
        ...

    def batch(self, done: int, total: int) -> None:
        """So many batches of this epoch are done."""
        ...

    def epoch(self, epoch: Epoch, epochs: int) -> None:
        """An epoch is over."""
        ...


@dataclass(frozen=True)
class Judged:
    """One classifier's scores on the people held out.

    Attributes:
        whole: at the end of each primitive.
        early: (seconds since the motion began, score).
        calibration: expected calibration error at the end; None where there are no probabilities.
        families: weighted F1 by kind of people, at the end.
    """

    name: str
    whole: Score
    early: tuple[tuple[float, Score], ...]
    calibration: float | None
    families: dict[str, float]


@dataclass(frozen=True)
class Run:
    """All that a training run found; the card and the printed table are made of it."""

    preset_name: str
    preset: Preset
    seed: int
    judged: tuple[Judged, ...]
    fitted: Fitted
    sha256: str
    path: Path
    parity: float


def _set(
    name: str, operators: int, multiple: float, seed: int, progress: Progress
) -> list[Primitive]:
    wanted = counts_of(multiple)
    total, done = sum(wanted.values()), 0

    def advance(more: int) -> None:
        nonlocal done
        done += more
        progress.generating(name, done, total)

    primitives = generate(operators, wanted, seed, progress=advance)
    progress.generating(name, total, total)
    return primitives


def judge(
    name: str,
    say: Callable[[Windows], np.ndarray],
    examples: Examples,
    families: list[str],
    has_probabilities: bool,
) -> Judged:
    """Score a classifier at the end of each primitive and early in it.

    Args:
        name: in the table.
        say: probabilities (or any scores) (n, classes) of windows.
        examples: of people that it has not seen.
        families: the kind of people of each example.
        has_probabilities: whether `say` gives probabilities.
    """
    classes = len(PRIMITIVES)
    whole_said = say(seen_after(examples, None))
    truth, people = examples.labels, examples.operators
    said = whole_said.argmax(axis=1)
    early = tuple(
        (after, score(truth, say(seen_after(examples, after)).argmax(axis=1), people, classes, 0))
        for after in EARLY_S
    )
    kinds = np.array(families)
    by_family = {
        kind: weighted_f1(truth[kinds == kind], said[kinds == kind])
        for kind in dict.fromkeys(families)
    }
    error = calibration_error(whole_said, truth) if has_probabilities else None
    return Judged(name, score(truth, said, people, classes, 0), early, error, by_family)


def parity(model: OnnxModel, fitted: Fitted, windows: Windows, rows: int = 200) -> float:
    """The largest difference between the file's probabilities and torch's, unpadded rows."""
    import torch

    from training.network import Probabilities

    reference = Probabilities(fitted.network, fitted.temperature).eval()
    largest = 0.0
    for sticks, length in zip(windows.sticks[:rows], windows.lengths[:rows], strict=True):
        window = np.ascontiguousarray(sticks[:length])
        with torch.no_grad():
            wanted = reference(torch.from_numpy(window[None]), torch.tensor([length])).numpy()[0]
        largest = max(largest, float(np.abs(model.probabilities(window) - wanted).max()))
    return largest


def train(preset_name: str, seed: int, out: Path, progress: Progress) -> Run:
    """Train, judge, export to `out`/intent.onnx and write the card `out`/README.md.

    Raises:
        ValueError: on an unknown preset.
    """
    if preset_name not in PRESETS:
        raise ValueError(f"preset {preset_name!r}: use one of {', '.join(PRESETS)}")
    preset = PRESETS[preset_name]
    # A seed for each set: people of different sets are different people.
    seeds = np.random.SeedSequence(seed).generate_state(3)
    training = examples_of(
        _set("training", preset.operators, preset.multiple, int(seeds[0]), progress)
    )
    validation = examples_of(
        _set(
            "validation",
            preset.validation_operators,
            preset.validation_multiple,
            int(seeds[1]),
            progress,
        )
    )
    tested = _set("test", preset.test_operators, preset.test_multiple, int(seeds[2]), progress)
    test = examples_of(tested)

    fitted = fit(
        training,
        validation,
        len(PRIMITIVES),
        preset.epochs,
        seed,
        progress.batch,
        lambda epoch: progress.epoch(epoch, preset.epochs),
    )
    path = out / f"{MODEL_NAME}.onnx"
    sha256 = export(fitted, PRIMITIVES, MODEL_NAME, path)
    model = OnnxModel(path)
    machine = fit_svm(seen_after(_share(training, sum(THESIS_COUNTS.values())), None))
    families = [primitive.family for primitive in tested]
    run = Run(
        preset_name=preset_name,
        preset=preset,
        seed=seed,
        judged=(
            judge("CNN-GRU", lambda w: _batched(model, w), test, families, True),
            judge(
                "SVM (thesis)",
                lambda w: machine.decision_function(features(w)),
                test,
                families,
                False,
            ),
        ),
        fitted=fitted,
        sha256=sha256,
        path=path,
        parity=parity(model, fitted, seen_after(test, None)),
    )
    (out / "README.md").write_text(card_of(run))
    (out / f"{MODEL_NAME}.json").write_text(json.dumps(figures(run), indent=2) + "\n")
    return run


def _share(examples: Examples, count: int) -> Examples:
    """About `count` examples, evenly picked: the SVM gets as many as the thesis has."""
    step = max(1, len(examples.tracks) // count)
    return Examples(examples.tracks[::step], examples.labels[::step], examples.operators[::step])


def _batched(model: OnnxModel, windows: Windows) -> np.ndarray:
    return np.stack(
        [
            model.probabilities(np.ascontiguousarray(sticks[:length]))
            for sticks, length in zip(windows.sticks, windows.lengths, strict=True)
        ]
    )


def figures(run: Run) -> dict[str, object]:
    """The run's figures, for programs."""
    return {
        "preset": run.preset_name,
        "seed": run.seed,
        "sha256": run.sha256,
        "parity": run.parity,
        "classifiers": {
            judged.name: {
                "accuracy": judged.whole.accuracy,
                "f1": judged.whole.f1,
                "f1_interval": judged.whole.interval,
                "confusion": judged.whole.confusion.tolist(),
                "count": judged.whole.count,
                "operators": judged.whole.operators,
                "early_f1": {str(after): s.f1 for after, s in judged.early},
                "calibration_error": judged.calibration,
                "families": judged.families,
            }
            for judged in run.judged
        },
    }
