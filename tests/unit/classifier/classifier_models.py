"""Model files, right and wrong, that answer a constant."""

from pathlib import Path

import onnx
from onnx import TensorProto, helper

from services.classifier.model import CONTRACT

GOOD = {
    "contract": CONTRACT,
    "labels": '["line", "arc", "sine", "helix"]',
    "rate_hz": "50.0",
    "confidence_min": "0.6",
}
INPUTS = (
    ("sticks", TensorProto.FLOAT, ["batch", "time", 4]),
    ("times_s", TensorProto.FLOAT, ["batch", "time"]),
    ("lengths", TensorProto.INT64, ["batch"]),
    ("full_yaw_radps", TensorProto.FLOAT, ["batch"]),
)


def write_model(
    path: Path,
    *,
    metadata: dict[str, str] = GOOD,
    sticks: str = "sticks",
    meant: str = "meant",
    time_axis: int | str = "time",
    classes: int = 4,
    logits: tuple[float, ...] = (0.0, 1.0, 0.0, 0.0),
    softmax: bool = True,
    meant_value: float = 0.9,
    meant_of_rest: float | None = None,
) -> Path:
    """A model that answers a constant, as right or wrong as asked.

    Args:
        path: where.
        metadata: of the file.
        sticks: name of the first input.
        meant: name of the second output.
        time_axis: a number to freeze it.
        classes: columns of the probabilities.
        logits: of the classes.
        softmax: whether the probabilities are any.
        meant_value: the second output.
        meant_of_rest: it for windows whose sticks sum to 0, if another.
    """
    row = [*logits, *([0.0] * classes)][:classes]
    nodes = [
        helper.make_node("ReduceSum", [sticks, "last_axes"], ["total"], keepdims=0),
        helper.make_node("Mul", ["total", "zero"], ["nothing"]),
        helper.make_node("Unsqueeze", ["nothing", "one"], ["column"]),
        helper.make_node("Add", ["column", "row"], ["logits"]),
        helper.make_node("Softmax", ["logits"], ["probabilities"], axis=1)
        if softmax
        else helper.make_node("Add", ["logits", "row"], ["probabilities"]),
        helper.make_node("Equal", ["total", "zero"], ["rests"]),
        helper.make_node("Where", ["rests", "rest", "value"], [meant]),
    ]
    inputs = [
        helper.make_tensor_value_info(
            sticks if name == "sticks" else name,
            kind,
            [time_axis if axis == "time" else axis for axis in shape],
        )
        for name, kind, shape in INPUTS
    ]
    rest = meant_value if meant_of_rest is None else meant_of_rest
    graph = helper.make_graph(
        nodes,
        "constant",
        inputs,
        [
            helper.make_tensor_value_info("probabilities", TensorProto.FLOAT, ["batch", classes]),
            helper.make_tensor_value_info(meant, TensorProto.FLOAT, ["batch"]),
        ],
        [
            helper.make_tensor("last_axes", TensorProto.INT64, [2], [1, 2]),
            helper.make_tensor("one", TensorProto.INT64, [1], [1]),
            helper.make_tensor("zero", TensorProto.FLOAT, [], [0.0]),
            helper.make_tensor("row", TensorProto.FLOAT, [1, classes], row),
            helper.make_tensor("value", TensorProto.FLOAT, [1], [meant_value]),
            helper.make_tensor("rest", TensorProto.FLOAT, [1], [rest]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, metadata)
    onnx.save(model, str(path))
    return path
