import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from classifier_models import GOOD, write_model

from common.messages import PRIMITIVES
from services.classifier.config import SHIPPED_MODEL
from services.classifier.model import SHORTEST_SAMPLES, ModelError, OnnxModel


def test_a_model_that_fits_is_taken_with_its_name_and_hash(tmp_path: Path) -> None:
    model = OnnxModel(write_model(tmp_path / "small.onnx"))
    assert model.labels == PRIMITIVES
    assert model.confidence_min == 0.6
    name, _, digest = model.name.rpartition("-")
    assert name == "small"
    assert len(digest) == 8
    answer = model.answer(np.ones((30, 4), dtype=np.float32), 1.0)
    assert answer.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    assert answer.probabilities.argmax() == 1
    assert answer.meant == pytest.approx(0.9)


def test_more_primitives_than_the_four_are_welcome(tmp_path: Path) -> None:
    metadata = {**GOOD, "labels": '["line", "arc", "sine", "helix", "spiral"]'}
    model = OnnxModel(write_model(tmp_path / "m.onnx", metadata=metadata, classes=5))
    assert model.labels[-1] == "spiral"


@pytest.mark.parametrize(
    ("spoiled", "reason"),
    [
        ({"metadata": {}}, "contract"),
        ({"metadata": {**GOOD, "contract": "intent-sticks/1"}}, "contract"),
        ({"metadata": {**GOOD, "rate_hz": "45.0"}}, "Hz"),
        ({"metadata": {**GOOD, "labels": "line"}}, "labels"),
        ({"metadata": {**GOOD, "labels": "[1, 2]"}}, "labels"),
        ({"metadata": {**GOOD, "labels": '["line", "arc", "sine"]'}, "classes": 3}, "helix"),
        (
            {
                "metadata": {**GOOD, "labels": '["line", "arc", "sine", "helix", "none"]'},
                "classes": 5,
            },
            "none",
        ),
        ({"metadata": {k: v for k, v in GOOD.items() if k != "confidence_min"}}, "confidence_min"),
        ({"metadata": {**GOOD, "confidence_min": "sure"}}, "confidence_min"),
        ({"metadata": {**GOOD, "confidence_min": "nan"}}, "confidence_min"),
        ({"metadata": {**GOOD, "confidence_min": "1.2"}}, "confidence_min"),
        ({"sticks": "x"}, "inputs"),
        ({"meant": "sure"}, "outputs"),
        ({"time_axis": 200}, "fails on"),
        ({"classes": 5}, "shapes"),
        ({"softmax": False}, "no probabilities"),
        ({"softmax": False, "logits": (-0.1, 0.6, 0.0, 0.0)}, "no probabilities"),
        ({"meant_value": 1.5}, "no probabilities"),
        ({"meant_of_rest": float("nan")}, "no probabilities"),
        ({"logits": (float("nan"), 0.0, 0.0, 0.0)}, "no probabilities"),
    ],
)
def test_a_model_that_does_not_fit_is_refused_with_the_reason(
    tmp_path: Path, spoiled: dict[str, Any], reason: str
) -> None:
    path = write_model(tmp_path / "m.onnx", **spoiled)
    with pytest.raises(ModelError, match=reason) as refused:
        OnnxModel(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("data", [b"", b"no model", None])
def test_a_file_that_is_no_model_is_refused(tmp_path: Path, data: bytes | None) -> None:
    path = tmp_path / "m.onnx"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(ModelError, match=r"m\.onnx"):
        OnnxModel(path)


@pytest.fixture(scope="module")
def shipped() -> OnnxModel:
    return OnnxModel(SHIPPED_MODEL)


def said_of(model: OnnxModel, vx: np.ndarray, vy: np.ndarray, vz: np.ndarray) -> str:
    sticks = np.stack([vx, vy, vz, np.zeros_like(vx)], axis=1).astype(np.float32)
    answer = model.answer(sticks, 1.0)
    best = int(answer.probabilities.argmax())
    assert answer.meant * answer.probabilities[best] >= model.confidence_min
    return model.labels[best]


@pytest.mark.parametrize("heading", np.linspace(-3.0, 3.0, 7))
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_the_shipped_model_names_clean_shapes_in_any_direction(
    shipped: OnnxModel, heading: float, sense: float
) -> None:
    t = np.arange(0.0, 3.6, 0.02)
    level = np.zeros_like(t)
    turning = heading + sense * 1.1 * t
    swinging = heading + sense * 0.7 * np.cos(2.0 * np.pi * t / 2.2)
    straight = np.full_like(t, heading)
    for angle, up, label in (
        (straight, level, "line"),
        (turning, level, "arc"),
        (swinging, level, "sine"),
        (turning, level + 0.5 * sense, "helix"),
    ):
        assert said_of(shipped, 0.7 * np.cos(angle), 0.7 * np.sin(angle), up) == label


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_the_shipped_model_knows_a_vertical_line(shipped: OnnxModel, sense: float) -> None:
    still = np.zeros(100)
    assert said_of(shipped, still, still, still + 0.6 * sense) == "line"


def test_the_shipped_model_takes_a_wide_slow_turn_for_an_arc(shipped: OnnxModel) -> None:
    """0.8 m/s on a circle of 4 m: steered by yaw it shows after 63 degrees, strafed after 86.

    The stick takes 0.3 s to rise, as thumbs do.
    """
    t = np.arange(0.0, 7.5, 0.02)
    push = 0.8 * np.clip(t / 0.3, 0.0, 1.0)
    level, turning = np.zeros_like(t), np.full_like(t, 0.2)
    steered = np.stack([push, level, level, turning], axis=1).astype(np.float32)[:275]
    answer = shipped.answer(steered, 1.0)
    assert shipped.labels[int(answer.probabilities.argmax())] == "arc"
    angle = turning * t
    assert said_of(shipped, push * np.cos(angle), push * np.sin(angle), level) == "arc"


def test_the_shipped_model_sees_a_curve_that_is_flown_by_yaw(shipped: OnnxModel) -> None:
    sticks = np.tile(np.array([0.8, 0.0, 0.0, 0.5], dtype=np.float32), (150, 1))
    answer = shipped.answer(sticks, 1.0)
    assert shipped.labels[int(answer.probabilities.argmax())] == "arc"
    slower = shipped.answer(sticks, 0.0)
    assert shipped.labels[int(slower.probabilities.argmax())] == "line"


def test_many_windows_at_once_are_answered_as_one_by_one(shipped: OnnxModel) -> None:
    """Whatever they are padded with."""
    rng = np.random.default_rng(0)
    lengths = np.array([SHORTEST_SAMPLES, 41, 100, 151, 200])
    sticks = rng.uniform(-1.0, 1.0, (len(lengths), lengths.max(), 4)).astype(np.float32)
    yaw_radps = np.linspace(0.5, 1.5, len(lengths)).astype(np.float32)
    probabilities, meant = shipped.answers(sticks, lengths, yaw_radps)
    for row, length in enumerate(lengths):
        alone = shipped.answer(np.ascontiguousarray(sticks[row, :length]), float(yaw_radps[row]))
        assert probabilities[row] == pytest.approx(alone.probabilities, abs=1e-5)
        assert meant[row] == pytest.approx(alone.meant, abs=1e-5)


def test_a_service_needs_neither_torch_nor_sklearn() -> None:
    code = (
        "import sys, services.classifier.service, services.classifier.config;"
        "sys.exit(any(m in sys.modules for m in ('torch', 'sklearn', 'onnx', 'training')))"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=30).returncode == 0
