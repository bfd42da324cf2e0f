"""Four convolutions and two GRUs, as in the thesis, on what the sticks draw in space.

One graph from raw sticks to probabilities: everything the network sees is computed inside, so that
no service can prepare its input otherwise than training did.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from training.calibration import Scaling, scaled
from training.geometry import Geometry
from training.labels import PRIMITIVES

VERSION = 2
"""Of what the shapes of weights do not tell: channels, features, their order and formulas. Add 1
with each change of these: weights of another version are refused."""
LEAK = 0.1
TAPS = (7, 5, 5, 3)
"""Of the convolutions."""
LARGEST = 6.0
"""Inputs beyond so many standard deviations say no more than this."""
FLAT = 0.05
"""Added to a feature's standard deviation."""
# Decisions, each yes or no: curved, climbing, alternating. A primitive is what they come to; those
# that do not bear on it are left out (its row's sign is 0).
DECISIONS = {
    "line": (-1, 0, 0),
    "arc": (1, -1, -1),
    "sine": (1, -1, 1),
    "helix": (1, 1, 0),
}


@dataclass(frozen=True)
class Architecture:
    """Sizes, and what may be left out to see what it is worth.

    Attributes:
        width: channels of the convolutions and units of the GRUs; 0 leaves both out.
        strides: of the convolutions.
        summary: units of the two layers that read the summary; 0 leaves it out.
        head: units of the head's hidden layer.
        dropout: of all dropout layers.
        noise: on the summary's features in training, in standard deviations of each.
        absent: share of the windows in training whose series' features are left out, so that the
            summary is learned to be read alone as well.
        geometry: whether convolutions see geometry, or the sticks alone.
        decisions: whether the four probabilities are composed of three decisions.
        pooling: what is taken of the GRUs' states over time.
    """

    width: int = 24
    strides: tuple[int, int, int, int] = (2, 2, 2, 2)
    summary: int = 128
    head: int = 64
    dropout: float = 0.1
    noise: float = 0.15
    absent: float = 0.5
    geometry: bool = True
    decisions: bool = True
    pooling: tuple[str, ...] = ("last", "mean", "largest")


class _Standard(nn.Module):
    """Features with mean 0 and variance 1 over windows that are measured once."""

    mean: Tensor
    scale: Tensor

    def __init__(self, features: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))

    def measure(self, x: Tensor) -> None:
        """Take means and deviations of rows (n, features)."""
        self.mean.copy_(x.mean(0))
        # Some features hardly vary: without a floor their rounding errors would count.
        self.scale.copy_(1.0 / (x.std(0) + FLAT))

    def forward(self, x: Tensor) -> Tensor:
        return ((x - self.mean) * self.scale).clamp(-LARGEST, LARGEST)


class _Convolution(nn.Module):
    """Conv1d, batch norm, LeakyReLU; of 0 where padded, so its length changes nothing."""

    def __init__(self, inputs: int, outputs: int, taps: int, stride: int) -> None:
        super().__init__()
        self.conv = nn.Conv1d(inputs, outputs, taps, stride, padding=taps // 2, bias=False)
        self.norm = nn.BatchNorm1d(outputs)
        self.stride = stride

    def forward(self, x: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        x = F.leaky_relu(self.norm(self.conv(x * mask)), LEAK)
        return x, mask[:, :, :: self.stride]


class Encoder(nn.Module):
    """Four convolutions, two GRUs and pooling: series of any length to features of one size.

    Args:
        channels: of the series.
        width: channels of the convolutions and units of the GRUs.
        strides: of the convolutions.
        dropout: between convolutions and GRUs.
        pooling: of "last", "mean", "largest".
    """

    def __init__(
        self,
        channels: int,
        width: int,
        strides: tuple[int, int, int, int],
        dropout: float,
        pooling: tuple[str, ...] = Architecture.pooling,
    ) -> None:
        super().__init__()
        self.standardise = nn.BatchNorm1d(channels)
        inputs = (channels, width, width, width)
        self.convolutions = nn.ModuleList(
            _Convolution(before, width, taps, stride)
            for before, taps, stride in zip(inputs, TAPS, strides, strict=True)
        )
        self.dropout = nn.Dropout(dropout)
        self.gru = nn.GRU(width, width, num_layers=2, batch_first=True)
        self.pooling = pooling
        self.features = width * len(pooling)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """Features (B, features) of series (B, channels, T); mask (B, 1, T) is 1 where real."""
        x = self.standardise(x).clamp(-LARGEST, LARGEST)
        for convolution in self.convolutions:
            x, mask = convolution(x, mask)
        # What comes after the last real step changes no state before it.
        states, _ = self.gru(self.dropout(x.transpose(1, 2)))
        shares = []
        if "last" in self.pooling:
            # The last real step: the only one that no real one follows.
            shares.append(mask - F.pad(mask, (-1, 1)))
        if "mean" in self.pooling:
            shares.append(mask / mask.sum(2, keepdim=True))
        pooled = [torch.matmul(torch.cat(shares, 1), states).flatten(1)] if shares else []
        if "largest" in self.pooling:
            pooled.append((states + torch.log(mask).transpose(1, 2)).amax(1))
        return torch.cat(pooled, 1)


TRUNK_STRIDES = (2, 2, 2, 1)
"""Recordings may be of 10 samples."""


class Trunk(nn.Module):
    """The network on any series: the encoder and a linear head, without sticks or geometry.

    Args:
        channels: of the series.
        classes: how many labels.
        width: channels of the convolutions and units of the GRUs.
        dropout: of both dropout layers.
    """

    def __init__(
        self,
        channels: int,
        classes: int,
        width: int = Architecture.width,
        dropout: float = Architecture.dropout,
    ) -> None:
        super().__init__()
        self.encoder = Encoder(channels, width, TRUNK_STRIDES, dropout)
        self.head = nn.Sequential(nn.Dropout(dropout), nn.Linear(self.encoder.features, classes))

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """Logits (B, classes) of series (B, channels, T >= 7) with a mask (B, 1, T)."""
        return self.head(self.encoder(x, mask))  # type: ignore[no-any-return]


class Network(nn.Module):
    """From sticks to what they mean: geometry, encoder and summary side by side, decisions."""

    against: Tensor
    costs: Tensor

    def __init__(self, architecture: Architecture | None = None) -> None:
        super().__init__()
        self.architecture = a = architecture or Architecture()
        self.geometry = Geometry()
        features = 0
        if a.width:
            channels = Geometry.CHANNELS if a.geometry else len(Geometry.STICKS)
            self.encoder = Encoder(channels, a.width, a.strides, a.dropout, a.pooling)
            features += self.encoder.features
        if a.summary:
            self.standardise = _Standard(Geometry.SUMMARY)
            self.reader = nn.Sequential(
                nn.Linear(Geometry.SUMMARY, a.summary),
                nn.LeakyReLU(LEAK),
                nn.Dropout(a.dropout),
                nn.Linear(a.summary, a.summary),
                nn.LeakyReLU(LEAK),
            )
            features += a.summary
        answers = 3 if a.decisions else len(PRIMITIVES)
        self.head = nn.Sequential(
            nn.Dropout(a.dropout),
            nn.Linear(features, a.head),
            nn.LeakyReLU(LEAK),
            nn.Dropout(a.dropout),
            nn.Linear(a.head, answers + 1),
        )
        signs = torch.tensor([DECISIONS[label] for label in PRIMITIVES], dtype=torch.float32).T
        # Column k of `against` is decision k denied; column k + 3 the decision itself.
        against = torch.cat([-torch.eye(3), torch.eye(3)], 1)
        self.register_buffer("against", against, persistent=False)
        costs = -torch.cat([(signs > 0).float(), (signs < 0).float()])
        self.register_buffer("costs", costs, persistent=False)

    def forward(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Logits of the primitives (B, 4) and of `meant` (B,).

        Inputs as in services/classifier/model.py.
        """
        return self.answers(self.features(sticks, times_s, lengths, full_yaw_radps))

    def measure(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> None:
        """Standardise the summary by these windows, before anything is learned."""
        if self.architecture.summary:
            with torch.no_grad():
                _, _, summary = self.geometry(sticks, times_s, lengths, full_yaw_radps)
            self.standardise.measure(summary)

    def features(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> list[Tensor]:
        """What is known of windows: what the encoder makes of the series, and the summary."""
        a = self.architecture
        with torch.no_grad():
            x, mask, summary = self.geometry(sticks, times_s, lengths, full_yaw_radps)
        features = []
        if a.width:
            series = self.encoder(x if a.geometry else x[:, Geometry.STICKS], mask)
            if self.training and a.summary:
                series = series * (torch.rand(len(series), 1) >= a.absent)
            features.append(series)
        if a.summary:
            summary = self.standardise(summary)
            if self.training:
                summary = summary + a.noise * torch.randn_like(summary)
            features.append(summary)
        return features

    def answers(self, features: list[Tensor]) -> tuple[Tensor, Tensor]:
        """Logits of the primitives (B, 4) and of `meant` (B,) of what `features` gave."""
        *series, last = features
        if self.architecture.summary:
            last = self.reader(last)
        out = self.head(torch.cat([*series, last], 1))
        logits, meant = out[:, :-1], out[:, -1]
        if self.architecture.decisions:
            # log(sigmoid(z)) = -softplus(-z): the probability of a chain is the sum of these.
            logits = F.softplus(logits @ self.against) @ self.costs
        return logits, meant


class Calibrated(nn.Module):
    """A network with its calibration: what is exported.

    Args:
        network: which.
        scaling: of the primitives' logits; see training/calibration.py.
        meant: scale and shift of the logit of `meant`.
    """

    scaling: Tensor

    def __init__(self, network: Network, scaling: Scaling, meant: tuple[float, float]) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("scaling", torch.tensor(scaling))
        self.meant = meant

    def forward(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Probabilities (B, 4) and meant (B,)."""
        logits, meant = self.network(sticks, times_s, lengths, full_yaw_radps)
        scale, shift = self.meant
        probabilities = torch.softmax(scaled(logits, lengths, self.scaling), 1)
        return probabilities, torch.sigmoid(meant * scale + shift)
