"""`make fits`: how well motions with known shapes are fitted, beside an oracle, and how fast.

Every case is fitted by ours and by a public method in the same run: circles by circle_fit's
Levenberg-Marquardt from its Taubin, as the thesis does; the others by scipy's least squares on the
geometric distance, which is given what no fit has: the truth as its first guess. Each figure is the
95th percentile of an error over all trials; a fit that is refused errs infinitely.
"""

import argparse
import json
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import circle_fit
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from cli import launch
from common import messages as m
from common.clock import NS_PER_S, SystemClock, seconds
from common.frames import Array, quaternion_of
from common.node import Node
from common.topics import alive_key_of
from common.zenoh_bus import ZenohBus
from services.synthesis.config import Config
from services.synthesis.core import Synthesizer
from services.synthesis.primitives import EXTENDED, PRIMITIVES
from services.synthesis.primitives.arc import Arc
from services.synthesis.primitives.helix import Helix
from services.synthesis.primitives.line import Line
from services.synthesis.primitives.plane import at_ways, way_of
from services.synthesis.primitives.shape import Example, UnfitError
from services.synthesis.primitives.sine import Sine

RESAMPLES = 1000
REFUSED = 1e9
START_TIMEOUT_S = 60.0
SPEED_MPS = 0.8
FLOWN_S, AHEAD_S = 4.0, 3.0
POSE_HZ = 100
TARGET_FIT_MS, TARGET_BUS_MS, TARGET_AHEAD = 2.0, 5.0, 0.05


@dataclass(frozen=True)
class Row:
    """One case.

    Attributes:
        case: what was flown, and the noise.
        error: which error, and its unit.
        refused: trials that ours refused.
        ours: its 95th percentile.
        oracle: the oracle's.
        ratio: ours over the oracle's.
        low: of the ratio, 95 % of the resampled trials are above.
        high: ... and below.
        p50_ms: median time of our fit.
        p99_ms: 99th percentile of it.
    """

    case: str
    error: str
    refused: int
    ours: float
    oracle: float
    ratio: float
    low: float
    high: float
    p50_ms: float
    p99_ms: float


Trial = tuple[Array, Example]
"""Noisy points (N, 3), and what they are of."""


def compared(
    case: str,
    error: str,
    trials: list[Trial],
    fit: Callable[[Trial], float],
    oracle: Callable[[Trial], float],
    rng: np.random.Generator,
) -> Row:
    """Fit all trials by ours and by the oracle."""

    def tried(trial: Trial) -> float:
        try:
            return fit(trial)
        except UnfitError:
            return REFUSED

    clock = SystemClock()
    ours, times_ns = np.empty(len(trials)), np.empty(len(trials))
    for i, trial in enumerate(trials):
        begin_ns = clock.monotonic_ns()
        ours[i] = tried(trial)
        times_ns[i] = clock.monotonic_ns() - begin_ns
    theirs = np.array([oracle(trial) for trial in trials])
    picks = rng.integers(0, len(trials), (RESAMPLES, len(trials)))
    ratios = np.percentile(ours[picks], 95, axis=1) / np.percentile(theirs[picks], 95, axis=1)
    own95, their95 = float(np.percentile(ours, 95)), float(np.percentile(theirs, 95))
    low, high = np.percentile(ratios, [2.5, 97.5])
    p50_ms, p99_ms = np.percentile(times_ns, [50, 99]) / 1e6
    refused = int(np.count_nonzero(ours == REFUSED))
    ratio = own95 / their95
    return Row(case, error, refused, own95, their95, ratio, float(low), float(high), p50_ms, p99_ms)


def noisy(example: Example, sigma_m: float, rng: np.random.Generator) -> Trial:
    """The example with independent errors in each coordinate."""
    return example.points_m + rng.normal(0.0, sigma_m, example.points_m.shape), example


# --- arcs ----------------------------------------------------------------------------------------


def _radius_error(radius_m: float, trial: Trial) -> float:
    return abs(radius_m / trial[1].params["radius"] - 1.0)


def arcs(count: int, rng: np.random.Generator) -> Iterator[Row]:
    """Sweeps of 60 to 360 degrees at noises of 1 to 5 % of the radius."""

    def ours(trial: Trial) -> float:
        return _radius_error(Arc.fit(trial[0], trial[1].points_m[-1]).params["radius"], trial)

    def marquardt(trial: Trial) -> float:
        start = np.array(circle_fit.taubinSVD(trial[0][:, :2])[:3])
        return _radius_error(circle_fit.lm(trial[0][:, :2], start, 200, epsilon=1e-9)[2], trial)

    for sweep_deg, share in product((60, 90, 180, 270, 360), (0.01, 0.02, 0.05)):
        examples = [Arc.example(rng, math.radians(sweep_deg)) for _ in range(count)]
        trials = [noisy(each, share * each.params["radius"], rng) for each in examples]
        case = f"arc {sweep_deg} deg, noise {share:.0%} of radius"
        yield compared(case, "radius, share", trials, ours, marquardt, rng)


# --- helices -------------------------------------------------------------------------------------


def _pitch_error(pitch_m: float, trial: Trial) -> float:
    return abs(pitch_m - trial[1].params["pitch"]) / trial[1].params["radius"]


def _oracle_helix(trial: Trial) -> float:
    """All five parameters at once, from the truth."""
    points, truth = trial[0], trial[1].params
    x, y, z = points.T

    def off(helix: Array) -> Array:
        cx, cy, radius, height, pitch = helix
        turned = np.unwrap(np.arctan2(y - cy, x - cx)) / (2.0 * math.pi)
        turned = math.copysign(1.0, truth["sweep"]) * (turned - turned[-1])
        return np.concatenate(
            [np.hypot(x - cx, y - cy) - radius, z - height - pitch * (turned - turned.mean())]
        )

    start = [truth["cx"], truth["cy"], truth["radius"], z.mean(), truth["pitch"]]
    return _pitch_error(float(least_squares(off, start).x[4]), trial)


def helices(count: int, rng: np.random.Generator) -> Iterator[Row]:
    """Half a turn to two turns, left and right, up and down, at a noise of 5 % of the radius."""

    def ours(trial: Trial) -> float:
        return _pitch_error(Helix.fit(trial[0], trial[1].points_m[-1]).params["pitch"], trial)

    for turns, sense in product((0.5, 1.0, 2.0), (1.0, -1.0)):
        trials: list[Trial] = []
        while len(trials) < count:
            example = Helix.example(rng, turns * 2.0 * math.pi)
            if example.params["sweep"] * sense > 0.0:
                trials.append(noisy(example, 0.05 * example.params["radius"], rng))
        way = "left" if sense > 0.0 else "right"
        case = f"helix {turns:g} turns {way}, noise 5% of radius"
        yield compared(case, "pitch, radii", trials, ours, _oracle_helix, rng)


# --- sines ---------------------------------------------------------------------------------------


def _wave_error(amplitude_m: float, wavelength_m: float, trial: Trial) -> float:
    truth = trial[1].params
    return max(
        abs(amplitude_m / truth["amplitude"] - 1.0), abs(wavelength_m / truth["wavelength"] - 1.0)
    )


def _oracle_sine(trial: Trial) -> float:
    """Distance to the wave's tangent, all five parameters at once, from the truth."""
    points, truth = trial[0][:, :2], trial[1].params
    origin = np.array([truth["x"], truth["y"]])

    def off(wave: Array) -> Array:
        heading, offset, amplitude, number, phase = wave
        cos, sin = math.cos(heading), math.sin(heading)
        x, y = (points - origin).T
        along, across = cos * x + sin * y, cos * y - sin * x
        slope = amplitude * number * np.cos(number * along + phase)
        return np.asarray(
            (across - offset - amplitude * np.sin(number * along + phase)) / np.hypot(1.0, slope)
        )

    number = 2.0 * math.pi / truth["wavelength"]
    start = [truth["heading"], 0.0, truth["amplitude"], number, truth["phase"]]
    wave = least_squares(off, start, x_scale="jac").x
    return _wave_error(abs(float(wave[2])), 2.0 * math.pi / abs(float(wave[3])), trial)


def sines(count: int, rng: np.random.Generator) -> Iterator[Row]:
    """0.6 to 2 periods at any angle, at noises of 1 to 10 % of the amplitude."""

    def ours(trial: Trial) -> float:
        params = Sine.fit(trial[0], trial[1].points_m[-1]).params
        return _wave_error(params["amplitude"], params["wavelength"], trial)

    for periods, share in product((0.6, 0.8, 1.0, 1.5, 2.0), (0.01, 0.05, 0.1)):
        examples = [Sine.example(rng, periods) for _ in range(count)]
        trials = [noisy(each, share * each.params["amplitude"], rng) for each in examples]
        case = f"sine {periods:g} periods, noise {share:.0%} of amplitude"
        yield compared(case, "amplitude or wavelength, share", trials, ours, _oracle_sine, rng)


# --- lines ---------------------------------------------------------------------------------------


def _angle_deg(direction: Array, truth: Array) -> float:
    """Between two unit vectors; twice the arcsine of half the chord is exact near 0."""
    return math.degrees(2.0 * math.asin(min(1.0, float(np.linalg.norm(direction - truth)) / 2.0)))


def lines(count: int, rng: np.random.Generator) -> Iterator[Row]:
    """Each of the 26 directions to a cube's neighbours, at a noise of 5 % of the length."""
    for towards in product((-1.0, 0.0, 1.0), repeat=3):
        if not any(towards):
            continue
        truth = np.array(towards) / math.hypot(*towards)
        example = Example(np.outer(np.linspace(0.0, 1.0, 90), truth), {})
        trials = [noisy(example, 0.05, rng) for _ in range(count)]

        def ours(trial: Trial, truth: Array = truth) -> float:
            return _angle_deg(Line.fit(trial[0], trial[0][-1]).direction, truth)

        def oracle(trial: Trial, truth: Array = truth) -> float:
            points = trial[0] - trial[0].mean(axis=0)

            def off(direction: Array) -> Array:
                unit = direction / np.linalg.norm(direction)
                return np.asarray(points - np.outer(points @ unit, unit)).ravel()

            found = least_squares(off, truth).x
            return _angle_deg(found / np.linalg.norm(found), truth)

        name = " ".join(f"{part:+.0f}" for part in towards)
        yield compared(
            f"line towards {name}, noise 5% of length", "deg", trials, ours, oracle, rng=rng
        )


# --- what comes of it ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Ahead:
    """How far a suggested path is from where clean motion goes on to, 3 s ahead.

    Attributes:
        primitive: what was flown, and taken for.
        noise_m: of each pose.
        flown: motions.
        suggested: of them led to a suggestion of this primitive.
        p50: median error as a share of the distance.
        p95: 95th percentile.
        worst: the largest.
    """

    primitive: str
    noise_m: float
    flown: int
    suggested: int
    p50: float
    p95: float
    worst: float


EXTENTS = {"line": 12.0, "arc": 12.0, "helix": 12.0, "sine": 5.0}
"""Of examples, in their modules' units: more than is flown and looked ahead."""
LONG_EXTENTS = {"spiral": 10.0, "eight": 1.6, "zigzag": 3.9, "compound": 2.8}
"""Of the extended shapes, of which all is flown but the time looked ahead."""
LONGEST_S = 36.0


def ahead(name: str, count: int, noise_m: float, rng: np.random.Generator) -> Ahead:
    """Fly examples at a steady speed, and compare what is suggested with what would follow."""
    errors = []
    primitive = (PRIMITIVES | EXTENDED)[name]
    config = Config(primitives="extended", min_height_m=-1e3, max_height_m=1e3)
    for _ in range(count):
        example = primitive.example(rng, (EXTENTS | LONG_EXTENTS)[name], 2000)
        way = way_of(example.points_m)
        flown_s = FLOWN_S
        if name in EXTENDED:
            flown_s = min(float(way[-1]) / SPEED_MPS - AHEAD_S, LONGEST_S)
        ticks = round(flown_s * POSE_HZ)
        times_s = np.append(np.arange(ticks + 1) / POSE_HZ, ticks / POSE_HZ + AHEAD_S)
        flown_m = at_ways(example.points_m, SPEED_MPS * times_s)
        seen_m = flown_m + rng.normal(0.0, noise_m, flown_m.shape)
        synthesizer = Synthesizer(config)
        for tick, at_m in enumerate(seen_m[:-1]):
            now_ns = NS_PER_S + tick * NS_PER_S // POSE_HZ
            synthesizer.on_pose(_pose(at_m, now_ns), now_ns)
        said = synthesizer.on_intent(_intent(name if name in PRIMITIVES else "line"), now_ns)
        if not isinstance(said, m.Suggestion) or said.primitive != name:
            continue
        reach_m = AHEAD_S * SPEED_MPS
        there_m = at_ways(np.array(said.path)[:, :3], np.array([reach_m]))[0]
        errors.append(float(np.linalg.norm(there_m - flown_m[-1])) / reach_m)
    suggested = len(errors)
    p50, p95, worst = np.percentile(errors or [np.nan], [50, 95, 100])
    return Ahead(name, noise_m, count, suggested, float(p50), float(p95), float(worst))


def _pose(at_m: Array, now_ns: int) -> m.Pose:
    x, y, z = (float(v) for v in at_m)
    qx, qy, qz, qw = quaternion_of(0.0, 0.0, 0.0)
    return m.Pose(
        stamp=now_ns,
        seq=0,
        position=(x, y, z),
        orientation=(qx, qy, qz, qw),
        velocity=(0.0, 0.0, 0.0),
        angular_velocity=(0.0, 0.0, 0.0),
        covariance=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        status="ok",
        source="bench",
    )


def _intent(label: str) -> m.Intent:
    return m.Intent(
        stamp=0,
        seq=0,
        label=label,
        probabilities={name: float(name == label) for name in m.PRIMITIVES},
        confidence=1.0,
        window_start=0,
        window_end=round(FLOWN_S * NS_PER_S),
        samples=200,
        model="bench",
    )


def through_the_bus(count: int, rng: np.random.Generator) -> Array:
    """Milliseconds (count,) from a `synthesis/fit` question to its answer, over the router."""
    clock = SystemClock()
    taken_ms = []
    with launch.running(["synthesis"], {}) as system:
        bus = ZenohBus(system.endpoint)
        node = Node(bus, system.vehicle, "bench")
        alive: set[str] = set()
        bus.watch(alive_key_of(system.vehicle, "*"), lambda key, _: alive.add(key.split("/")[-1]))
        launch.wait_alive(system, alive, ["synthesis"], threading.Event(), START_TIMEOUT_S)
        try:
            requests = [
                m.FitRequest(
                    primitive=name,
                    points=[
                        (float(x), float(y), float(z))
                        for x, y, z in noisy(PRIMITIVES[name].example(rng, extent), 0.01, rng)[0]
                    ],
                )
                for name, extent in {"line": 3.0, "arc": 2.0, "helix": 4.0, "sine": 1.2}.items()
                for _ in range(count // 4)
            ]
            for request in requests:
                begin_ns = clock.monotonic_ns()
                node.ask("synthesis/fit", request)
                taken_ms.append(1e3 * seconds(clock.monotonic_ns() - begin_ns))
        finally:
            node.close()
    return np.array(taken_ms)


def main() -> None:
    """Run all cases and print their tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=300, help="a case (300)")
    parser.add_argument("--seed", type=int, default=1, help="of truths and noise (1)")
    parser.add_argument("--output", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    console = Console()
    rows: list[Row] = []
    table = Table(
        *("case", "error", "refused", "ours p95", "oracle p95", "ratio", "95 % of it"),
        *("p50 ms", "p99 ms"),
        title=f"{options.trials} trials a case; ratio <= 1, p99 <= {TARGET_FIT_MS:g} ms",
    )  # fmt: skip
    for cases in (arcs, helices, sines, lines):
        for row in cases(options.trials, rng):
            rows.append(row)
            table.add_row(
                *(
                    row.case,
                    row.error,
                    str(row.refused),
                    f"{row.ours:.4f}",
                    f"{row.oracle:.4f}",
                    f"{row.ratio:.3f}",
                ),
                *(f"{row.low:.3f}..{row.high:.3f}", f"{row.p50_ms:.2f}", f"{row.p99_ms:.2f}"),
            )
    console.print(table)
    aheads = [
        ahead(name, options.trials // (3 if name in PRIMITIVES else 10), noise_m, rng)
        for noise_m in (0.0, 0.01)
        for name in PRIMITIVES | EXTENDED
    ]
    table = Table(
        "primitive", "noise of poses", "flown", "suggested", "p50", "p95", "worst",
        title=f"Error {AHEAD_S:g} s ahead, share of the distance; <= {TARGET_AHEAD:.0%} when clean",
    )  # fmt: skip
    for each in aheads:
        table.add_row(
            *(each.primitive, f"{each.noise_m} m", str(each.flown), str(each.suggested)),
            *(f"{each.p50:.2%}", f"{each.p95:.2%}", f"{each.worst:.2%}"),
        )
    console.print(table)
    p50_ms, p99_ms = np.percentile(through_the_bus(4 * options.trials, rng), [50, 99])
    console.print(
        f"synthesis/fit through the bus, {4 * options.trials} questions:"
        f" p50 {p50_ms:.2f} ms, p99 {p99_ms:.2f} ms; <= {TARGET_BUS_MS:g} ms"
    )
    if options.output:
        result = {
            "fits": [asdict(row) for row in rows],
            "ahead": [asdict(each) for each in aheads],
            "bus_ms": {"p50": p50_ms, "p99": p99_ms},
        }
        options.output.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
