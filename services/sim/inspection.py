"""Whether a class is a vehicle that can be simulated: checked before it is put into a world."""

import inspect
import math
from functools import cache
from itertools import chain
from typing import Any

import msgspec

from common.messages import FollowingRates, FullStickSpeeds
from services.sim.body import CALM, BodyState, Loads, Sticks
from services.sim.build import INSTRUMENTS, Build
from services.sim.plant import Plant

_UNIT_ERROR = 1e-3
"""A quaternion's length may be off 1 by this."""
_STEP_S = 0.005
_LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def faults_of(plant: object) -> str:
    """What keeps a class from being simulated, and what to do about it; empty if nothing does.

    Raises:
        Exception: whatever it raises itself when it is tried.
    """
    if plant is None:
        return "it has no PLANT; end it with PLANT = YourPlant"
    if not (isinstance(plant, type) and issubclass(plant, Plant)):
        return f"PLANT is {plant!r}; it must be a class derived from services.sim.plant.Plant"
    return _fault_of(plant)


@cache
def _fault_of(plant: type[Plant]) -> str:
    name = plant.__name__
    needed = sorted(getattr(plant, "__abstractmethods__", ()))
    if plant.flies:
        needed += [each for each in ("take_off", "land") if each not in _own(plant)]
    if needed:
        return f"{name} lacks {', '.join(needed)}"
    return _fault_of_figures(plant) or _fault_of_build(plant.build) or _fault_in_trial(plant)


def _own(plant: type[Plant]) -> set[str]:
    """What a class has besides what every plant has."""
    return {
        each for each, value in inspect.getmembers(plant) if value is not getattr(Plant, each, None)
    }


def _fault_of_figures(plant: type[Plant]) -> str:
    kinds: dict[str, Any] = {
        "flies": bool,
        "noise": float,
        "drift": float,
        "life_s": float,
        "full_stick": FullStickSpeeds | None,
        "rates": FollowingRates | None,
    }
    for field, kind in kinds.items():
        try:
            msgspec.convert(getattr(plant, field), kind)
        except msgspec.ValidationError as error:
            return f"{plant.__name__}.{field}: {error}"
    if not (plant.noise >= 0.0 and plant.drift >= 0.0):
        return f"{plant.__name__}.noise and .drift: must be 0 or more"
    if not plant.life_s > 0.0:
        return f"{plant.__name__}.life_s: must be above 0"
    return ""


def _fault_of_build(build: object) -> str:
    if not isinstance(build, Build):
        return f"build is {build!r}; it must be a services.sim.build.Build"
    try:
        # numpy's numbers and arrays are as good as Python's.
        msgspec.convert(msgspec.to_builtins(build, enc_hook=lambda each: each.tolist()), Build)
    except msgspec.ValidationError as error:
        return f"build: {error}".replace("`$.", "`build.")
    for field in ("hull", "look"):
        bodies = getattr(build, field)
        if not bodies:
            what = "what collides" if field == "hull" else "what others see"
            return f"build.{field} is empty; it must hold {what}, at least one Body"
        if not all(side > 0.0 for body in bodies for side in body.size_m):
            return f"build.{field}: the sides of a body must be above 0"
        places = [(*body.size_m, *body.position_m, *body.orientation) for body in bodies]
        if not all(map(math.isfinite, chain.from_iterable(places))):
            return f"build.{field}: the numbers of a body must be finite"
        if any(abs(math.hypot(*body.orientation) - 1.0) > _UNIT_ERROR for body in bodies):
            return f"build.{field}: the orientation of a body must be a quaternion of length 1"
    if not (build.mass_kg > 0.0 and all(each > 0.0 for each in build.inertia_kgm2)):
        return "build: mass_kg and inertia_kgm2 must be above 0"
    if not (build.friction >= 0.0 and (build.friction_tipped or 0.0) >= 0.0):
        return "build: friction and friction_tipped must be 0 or more"
    unknown = sorted(build.sensors - INSTRUMENTS)
    if unknown:
        known = ", ".join(sorted(INSTRUMENTS))
        return f"build.sensors: there is no {unknown[0]!r}; there are {known}"
    return ""


def _fault_in_trial(plant: type[Plant]) -> str:
    """One step each of what it may be asked for, a metre above the ground."""
    tried = plant(_STEP_S)
    state = BodyState((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0), _LEVEL, CALM, CALM)
    results: dict[str, Any] = {"fly": tried.fly(Sticks(0.5, 0.5, 0.5, 0.5), state, CALM, 1.0)}
    if plant.flies:
        results["take_off"] = tried.take_off(state, CALM, 0.1)
        results["land"] = tried.land(state, CALM, 1.0)
    tried.restart()
    results["fall"] = tried.fall(state, CALM, 1.0)
    for method, loads in results.items():
        if not isinstance(loads, Loads):
            return f"{plant.__name__}.{method} returned {loads!r}; it must return Loads"
        figures = (loads.thrust_n, *loads.torque_nm, *loads.air_n)
        if len(figures) != 7 or not all(map(math.isfinite, figures)):
            return f"{plant.__name__}.{method} returned {loads}; these are no 7 finite numbers"
    return ""
