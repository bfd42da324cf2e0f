"""How vehicles follow the stick: one module a plant, chosen by its name."""

from services.sim.plants.ardrone import ArdronePlant
from services.sim.plants.plant import Plant
from services.sim.plants.tum import TumPlant

_PLANTS: tuple[type[Plant], ...] = (TumPlant, ArdronePlant)

PLANTS = {plant.name: plant for plant in _PLANTS}
"""Those that are built, by name."""
