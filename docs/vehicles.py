"""Makes docs/vehicles.jpg: several vehicles in one world, as one of them sees the others."""

import math
from pathlib import Path

from common.messages import ResetRequest
from services.sim.cameras import Shot, cameras_of
from services.sim.config import Config
from services.sim.core import Simulation
from services.sim.renderer import jpeg_of
from services.sim.studio import open_renderer

PLACES = (
    (-1.0, 0.0, 0.9, 0.0),
    (0.9, 0.45, 0.75, 0.6),
    (0.9, -0.5, 0.0, 0.9),
    (2.2, 0.3, 0.0, -0.5),
)
"""Forward, left, up of the world's start, in m; the turn against it in rad."""

if __name__ == "__main__":
    config = Config(world="gazebo", vehicles="tum,ardrone,rover,rover", front_size="480p")
    simulation = Simulation(config)
    start = simulation.state
    (x, y, _), yaw_rad = start.position_m, start.yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    for index, (ahead, left, up, turn_rad) in enumerate(PLACES):
        place = (x + cos * ahead - sin * left, y + sin * ahead + cos * left, up)
        simulation.reset(ResetRequest(position=place, yaw=yaw_rad + turn_rad), index)
    shots: list[Shot] = []
    while not shots:
        told = simulation.step_all([None] * len(PLACES))[0]
        shots = [shot for shot in told.shots if shot.topic == "camera/front"]
    renderer = open_renderer("gl")
    renderer.load(simulation.scene())
    picture = renderer.draw(cameras_of(config)[0], shots[0])
    (Path(__file__).parent / "vehicles.jpg").write_bytes(jpeg_of(picture, 82))
