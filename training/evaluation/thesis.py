"""The thesis' two classifiers: the support vector machine and the network, as it describes them."""

import copy

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from training.evaluation.contender import Lesson, Scores, Tell
from training.evaluation.views import in_start_frame, padded, thinned
from training.labels import PRIMITIVES
from training.svm import POINTS, machine
from training.windows import Windows

Array32 = NDArray[np.float32]
IntArray = NDArray[np.int64]

SAMPLES = 200
"""Sequences are padded to this; of longer ones it sees the newest."""
WIDTH = 64
TAPS = (7, 5, 5, 3)
STRIDES = (2, 2, 1, 1)
DROPOUT = 0.3
BATCH = 128
LEARNING_RATE = 1e-3
EPOCHS, PATIENCE_EPOCHS = 16, 3


def machine_rows(windows: Windows, full_yaw_radps: float) -> NDArray[np.float64]:
    """(n, 200): 100 roll (vy) then 100 pitch (vx) samples, over each window's own length."""
    rows = []
    sticks = in_start_frame(windows, full_yaw_radps)
    for one, length in zip(sticks, windows.lengths, strict=True):
        at, index = np.linspace(0.0, length - 1.0, POINTS), np.arange(length)
        rows.append(np.concatenate([np.interp(at, index, one[:length, axis]) for axis in (1, 0)]))
    return np.stack(rows)


class ThesisMachine:
    """Section 3.1's machine, asked for all four primitives. It does not see vz."""

    name = "svm"
    has_probabilities = False

    def fit(self, lesson: Lesson, _seed: int, tell: Tell) -> None:
        """Learn from the windows."""
        self._yaw_radps = lesson.full_yaw_radps
        some = thinned(lesson.windows)
        self._machine = machine()
        self._machine.fit(machine_rows(some, self._yaw_radps), some.labels)
        tell(1, 1)

    def scores(self, windows: Windows) -> Scores:
        """Its decision function."""
        rows = machine_rows(windows, self._yaw_radps)
        return np.asarray(self._machine.decision_function(rows))


class Network(nn.Module):
    """Figure 4.2: batch norm, four convolutions, dropout, two GRUs, dropout, softmax.

    Numbers of filters, their sizes and strides are not in the thesis; these are ours.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.BatchNorm1d(3)]
        for number, (taps, stride) in enumerate(zip(TAPS, STRIDES, strict=True)):
            layers += [
                nn.Conv1d(WIDTH if number else 3, WIDTH, taps, stride, padding=taps // 2),
                nn.BatchNorm1d(WIDTH),
                nn.LeakyReLU(0.1),
            ]
        self.convolutions = nn.Sequential(*layers, nn.Dropout(DROPOUT))
        self.gru = nn.GRU(WIDTH, WIDTH, num_layers=2, batch_first=True)
        self.head = nn.Sequential(nn.Dropout(DROPOUT), nn.Linear(WIDTH, classes))

    def forward(self, series: Tensor) -> Tensor:
        """Logits (n, classes) of padded series (n, 3, T): of the last state, padding and all."""
        states, _ = self.gru(self.convolutions(series).transpose(1, 2))
        return self.head(states[:, -1])  # type: ignore[no-any-return]


class ThesisNetwork:
    """Section 4.1's network: early stopping on other people, then once more on all of them."""

    name = "cnn-gru-thesis"
    has_probabilities = True

    def fit(self, lesson: Lesson, seed: int, tell: Tell) -> None:
        """Learn, note the best epoch, learn again from training and validation people."""
        self._yaw_radps = lesson.full_yaw_radps
        some, other = thinned(lesson.windows), thinned(lesson.held)
        series, held = self._series(some), self._series(other)
        labels, held_labels = some.labels, other.labels
        epochs, self.history = self._train(
            series, labels, seed, EPOCHS, lambda done, of: tell(done, 2 * of), held, held_labels
        )
        self._train(
            np.concatenate([series, held]),
            np.concatenate([labels, held_labels]),
            seed,
            epochs,
            lambda done, of: tell(of + done, 2 * of),
        )

    def _train(
        self,
        series: Array32,
        labels: IntArray,
        seed: int,
        epochs: int,
        tell: Tell,
        held: Array32 | None = None,
        held_labels: IntArray | None = None,
    ) -> tuple[int, list[tuple[float, float]]]:
        """Train for `epochs`, or until the held loss no longer falls; the epoch that was best."""
        torch.manual_seed(seed)
        rng = np.random.default_rng(seed)
        self._network = Network(len(PRIMITIVES))
        counts = np.bincount(labels, minlength=len(PRIMITIVES))
        weights = torch.tensor(len(labels) / (len(counts) * counts), dtype=torch.float32)
        loss_of = nn.CrossEntropyLoss(weights)
        optimiser = torch.optim.Adam(self._network.parameters(), lr=LEARNING_RATE)
        best, best_epoch, best_state = float("inf"), epochs, None
        history: list[tuple[float, float]] = []
        for epoch in range(1, epochs + 1):
            self._network.train()
            order, total = rng.permutation(len(labels)), 0.0
            for begin in range(0, len(order), BATCH):
                rows = order[begin : begin + BATCH]
                optimiser.zero_grad()
                logits = self._network(torch.from_numpy(series[rows]))
                loss = loss_of(logits, torch.from_numpy(labels[rows]))
                loss.backward()
                optimiser.step()
                total += float(loss.item()) * len(rows)
            tell(epoch, epochs)
            if held is None or held_labels is None:
                continue
            held_loss = float(
                nn.functional.cross_entropy(self._logits(held), torch.from_numpy(held_labels))
            )
            history.append((total / len(order), held_loss))
            if held_loss < best:
                best, best_epoch = held_loss, epoch
                best_state = copy.deepcopy(self._network.state_dict())
            elif epoch - best_epoch >= PATIENCE_EPOCHS:
                break
        if best_state is not None:
            self._network.load_state_dict(best_state)
        return best_epoch, history

    def _logits(self, series: Array32) -> Tensor:
        self._network.eval()
        with torch.no_grad():
            return torch.cat(
                [
                    self._network(torch.from_numpy(series[begin : begin + 512]))
                    for begin in range(0, len(series), 512)
                ]
            )

    def _series(self, windows: Windows) -> Array32:
        return padded(windows, self._yaw_radps, SAMPLES)

    def scores(self, windows: Windows) -> Scores:
        """The softmax."""
        logits = self._logits(self._series(windows))
        return np.asarray(torch.softmax(logits, 1).numpy(), dtype=np.float64)
