"""Fits the network: random windows anew in every epoch, a validation loss, and a calibration."""

import copy
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from common.sticks import FULL_STICK
from services.classifier.window import WINDOW_SAMPLES
from training.calibration import Scaling, confidence_min_of, platt_of, scaling_of
from training.dataset.primitive import Primitive
from training.network import Architecture, Calibrated, Network
from training.windows import (
    NONE_INDEX,
    Array32,
    Examples,
    Windows,
    asked_windows,
    examples_of,
    joined,
    padded,
    random_tracks,
    random_windows,
)

FULL_YAW_RADPS = FULL_STICK["tum"].yaw_radps
"""Of the vehicle that simulated people fly; the graph takes any other."""
VALIDATION_CUTS = 3
MEANT_WEIGHT = 0.5
"""Of the loss of `meant`, beside that of the primitives."""
MIXED = torch.distributions.Beta(torch.tensor(0.3), torch.tensor(0.3))
"""Each window's features are mixed with another one's in such shares (Zhang et al. 2018)."""
MEASURED = 2000
"""Windows that features are standardised by."""
AVERAGE_STEPS = 200
"""The weights that are kept are a running mean over about so many steps."""
WARM_UP_SHARE = 0.15
THREADS = 1
"""One order of sums, so the same seed gives the same network on any number of cores."""


@dataclass(frozen=True)
class Budget:
    """How long to train.

    Attributes:
        windows: shown in all, in whole epochs.
        batch: windows a step.
        learning_rate: at its highest; it rises from, and falls to nearly nothing along a cosine.
        weight_decay: of AdamW.
    """

    windows: int
    batch: int = 96
    learning_rate: float = 3e-3
    weight_decay: float = 1e-2

    def epochs(self, examples: int) -> int:
        """Whole epochs over so many examples."""
        return max(1, round(self.windows / examples))


EVALUATION = Budget(windows=1_200_000)
"""For one fold of an evaluation."""


UNSCALED: Scaling = (0.0, 0.0)


@dataclass(frozen=True)
class Epoch:
    """How an epoch went; losses are in nats a window, `meant`'s share included."""

    number: int
    training_loss: float
    validation_loss: float
    validation_accuracy: float
    is_best: bool


@dataclass(frozen=True)
class Fitted:
    """A trained network with its calibration and its history.

    Attributes:
        network: in evaluation mode.
        scaling: of the primitives' logits; see training/calibration.py.
        platt: scale and shift of the logit of `meant`.
        confidence_min: `meant` times the largest probability above which 95 % of answers are right.
        history: of the training.
    """

    network: Network
    scaling: Scaling = UNSCALED
    platt: tuple[float, float] = (1.0, 0.0)
    confidence_min: float = 0.5
    history: tuple[Epoch, ...] = field(default=(), repr=False)

    @property
    def calibrated(self) -> Calibrated:
        """The module that answers as the exported file does."""
        return Calibrated(self.network, self.scaling, self.platt).eval()

    def probabilities(
        self, windows: Windows, full_yaw_radps: float = FULL_YAW_RADPS
    ) -> NDArray[np.float32]:
        """Of the four primitives, (n, 4)."""
        return self.answers(windows, full_yaw_radps)[0]

    def meant(
        self, windows: Windows, full_yaw_radps: float = FULL_YAW_RADPS
    ) -> NDArray[np.float32]:
        """The probability (n,) that a primitive is meant at all."""
        return self.answers(windows, full_yaw_radps)[1]

    def answers(
        self, windows: Windows, full_yaw_radps: float = FULL_YAW_RADPS
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Probabilities (n, 4) and meant (n,)."""
        probabilities, meant = said(self.calibrated, windows, full_yaw_radps)
        return probabilities.numpy(), meant.numpy()


def inputs_of(windows: Windows, full_yaw_radps: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Windows as the graph's inputs."""
    yaw = torch.full((len(windows),), full_yaw_radps)
    sticks, times_s = torch.from_numpy(windows.sticks), torch.from_numpy(windows.times_s)
    return sticks, times_s, torch.from_numpy(windows.lengths), yaw


def said(
    module: nn.Module, windows: Windows, full_yaw_radps: float = FULL_YAW_RADPS, batch: int = 256
) -> tuple[Tensor, Tensor]:
    """What a `Network` or a `Calibrated` says of windows, (n, 4) and (n,)."""
    module.eval()
    parts = []
    with torch.no_grad():
        for begin in range(0, len(windows), batch):
            rows = slice(begin, begin + batch)
            samples = int(windows.lengths[rows].max())
            part = Windows(
                windows.sticks[rows, :samples],
                windows.times_s[rows, :samples],
                windows.lengths[rows],
                windows.labels[rows],
            )
            parts.append(module(*inputs_of(part, full_yaw_radps)))
    return torch.cat([p for p, _ in parts]), torch.cat([m for _, m in parts])


def loss_of(logits: Tensor, meant: Tensor, labels: Tensor) -> Tensor:
    """Cross-entropy of the primitives where one is meant, and of whether one is."""
    is_meant = labels != NONE_INDEX
    loss = MEANT_WEIGHT * F.binary_cross_entropy_with_logits(meant, is_meant.to(meant.dtype))
    if bool(is_meant.any()):
        of_shape = F.cross_entropy(logits[is_meant], labels[is_meant], reduction="sum")
        loss = loss + of_shape / len(labels)
    return loss


def accuracy_of(logits: Tensor, labels: Tensor) -> float:
    """Share of the primitives that are named right."""
    is_meant = labels != NONE_INDEX
    right = (logits.argmax(1) == labels)[is_meant]
    return float(right.float().mean().item()) if len(right) else 0.0


class Training:
    """A training that can be stopped after any epoch and gone on with.

    Args:
        training: what to learn from; cut anew in every epoch.
        validation: other operators' examples, cut the same way throughout.
        seed: the same seed and machine give the same network.
        budget: how long.
        architecture: of the network.
        augment: whether to splice, mirror and scale.
        cuts: whether to cut; otherwise it sees whole primitives only.
        name: of the run; a checkpoint of another one is refused.
    """

    def __init__(
        self,
        training: Examples,
        validation: Examples,
        seed: int,
        budget: Budget,
        architecture: Architecture | None = None,
        *,
        augment: bool = True,
        cuts: bool = True,
        name: str = "",
    ) -> None:
        torch.set_num_threads(THREADS)
        torch.use_deterministic_algorithms(True)
        torch.manual_seed(seed)
        self._examples, self._budget = training, budget
        self._augment, self._cuts = augment, cuts
        self._name = name
        self._rng = np.random.default_rng(seed)
        drawn = [
            random_windows(validation, self._rng, augment=False) for _ in range(VALIDATION_CUTS)
        ]
        self.held = joined(drawn)
        self._asked = asked_windows(validation, self._rng)
        self._held_labels = torch.from_numpy(self.held.labels)
        self._network = Network(architecture)
        self._measure(training)
        self._average = copy.deepcopy(self._network).requires_grad_(False)
        self._optimiser = torch.optim.AdamW(
            self._network.parameters(),
            lr=budget.learning_rate,
            weight_decay=budget.weight_decay,
        )
        self.epochs = budget.epochs(len(training))
        steps = -(-len(training) // budget.batch)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(
            self._optimiser,
            budget.learning_rate,
            total_steps=steps * self.epochs + 1,
            pct_start=WARM_UP_SHARE,
        )
        self._steps = 0
        self._best = self._average.state_dict()
        self.history: list[Epoch] = []

    @property
    def is_over(self) -> bool:
        """Whether all epochs are done."""
        return len(self.history) >= self.epochs

    def epoch(self, on_batch: Callable[[int, int], None] = lambda _done, _of: None) -> Epoch:
        """One pass over all examples; `on_batch` is told how many of how many batches are done."""
        tracks = self._tracks()
        labels = self._examples.labels
        self._network.train()
        loss_sum = 0.0
        # Not by length, which would pad less: batch norms would see other lengths than they fly.
        size = self._budget.batch
        order = self._rng.permutation(len(tracks))
        batches = [order[begin : begin + size] for begin in range(0, len(order), size)]
        for done, rows in enumerate(batches, 1):
            windows = padded([tracks[k] for k in rows], labels[rows])
            loss = self._step(windows)
            loss_sum += loss * len(rows)
            on_batch(done, len(batches))
        logits, meant = said(self._average, self.held)
        held_loss = float(loss_of(logits, meant, self._held_labels).item())
        is_best = all(held_loss < before.validation_loss for before in self.history)
        if is_best:
            self._best = copy.deepcopy(self._average.state_dict())
        epoch = Epoch(
            len(self.history) + 1,
            loss_sum / len(labels),
            held_loss,
            accuracy_of(logits, self._held_labels),
            is_best,
        )
        self.history.append(epoch)
        return epoch

    def fitted(self) -> Fitted:
        """The best network so far, calibrated on the validation windows."""
        network = copy.deepcopy(self._average)
        network.load_state_dict(self._best)
        return calibrated(network.eval(), self._asked, tuple(self.history))

    def save(self, path: Path) -> None:
        """Write all that `resume` needs."""
        part = path.with_suffix(".part")
        torch.save(
            {
                "name": self._name,
                "network": self._network.state_dict(),
                "average": self._average.state_dict(),
                "best": self._best,
                "optimiser": self._optimiser.state_dict(),
                "schedule": self._schedule.state_dict(),
                "steps": self._steps,
                "history": [vars(epoch) for epoch in self.history],
                "rng": self._rng.bit_generator.state,
                "torch_rng": torch.get_rng_state(),
            },
            part,
        )
        part.replace(path)

    def resume(self, path: Path) -> None:
        """Go on where `save` was called, with the same data, seed and budget.

        Raises:
            OSError: if the checkpoint is of another run, or none at all.
        """
        try:
            state = torch.load(path, weights_only=True)
        except (RuntimeError, EOFError, pickle.UnpicklingError) as error:
            reason = str(error).split(". ")[0]
            raise OSError(f"checkpoint {path}: cannot be read: {reason}") from None
        name = state.get("name") if isinstance(state, dict) else None
        if name is None:
            raise OSError(f"checkpoint {path}: is none; run without --resume to begin anew")
        if name != self._name:
            raise OSError(
                f"checkpoint {path}: is of {name}, not of {self._name};"
                " run without --resume to begin anew"
            )
        try:
            self._network.load_state_dict(state["network"])
        except RuntimeError:
            raise OSError(
                f"checkpoint {path}: is of another network; run without --resume to begin anew"
            ) from None
        self._average.load_state_dict(state["average"])
        self._best = state["best"]
        self._optimiser.load_state_dict(state["optimiser"])
        self._schedule.load_state_dict(state["schedule"])
        self._steps = state["steps"]
        self.history = [Epoch(**epoch) for epoch in state["history"]]
        self._rng.bit_generator.state = state["rng"]
        torch.set_rng_state(state["torch_rng"])

    def _measure(self, examples: Examples) -> None:
        """Standardises the summary's features by some of the windows that will be learned from."""
        some = examples.rows(self._rng.permutation(len(examples))[:MEASURED])
        windows = random_windows(some, self._rng, augment=self._augment)
        self._network.measure(*inputs_of(windows, FULL_YAW_RADPS))

    def _tracks(self) -> list[Array32]:
        if self._cuts:
            return random_tracks(self._examples, self._rng, augment=self._augment)
        return whole_tracks(self._examples)

    def _step(self, windows: Windows) -> float:
        """One step of the optimiser; loss of the batch."""
        labels = torch.from_numpy(windows.labels)
        self._optimiser.zero_grad()
        features = self._network.features(*inputs_of(windows, FULL_YAW_RADPS))
        share = float(MIXED.sample().item())
        other = torch.randperm(len(labels))
        logits, meant = self._network.answers(
            [share * one + (1.0 - share) * one[other] for one in features]
        )
        loss = share * loss_of(logits, meant, labels)
        loss = loss + (1.0 - share) * loss_of(logits, meant, labels[other])
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self._network.parameters(), 1.0)
        self._optimiser.step()
        self._schedule.step()
        self._steps += 1
        # At first the mean is over fewer steps, so that it forgets the beginning.
        share = max(1.0 / AVERAGE_STEPS, 9.0 / (10.0 + self._steps))
        with torch.no_grad():
            weights = zip(self._average.parameters(), self._network.parameters(), strict=True)
            for mean, weight in weights:
                mean.lerp_(weight, share)
            # Batch norms' means and variances are running means already.
            for kept, now in zip(self._average.buffers(), self._network.buffers(), strict=True):
                kept.copy_(now)
        return float(loss.item())


def calibrated(network: Network, asked: Windows, history: tuple[Epoch, ...] = ()) -> Fitted:
    """A network with scaling, `meant` and threshold fitted on windows it has not learned."""
    logits, meant = said(network, asked)
    labels = torch.from_numpy(asked.labels)
    is_meant = labels != NONE_INDEX
    lengths = torch.from_numpy(asked.lengths)[is_meant]
    scaling = scaling_of(logits[is_meant], lengths, labels[is_meant])
    # Without a single `none` there is nothing to tell apart: all is meant.
    platt = (1.0, 0.0) if bool(is_meant.all()) else platt_of(meant, is_meant)
    fitted = Fitted(network, scaling, platt, history=history)
    threshold = confidence_min_of(*fitted.answers(asked), asked.labels)
    return replace(fitted, confidence_min=threshold)


def fit_network(
    training: Sequence[Primitive],
    validation: Sequence[Primitive],
    seed: int,
    budget: Budget = EVALUATION,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Fitted:
    """Train on people and calibrate on others.

    Args:
        training: performances of the four primitives and of none.
        validation: the same by other people.
        seed: the same seed, data and machine give the same network.
        budget: how long.
        progress: told how many of how many epochs are done.
    """
    run = Training(examples_of(training), examples_of(validation), seed, budget)
    while not run.is_over:
        run.epoch()
        progress(len(run.history), run.epochs)
    return run.fitted()


def whole_tracks(examples: Examples) -> list[Array32]:
    """Each primitive as it is at its end."""
    return [track[-WINDOW_SAMPLES:] for track in examples.tracks]
