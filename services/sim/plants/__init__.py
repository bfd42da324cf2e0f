"""The vehicles: one file each, which names its class `PLANT`; its own name is the file's."""

import importlib
import pkgutil

from services.sim.plant import Plant


def names() -> tuple[str, ...]:
    """Those whose files are in this folder."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(__path__)))


def load(name: str) -> type[Plant]:
    """A vehicle by its name.

    Raises:
        ValueError: if there is no such file; the text names those that there are.
    """
    if name not in names():
        raise ValueError(f"no {name!r}; there are {', '.join(names())}")
    plant: type[Plant] = importlib.import_module(f"{__name__}.{name}").PLANT
    return plant
