"""Real people: the network's own trunk on public recordings of movements, by their own splits.

The front end that sees geometry is for sticks; what these data sets are given to is what follows
it, convolutions and GRUs, with each data set's channels. MiniRocket is run beside it, and what has
been published stands next to both.

Sources: four sets are in aeon's wheel (UCR and UEA archives, with their training and test split);
the shoulder exercises of Burns et al. (arXiv 1802.01489) are in seglearn's, and are split by
subject, two of ten held out in each of five folds, in windows of 4 s.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from training.network import Trunk

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

SHOULDER = "shoulder exercises"
SHOULDER_SUBJECTS = 10
SHOULDER_FOLDS = 5
SHOULDER_SAMPLES = 200
"""4 s at 50 Hz."""

USUAL_SAMPLES = 150
"""The median length that each set is brought to by one factor: the trunk's strides are for series
of some hundred samples, and vowels have fifteen."""
BATCH = 32
LEARNING_RATE = 2e-3
WEIGHT_DECAY = 1e-2
SMOOTHING = 0.05
WARM_UP = 0.15
STRETCH = (0.8, 1.25)
CROP = (0.8, 1.0)
SHORTEST_SAMPLES = 8
GAIN = 0.1
NOISE = 0.05


@dataclass(frozen=True)
class Published:
    """What others report on a data set.

    Attributes:
        recurrent: the best of a recurrent network known to us; None if none is.
        best: of any kind.
        source: where both are from.
    """

    recurrent: float | None
    best: float
    source: str


@dataclass(frozen=True)
class HumanSet:
    """A data set and how long to train on it.

    Attributes:
        name: of the archive.
        steps: batches.
        published: what others report.
    """

    name: str
    steps: int
    published: Published


HUMAN_SETS = (
    HumanSet("BasicMotions", 300, Published(1.0, 1.0, "UEA archive")),
    HumanSet("JapaneseVowels", 600, Published(0.997, 0.997, "UEA archive, .978 to .997")),
    HumanSet("PickupGestureWiimoteZ", 600, Published(None, 0.94, "RDST; MR-Hydra .900")),
    HumanSet("GunPoint", 600, Published(None, 1.0, "MR-Hydra")),
    HumanSet(SHOULDER, 500, Published(0.889, 0.889, "arXiv 1802.01489, CRNN, 20 subjects")),
)


@dataclass(frozen=True)
class Split:
    """Series to learn from and to judge on.

    Attributes:
        training: each (channels, N), of any length.
        training_labels: (n,).
        test: likewise.
        test_labels: (m,).
    """

    training: Sequence[Array32]
    training_labels: IntArray
    test: Sequence[Array32]
    test_labels: IntArray


def split_of(name: str, seed: int) -> Split:
    """The official split, or one of the folds by subject."""
    return _shoulder(seed % SHOULDER_FOLDS) if name == SHOULDER else _archive(name)


def _archive(name: str) -> Split:
    from aeon.datasets import load_classification

    series, labels = load_classification(name, split="train", load_equal_length=False)
    tested, test_labels = load_classification(name, split="test", load_equal_length=False)
    classes = np.unique(labels)
    return Split(
        [np.asarray(one, dtype=np.float32) for one in series],
        np.searchsorted(classes, labels),
        [np.asarray(one, dtype=np.float32) for one in tested],
        np.searchsorted(classes, test_labels),
    )


def _shoulder(number: int) -> Split:
    from seglearn.datasets import load_watch

    watch = load_watch()
    out = np.isin(watch["subject"], [2 * number + 1, 2 * number + 2])

    def windows(chosen: NDArray[np.bool_], step: int) -> tuple[list[Array32], IntArray]:
        series, labels = [], []
        for at in np.flatnonzero(chosen):
            recording = np.asarray(watch["X"][at], dtype=np.float32).T
            for begin in range(0, recording.shape[1] - SHOULDER_SAMPLES + 1, step):
                series.append(recording[:, begin : begin + SHOULDER_SAMPLES])
                labels.append(int(watch["y"][at]))
        return series, np.array(labels, dtype=np.int64)

    return Split(*windows(~out, SHOULDER_SAMPLES // 2), *windows(out, SHOULDER_SAMPLES))


def _batch(series: Sequence[Array32]) -> tuple[torch.Tensor, torch.Tensor]:
    """Series (n, channels, T), zero-padded, and their masks (n, 1, T)."""
    longest = max(one.shape[1] for one in series)
    padded = np.zeros((len(series), len(series[0]), longest), dtype=np.float32)
    mask = np.zeros((len(series), 1, longest), dtype=np.float32)
    for row, one in enumerate(series):
        padded[row, :, : one.shape[1]] = one
        mask[row, 0, : one.shape[1]] = 1.0
    return torch.from_numpy(padded), torch.from_numpy(mask)


def _stretched(series: Array32, count: int) -> Array32:
    """A series (channels, N) read at so many times, evenly from its beginning to its end."""
    samples = series.shape[1]
    at = np.linspace(0.0, samples - 1.0, max(SHORTEST_SAMPLES, count))
    rows = [np.interp(at, np.arange(samples), channel) for channel in series]
    return np.array(rows, dtype=np.float32)


def _varied(series: Array32, rng: np.random.Generator) -> Array32:
    """A series as another person might have made it: a part, stretched, louder, with noise."""
    samples = series.shape[1]
    if rng.random() < 0.5:
        kept = max(SHORTEST_SAMPLES, int(samples * rng.uniform(*CROP)))
        begin = int(rng.integers(0, samples - kept + 1))
        series, samples = series[:, begin : begin + kept], kept
    if rng.random() < 0.5:
        series = _stretched(series, int(samples * rng.uniform(*STRETCH)))
    gain = 1.0 + GAIN * rng.standard_normal((len(series), 1))
    return (series * gain + NOISE * rng.standard_normal(series.shape)).astype(np.float32)


def trunk_accuracy(
    split: Split, steps: int, seed: int, tell: Callable[[int, int], None] = lambda _d, _o: None
) -> float:
    """Share of the test series that the trained trunk names rightly."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    everything = np.concatenate(split.training, axis=1)
    mean, scale = everything.mean(axis=1, keepdims=True), everything.std(axis=1, keepdims=True)
    factor = USUAL_SAMPLES / float(np.median([one.shape[1] for one in split.training]))

    def prepared(series: Sequence[Array32]) -> list[Array32]:
        return [
            _stretched((one - mean) / (scale + 1e-6), round(one.shape[1] * factor))
            for one in series
        ]

    training, test = prepared(split.training), prepared(split.test)
    classes = int(split.training_labels.max()) + 1
    network = Trunk(len(mean), classes)
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, steps, pct_start=WARM_UP
    )
    loss_of = nn.CrossEntropyLoss(label_smoothing=SMOOTHING)
    labels = torch.from_numpy(split.training_labels)
    network.train()
    waiting: list[int] = []
    for step in range(steps):
        if len(waiting) < BATCH:
            waiting += rng.permutation(len(training)).tolist()
        rows, waiting = waiting[:BATCH], waiting[BATCH:]
        optimiser.zero_grad()
        logits = network(*_batch([_varied(training[row], rng) for row in rows]))
        loss = loss_of(logits, labels[rows])
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        tell(step + 1, steps)
    network.eval()
    with torch.no_grad():
        said = torch.cat(
            [network(*_batch(test[at : at + 256])).argmax(1) for at in range(0, len(test), 256)]
        )
    return float((said.numpy() == split.test_labels).mean())


def minirocket_accuracy(split: Split, seed: int, *, stretch: bool) -> float:
    """The same of MiniRocket, whose series are zero-padded or stretched to one length."""
    from aeon.classification.convolution_based import MiniRocketClassifier

    longest = max(one.shape[1] for one in (*split.training, *split.test))

    def fixed(series: Sequence[Array32]) -> Array32:
        if not stretch:
            padded = np.zeros((len(series), len(series[0]), longest), dtype=np.float32)
            for row, one in enumerate(series):
                padded[row, :, : one.shape[1]] = one
            return padded
        return np.stack([_stretched(one, longest) for one in series])

    machine = MiniRocketClassifier(random_state=seed)
    machine.fit(fixed(split.training), split.training_labels)
    return float((machine.predict(fixed(split.test)) == split.test_labels).mean())


def judge_human(
    human: HumanSet, steps: int, seed: int, tell: Callable[[int, int], None]
) -> dict[str, float]:
    """Accuracies of the trunk and of MiniRocket, padded and stretched, on one split."""
    split = split_of(human.name, seed)
    return {
        "ours": trunk_accuracy(split, steps, seed, tell),
        "padded": minirocket_accuracy(split, seed, stretch=False),
        "stretched": minirocket_accuracy(split, seed, stretch=True),
        "n": float(len(split.test)),
    }
