"""How closely paths are flown: autopilot and baselines, both plants, calm and wind.

    make flight                                  the whole table, about 20 minutes on two cores
    python tests/performance/flight.py --seeds 2 --methods autopilot,mpc --seen 0

Each figure is the root of the mean squared distance of the true place to the path (3D, from the
acceptance to the end), as the mean over seeds with its 95 % interval (Student's t). The seed draws
the heading, the wind's direction and all noise.
"""

import argparse
import json
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from scipy import stats

from common.messages import Plant
from services.autopilot.core import Follow
from services.autopilot.follower import Follower
from studies.baselines.goto import GotoQueue, hurried, waypoints
from studies.baselines.predictive import PredictiveFollower
from studies.tracking import HOVER, PATHS, Case, fly

METHODS: dict[str, Follow] = {
    "autopilot": Follower,
    "mpc": PredictiveFollower,
    "gotos": GotoQueue,
    "gotos at 1 m/s": hurried,
    "waypoints": waypoints,
}
PLANTS: tuple[Plant, ...] = ("tum", "ardrone")
AIRS = ((0.0, False), (3.0, False), (3.0, True))
"""Wind in m/s, and whether it gusts; the bars are for the first two."""
BARS_CM = {"line": (5, 15), "arc": (10, 25), "helix": (10, 25), "sine": (15, 30)}
"""With the true pose, with the estimated one."""
LESS_THAN_GOTOS = 0.4


@dataclass(frozen=True)
class Outcome:
    """One flight's figures; `rmse_cm` is None if the path was not accepted or the start missed."""

    method: str
    case: Case
    reason: str
    rmse_cm: float | None
    speed_mps: float


def flown(method: str, case: Case) -> Outcome:
    """Fly once."""
    try:
        flight = fly(case, METHODS[method])
    except RuntimeError as error:
        return Outcome(method, case, str(error), None, 0.0)
    return Outcome(method, case, flight.reason, 100.0 * flight.rmse_m, flight.speed_mps)


def cases(seeds: int, seen: bool) -> Iterator[Case]:
    """All that is flown, the rows in order."""
    for plant in PLANTS:
        # Pictures take five times as long, and no bar is set for gusts.
        for wind_mps, gusts in AIRS[:2] if seen else AIRS:
            for primitive in (*PATHS, HOVER):
                for seed in range(seeds):
                    yield Case(primitive, plant, wind_mps, gusts, seed, seen)


def fly_all(jobs: list[tuple[str, Case]], processes: int) -> list[Outcome]:
    """Fly them side by side; the order is kept."""
    with (
        Progress(console=Console(stderr=True)) as progress,
        ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool,
    ):
        task = progress.add_task("flights", total=len(jobs))
        futures = [pool.submit(flown, *job) for job in jobs]
        for future in futures:
            future.add_done_callback(lambda _: progress.advance(task))
        return [future.result() for future in futures]


def interval(values: list[float]) -> tuple[float, float]:
    """Mean and half of its 95 % interval."""
    if len(values) < 2:
        return (values[0] if values else float("nan")), float("nan")
    half = stats.t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(half)


def cell(outcomes: list[Outcome]) -> str:
    """Error with interval, mean speed, and how many flew all of the path if not all did."""
    if not outcomes:
        return ""
    errors = [each.rmse_cm for each in outcomes if each.rmse_cm is not None]
    mean, half = interval(errors)
    whole = sum(each.reason == "flown" for each in outcomes)
    text = f"{mean:.1f} ± {half:.1f}"
    if outcomes[0].case.primitive != HOVER:
        text += f"  {np.mean([each.speed_mps for each in outcomes]):.2f} m/s"
    return text if whole == len(outcomes) else f"{text}, {whole}/{len(outcomes)} flown"


def table_of(outcomes: list[Outcome], methods: list[str], seen: bool) -> tuple[Table, bool]:
    """The table, and whether every bar is met."""
    rows: dict[tuple[Plant, float, bool, str], dict[str, list[Outcome]]] = {}
    for each in outcomes:
        case = each.case
        row = rows.setdefault((case.plant, case.wind_mps, case.gusts, case.primitive), {})
        row.setdefault(each.method, []).append(each)
    title = "estimated pose" if seen else "true pose"
    table = Table("plant", "wind", "path", "bar", *methods, title=f"RMSE in cm, {title}")
    met = True
    for (plant, wind_mps, gusts, primitive), row in rows.items():
        has_bar = primitive in BARS_CM and not gusts
        bar_cm = BARS_CM[primitive][seen] if has_bar else np.inf
        own = [each.rmse_cm for each in row["autopilot"]]
        good = None not in own and all(each.reason == "flown" for each in row["autopilot"])
        good = good and interval([each for each in own if each is not None])[0] <= bar_cm
        bar = f"{bar_cm} {'met' if good else 'MISSED'}" if has_bar else ""
        met = met and (good or not has_bar)
        cells = []
        for method in methods:
            text = cell(row.get(method, []))
            if method.startswith("gotos") and text:
                less = reduction(row["autopilot"], row[method])
                text += f"\nautopilot {less:.0%} less"
                met = met and (not has_bar or less >= LESS_THAN_GOTOS)
            cells.append(text)
        wind = f"{wind_mps:g} m/s{' gusty' if gusts else ''}"
        table.add_row(plant, wind, primitive, bar, *cells)
    return table, met


def reduction(own: list[Outcome], other: list[Outcome]) -> float:
    """By how much the mean error is less than another's."""
    ours = np.mean([each.rmse_cm for each in own if each.rmse_cm is not None])
    theirs = np.mean([each.rmse_cm for each in other if each.rmse_cm is not None])
    return float(1.0 - ours / theirs)


def main() -> int:
    """Fly and print; 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="flights a figure, true pose (5)")
    parser.add_argument("--seen", type=int, default=5, help="the same, estimated pose (5)")
    parser.add_argument("--methods", default=",".join(METHODS), help="autopilot among them")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--output", type=Path, help="also write every flight as JSON")
    options = parser.parse_args()
    methods = options.methods.split(",")
    if "autopilot" not in methods or not set(methods) <= set(METHODS):
        parser.error(f"--methods: must hold autopilot; others are {', '.join(METHODS)}")
    every: list[Outcome] = []
    met = True
    for seen, seeds in ((False, options.seeds), (True, options.seen)):
        if seeds == 0:
            continue
        who = ["autopilot"] if seen else methods
        outcomes = fly_all(
            [
                (method, case)
                for case in cases(seeds, seen)
                for method in who
                if case.primitive != HOVER or method == "autopilot"
            ],
            options.processes,
        )
        table, good = table_of(outcomes, who, seen)
        Console(width=None if Console().is_terminal else 170).print(table)
        every += outcomes
        met = met and good
    if options.output:
        options.output.write_text(json.dumps([asdict(each) for each in every], indent=1))
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
