"""Pictures are the same whoever draws them, and what goes wrong there is told here."""

import pytest

from services.sim.cameras import Shot
from services.sim.config import Config
from services.sim.core import Simulation
from studies.darkroom import PAINTERS, Darkroom

CONFIG = Config(world="track")
SHOT = Shot("camera/front", 0, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
NO_SHOT = Shot("camera/down", 0, (0.0, 0.0, 1.0), ())  # type: ignore[arg-type]


def test_pictures_are_the_same_whoever_draws_them_and_errors_come_to_who_wants_them() -> None:
    darkroom = Darkroom(Simulation(CONFIG), CONFIG)
    orders = [darkroom.develop(SHOT) for _ in range(PAINTERS)]
    assert len({order.painter for order in orders}) == PAINTERS
    pictures = [order.result() for order in orders]
    assert pictures[0].data[:2] == b"\xff\xd8"
    assert pictures == [pictures[0]] * PAINTERS
    spoilt = [darkroom.develop(NO_SHOT) for _ in range(PAINTERS)]
    late = darkroom.develop(SHOT)
    for order in spoilt:
        with pytest.raises(ValueError, match="unpack"):
            order.result()
    with pytest.raises(RuntimeError, match="ended"):
        late.result()
    darkroom.close()
