"""The trained network as one ONNX file, and what a service must know about it inside."""

import hashlib
import json
import pickle
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import onnx
import onnx.utils
import torch

from services.classifier.model import CONTRACT, INPUTS, OUTPUTS
from services.classifier.window import MODEL_RATE_HZ
from training.fit import FULL_YAW_RADPS, Fitted, inputs_of
from training.network import VERSION, Architecture, Network
from training.windows import padded

OPSET = 17
EXAMPLE_SAMPLES = (64, 44)


def export(fitted: Fitted, labels: Sequence[str], name: str, path: Path) -> str:
    """Write a network with its calibration; returns the file's SHA-256 in hex.

    Batch and time stay free: a service gives a motion its own length, without padding.
    """
    tracks = [np.full((samples, 4), 0.3, dtype=np.float32) for samples in EXAMPLE_SAMPLES]
    example = inputs_of(padded(tracks, np.zeros(len(tracks), dtype=np.int64)), FULL_YAW_RADPS)
    axes = {"sticks": {0: "batch", 1: "time"}, "times_s": {0: "batch", 1: "time"}}
    path.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        # The legacy exporter (the newer one freezes time) warns of itself and of GRU batch sizes.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            fitted.calibrated,
            example,
            str(path),
            input_names=list(INPUTS),
            output_names=list(OUTPUTS),
            dynamic_axes={key: axes.get(key, {0: "batch"}) for key in (*INPUTS, *OUTPUTS)},
            opset_version=OPSET,
            dynamo=False,
            external_data=False,
        )
    graph = onnx.load(str(path))
    for node in graph.graph.node:
        if node.op_type == "GRU":
            # A first state of zeros, as without: to make it takes eight operations.
            del node.input[5:]
    graph = onnx.utils.Extractor(graph).extract_model(list(INPUTS), list(OUTPUTS))
    metadata = {
        "contract": CONTRACT,
        "name": name,
        "labels": json.dumps(list(labels)),
        "rate_hz": str(MODEL_RATE_HZ),
        "confidence_min": f"{fitted.confidence_min:.4f}",
    }
    graph.graph.name = name
    onnx.helper.set_model_props(graph, metadata)
    onnx.checker.check_model(graph, full_check=True)
    onnx.save(graph, str(path))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def save(fitted: Fitted, path: Path) -> None:
    """Write the weights as torch has them, for `finetune`: ONNX files fold batch norms away."""
    torch.save(
        {
            "version": VERSION,
            "architecture": asdict(fitted.network.architecture),
            "weights": fitted.network.state_dict(),
            "scaling": fitted.scaling,
            "platt": fitted.platt,
            "confidence_min": fitted.confidence_min,
        },
        path,
    )


def load(path: Path) -> Fitted:
    """What `save` wrote.

    Raises:
        OSError: if there is no such file, or it is none of `save`'s.
    """
    try:
        state = torch.load(path, weights_only=True)
    except FileNotFoundError:
        raise OSError(
            f"weights {path}: no such file; they lie beside the model that 'autocomplete train'"
            " wrote"
        ) from None
    except (RuntimeError, EOFError, pickle.UnpicklingError):
        raise _unfit(path) from None
    try:
        if state["version"] != VERSION:
            raise _unfit(path)
        network = Network(Architecture(**state["architecture"]))
        network.load_state_dict(state["weights"])
        scaling = tuple(state["scaling"])
        return Fitted(network.eval(), scaling, tuple(state["platt"]), state["confidence_min"])
    except (RuntimeError, KeyError, TypeError):
        raise _unfit(path) from None


def _unfit(path: Path) -> OSError:
    return OSError(
        f"weights {path}: not of this version's network; train anew with 'autocomplete train'"
    )
