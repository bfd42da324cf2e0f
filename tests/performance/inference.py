"""`make bench-classifier`: how long the classifier takes, as one table.

First in this process, on one thread; then through a router, by asking the running service. Beside
each figure stands what it is measured against, timed in the same run, turn by turn.
"""

import argparse
import contextlib
import json
import multiprocessing
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from cli import launch
from common import messages as m
from common.bus import Bus, QueryFailedError
from common.clock import NS_PER_S, SystemClock, nanoseconds, seconds, sleep
from common.node import ASK_TIMEOUT_S, Node
from common.topics import alive_key_of
from common.zenoh_bus import ZenohBus
from services.classifier.config import SHIPPED_MODEL, Config
from services.classifier.core import Classifier
from services.classifier.model import OnnxModel
from services.classifier.window import MODEL_RATE_HZ, WINDOW_S, WINDOW_SAMPLES, StickWindow, at_rate

Call = Callable[[], object]

SAMPLES = tuple(sorted({50, 100, 200, WINDOW_SAMPLES}))
PAD_HZ = 100
PERIOD_S = 0.1
IN_PROCESS_TARGET = "p50 <= 0.2, p99 <= 0.3"
ON_BUS_TARGET = "p99 <= 2"
BLOCK, WARM_UP = 50, 5
"""Calls of one kind in a row before the other kind has its turn: both see the same machine."""
START_TIMEOUT_S = 60.0
ECHO_KEY = "bench/echo"


@dataclass(frozen=True)
class Row:
    """One thing's times in ms beside those of what it is measured against."""

    what: str
    p50_ms: float
    p99_ms: float
    against: str
    against_p50_ms: float
    against_p99_ms: float
    target: str
    count: int


def race(what: str, call: Call, against: str, other: Call, count: int, target: str = "") -> Row:
    """Time two calls in turns."""
    clock = SystemClock()
    times_ms: tuple[list[float], list[float]] = ([], [])
    for _ in range(max(1, count // BLOCK)):
        for asked, taken in zip((call, other), times_ms, strict=True):
            for turn in range(WARM_UP + BLOCK):
                begin_ns = clock.monotonic_ns()
                asked()
                if turn >= WARM_UP:
                    taken.append(seconds(clock.monotonic_ns() - begin_ns) * 1e3)
    (p50, p99), (other_p50, other_p99) = (np.percentile(taken, [50, 99]) for taken in times_ms)
    return Row(
        what,
        float(p50),
        float(p99),
        against,
        float(other_p50),
        float(other_p99),
        target,
        len(times_ms[0]),
    )


def swinging(duration_s: float, rate_hz: float) -> list[m.Stick]:
    """Sticks of an operator who swings to and fro and turns a little."""
    times_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    return [
        m.Stick(
            stamp=nanoseconds(time_s),
            seq=seq,
            vx=0.6,
            vy=float(0.5 * np.sin(2.0 * time_s)),
            vz=0.1,
            wz=0.2,
        )
        for seq, time_s in enumerate(times_s.tolist())
    ]


def made_anew(sticks: Sequence[m.Stick]) -> NDArray[np.float32]:
    """The window from all its sticks at once: what `StickWindow` saves at each intent."""
    stamps_ns = np.array([stick.stamp for stick in sticks], dtype=np.int64)
    axes = np.array([(stick.vx, stick.vy, stick.vz, stick.wz) for stick in sticks])
    rows = at_rate((stamps_ns - stamps_ns[0]) / NS_PER_S, axes)
    return np.ascontiguousarray(rows[-WINDOW_SAMPLES:], dtype=np.float32)


def window_row(count: int) -> Row:
    """The window's share of an intent: ten sticks taken and the window asked, or made anew."""
    periods = (count + BLOCK) * (BLOCK + WARM_UP) // BLOCK
    sticks = swinging(periods * PERIOD_S, PAD_HZ)
    a_period, a_window = round(PERIOD_S * PAD_HZ), round(WINDOW_S * PAD_HZ)
    window = StickWindow()
    coming = iter(sticks)

    def kept() -> object:
        for _ in range(a_period):
            window.add(next(coming))
        return window.motion()

    return race(
        f"window of {WINDOW_S:g} s at {PAD_HZ} Hz, T = {PERIOD_S} s",
        kept,
        "made anew each time",
        lambda: made_anew(sticks[:a_window]),
        count,
    )


def thesis_network() -> Callable[[NDArray[np.float32]], object]:
    """The thesis' network, untrained, as plain ONNX: of sticks that others have prepared."""
    import torch

    from training.evaluation.thesis import Network
    from training.labels import PRIMITIVES

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # Of batches of several series, which there are none of.
        warnings.simplefilter("ignore")
        path = Path(folder) / "thesis.onnx"
        torch.onnx.export(
            Network(len(PRIMITIVES)).eval(),
            (torch.zeros(1, 3, WINDOW_SAMPLES),),
            str(path),
            input_names=["series"],
            dynamic_axes={"series": {2: "time"}},
            dynamo=False,
        )
        session = onnxruntime.InferenceSession(path.read_bytes(), options)
    return lambda sticks: session.run(
        None, {"series": np.ascontiguousarray(sticks[None, :, :3].transpose(0, 2, 1))}
    )


def model_rows(model: OnnxModel, count: int) -> list[Row]:
    """From the sticks that a core holds to the intent, and its graph beside the thesis' network."""
    plain = thesis_network()
    rows = []
    for samples in SAMPLES:
        core = Classifier(Config(period_s=PERIOD_S), model)
        sticks = swinging(samples / MODEL_RATE_HZ, MODEL_RATE_HZ)
        for stick in sticks:
            core.on_stick(stick, stick.stamp)
        now_ns = sticks[-1].stamp
        window = made_anew(sticks)
        rows += [
            race(
                f"intent of {samples} samples",
                partial(core.intent, now_ns, now_ns),
                "its model alone",
                partial(model.answer, window, 1.0),
                count,
                IN_PROCESS_TARGET,
            ),
            race(
                f"model, {samples} samples",
                partial(model.answer, window, 1.0),
                "the thesis' network",
                partial(plain, window),
                count,
            ),
        ]
    return rows


def bus_rows(path: Path, vehicle: str, count: int) -> list[Row]:
    """`classifier/classify` through a router, beside an echo of the same bytes through it."""
    settings: dict[str, dict[str, Any]] = {
        "classifier": {"model": str(path), "period_s": str(PERIOD_S)}
    }
    with launch.running(["classifier"], settings, vehicle) as system:
        node = Node(ZenohBus(system.endpoint), vehicle, "bench")
        try:
            wait_for_classifier(node, vehicle, system)
            with echoing(node.bus, system.endpoint) as echo:
                return [bus_row(node, echo, samples, count) for samples in SAMPLES]
        finally:
            node.close()


def bus_row(node: Node, echo: Callable[[bytes], bytes], samples: int, count: int) -> Row:
    """A question of so many samples."""
    sticks = swinging(samples / MODEL_RATE_HZ, MODEL_RATE_HZ)
    question = m.ClassifyRequest(
        samples=[(stick.vx, stick.vy, stick.vz) for stick in sticks], rate=MODEL_RATE_HZ
    )
    return race(
        f"question of {samples} samples through the router",
        partial(node.ask, "classifier/classify", question),
        "an echo of its bytes",
        partial(echo, m.encode(question)),
        count,
        ON_BUS_TARGET,
    )


def serve_echo(endpoint: str, stop: Event) -> None:
    """Send each question back as it is, from a process of its own."""
    bus = ZenohBus(endpoint)
    bus.serve(ECHO_KEY, lambda request: request.reply(request.payload, ECHO_KEY))
    stop.wait()
    bus.close()


@contextlib.contextmanager
def echoing(bus: Bus, endpoint: str) -> Iterator[Callable[[bytes], bytes]]:
    """An echo service, as a call that asks it."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    process = context.Process(target=serve_echo, args=(endpoint, stop))
    process.start()

    def ask(payload: bytes) -> bytes:
        return bus.ask(ECHO_KEY, payload, ECHO_KEY, ASK_TIMEOUT_S)

    def is_served() -> bool:
        with contextlib.suppress(QueryFailedError):
            return ask(b"?") == b"?"
        return False

    try:
        while process.is_alive() and not is_served():
            sleep(0.1)
        yield ask
    finally:
        stop.set()
        process.join()


def wait_for_classifier(node: Node, vehicle: str, system: launch.System) -> None:
    """Return once the service answers.

    Raises:
        SystemFailedError: if it never does.
    """
    alive: set[str] = set()
    node.bus.watch(alive_key_of(vehicle, "*"), lambda key, _alive: alive.add(key.rsplit("/", 1)[1]))
    launch.wait_alive(system, alive, ["classifier"], threading.Event(), START_TIMEOUT_S)


def main() -> None:
    """Run the bench and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, default=SHIPPED_MODEL, help="the file to time")
    parser.add_argument("--count", type=int, default=3000, help="calls of each kind (3000)")
    parser.add_argument("--vehicle", default="bench", help="name on the network (bench)")
    parser.add_argument("--output", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    model = OnnxModel(options.model)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("window", total=3)
        rows = [window_row(options.count)]
        progress.update(task, advance=1, description="in this process")
        rows += model_rows(model, options.count)
        progress.update(task, advance=1, description="through a router")
        rows += bus_rows(options.model, options.vehicle, options.count // 3)
        progress.update(task, advance=1)
    table = Table(
        "ms",
        *("p50", "p99", "target", "against", "p50", "p99", "ratio"),
        title=f"{model.name}, {options.model.stat().st_size / 1e3:.0f} kB, one thread",
        caption=f"n = {options.count} calls of each kind in the process,"
        f" {options.count // 3} through the router",
    )
    for row in rows:
        table.add_row(
            row.what,
            f"{row.p50_ms:.3f}",
            f"{row.p99_ms:.3f}",
            row.target,
            row.against,
            f"{row.against_p50_ms:.3f}",
            f"{row.against_p99_ms:.3f}",
            f"{row.p50_ms / row.against_p50_ms:.2f}",
        )
    Console().print(table)
    if options.output:
        options.output.write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
