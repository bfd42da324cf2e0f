"""The vehicles: one file each, which names its class `PLANT`; its own name is the file's."""

import importlib
import importlib.util
import pkgutil
import traceback
from reprlib import repr as repr_of

from services.sim.inspection import faults_of
from services.sim.plant import Plant


def names() -> tuple[str, ...]:
    """Those whose files are in this folder."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(__path__)))


def load(name: str) -> type[Plant]:
    """A vehicle by its name.

    Raises:
        ValueError: if there is no such file, whose text names those that there are; or if it is
            none of a vehicle, whose text names the file and what is wrong with it.
    """
    if name not in names():
        raise ValueError(f"no plant {repr_of(name)}; there are {', '.join(names())}")
    module = f"{__name__}.{name}"
    spec = importlib.util.find_spec(module)
    file = str(spec and spec.origin)
    try:
        plant = getattr(importlib.import_module(module), "PLANT", None)
        fault = faults_of(plant)
    except (Exception, SystemExit) as error:
        raise ValueError(f"{_place_in(file, error)}: {_first_line(error)}") from None
    if fault:
        raise ValueError(f"{file}: {fault}")
    assert isinstance(plant, type)
    return plant


def _place_in(file: str, error: BaseException) -> str:
    """The file, and the line in it that an error came from."""
    if isinstance(error, SyntaxError):
        return file
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__, None)
        if frame.filename == file
    ]
    return f"{file}:{lines[-1]}" if lines else file


def _first_line(error: BaseException) -> str:
    text = next(iter(str(error).splitlines()), "")
    return f"{type(error).__name__}: {text}".removesuffix(": ")
