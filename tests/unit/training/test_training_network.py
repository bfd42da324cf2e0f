from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from services.classifier.model import OnnxModel
from training.export import export
from training.fit import Fitted
from training.labels import PRIMITIVES
from training.network import CnnGru, Probabilities

TEMPERATURE = 0.9
torch.set_num_threads(1)


@pytest.fixture(scope="module")
def network() -> CnnGru:
    """Untrained, but with the statistics and slopes of a trained one."""
    torch.manual_seed(3)
    network = CnnGru(len(PRIMITIVES))
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm1d):
            module.running_mean.normal_(0.0, 0.3)
            module.running_var.uniform_(0.3, 2.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, 0.0, 0.2)
    torch.nn.init.normal_(network.head.weight, 0.0, 1.0)
    network.eval()
    # Without this it would say the same label of everything.
    with torch.no_grad():
        logits = [
            network(torch.from_numpy(sticks_of(length, length)[None]), torch.tensor([length]))
            for length in range(40, 400, 20)
        ]
        network.head.bias -= torch.cat(logits).mean(0)
    return network


def sticks_of(length: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(0.01, 0.05, length)) + rng.uniform(-3, 3)
    level = rng.uniform(0.2, 1.0)
    rows = np.stack([level * np.cos(angle), level * np.sin(angle), 0.3 * np.sin(angle / 2)], 1)
    rows += rng.normal(0.0, 0.02, rows.shape)
    return np.clip(rows, -1.0, 1.0).astype(np.float32)


def torch_says(network: CnnGru, sticks: np.ndarray) -> np.ndarray:
    with torch.no_grad():
        return Probabilities(network, TEMPERATURE)(
            torch.from_numpy(sticks[None]), torch.tensor([len(sticks)])
        ).numpy()[0]


def test_the_file_says_what_torch_says_at_every_length(network: CnnGru, tmp_path: Path) -> None:
    path = tmp_path / "intent.onnx"
    export(Fitted(network, TEMPERATURE, ()), PRIMITIVES, "intent", path)
    assert [p.name for p in tmp_path.iterdir()] == ["intent.onnx"], "weights lie beside the file"
    model = OnnxModel(path)
    said = set()
    for length in range(20, 401):
        sticks = sticks_of(length, length)
        wanted = torch_says(network, sticks)
        given = model.probabilities(sticks)
        assert given == pytest.approx(wanted, abs=1e-5), length
        assert given.argmax() == wanted.argmax()
        said.add(int(given.argmax()))
    assert len(said) > 1, "a network that always says the same proves nothing"


def test_the_file_takes_batches_of_different_lengths(network: CnnGru, tmp_path: Path) -> None:
    path = tmp_path / "intent.onnx"
    export(Fitted(network, TEMPERATURE, ()), PRIMITIVES, "intent", path)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    rows = [sticks_of(length, length) for length in (33, 200, 120)]
    batch = np.zeros((3, 200, 3), dtype=np.float32)
    for index, row in enumerate(rows):
        batch[index, : len(row)] = row
    lengths = np.array([len(row) for row in rows], dtype=np.int64)
    (output,) = session.run(None, {"sticks": batch, "lengths": lengths})
    for row, given in zip(rows, output, strict=True):
        assert given == pytest.approx(torch_says(network, row), abs=1e-5)


@pytest.mark.parametrize("length", [20, 57, 200])
def test_what_is_padding_does_not_matter(network: CnnGru, length: int) -> None:
    sticks = sticks_of(length, 1)
    rubbish = np.concatenate([sticks, np.full((60, 3), 0.7, dtype=np.float32)])
    with torch.no_grad():
        padded = Probabilities(network, TEMPERATURE)(
            torch.from_numpy(rubbish[None]), torch.tensor([length])
        ).numpy()[0]
    assert padded == pytest.approx(torch_says(network, sticks), abs=1e-5)


@pytest.mark.parametrize("turn", [0.4, 1.7, 3.1])
def test_turning_the_whole_motion_changes_nothing(network: CnnGru, turn: float) -> None:
    sticks = sticks_of(150, 2)
    c, s = np.cos(turn), np.sin(turn)
    turned = sticks @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    assert torch_says(network, turned) == pytest.approx(torch_says(network, sticks), abs=1e-4)


def test_resting_sticks_give_probabilities_too(network: CnnGru) -> None:
    said = torch_says(network, np.zeros((60, 3), dtype=np.float32))
    assert np.isfinite(said).all()
    assert said.sum() == pytest.approx(1.0, abs=1e-5)
