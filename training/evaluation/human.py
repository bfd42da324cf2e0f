"""Real people: the network's own trunk on public recordings of movements, by their own splits.

The front end that sees geometry is for sticks; what these data sets are given to is what follows
it, convolutions and GRUs, with each data set's channels. MiniRocket is run beside it on the very
same standardised series, and what has been published stands next to both.

Sources: four sets are in aeon's wheel (UCR and UEA archives, with their training and test split);
the shoulder exercises of Burns et al. (arXiv 1802.01489) are in seglearn's, and are split by
subject, two of ten held out in each of five folds, in windows of 4 s.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.evaluation.human_trunk import Array32, IntArray, fit_trunk, read

SHOULDER = "shoulder exercises"
SHOULDER_FOLDS = 5
SHOULDER_SAMPLES = 200
"""4 s at 50 Hz."""


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
    """A data set.

    Attributes:
        name: of the archive.
        published: what others report.
    """

    name: str
    published: Published


HUMAN_SETS = (
    HumanSet("BasicMotions", Published(1.0, 1.0, "UEA archive")),
    HumanSet("JapaneseVowels", Published(0.997, 0.997, "UEA archive, .978 to .997")),
    HumanSet("PickupGestureWiimoteZ", Published(None, 0.94, "RDST; MR-Hydra .900")),
    HumanSet("GunPoint", Published(None, 1.0, "MR-Hydra")),
    HumanSet(SHOULDER, Published(0.889, 0.889, "arXiv 1802.01489, CRNN, 20 subjects")),
)


@dataclass(frozen=True)
class Split:
    """Series to learn from and to judge on, every channel standardised by those to learn from.

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


def standardised(split: Split) -> Split:
    """The same with each channel's mean 0 and deviation 1 over the samples to learn from."""
    everything = np.concatenate(split.training, axis=1)
    mean, scale = everything.mean(axis=1, keepdims=True), everything.std(axis=1, keepdims=True)

    def of(series: Sequence[Array32]) -> list[Array32]:
        return [(one - mean) / (scale + 1e-6) for one in series]

    return Split(of(split.training), split.training_labels, of(split.test), split.test_labels)


def _archive(name: str) -> Split:
    from aeon.datasets import load_classification

    series, labels = load_classification(name, split="train", load_equal_length=False)
    tested, test_labels = load_classification(name, split="test", load_equal_length=False)
    classes = np.unique(labels)
    return standardised(
        Split(
            [np.asarray(one, dtype=np.float32) for one in series],
            np.searchsorted(classes, labels),
            [np.asarray(one, dtype=np.float32) for one in tested],
            np.searchsorted(classes, test_labels),
        )
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

    return standardised(
        Split(*windows(~out, SHOULDER_SAMPLES // 2), *windows(out, SHOULDER_SAMPLES))
    )


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
        at = np.linspace(0.0, 1.0, longest)
        return np.stack([read(one, at) for one in series])

    machine = MiniRocketClassifier(random_state=seed)
    machine.fit(fixed(split.training), split.training_labels)
    return float((machine.predict(fixed(split.test)) == split.test_labels).mean())


def judge_human(
    human: HumanSet, steps: int, seed: int, tell: Callable[[int, int], None]
) -> dict[str, float]:
    """Accuracies of the trunk and of MiniRocket, padded and stretched, on one split."""
    split = split_of(human.name, seed)
    trunk = fit_trunk(split.training, split.training_labels, seed, steps, tell)
    said = trunk.probabilities(split.test).argmax(1)
    return {
        "ours": float((said == split.test_labels).mean()),
        "padded": minirocket_accuracy(split, seed, stretch=False),
        "stretched": minirocket_accuracy(split, seed, stretch=True),
        "n": float(len(split.test)),
    }
