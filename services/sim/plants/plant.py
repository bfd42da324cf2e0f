"""What every plant is."""

from typing import ClassVar, Protocol

from common.messages import Plant as PlantName
from services.sim.body import BodyState, Loads, Sticks, Vector3


class Plant(Protocol):
    """Turns sticks into loads on the body, one step of physics at a time.

    Attributes:
        name: as configuration and messages have it.
        noise: what is added to each stick at 50 Hz, uniform within +-this.
        drift: what is added besides, redrawn every 5 s.
    """

    name: ClassVar[PlantName]
    noise: ClassVar[float]
    drift: ClassVar[float]

    def __init__(self, step_s: float) -> None: ...

    def restart(self) -> None:
        """Forget the past, as when the rotors stop."""
        ...

    def fly(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The loads of the next step.

        Args:
            sticks: what is commanded.
            state: the body's motion.
            wind_mps: of the air, world.
            below_m: from the body's origin to what is below.
        """
        ...

    def take_off(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The same while it takes off."""
        ...

    def land(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The same while it lands."""
        ...

    def fall(self, state: BodyState, wind_mps: Vector3) -> Loads:
        """The same while the rotors stand still."""
        ...
