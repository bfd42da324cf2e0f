"""What others do, with pybullet alone: their loop of physics, their cameras.

gym-pybullet-drones is on no package index, so its loop (00ca90a, `BaseAviary.step`) is stated here
by its calls: at 240 Hz four rotor forces, a yaw torque, a step, and the state read into arrays;
with drag also a rotation matrix and a fifth force. Its body has five links.
"""

import importlib.util
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet

from common.camera import Lens
from services.sim.cameras import Camera, Shot
from services.sim.stage import Scene, add_visible
from services.sim.tiny import TinyRenderer, matrices_of

PEER_HZ = 240
_MASS_KG, _ARM_M = 0.027, 0.04
_FORCE, _TORQUE, _DRAG = 3.16e-10, 7.94e-12, 9.2e-7


class PeerPhysics:
    """A quadrotor stepped as gym-pybullet-drones steps its own.

    Args:
        drag: whether its drag model is on.
    """

    def __init__(self, drag: bool) -> None:
        self._drag = drag
        self._id = pybullet.connect(pybullet.DIRECT)
        on = {"physicsClientId": self._id}
        pybullet.setGravity(0.0, 0.0, -9.8, **on)
        pybullet.setTimeStep(1.0 / PEER_HZ, **on)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **on)
        pybullet.createMultiBody(0.0, plane, **on)
        hull = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER, radius=0.06, height=0.025, **on
        )
        places = [(_ARM_M * x, _ARM_M * y, 0.0) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        places.append((0.0, 0.0, 0.0))
        self._body = pybullet.createMultiBody(
            _MASS_KG,
            hull,
            basePosition=(0.0, 0.0, 1.0),
            linkMasses=[0.0] * 5,
            linkCollisionShapeIndices=[-1] * 5,
            linkVisualShapeIndices=[-1] * 5,
            linkPositions=places,
            linkOrientations=[(0.0, 0.0, 0.0, 1.0)] * 5,
            linkInertialFramePositions=[(0.0, 0.0, 0.0)] * 5,
            linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)] * 5,
            linkParentIndices=[0] * 5,
            linkJointTypes=[pybullet.JOINT_FIXED] * 5,
            linkJointAxis=[(0.0, 0.0, 1.0)] * 5,
            **on,
        )
        self._rpm = np.full(4, math.sqrt(_MASS_KG * 9.8 / 4.0 / _FORCE))
        self._position, self._turn = np.zeros((1, 3)), np.zeros((1, 4))
        self._angles, self._velocity, self._rates = (np.zeros((1, 3)) for _ in range(3))

    def step(self) -> None:
        """One step."""
        self._read()
        on = {"physicsClientId": self._id}
        forces = np.array(self._rpm**2) * _FORCE
        torques = np.array(self._rpm**2) * _TORQUE
        turn = -torques[0] + torques[1] - torques[2] + torques[3]
        for rotor in range(4):
            pybullet.applyExternalForce(
                self._body, rotor, [0, 0, forces[rotor]], [0, 0, 0], pybullet.LINK_FRAME, **on
            )
        pybullet.applyExternalTorque(self._body, 4, [0, 0, turn], pybullet.LINK_FRAME, **on)
        if self._drag:
            rotation = np.array(pybullet.getMatrixFromQuaternion(self._turn[0])).reshape(3, 3)
            factors = -_DRAG * np.sum(2.0 * np.pi * self._rpm / 60.0) * np.ones(3)
            drag = np.dot(rotation.T, factors * self._velocity[0])
            pybullet.applyExternalForce(self._body, 4, drag, [0, 0, 0], pybullet.LINK_FRAME, **on)
        pybullet.stepSimulation(**on)

    def close(self) -> None:
        """Leave pybullet."""
        pybullet.disconnect(self._id)

    def _read(self) -> None:
        on = {"physicsClientId": self._id}
        self._position[0], self._turn[0] = pybullet.getBasePositionAndOrientation(self._body, **on)
        self._angles[0] = pybullet.getEulerFromQuaternion(self._turn[0])
        self._velocity[0], self._rates[0] = pybullet.getBaseVelocity(self._body, **on)


def tiny_camera(scene: Scene) -> Callable[[Camera, Shot], Any]:
    """pybullet's TinyRenderer, without shadows, on a scene."""
    renderer = TinyRenderer()
    renderer.load(scene)
    return renderer.draw


def egl_camera(scene: Scene) -> Callable[[Camera, Shot], Any]:
    """pybullet's EGL plugin on a scene.

    Raises:
        OSError: if the plugin cannot be loaded here.
    """
    found = importlib.util.find_spec("eglRenderer")
    client = pybullet.connect(pybullet.DIRECT)
    on = {"physicsClientId": client}
    if found is None or found.origin is None:
        raise OSError("pybullet's EGL plugin is not installed")
    if pybullet.loadPlugin(found.origin, "_eglRendererPlugin", **on) < 0:
        raise OSError("pybullet's EGL plugin cannot be loaded")
    for body in scene.bodies:
        add_visible(body, (0.6, 0.5, 0.4, 1.0), **on)
    floor = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=(30.0, 30.0, 0.01), rgbaColor=(0.3, 0.5, 0.2, 1.0), **on
    )
    pybullet.createMultiBody(0.0, -1, floor, basePosition=(0.0, 0.0, -0.01), **on)

    def draw(camera: Camera, shot: Shot) -> Any:
        view, projection = matrices_of(camera, shot)
        lens: Lens = camera.lens
        return pybullet.getCameraImage(
            lens.width,
            lens.height,
            view,
            projection,
            renderer=pybullet.ER_BULLET_HARDWARE_OPENGL,
            **on,
        )[2]

    return draw
