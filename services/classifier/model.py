"""The ONNX model: what its file must be, and what it says of a window of sticks."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from common.messages import NONE_LABEL, PRIMITIVES
from services.classifier.window import MODEL_RATE_HZ, WINDOW_SAMPLES

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

CONTRACT = "intent-sticks/2"
"""Names what follows; a model made for another version is refused."""
INPUTS = ("sticks", "times_s", "lengths", "full_yaw_radps")
"""What is asked.

sticks: (batch, time, 4) float32 vx vy vz wz as fractions of full stick, in the frame of the heading
at each moment, at `MODEL_RATE_HZ`.
times_s: (batch, time) float32, of each sample since its window's first.
lengths: (batch,) int64, how many samples of each row are real; the others are its padding.
full_yaw_radps: (batch,) float32, the vehicle's yaw rate at full stick.
"""
OUTPUTS = ("probabilities", "meant")
"""What is answered.

probabilities: (batch, labels) float32 of the primitives, if one is meant; each row sums to 1.
meant: (batch,) float32, the probability that a primitive is meant at all.
"""
SHORTEST_SAMPLES = 20
"""Windows from here on must be answered; a shorter one holds no shape (0.4 s)."""

_WANTED_INPUTS = {
    "sticks": ("tensor(float)", 3),
    "times_s": ("tensor(float)", 2),
    "lengths": ("tensor(int64)", 1),
    "full_yaw_radps": ("tensor(float)", 1),
}
_TIMES_S = np.arange(WINDOW_SAMPLES, dtype=np.float32)[None] / np.float32(MODEL_RATE_HZ)
_PROBE_SAMPLES = (SHORTEST_SAMPLES, 173, WINDOW_SAMPLES)
_PROBE_FORWARD = (0.5, 0.0)


class ModelError(ValueError):
    """A model file that cannot be used, or an answer that is none; the text says why."""


@dataclass(frozen=True)
class Answer:
    """What a model says of one window.

    Attributes:
        probabilities: (labels,) of the primitives, if one is meant; they sum to 1.
        meant: the probability that one is meant at all.
    """

    probabilities: Array
    meant: float


class Model(Protocol):
    """Anything that says what a window of sticks means."""

    @property
    def name(self) -> str:
        """Name and hash."""
        ...

    @property
    def labels(self) -> tuple[str, ...]:
        """The primitives it knows, in the order of its probabilities."""
        ...

    @property
    def confidence_min(self) -> float:
        """The product of `meant` and the likeliest primitive's probability to act on."""
        ...

    def answer(self, sticks: Array32, full_yaw_radps: float) -> Answer:
        """What sticks (N, 4) at `MODEL_RATE_HZ` mean.

        Raises:
            ModelError: if there is no answer.
        """
        ...


class OnnxModel:
    """A model file in ONNX Runtime, on one thread.

    Args:
        path: the file.

    Raises:
        ModelError: if there is no such file or it does not fit the contract.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
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
        _check_contract(path, metadata)
        self._check_shapes()
        self.labels = _labels(path, metadata)
        self.confidence_min = _confidence_min(path, metadata)
        digest = hashlib.sha256(data).hexdigest()
        self.name = f"{metadata.get('name') or path.stem}-{digest[:8]}"
        self._probe()

    def answer(self, sticks: Array32, full_yaw_radps: float) -> Answer:
        """What sticks (N, 4) at `MODEL_RATE_HZ` mean.

        Raises:
            ModelError: if the graph fails on them, or answers no probabilities.
        """
        probabilities, meant = self.answers(
            sticks[None],
            np.array([len(sticks)], dtype=np.int64),
            np.array([full_yaw_radps], dtype=np.float32),
        )
        # Of so few numbers, lists are quicker than arrays.
        row, is_meant = probabilities[0].tolist(), float(meant[0])
        total = sum(row)
        # One comparison each: whatever is NaN fails them too.
        if not (min(row) >= 0.0 and abs(total - 1.0) < 1e-3 and 0.0 <= is_meant <= 1.0):
            raise ModelError(
                f"model {self._path}: answers {row} and {is_meant} to {len(sticks)}"
                " samples, which are no probabilities"
            )
        return Answer(np.array(row) / total, is_meant)

    def answers(
        self, sticks: Array32, lengths: IntArray, full_yaw_radps: Array32
    ) -> tuple[Array32, Array32]:
        """Many windows at once, as they come from the graph.

        Args:
            sticks: (batch, time, 4) at `MODEL_RATE_HZ`, padded with anything to one length of at
                most `WINDOW_SAMPLES`.
            lengths: (batch,) real samples of each.
            full_yaw_radps: (batch,) of each one's vehicle.

        Returns:
            Probabilities (batch, labels) and meant (batch,).

        Raises:
            ModelError: if the graph fails on them.
        """
        batch, samples, _ = sticks.shape
        times_s = _TIMES_S[:, :samples]
        feed = {
            "sticks": sticks,
            "times_s": times_s if batch == 1 else np.repeat(times_s, batch, axis=0),
            "lengths": lengths,
            "full_yaw_radps": full_yaw_radps,
        }
        try:
            probabilities, meant = self._session.run(OUTPUTS, feed)
        except Exception as error:
            reason = str(error).splitlines()[0]
            raise ModelError(f"model {self._path}: fails on {samples} samples: {reason}") from None
        return probabilities, meant

    def _check_shapes(self) -> None:
        given = {i.name: (i.type, len(i.shape)) for i in self._session.get_inputs()}
        if given != _WANTED_INPUTS:
            raise ModelError(f"model {self._path}: its inputs are {given}, not {_WANTED_INPUTS}")
        outputs = {o.name: o.type for o in self._session.get_outputs()}
        wanted = dict.fromkeys(OUTPUTS, "tensor(float)")
        if outputs != wanted:
            raise ModelError(f"model {self._path}: its outputs are {outputs}, not {wanted}")

    def _probe(self) -> None:
        """Ask it: a graph with frozen axes, without softmax, or with 0/0 at rest shows at once."""
        for samples in _PROBE_SAMPLES:
            for forward in _PROBE_FORWARD:
                sticks = np.zeros((1, samples, 4), dtype=np.float32)
                sticks[:, :, 0] = forward
                lengths = np.array([samples], dtype=np.int64)
                probabilities, meant = self.answers(sticks, lengths, np.ones(1, dtype=np.float32))
                if probabilities.shape != (1, len(self.labels)) or meant.shape != (1,):
                    raise ModelError(
                        f"model {self._path}: its outputs have shapes {probabilities.shape} and"
                        f" {meant.shape}, not (1, {len(self.labels)}) and (1,)"
                    )
                self.answer(sticks[0], 1.0)


def _check_contract(path: Path, metadata: dict[str, str]) -> None:
    contract = metadata.get("contract")
    if contract != CONTRACT:
        raise ModelError(
            f"model {path}: made for contract {contract!r}, this one is {CONTRACT!r};"
            " train one with 'autocomplete train'"
        )
    if metadata.get("rate_hz") != str(MODEL_RATE_HZ):
        raise ModelError(
            f"model {path}: made for {metadata.get('rate_hz')} Hz, not {MODEL_RATE_HZ}"
        )


def _labels(path: Path, metadata: dict[str, str]) -> tuple[str, ...]:
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
    if NONE_LABEL in labels:
        raise ModelError(f"model {path}: its labels hold {NONE_LABEL!r}, which is said by `meant`")
    missing = [label for label in PRIMITIVES if label not in labels]
    if missing:
        raise ModelError(f"model {path}: its labels lack {', '.join(missing)}")
    return tuple(labels)


def _confidence_min(path: Path, metadata: dict[str, str]) -> float:
    text = metadata.get("confidence_min")
    try:
        confidence_min = float(text or "")
    except ValueError:
        confidence_min = float("nan")
    if not 0.0 <= confidence_min <= 1.0:
        raise ModelError(
            f"model {path}: its confidence_min is {text!r}; it should be a number from 0 to 1"
        )
    return confidence_min
