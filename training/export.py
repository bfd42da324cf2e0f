"""The trained network as one ONNX file, and what a service must know about it inside."""

import hashlib
import json
import warnings
from collections.abc import Sequence
from pathlib import Path

import onnx
import torch

from services.classifier.model import CONTRACT, INPUTS, OUTPUT
from services.classifier.window import MODEL_RATE_HZ
from training.fit import Fitted
from training.network import Probabilities

OPSET = 17
EXAMPLE_SAMPLES = 64


def export(fitted: Fitted, labels: Sequence[str], name: str, path: Path) -> str:
    """Write a network with its softmax and temperature; returns the file's SHA-256 in hex.

    Batch and time stay free: a service gives a motion its own length, without padding.
    """
    model = Probabilities(fitted.network, fitted.temperature).eval()
    example = (
        torch.randn(2, EXAMPLE_SAMPLES, 3) * 0.3,
        torch.tensor([EXAMPLE_SAMPLES, EXAMPLE_SAMPLES - 20]),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        # The legacy exporter (the newer one freezes time) warns of itself and of GRU batch sizes.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            model,
            example,
            str(path),
            input_names=list(INPUTS),
            output_names=[OUTPUT],
            dynamic_axes={
                INPUTS[0]: {0: "batch", 1: "time"},
                INPUTS[1]: {0: "batch"},
                OUTPUT: {0: "batch"},
            },
            opset_version=OPSET,
            dynamo=False,
            external_data=False,
        )
    graph = onnx.load(str(path))
    metadata = {
        "contract": CONTRACT,
        "name": name,
        "labels": json.dumps(list(labels)),
        "rate_hz": str(MODEL_RATE_HZ),
    }
    onnx.helper.set_model_props(graph, metadata)
    onnx.checker.check_model(graph, full_check=True)
    onnx.save(graph, str(path))
    return hashlib.sha256(path.read_bytes()).hexdigest()
