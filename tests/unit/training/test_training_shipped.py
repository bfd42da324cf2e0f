"""The model in models/ is what its card, its figures and its weights say it is."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from services.classifier.model import OnnxModel
from training.export import export, load
from training.fit import FULL_YAW_RADPS, Fitted
from training.generator.dataset import generate
from training.labels import NONE, PRIMITIVES
from training.windows import examples_of, padded

MODELS = Path(__file__).parents[3] / "models"


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return load(MODELS / "intent.pt")


def test_the_card_and_the_figures_are_of_this_file() -> None:
    sha256 = hashlib.sha256((MODELS / "intent.onnx").read_bytes()).hexdigest()
    figures = json.loads((MODELS / "intent.json").read_text())
    assert figures["sha256"] == sha256
    card = (MODELS / "README.md").read_text()
    assert sha256 in card
    for judged in figures["sets"].values():
        assert f"{judged['f1']:.3f}" in card
    assert [epoch["number"] for epoch in figures["history"]] == list(
        range(1, len(figures["history"]) + 1)
    )


def test_the_file_says_what_its_weights_say_at_every_length(fitted: Fitted) -> None:
    """On what simulated people do, with the label of the same primitive."""
    model = OnnxModel(MODELS / "intent.onnx")
    performed = generate(12, dict.fromkeys((*PRIMITIVES, NONE), 24), seed=11)
    tracks = examples_of(performed).tracks
    said = set()
    for length in range(20, 401):
        long_enough = [track for track in tracks if len(track) >= length] or [
            np.tile(tracks[0], (length // len(tracks[0]) + 1, 1))
        ]
        sticks = np.ascontiguousarray(long_enough[length % len(long_enough)][:length])
        probabilities, meant = fitted.answers(padded([sticks], np.zeros(1, dtype=np.int64)))
        answer = model.answer(sticks, FULL_YAW_RADPS)
        assert answer.probabilities == pytest.approx(probabilities[0], abs=1e-5), length
        assert answer.meant == pytest.approx(meant[0], abs=1e-5), length
        assert answer.probabilities.argmax() == probabilities[0].argmax(), length
        said.add(int(probabilities[0].argmax()))
    assert said == set(range(len(PRIMITIVES)))


def test_the_threshold_in_the_file_is_the_one_that_was_calibrated(
    fitted: Fitted, tmp_path: Path
) -> None:
    model = OnnxModel(MODELS / "intent.onnx")
    assert model.confidence_min == pytest.approx(fitted.confidence_min, abs=1e-4)
    again = tmp_path / "intent.onnx"
    export(fitted, PRIMITIVES, "intent", again)
    assert OnnxModel(again).confidence_min == model.confidence_min


def test_what_is_said_of_a_held_stick_does_not_hang_on_rounding() -> None:
    """Turns of such a stick may cancel out: then nothing tells left from right."""
    model = OnnxModel(MODELS / "intent.onnx")
    rng = np.random.default_rng(3)
    for _ in range(300):
        stick = rng.uniform(-1.0, 1.0, 4) * (rng.random(4) < 0.6)
        held = np.tile(stick, (int(rng.integers(20, 401)), 1)).astype(np.float32)
        touched = held * (1.0 + 1e-7 * rng.standard_normal(held.shape)).astype(np.float32)
        before, after = model.answer(held, FULL_YAW_RADPS), model.answer(touched, FULL_YAW_RADPS)
        assert after.probabilities == pytest.approx(before.probabilities, abs=0.02), stick
        assert after.meant == pytest.approx(before.meant, abs=0.02), stick
