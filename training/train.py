"""From nothing to a model file: generate people, train, judge on others, export, write the card."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

import numpy as np

from services.classifier.model import OnnxModel
from training.card import card_of
from training.export import export, save
from training.fit import FULL_YAW_RADPS, Budget, Epoch, Fitted, Training
from training.labels import PRIMITIVES
from training.network import VERSION
from training.outcome import Judged, Preset, Run
from training.people import Share, people_of
from training.scores import calibration_error, confidence_bins, none_auroc, score, weighted_f1
from training.windows import MOMENTS_S, NONE_INDEX, Examples, Windows, examples_of, seen_after

MODEL_NAME = "intent"
PARITY_ROWS = 200


PRESETS = {
    "shipped": Preset(
        training=Share(wide_people=600, wide=8.0, thesis_people=250, thesis=4.0),
        validation=Share(wide_people=75, wide=0.7, thesis_people=50, thesis=0.4),
        test=Share(wide_people=100, wide=1.0, thesis_people=50, thesis=1.0),
        budget=Budget(windows=2_000_000),
    ),
    "quick": Preset(
        training=Share(wide_people=24, wide=0.4, thesis_people=10, thesis=0.2),
        validation=Share(wide_people=12, wide=0.1, thesis_people=5, thesis=0.05),
        test=Share(wide_people=12, wide=0.15, thesis_people=10, thesis=0.15),
        budget=Budget(windows=12_000),
    ),
}


class Progress(Protocol):
    """Where a run tells how far it is."""

    def generating(self, name: str, done: int, total: int) -> None:
        """So many parts of a set are made."""
        ...

    def batch(self, done: int, total: int) -> None:
        """So many batches of this epoch are done."""
        ...

    def epoch(self, epoch: Epoch, epochs: int) -> None:
        """An epoch is over."""
        ...


def answers_of(model: OnnxModel, windows: Windows) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (n, 4) and meant (n,) of windows by a model file, one window at a time."""
    yaw = np.full(1, FULL_YAW_RADPS, dtype=np.float32)
    rows = [
        model.answers(
            np.ascontiguousarray(sticks[None, :length]), np.array([length], dtype=np.int64), yaw
        )
        for sticks, length in zip(windows.sticks, windows.lengths, strict=True)
    ]
    return np.concatenate([p for p, _ in rows]), np.concatenate([m for _, m in rows])


def judge(name: str, model: OnnxModel, examples: Examples) -> Judged:
    """Score a model file at the end of each primitive and early in it.

    Args:
        name: of the population.
        model: the file.
        examples: of people that it has not learned from, `none` among them.
    """
    is_meant = examples.labels != NONE_INDEX
    shapes = examples.rows(np.flatnonzero(is_meant))
    whole, meant = answers_of(model, seen_after(examples, None))
    truth, people = shapes.labels, shapes.operators
    said = whole[is_meant].argmax(axis=1)
    classes = len(PRIMITIVES)
    early, answers = [], [whole[is_meant]]
    for after_s in MOMENTS_S:
        then = answers_of(model, seen_after(shapes, after_s))[0]
        early.append((after_s, score(truth, then.argmax(axis=1), people, classes, 0)))
        answers.append(then)
    bins = confidence_bins(np.concatenate(answers), np.tile(truth, len(answers)))
    return Judged(
        name,
        score(truth, said, people, classes, 0),
        tuple(early),
        calibration_error(bins),
        none_auroc(meant, is_meant),
        {
            str(kind): weighted_f1(truth[shapes.families == kind], said[shapes.families == kind])
            for kind in dict.fromkeys(shapes.families.tolist())
        },
    )


def parity(model: OnnxModel, fitted: Fitted, windows: Windows) -> float:
    """The largest difference between the file's answers and torch's."""
    some = Windows(
        windows.sticks[:PARITY_ROWS],
        windows.times_s[:PARITY_ROWS],
        windows.lengths[:PARITY_ROWS],
        windows.labels[:PARITY_ROWS],
    )
    given, wanted = answers_of(model, some), fitted.answers(some)
    return max(float(np.abs(a - b).max()) for a, b in zip(given, wanted, strict=True))


def train(
    preset_name: str,
    seed: int,
    out: Path,
    progress: Progress,
    *,
    resume: bool = False,
    processes: int = 1,
) -> Run:
    """Train, judge, export to `out`/intent.onnx and write the card `out`/README.md.

    After each epoch all that is needed to go on is written to `out`/intent.checkpoint.

    Args:
        preset_name: a key of `PRESETS`.
        seed: the same seed and machine give the same file.
        out: folder.
        progress: told how far it is.
        resume: go on with a run of the same preset, seed and people that was stopped.
        processes: that make the people side by side.

    Raises:
        ValueError: on an unknown preset.
        OSError: if there is nothing to resume, or it is of another run.
    """
    if preset_name not in PRESETS:
        raise ValueError(f"preset {preset_name!r}: use one of {', '.join(PRESETS)}")
    preset = PRESETS[preset_name]
    checkpoint = out / f"{MODEL_NAME}.checkpoint"
    if resume and not checkpoint.exists():
        raise OSError(f"--resume: there is no {checkpoint}; run without it to begin anew")
    seeds = [int(state) for state in np.random.SeedSequence(seed).generate_state(3)]

    def people(name: str, share: Share, number: int) -> Examples:
        made = people_of(name, share, seeds[number], processes, progress.generating)
        return examples_of(made)

    training = people("training", preset.training, 0)
    validation = people("validation", preset.validation, 1)
    learned = f"people {digest(training, validation)}, network {VERSION}"
    name = f"{preset_name}, {preset.budget.windows} windows, seed {seed}, {learned}"
    run = Training(training, validation, seed, preset.budget, name=name)
    if resume:
        run.resume(checkpoint)
    out.mkdir(parents=True, exist_ok=True)
    while not run.is_over:
        progress.epoch(run.epoch(progress.batch), run.epochs)
        run.save(checkpoint)
    fitted = run.fitted()
    path = out / f"{MODEL_NAME}.onnx"
    sha256 = export(fitted, PRIMITIVES, MODEL_NAME, path)
    save(fitted, path.with_suffix(".pt"))
    model = OnnxModel(path)

    test = people("test", preset.test, 2)
    is_wide = np.char.find(test.operators, "test-wide") == 0
    sets = {
        "calibrated": test.rows(np.flatnonzero(~is_wide)),
        "wide": test.rows(np.flatnonzero(is_wide)),
    }
    done = Run(
        preset_name=preset_name,
        preset=preset,
        seed=seed,
        sizes={"training": len(training), "validation": len(validation), "test": len(test)},
        judged=tuple(judge(name, model, one) for name, one in sets.items()),
        fitted=fitted,
        sha256=sha256,
        path=path,
        parity=parity(model, fitted, seen_after(test, None)),
    )
    (out / "README.md").write_text(card_of(done))
    (out / f"{MODEL_NAME}.json").write_text(json.dumps(figures(done), indent=1) + "\n")
    checkpoint.unlink()
    return done


def digest(*sets: Examples) -> str:
    """What sticks and labels come to, in 8 hex digits: people made by other code are others."""
    told = hashlib.sha256()
    for examples in sets:
        told.update(examples.labels.tobytes())
        for track in examples.tracks:
            told.update(track.tobytes())
    return told.hexdigest()[:8]


def figures(run: Run) -> dict[str, object]:
    """The run's figures, for programs."""
    return {
        "preset": run.preset_name,
        "seed": run.seed,
        "sha256": run.sha256,
        "parity": run.parity,
        "confidence_min": run.fitted.confidence_min,
        "sets": {
            judged.name: {
                "accuracy": judged.whole.accuracy,
                "f1": judged.whole.f1,
                "f1_interval": judged.whole.interval,
                "confusion": judged.whole.confusion.tolist(),
                "count": judged.whole.count,
                "operators": judged.whole.operators,
                "early_f1": {str(after): s.f1 for after, s in judged.early},
                "calibration_error": judged.calibration,
                "none_auroc": judged.auroc,
                "families": judged.families,
            }
            for judged in run.judged
        },
        "history": [asdict(epoch) for epoch in run.fitted.history],
    }
