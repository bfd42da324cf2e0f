"""The ONNX model: what it must look like, and its probabilities."""

import hashlib
import json
from pathlib import Path
from typing import Protocol

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from services.classifier.window import MODEL_RATE_HZ

CONTRACT = "intent-sticks/1"
"""Names what follows; a model made for another version is refused."""
INPUTS = ("sticks", "lengths")
"""(batch, time, 3) float32 vx vy vz at `MODEL_RATE_HZ`, and (batch,) int64 real samples of each."""
OUTPUT = "probabilities"
PRIMITIVES = ("line", "arc", "sine", "helix")
"""The labels that the wire contract asks of every model."""
_PROBE_SAMPLES = (50, 173)


class ModelError(ValueError):
    """A model file that cannot be used; the text says why and what to do."""


class Model(Protocol):
    """Anything that gives probabilities to a window of sticks."""

    @property
    def name(self) -> str:
        """Name and hash."""
        ...

    @property
    def labels(self) -> tuple[str, ...]:
        """The primitives it knows, in the order of its output."""
        ...

    def probabilities(self, sticks: NDArray[np.float32]) -> NDArray[np.float64]:
        """Probabilities (classes,) of sticks (N, 3) at `MODEL_RATE_HZ`; they sum to 1."""
        ...


class OnnxModel:
    """A model file in ONNX Runtime, on one thread."""

    def __init__(self, path: Path) -> None:
        """Load and check a file.

        Raises:
            ModelError: if there is no such file or it does not fit the contract.
        """
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ModelError(
                f"model {path}: cannot be read: {error.strerror};"
                " train one with 'autocomplete train'"
            ) from None
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(
                data, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            # ONNX Runtime raises classes of its own with no common base but Exception.
            raise ModelError(f"model {path}: no ONNX model: {str(error).splitlines()[0]}") from None
        metadata = self._session.get_modelmeta().custom_metadata_map
        self.labels = _checked_labels(path, metadata)
        self._check_shapes(path)
        digest = hashlib.sha256(data).hexdigest()
        self.name = f"{metadata.get('name') or path.stem}-{digest[:8]}"
        self._probe(path)

    def probabilities(self, sticks: NDArray[np.float32]) -> NDArray[np.float64]:
        """Probabilities (classes,) of sticks (N, 3) at `MODEL_RATE_HZ`; they sum to 1."""
        lengths = np.array([len(sticks)], dtype=np.int64)
        (output,) = self._session.run([OUTPUT], {INPUTS[0]: sticks[None], INPUTS[1]: lengths})
        row = np.asarray(output[0], dtype=np.float64)
        return np.asarray(row / row.sum())

    def _check_shapes(self, path: Path) -> None:
        given = {i.name: (i.type, len(i.shape)) for i in self._session.get_inputs()}
        wanted = {INPUTS[0]: ("tensor(float)", 3), INPUTS[1]: ("tensor(int64)", 1)}
        if given != wanted:
            raise ModelError(f"model {path}: its inputs are {given}, not {wanted}")
        outputs = [o.name for o in self._session.get_outputs()]
        if outputs != [OUTPUT]:
            raise ModelError(f"model {path}: its outputs are {outputs}, not {[OUTPUT]}")

    def _probe(self, path: Path) -> None:
        """Ask it twice: a graph with frozen axes, or one without softmax, shows at once."""
        for samples in _PROBE_SAMPLES:
            sticks = np.zeros((1, samples, 3), dtype=np.float32)
            sticks[:, :, 0] = 0.5
            feed = {INPUTS[0]: sticks, INPUTS[1]: np.array([samples], dtype=np.int64)}
            try:
                (output,) = self._session.run([OUTPUT], feed)
            except Exception as error:
                reason = str(error).splitlines()[0]
                raise ModelError(f"model {path}: fails on {samples} samples: {reason}") from None
            good = (
                output.shape == (1, len(self.labels))
                and bool(np.isfinite(output).all())
                and bool((output >= 0.0).all())
                and abs(float(output.sum()) - 1.0) < 1e-3
            )
            if not good:
                raise ModelError(
                    f"model {path}: its output of shape {output.shape} is no set of probabilities"
                    f" of {len(self.labels)} labels"
                )


def _checked_labels(path: Path, metadata: dict[str, str]) -> tuple[str, ...]:
    contract = metadata.get("contract")
    if contract != CONTRACT:
        raise ModelError(f"model {path}: made for contract {contract!r}, this one is {CONTRACT!r}")
    if metadata.get("rate_hz") != str(MODEL_RATE_HZ):
        raise ModelError(
            f"model {path}: made for {metadata.get('rate_hz')} Hz, not {MODEL_RATE_HZ}"
        )
    try:
        labels = json.loads(metadata["labels"])
    except (KeyError, json.JSONDecodeError):
        raise ModelError(f"model {path}: its metadata names no labels") from None
    if (
        not isinstance(labels, list)
        or not all(isinstance(label, str) and label for label in labels)
        or len(set(labels)) != len(labels)
    ):
        raise ModelError(f"model {path}: its labels are no list of names: {labels}")
    missing = [label for label in PRIMITIVES if label not in labels]
    if missing:
        raise ModelError(f"model {path}: its labels lack {', '.join(missing)}")
    return tuple(labels)
