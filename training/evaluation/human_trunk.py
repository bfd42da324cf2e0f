"""How the network's trunk learns a data set of recordings: one recipe, whatever is recorded.

Most of it is variation: some sets have five series a class, and a network learns from them only if
it never sees the same one twice. Parts, paces, mixed channels and loudness are what differs between
two people, and between two performances of one; series mixed with each other, with their labels
mixed alike, keep it from being sure in between (mixup: arXiv 1710.09412).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from training.fit import THREADS
from training.network import Trunk

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

WIDTH = 48
"""Channels of the convolutions and units of the GRUs."""
STEPS = 500
BATCH = 32
LEARNING_RATE = 2e-3
WEIGHT_DECAY = 1e-2
SMOOTHING = 0.05
WARM_UP_SHARE = 0.15

USUAL_SAMPLES = 150
"""The median length that each set is brought to by one factor: the trunk's strides are for series
of some hundred samples, and vowels have fifteen."""
SHORTEST_SAMPLES = 8
CROP = (0.9, 1.0)
PACE = (0.87, 1.15)
SHARE_VARIED = 0.5
"""Of the series that are cropped, and of those whose pace is another."""
WAVE_KNOTS = 5
WARPING = 0.3
LOUDNESS = 0.2
MIXING = 0.15
NOISE = 0.05
MIXUP = 0.4


def read(series: Array32, at: NDArray[np.float64]) -> Array32:
    """A series (channels, N) at so many times; 0 is its first sample, 1 its last."""
    last = series.shape[1] - 1
    rows = [np.interp(at * last, np.arange(last + 1), channel) for channel in series]
    return np.array(rows, dtype=np.float32)


def _count(series: Array32, factor: float) -> int:
    return max(SHORTEST_SAMPLES, int(series.shape[1] * factor + 0.5))


def _wave(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """So many samples of what changes slowly around 0."""
    knots = rng.standard_normal(WAVE_KNOTS)
    return np.interp(np.linspace(0.0, WAVE_KNOTS - 1.0, count), np.arange(WAVE_KNOTS), knots)


def varied(series: Array32, factor: float, rng: np.random.Generator) -> Array32:
    """A series as another person might have made it.

    Args:
        series: (channels, N), standardised.
        factor: of samples, where nothing is varied.
        rng: draws the variation.
    """
    channels = len(series)
    share = rng.uniform(*CROP) if rng.random() < SHARE_VARIED else 1.0
    begin = rng.uniform(0.0, 1.0 - share)
    slower = np.exp(rng.uniform(*np.log(PACE))) if rng.random() < SHARE_VARIED else 1.0
    count = _count(series, factor * share * slower)
    passed = np.cumsum(np.exp(WARPING * _wave(rng, count)))
    at = begin + share * (passed - passed[0]) / (passed[-1] - passed[0])
    others = rng.standard_normal((channels, channels)) / np.sqrt(channels)
    mixing = np.eye(channels) + MIXING * others
    louder = 1.0 + LOUDNESS * _wave(rng, count)
    performed = mixing @ read(series, at) * louder
    made: Array32 = (performed + NOISE * rng.standard_normal(performed.shape)).astype(np.float32)
    return made


def _batch(series: Sequence[Array32]) -> tuple[Tensor, Tensor]:
    """Series (n, channels, T), zero-padded, and their masks (n, 1, T)."""
    longest = max(one.shape[1] for one in series)
    padded = np.zeros((len(series), len(series[0]), longest), dtype=np.float32)
    mask = np.zeros((len(series), 1, longest), dtype=np.float32)
    for row, one in enumerate(series):
        padded[row, :, : one.shape[1]] = one
        mask[row, 0, : one.shape[1]] = 1.0
    return torch.from_numpy(padded), torch.from_numpy(mask)


def _timed(series: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """With the time since the beginning as a channel: some gestures hardly differ otherwise."""
    return torch.cat([series, mask.cumsum(2) * mask / USUAL_SAMPLES], 1), mask


@dataclass(frozen=True)
class FittedTrunk:
    """A trained trunk.

    Attributes:
        network: in evaluation mode.
        factor: by which a series gets more samples before the network sees it.
    """

    network: Trunk
    factor: float

    def probabilities(self, series: Sequence[Array32]) -> Array32:
        """Of each class, (n, classes), for standardised series, each (channels, N)."""
        seen = [read(one, np.linspace(0.0, 1.0, _count(one, self.factor))) for one in series]
        with torch.no_grad():
            said = [self.network(*_timed(*_batch([one]))).softmax(1).numpy() for one in seen]
        return np.concatenate(said)


def fit_trunk(
    training: Sequence[Array32],
    labels: IntArray,
    seed: int,
    steps: int = STEPS,
    tell: Callable[[int, int], None] = lambda _done, _of: None,
) -> FittedTrunk:
    """Train on standardised series, each (channels, N) of any length, and their labels (n,)."""
    torch.set_num_threads(THREADS)
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    factor = USUAL_SAMPLES / float(np.median([one.shape[1] for one in training]))
    targets = F.one_hot(torch.from_numpy(labels)).float()
    network = Trunk(len(training[0]) + 1, targets.shape[1], WIDTH).train()
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, steps, pct_start=WARM_UP_SHARE
    )
    waiting: list[int] = []
    for step in range(steps):
        if len(waiting) < BATCH:
            waiting += rng.permutation(len(training)).tolist()
        rows, waiting = waiting[:BATCH], waiting[BATCH:]
        series, mask = _batch([varied(training[row], factor, rng) for row in rows])
        wanted = targets[rows]
        # Each remains itself for the most part: its own mask goes with it.
        part = rng.beta(MIXUP, MIXUP, len(rows)).astype(np.float32)
        own = torch.from_numpy(np.maximum(part, 1.0 - part))[:, None]
        other = rng.permutation(len(rows)).tolist()
        series = own[..., None] * series + (1.0 - own[..., None]) * series[other] * mask
        wanted = own * wanted + (1.0 - own) * wanted[other]
        optimiser.zero_grad()
        loss = F.cross_entropy(network(*_timed(series, mask)), wanted, label_smoothing=SMOOTHING)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        tell(step + 1, steps)
    return FittedTrunk(network.eval(), factor)
