"""Pictures are the same whoever draws them, and what goes wrong there is told here."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from common.camera import FRONT, Mount
from common.messages import Image
from services.sim.cameras import Shot
from services.sim.config import Config
from services.sim.core import Simulation
from studies.darkroom import PAINTERS, Darkroom

CONFIG = Config(world="track")
SHOT = Shot("camera/front", 0, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
NO_SHOT = Shot("camera/down", 0, (0.0, 0.0, 1.0), ())  # type: ignore[arg-type]


def test_pictures_are_taken_from_where_the_plant_has_its_cameras(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = Simulation(CONFIG)
    darkroom = Darkroom(simulation, CONFIG)
    usual = darkroom.develop(SHOT).result()
    plant = simulation.actors[0].plant
    # As if on the roof of another vehicle, looking back.
    x, y, z = FRONT.position_m
    (a, b, c), (d, e, f), up = FRONT.body_from_optical
    back = Mount((-x, -y, z + 0.5), ((-a, -b, -c), (-d, -e, -f), up))
    monkeypatch.setattr(plant, "build", replace(plant.build, front=back))
    darkroom.load()
    other = darkroom.develop(SHOT).result()
    turned = replace(SHOT, position_m=(0.0, 0.0, 1.5), orientation=(0.0, 0.0, 1.0, 0.0))
    monkeypatch.undo()
    darkroom.load()
    expected, again = darkroom.develop(turned).result(), darkroom.develop(SHOT).result()
    darkroom.close()
    assert again.data == usual.data != other.data
    seen, meant = (_grey(picture) for picture in (other, expected))
    assert np.abs(seen - meant).mean() < 2.0 < np.abs(seen - _grey(usual)).mean()


def _grey(picture: Image) -> np.ndarray:
    data = np.frombuffer(picture.data, np.uint8)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), float)


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
    assert late.result() == pictures[0]
    darkroom.close()
    with pytest.raises(RuntimeError, match="ended"):
        darkroom.develop(SHOT).result()
