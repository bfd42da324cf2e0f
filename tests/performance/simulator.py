"""`make bench-simulator`: how fast the simulator is, beside what others use, in one run.

What is compared is measured in turns, so that a busy moment of the machine meets both; a figure is
the median of its turns.
"""

import argparse
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
from bench import WARM_UP_S, Meter, Row, fly, report
from peers import PEER_HZ, PeerPhysics, egl_camera, tiny_camera
from rich.console import Console
from rich.progress import Progress
from workers import Worker

import worlds
from cli import launch
from common import messages as m
from common.clock import SystemClock, seconds, sleep
from common.node import Node
from common.topics import SERVICES, TOPICS
from common.zenoh_bus import ZenohBus
from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.core import Autopilot
from services.classifier.config import Config as ClassifierConfig
from services.classifier.core import Classifier
from services.classifier.model import OnnxModel
from services.localizer.config import Config as LocalizerConfig
from services.localizer.core import Localizer
from services.operator.person import Person
from services.operator.pilot import Pilot
from services.operator.route import route_of
from services.sim.cameras import SIZES, Shot, cameras_of
from services.sim.config import Config, FrontSize
from services.sim.core import PHYSICS_HZ, STEP_S, Simulation
from services.sim.crew import crew_of, names_of
from services.sim.stage import Scene, Stage
from services.sim.studio import Studio
from services.synthesis.config import Config as SynthesisConfig
from services.synthesis.core import Synthesizer
from studies.darkroom import Darkroom
from studies.lockstep import HandsOff, Lockstep

TURNS = 15
LAPS = 40
"""Places along the track from which cameras are compared."""
COMMAND = m.Command(stamp=0, seq=0, vx=0.1, vy=0.0, vz=0.0, wz=0.0, action="fly", mode="manual")
SOAK_DRIFT_MS = 5.0
PEER_CAMERAS = {"EGL plugin": 8, "TinyRenderer": 20}
"""How many times slower they are to be."""
FEW = 4
FLEET = 3
"""Vehicles that share a simulator."""


@dataclass(frozen=True)
class Contender:
    """One of those that are compared.

    Attributes:
        name: for people.
        worker: does its turns.
        units: what a turn gets done, in s of simulated time or in pictures.
    """

    name: str
    worker: Worker
    units: float


def in_turns(contenders: list[Contender], turns: int, progress: Progress) -> dict[str, float]:
    """Units a second of each, the median of its turns; ends the workers."""
    task = progress.add_task(", ".join(each.name for each in contenders)[:60], total=turns)
    rates: dict[str, list[float]] = {each.name: [] for each in contenders}
    for _ in range(turns):
        for each in contenders:
            rates[each.name].append(each.units / each.worker.turn_s())
        progress.advance(task)
    for each in contenders:
        each.worker.close()
    return {name: float(np.median(values)) for name, values in rates.items()}


def simulated(world: str, plant: str, duration_s: float) -> Callable[[], None]:
    """A turn of physics and sensors without pictures."""
    config = Config(world=world, plant=plant, renderer="none")
    simulation = Simulation(config)

    def turn() -> None:
        simulation.reset(m.ResetRequest(position=(0.0, 0.0, 1.0)))
        for count in range(round(duration_s * PHYSICS_HZ)):
            simulation.step(COMMAND if count % 4 == 0 else None)

    return turn


def peer_simulated(drag: bool, duration_s: float) -> Callable[[], None]:
    """A turn of gym-pybullet-drones' physics."""
    peer = PeerPhysics(drag)

    def turn() -> None:
        for _ in range(round(duration_s * PEER_HZ)):
            peer.step()

    return turn


def physics(progress: Progress) -> list[Row]:
    """Physics and sensors without pictures, in process, beside gym-pybullet-drones' loop."""
    duration_s = 10.0
    ours = [
        Contender(f"{plant} in {world}", Worker(simulated, world, plant, duration_s), duration_s)
        for world in ("empty", "track")
        for plant in ("tum", "ardrone")
    ]
    theirs = [
        Contender(name, Worker(peer_simulated, drag, duration_s), duration_s)
        for name, drag in (("peer", False), ("peer with drag", True))
    ]
    rates = in_turns(ours + theirs, TURNS, progress)
    rows = [
        Row(f"physics and sensors, {each.name} (x real time)", rates[each.name], 200.0, ">= 200")
        for each in ours
    ]
    for each in theirs:
        rate = rates[each.name]
        text = f"over gym-pybullet-drones' loop{each.name.removeprefix('peer')}, x {rate:.0f}"
        rows.append(Row(text, rates["ardrone in empty"], rate, "ratio >= 1"))
    return rows


def chain(duration_s: float, progress: Progress) -> list[Row]:
    """The whole flight chain in lock-step, without pictures: the scripted operator on the track."""
    config = Config(renderer="none")

    def fly_on() -> float:
        simulation = Simulation(config)
        route = route_of(worlds.load("track"))
        lockstep = Lockstep(
            simulation,
            HandsOff(),
            autopilot=Autopilot(AutopilotConfig(), 0),
            classifier=Classifier(ClassifierConfig(), OnnxModel(Path(ClassifierConfig().model))),
            synthesizer=Synthesizer(SynthesisConfig()),
        )
        lockstep.seat(Pilot(route, Person(seed=1), 0.02))
        clock = SystemClock()
        begin_ns = clock.monotonic_ns()
        lockstep.run(duration_s)
        return duration_s / seconds(clock.monotonic_ns() - begin_ns)

    task = progress.add_task("whole chain in lock-step", total=3)
    factors = []
    for _ in range(3):
        factors.append(fly_on())
        progress.advance(task)
    figure = "whole chain in lock-step, no pictures (x real time)"
    return [Row(figure, float(np.median(factors)), 50.0, ">= 50")]


def localized(duration_s: float, progress: Progress) -> list[Row]:
    """Lock-step with both cameras' pictures, 640x360 and QVGA, and the localizer."""
    config = Config(world="track")
    simulation = Simulation(config)
    darkroom = Darkroom(simulation, config)
    lockstep = Lockstep(
        simulation,
        HandsOff(),
        autopilot=Autopilot(AutopilotConfig(), 0),
        localizer=Localizer(LocalizerConfig()),
        darkroom=darkroom,
    )
    counts = {"camera/front": 0, "camera/down": 0}

    def count(topic: str) -> Callable[[m.Image, int], None]:
        def add(_picture: m.Image, _now_ns: int) -> None:
            counts[topic] += 1

        return add

    for topic in counts:
        lockstep.listen(topic, count(topic))
    # Until all who draw have begun.
    lockstep.run(5.0)
    lockstep.decide("takeoff")
    counts.update(dict.fromkeys(counts, 0))
    task = progress.add_task("lock-step with pictures and localizer", total=1)
    clock = SystemClock()
    begin_ns = clock.monotonic_ns()
    lockstep.run(duration_s)
    factor = duration_s / seconds(clock.monotonic_ns() - begin_ns)
    progress.advance(task)
    darkroom.close()
    assert counts["camera/front"] >= 30 * duration_s, counts
    assert counts["camera/down"] >= 60 * duration_s, counts
    figure = "lock-step with 640x360, QVGA and localizer (x real time)"
    return [Row(figure, factor, 5.0, ">= 5")]


def track_shots() -> tuple[Scene, list[Shot]]:
    """The track, and what one sees along it."""
    world = worlds.load("track")
    stage = Stage(world, STEP_S)
    scene = stage.scene()
    stage.close()
    places = world.ideal_path_m[:: max(1, len(world.ideal_path_m) // LAPS)]
    ahead = np.roll(places, -1, axis=0) - places
    shots = []
    for (x, y, z), (dx, dy, _) in zip(places, ahead, strict=True):
        half = np.arctan2(dy, dx) / 2.0
        turn = (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        shots.append(Shot("camera/front", 0, (float(x), float(y), float(z)), turn))
    return scene, shots


def with_all_cores() -> None:
    """Let Mesa rasterise on every core: no other service needs one here."""
    os.environ["LP_NUM_THREADS"] = str(psutil.cpu_count() or 1)


def photographed(size: FrontSize, endpoint: str) -> Callable[[], None]:
    """A turn of our pictures, encoded and published through a router."""
    with_all_cores()
    scene, shots = track_shots()
    node = Node(ZenohBus(endpoint), "bench", "sim")
    node.publishes("camera/front")

    def publish(shot: Shot, picture: m.Image) -> None:
        node.publish(shot.topic, picture)

    studio = Studio("auto", cameras_of(Config(front_size=size)), 80, publish)
    studio.load(scene)

    def turn() -> None:
        studio.take(shots)
        studio.finish()
        if studio.failure:
            raise RuntimeError(studio.failure)

    return turn


def peer_photographed(size: FrontSize, name: str) -> Callable[[], None]:
    """A turn of pybullet's own pictures, as they come; a few are enough of what is slow."""
    scene, shots = track_shots()
    camera = cameras_of(Config(front_size=size))[0]
    draw = {"EGL plugin": egl_camera, "TinyRenderer": tiny_camera}[name](scene)

    def turn() -> None:
        for shot in shots[:: len(shots) // FEW]:
            draw(camera, shot)

    return turn


def cameras(progress: Progress) -> list[Row]:
    """Pictures of the track a second: ours encoded and published, pybullet's as they come."""
    rows: list[Row] = []
    with launch.running((), {}) as system:
        count = len(track_shots()[1])
        sizes: tuple[FrontSize, ...] = ("360p", "720p")
        for size in sizes:
            contenders = [Contender("ours", Worker(photographed, size, system.endpoint), count)]
            for name in PEER_CAMERAS:
                try:
                    worker = Worker(peer_photographed, size, name)
                except RuntimeError as error:
                    Console(stderr=True).print(f"without pybullet's {name}: {error}")
                    continue
                few = len(range(0, count, count // FEW))
                contenders.append(Contender(name, worker, few))
            rates = in_turns(contenders, 5, progress)
            pixels = "x".join(str(each) for each in SIZES[size])
            rows.append(Row(f"{pixels}, encoded and published (fps)", rates["ours"], 30.0))
            rows += [
                Row(
                    f"{pixels} over pybullet's {name}, {rates[name]:.1f} fps raw",
                    rates["ours"],
                    rates[name],
                    f"ratio >= {bar}",
                )
                for name, bar in PEER_CAMERAS.items()
                if name in rates
            ]
    return rows


def everything(duration_s: float, progress: Progress) -> list[Row]:
    """The drone's own cameras, 1280x720 and QVGA, with every service running."""
    settings = {
        "sim": {"world": "track", "front_size": "720p"},
        "overlay": {"console_port": str(launch.free_port())},
        "operator": {"source": "scripted", "laps": "0"},
    }
    bars = {"real-time factor": 0.99, "camera/front (Hz)": 29.0, "camera/down (Hz)": 57.0}
    bars |= {f"{topic} (Hz)": 0.98 * (TOPICS[topic].rate_hz or 0.0) for topic in ("imu", "truth")}
    with launch.running(SERVICES, settings) as system:
        rows = fly(system, duration_s, progress)
    return [
        Row(f"720p, all services: {row.figure}", row.value, row.baseline, _bar(bars, row.figure))
        for row in rows
    ]


def _bar(bars: dict[str, float], figure: str) -> str:
    return f">= {bars[figure]:g}" if figure in bars else ""


def several(duration_s: float, progress: Progress) -> list[Row]:
    """Vehicles one behind the other on the track, each with both cameras, 640x360 and QVGA."""
    settings = {"sim": {"world": "track", "vehicles": FLEET}}
    with launch.running(("sim",), settings) as system:
        names = names_of(crew_of(FLEET, "tum"), system.vehicle)
        meters = [Meter(system.endpoint, name) for name in names]
        launch.wait_alive(system, meters[0].alive, ("sim",), threading.Event(), 60.0)
        for meter, place in zip(meters, worlds.load("track").ideal_path_m[::40], strict=False):
            position = (float(place[0]), float(place[1]), 1.0)
            meter.node.ask("sim/reset", m.ResetRequest(position=position))
        while not all(meter.counts["camera/front"] for meter in meters):
            for meter in meters:
                meter.node.spin()
            system.check()
            sleep(0.01)
        task = progress.add_task(f"{FLEET} vehicles with pictures", total=duration_s)
        clock = SystemClock()
        # First it catches up what it lost while it began.
        for length_s in (WARM_UP_S, duration_s):
            for meter in meters:
                meter.clear()
            begin_ns = clock.monotonic_ns()
            while (passed_s := seconds(clock.monotonic_ns() - begin_ns)) < length_s:
                for meter in meters:
                    meter.node.spin()
                system.check()
                sleep(0.005)
                progress.update(task, completed=passed_s)
        rates = [{topic: n / passed_s for topic, n in meter.counts.items()} for meter in meters]
        factor = meters[0].real_time_factor
        for meter in meters:
            meter.node.close()
    share = f"{FLEET} vehicles with 640x360 and QVGA"
    rows = [Row(f"{share}: real-time factor", factor, 1.0, ">= 0.99")]
    for topic in ("camera/front", "camera/down", "imu"):
        rate_hz = TOPICS[topic].rate_hz or 0.0
        rows += [
            Row(f"{share}: {topic} of the {place} (Hz)", each[topic], rate_hz)
            for place, each in zip(("first", "second", "third"), rates, strict=True)
        ]
    return rows


def soak(duration_s: float, progress: Progress) -> list[Row]:
    """Real time for long: memory that grows, stamps that leave the wall clock."""
    clock = SystemClock()
    settings = {"sim": {"world": "track"}}
    with launch.running(("sim",), settings) as system:
        node = Node(ZenohBus(system.endpoint), system.vehicle, "bench")
        lags_ms: list[float] = []

        def on_imu(imu: m.Imu, _arrival_ns: int) -> None:
            lags_ms.append((clock.utc_ns() - imu.stamp) / 1e6)

        pictures: list[int] = []
        node.on("imu", on_imu, depth=256)
        node.on("camera/front", lambda _picture, arrival_ns: pictures.append(arrival_ns))
        stop = threading.Event()
        while not pictures:
            node.spin()
            system.check()
            stop.wait(0.1)
        process = psutil.Process(system.processes["sim"].pid)
        task = progress.add_task(f"{duration_s:.0f} s of real time", total=duration_s)
        begin_ns = clock.monotonic_ns()
        memory: list[float] = []
        ends: list[float] = []
        while (passed_s := seconds(clock.monotonic_ns() - begin_ns)) < duration_s:
            node.spin()
            stop.wait(0.01)
            if passed_s > 15.0 and len(memory) < passed_s - 15.0:
                memory.append(process.memory_info().rss / 2**20)
                ends.append(float(np.median(lags_ms[-200:])))
                progress.update(task, completed=passed_s)
        system.check()
        node.close()
    tenth = max(1, len(memory) // 10)
    grown = float(np.median(memory[-tenth:]) - np.median(memory[:tenth]))
    drift = float(np.median(ends[-tenth:]) - np.median(ends[:tenth]))
    share = f"{duration_s / 60.0:.0f} min"
    return [
        Row(f"memory of the simulator after {share} (MB)", memory[-1], memory[0]),
        Row("its growth from the first tenth to the last (MB)", grown, 1.0, "about 0"),
        Row("stamps against the wall clock, drift (ms)", drift, SOAK_DRIFT_MS, "within 5"),
        Row("stamps behind the wall clock in the end, transport included (ms)", ends[-1], ends[0]),
    ]


PARTS: dict[str, Callable[[argparse.Namespace, Progress], list[Row]]] = {
    "physics": lambda _options, progress: physics(progress),
    "chain": lambda options, progress: chain(options.seconds, progress),
    "localized": lambda options, progress: localized(options.seconds / 2.0, progress),
    "cameras": lambda _options, progress: cameras(progress),
    "everything": lambda options, progress: everything(options.seconds, progress),
    "several": lambda options, progress: several(options.seconds / 2.0, progress),
    "soak": lambda options, progress: soak(options.soak, progress),
}


def main() -> None:
    """Run the bench and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (all)")
    parser.add_argument("--seconds", type=float, default=60.0, help="of flights (60)")
    parser.add_argument("--soak", type=float, default=600.0, help="seconds of real time (600)")
    parser.add_argument("--output", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: use {', '.join(PARTS)}")
    rows: list[Row] = []
    with Progress(console=Console(stderr=True)) as progress:
        for part in options.parts or PARTS:
            rows += PARTS[part](options, progress)
    report(rows, options.output)


if __name__ == "__main__":
    main()
