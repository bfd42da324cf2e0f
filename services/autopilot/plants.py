"""What the sticks do on each plant: the model that the controller turns round."""

from dataclasses import dataclass

from common.messages import VehicleStatus
from common.sticks import FULL_STICK, full_stick_of


@dataclass(frozen=True)
class Response:
    """One axis: its speed v follows the stick u as dv/dt = rate (speed * u - v), u a little late.

    Attributes:
        rate_ps: how fast, 1/s.
        late_s: the mean delay of u on its way.
        speed: steady speed per stick, m/s or rad/s.
        limit: the stick beyond which nothing more happens; across the plane, of both axes together.
    """

    rate_ps: float
    late_s: float
    speed: float
    limit: float = 1.0

    @property
    def top_speed(self) -> float:
        """The steady speed at the limit, m/s or rad/s."""
        return self.speed * self.limit


@dataclass(frozen=True)
class Plant:
    """The responses of the plane, upward, downward, and of the yaw."""

    plane: Response
    up: Response
    down: Response
    yaw: Response


def _plant(name: str, plane: tuple[float, float], up_ps: float, yaw_ps: float) -> Plant:
    full = FULL_STICK[name]
    return Plant(
        plane=Response(*plane, full.forward_mps / full.linear_to, full.linear_to),
        up=Response(up_ps, 0.0, full.up_mps),
        down=Response(up_ps, 0.0, full.down_mps),
        yaw=Response(yaw_ps, 0.0, full.yaw_radps),
    )


PLANTS: dict[str, Plant] = {
    # tum_simulator a020d89. Its speed loop 5, 1 over its tilt loop 10, 5 has the transfer function
    # (25 s + 50) / (s3 + 10 s2 + 45 s + 50), whose inverse is 1 + 0.4 s to second order:
    # a rate of 2.5 and no delay. Climb: 5 / (1 + 1); yaw: 2.
    "tum": _plant("tum", (2.5, 0.0), 2.5, 2.0),
    # tum_ardrone 6bcfb34: the speed follows the tilt with c1, the tilt the stick with c3; c7, c5.
    "ardrone": _plant("ardrone", (0.58, 1.0 / 7.0), 0.8, 25.0),
}


def plant_of(status: VehicleStatus) -> Plant | None:
    """The model of a vehicle; None if it has none, or cannot move to every side as drones do."""
    if status.full_stick is None or status.rates is None:
        return PLANTS.get(status.plant)
    full = full_stick_of(status)
    if not (full.moves_every_way and all(status.rates)):
        return None
    level_ps, upright_ps, turn_ps = status.rates
    return Plant(
        plane=Response(level_ps, 0.0, min(full.forward_mps, full.left_mps)),
        up=Response(upright_ps, 0.0, full.up_mps),
        down=Response(upright_ps, 0.0, full.down_mps),
        yaw=Response(turn_ps, 0.0, full.yaw_radps),
    )
