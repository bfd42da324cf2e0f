"""What every vehicle is: a body, and how that follows the sticks."""

from abc import ABC, abstractmethod
from typing import ClassVar

from common.messages import FollowingRates, FullStickSpeeds
from services.sim.body import BodyState, Loads, Sticks, Vector3
from services.sim.build import ARDRONE, Build


class Plant(ABC):
    """Turns sticks into loads on the body, one step of physics at a time.

    Attributes:
        build: the body.
        flies: whether it takes off and lands; else it stands on the ground and drives.
        noise: what is added to each stick at 50 Hz, uniform within +-this.
        drift: what is added besides, redrawn every 5 s.
        life_s: how long one charge lasts, of hover or of driving.
        full_stick: the steady speeds at full stick, as `vehicle` tells them to those who steer;
            None for those that the contract knows.
        rates: how fast it follows, the same.
    """

    build: ClassVar[Build] = ARDRONE
    flies: ClassVar[bool] = True
    noise: ClassVar[float] = 0.0
    drift: ClassVar[float] = 0.0
    # What the AR.Drone's maker states.
    life_s: ClassVar[float] = 12 * 60.0
    full_stick: ClassVar[FullStickSpeeds | None] = None
    rates: ClassVar[FollowingRates | None] = None

    @abstractmethod
    def __init__(self, step_s: float) -> None: ...

    @abstractmethod
    def restart(self) -> None:
        """Forget the past, as when the motors stop."""

    @abstractmethod
    def fly(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The loads of the next step.

        Args:
            sticks: what is commanded.
            state: the body's motion.
            wind_mps: of the air, world.
            below_m: from the body's origin to what is below.
        """

    def take_off(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The same while it takes off."""
        raise NotImplementedError

    def land(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The same while it lands."""
        raise NotImplementedError

    @abstractmethod
    def fall(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The same while the motors stand still."""
