from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from services.classifier.model import INPUTS, OnnxModel
from training.export import export
from training.fit import Fitted, inputs_of
from training.geometry import Geometry
from training.labels import PRIMITIVES
from training.network import Architecture, Network, Trunk
from training.windows import Windows, padded

YAW_RADPS = 1.3
torch.set_num_threads(1)


def untrained(architecture: Architecture | None = None) -> Fitted:
    """Untrained, but with the statistics and slopes of a trained one."""
    torch.manual_seed(3)
    network = Network(architecture)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm1d):
            module.running_mean.normal_(0.0, 0.3)
            module.running_var.uniform_(0.3, 2.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, 0.0, 0.2)
    network.measure(*inputs_of(window(*(sticks_of(k, k) for k in range(20, 401))), YAW_RADPS))
    last = network.head[-1]
    torch.nn.init.zeros_(last.bias)
    network.eval()
    # Without what follows it would decide the same of everything.
    decided = []
    handle = last.register_forward_hook(lambda _m, _in, out: decided.append(out))
    with torch.no_grad():
        for length in range(40, 400, 20):
            network(*inputs_of(window(sticks_of(length, length)), YAW_RADPS))
        handle.remove()
        spread = torch.cat(decided)
        scale = 0.4 / spread.std(0)
        last.weight *= scale[:, None]
        last.bias -= spread.mean(0) * scale
        last.bias[0] += 0.4
    return Fitted(network, scaling=(0.1, 0.2), platt=(0.8, 0.1), confidence_min=0.4)


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return untrained()


@pytest.fixture(scope="module")
def model(fitted: Fitted, tmp_path_factory: pytest.TempPathFactory) -> OnnxModel:
    path = tmp_path_factory.mktemp("model") / "intent.onnx"
    export(fitted, PRIMITIVES, "intent", path)
    assert [p.name for p in path.parent.iterdir()] == ["intent.onnx"], "weights lie beside it"
    return OnnxModel(path)


def sticks_of(length: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(0.01, 0.05, length)) + rng.uniform(-3, 3)
    level = rng.uniform(0.2, 1.0)
    up, yaw = 0.3 * np.sin(angle / 2), 0.4 * np.cos(angle / 3)
    rows = np.stack([level * np.cos(angle), level * np.sin(angle), up, yaw], 1)
    rows += rng.normal(0.0, 0.02, rows.shape)
    return np.clip(rows, -1.0, 1.0).astype(np.float32)


def window(*rows: np.ndarray) -> Windows:
    return padded(rows, np.zeros(len(rows), dtype=np.int64))


def torch_says(fitted: Fitted, sticks: np.ndarray, yaw_radps: float = YAW_RADPS) -> np.ndarray:
    probabilities, meant = fitted.answers(window(sticks), yaw_radps)
    return np.append(probabilities[0], meant[0])


def test_the_file_says_what_torch_says_at_every_length(fitted: Fitted, model: OnnxModel) -> None:
    labels, spread = set(), []
    for length in range(20, 401):
        sticks = sticks_of(length, length)
        wanted = torch_says(fitted, sticks)
        answer = model.answer(sticks, YAW_RADPS)
        assert answer.probabilities == pytest.approx(wanted[:4], abs=1e-5), length
        assert answer.meant == pytest.approx(wanted[4], abs=1e-5), length
        assert answer.probabilities.argmax() == wanted[:4].argmax()
        labels.add(int(wanted[:4].argmax()))
        spread.append(answer.meant)
    assert len(labels) > 1, "a network that always says the same proves nothing"
    assert np.std(spread) > 0.02


def test_the_file_takes_batches_of_different_lengths(fitted: Fitted, model: OnnxModel) -> None:
    rows = [sticks_of(length, length) for length in (33, 200, 120)]
    batch = window(*rows)
    yaws = np.array([0.5, 1.3, 2.0], dtype=np.float32)
    probabilities, meant = model.answers(batch.sticks, batch.lengths, yaws)
    for k, row in enumerate(rows):
        wanted = torch_says(fitted, row, float(yaws[k]))
        assert np.append(probabilities[k], meant[k]) == pytest.approx(wanted, abs=1e-5)


def test_the_file_carries_what_a_service_must_know(fitted: Fitted, tmp_path: Path) -> None:
    path = tmp_path / "intent.onnx"
    sha256 = export(fitted, PRIMITIVES, "intent", path)
    model = OnnxModel(path)
    assert model.confidence_min == pytest.approx(0.4)
    assert model.name == f"intent-{sha256[:8]}"
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    assert [i.name for i in session.get_inputs()] == list(INPUTS)


@pytest.mark.parametrize("length", [20, 57, 200])
def test_what_is_padding_does_not_matter(fitted: Fitted, model: OnnxModel, length: int) -> None:
    sticks = sticks_of(length, 1)
    rubbish = np.concatenate([sticks, np.full((61, 4), 0.7, dtype=np.float32)])
    probabilities, meant = model.answers(
        rubbish[None], np.array([length]), np.array([YAW_RADPS], dtype=np.float32)
    )
    given = np.append(probabilities[0], meant[0])
    assert given == pytest.approx(torch_says(fitted, sticks), abs=1e-5)


def test_a_curve_by_yaw_has_the_path_of_the_same_curve_by_strafing() -> None:
    """Forward with a steady turn, and the turning push of a vehicle that does not turn."""
    network = Network()
    t = np.arange(150) / 50.0
    still = 0.0 * t
    by_yaw = np.stack([0.6 + still, still, still, 0.5 + still], 1)
    turned = 0.5 * 2.0 * t
    by_push = np.stack([0.6 * np.cos(turned), 0.6 * np.sin(turned), still, still], 1)
    with torch.no_grad():
        channels = [
            network.geometry(*inputs_of(window(one.astype(np.float32)), 2.0))[0].numpy()
            for one in (by_yaw, by_push)
        ]
    but_raw = [k for k in range(channels[0].shape[1]) if k not in Geometry.STICKS or k == 2]
    a, b = (one[0, but_raw, 5:-5] for one in channels)
    assert np.abs(a - b).max() < 0.05


@pytest.mark.parametrize("yaw_radps", [0.7, 1.6])
def test_only_the_rate_of_turning_counts_not_whose_stick_it_is(
    fitted: Fitted, yaw_radps: float
) -> None:
    """Half the yaw stick on a vehicle that turns twice as fast is the same motion."""
    sticks = sticks_of(120, 5)
    other = sticks.copy()
    other[:, 3] *= 0.5 / yaw_radps
    assert torch_says(fitted, other, yaw_radps) == pytest.approx(
        torch_says(fitted, sticks, 0.5), abs=1e-4
    )


@pytest.mark.parametrize(
    "architecture",
    [
        Architecture(width=16, summary=0),
        Architecture(width=16, geometry=False),
        Architecture(width=16, decisions=False),
        Architecture(width=16, pooling=("last",)),
    ],
)
def test_what_an_ablation_leaves_out_leaves_a_network(
    architecture: Architecture, tmp_path: Path
) -> None:
    fitted = untrained(architecture)
    path = tmp_path / "intent.onnx"
    export(fitted, PRIMITIVES, "intent", path)
    sticks = sticks_of(90, 3)
    answer = OnnxModel(path).answer(sticks, YAW_RADPS)
    assert np.append(answer.probabilities, answer.meant) == pytest.approx(
        torch_says(fitted, sticks), abs=1e-5
    )


def test_resting_sticks_give_probabilities_too(fitted: Fitted) -> None:
    said = torch_says(fitted, np.zeros((60, 4), dtype=np.float32))
    assert np.isfinite(said).all()
    assert said[:4].sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("samples", [7, 29, 361])
def test_the_trunk_takes_any_series_and_leaves_its_padding_out(samples: int) -> None:
    torch.manual_seed(0)
    trunk = Trunk(channels=5, classes=3).eval()
    series = torch.randn(2, 5, samples)
    padding = torch.full((2, 5, 12), 9.0)
    ones = torch.ones(2, 1, samples)
    with torch.no_grad():
        alone = trunk(series, ones)
        beside = trunk(torch.cat([series, padding], 2), torch.cat([ones, torch.zeros(2, 1, 12)], 2))
    assert alone.shape == (2, 3)
    assert beside.numpy() == pytest.approx(alone.numpy(), abs=1e-5)
