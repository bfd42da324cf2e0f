import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest

from services.classifier.config import SHIPPED_MODEL
from services.classifier.model import CONTRACT, PRIMITIVES, ModelError, OnnxModel
from services.classifier.window import WINDOW_SAMPLES, for_model

GOOD = {"contract": CONTRACT, "labels": '["line", "arc", "sine", "helix"]', "rate_hz": "50.0"}


def write_model(
    path: Path,
    *,
    metadata: dict[str, str] = GOOD,
    inputs: tuple[str, str] = ("sticks", "lengths"),
    output: str = "probabilities",
    time_axis: int | str = "time",
    classes: int = 4,
    softmax: bool = True,
) -> Path:
    """A model that answers a constant, as right or wrong as asked."""
    make = onnx.helper
    kinds = onnx.TensorProto
    nodes = [
        make.make_node("ReduceMean", [inputs[0]], ["mean"], axes=[1, 2], keepdims=0),
        make.make_node("Unsqueeze", ["mean", "one"], ["column"]),
        make.make_node("MatMul", ["column", "weights"], ["logits"]),
        make.make_node("Cast", [inputs[1]], ["unused"], to=kinds.FLOAT),
        make.make_node("Softmax", ["logits"], [output], axis=1)
        if softmax
        else make.make_node("Add", ["logits", "weights"], [output]),
    ]
    graph = make.make_graph(
        nodes,
        "constant",
        [
            make.make_tensor_value_info(inputs[0], kinds.FLOAT, ["batch", time_axis, 3]),
            make.make_tensor_value_info(inputs[1], kinds.INT64, ["batch"]),
        ],
        [make.make_tensor_value_info(output, kinds.FLOAT, ["batch", classes])],
        [
            make.make_tensor("one", kinds.INT64, [1], [1]),
            make.make_tensor("weights", kinds.FLOAT, [1, classes], [0.5] * classes),
        ],
    )
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 17)], ir_version=8)
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, str(path))
    return path


def test_a_model_that_fits_is_taken_with_its_name_and_hash(tmp_path: Path) -> None:
    model = OnnxModel(write_model(tmp_path / "small.onnx"))
    assert model.labels == PRIMITIVES
    name, _, digest = model.name.rpartition("-")
    assert name == "small"
    assert len(digest) == 8
    assert model.probabilities(np.zeros((30, 3), dtype=np.float32)).sum() == pytest.approx(1.0)


def test_more_primitives_than_the_four_are_welcome(tmp_path: Path) -> None:
    metadata = {**GOOD, "labels": '["line", "arc", "sine", "helix", "spiral"]'}
    model = OnnxModel(write_model(tmp_path / "m.onnx", metadata=metadata, classes=5))
    assert model.labels[-1] == "spiral"


@pytest.mark.parametrize(
    ("spoiled", "reason"),
    [
        ({"metadata": {}}, "contract"),
        ({"metadata": {**GOOD, "contract": "intent-sticks/9"}}, "contract"),
        ({"metadata": {**GOOD, "rate_hz": "45.0"}}, "Hz"),
        ({"metadata": {**GOOD, "labels": "line"}}, "labels"),
        ({"metadata": {**GOOD, "labels": "[1, 2]"}}, "labels"),
        ({"metadata": {**GOOD, "labels": '["line", "arc", "sine"]'}, "classes": 3}, "helix"),
        ({"inputs": ("x", "lengths")}, "inputs"),
        ({"output": "logits_"}, "outputs"),
        ({"time_axis": 200}, "fails on"),
        ({"classes": 5}, "no set of probabilities"),
        ({"softmax": False}, "no set of probabilities"),
    ],
)
def test_a_model_that_does_not_fit_is_refused_with_the_reason(
    tmp_path: Path, spoiled: dict, reason: str
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
    times_s = np.arange(len(vx)) / 50.0
    sticks = np.stack([vx, vy, vz, np.zeros_like(vx)], axis=1)
    return model.labels[int(model.probabilities(for_model(times_s, sticks, 1.0)).argmax())]


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
    """0.8 m/s on a circle of 4 m: 0.2 rad/s, 34 degrees in 3 s."""
    angle = 0.2 * np.arange(0.0, 3.0, 0.02)
    assert said_of(shipped, 0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.0 * angle) == "arc"


def test_padding_changes_nothing(shipped: OnnxModel) -> None:
    rng = np.random.default_rng(0)
    for length in (20, 41, 100, 151):
        sticks = rng.uniform(-1.0, 1.0, (length, 3)).astype(np.float32)
        padded = np.zeros((1, WINDOW_SAMPLES, 3), dtype=np.float32)
        padded[0, :length] = sticks
        (output,) = shipped._session.run(
            None, {"sticks": padded, "lengths": np.array([length], dtype=np.int64)}
        )
        assert output[0] == pytest.approx(shipped.probabilities(sticks), abs=1e-5)


def test_a_service_needs_neither_torch_nor_sklearn() -> None:
    code = (
        "import sys, services.classifier.service, services.classifier.config;"
        "sys.exit(any(m in sys.modules for m in ('torch', 'sklearn', 'onnx', 'training')))"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=30).returncode == 0
