"""A model-predictive controller of the plane, solved by OSQP 50 times a second.

Same path, same plan of speeds, same model of the plant, same estimate of the wind, same limits of
the sticks and the same PIDs of height and yaw as the autopilot's follower: only the plane's law
differs. The thesis says that one was tried and was not superior.
"""

from functools import cache

import numpy as np
import osqp
from scipy import sparse
from scipy.signal import cont2discrete

from common.frames import Array, world_to_heading, yaw_of
from common.messages import Pose, Suggestion
from services.autopilot.config import Config
from services.autopilot.control import Controller, Sticks, within
from services.autopilot.follower import Follower
from services.autopilot.plants import PLANTS

STEP_S = 0.1
STEPS = 20
"""Two seconds: the ardrone's speed has a time constant of 1.7 s."""
SHORTEST_DELAY_S = 0.01
"""Sticks without any delay would make no state."""
PLACE_WEIGHT, SPEED_WEIGHT, CHANGE_WEIGHT = 20.0, 4.0, 0.05
"""Costs of m, m/s off the plan, and of m/s changed in what the sticks ask for, squared each."""


class PredictiveFollower:
    """Flies a path; arguments as of `Follower`."""

    def __init__(
        self, suggestion: Suggestion, pose: Pose, controller: Controller, config: Config
    ) -> None:
        self.suggestion = suggestion
        self._follower = Follower(suggestion, pose, controller, config)
        self._controller = controller
        self._model = _model(controller.plant_name)
        self._top_mps = controller.plant.plane.top_speed
        self._times_s: Array = STEP_S * np.arange(1, STEPS + 1, dtype=np.float64)
        self._solvers = [_solver(self._model, self._top_mps) for _ in (0, 1)]

    @property
    def cross_track_m(self) -> float:
        """Distance to the path."""
        return self._follower.cross_track_m

    @property
    def progress_m(self) -> float:
        """How far it flew along the path; laps add up."""
        return self._follower.progress_m

    @property
    def finished(self) -> bool:
        """Whether it is at the end of an open path."""
        return self._follower.finished

    def sticks(self, pose: Pose, age_s: float, dt_s: float) -> Sticks:
        """The sticks for now; arguments as of the follower's."""
        reference = self._follower.reference(pose, age_s, dt_s)
        others = self._controller.sticks(pose, age_s, reference, dt_s)
        places, speeds = self._follower.places(self._times_s)
        wanted = [
            self._plan(axis, pose, age_s, places[:, axis], speeds[:, axis]) for axis in (0, 1)
        ]
        east, north = within(wanted, reference.along, self._top_mps)
        forward, left = world_to_heading(east, north, yaw_of(pose.orientation))
        speed = self._controller.plant.plane.speed
        return Sticks(forward / speed, left / speed, others.vz, others.wz)

    def _plan(
        self, axis: int, pose: Pose, age_s: float, places_m: Array, speeds_mps: Array
    ) -> float:
        """The speed that the sticks should ask for now on one axis, m/s."""
        free, forced, _ = self._model
        wind = self._controller.disturbance
        asked_mps = wind.asked[axis]
        state = np.array(
            [
                pose.position[axis] + age_s * pose.velocity[axis],
                pose.velocity[axis],
                asked_mps,
                wind.plane_mps2[axis],
            ]
        )
        plan = np.column_stack([places_m, speeds_mps]).ravel()
        gap = free @ state - plan
        linear = forced.T @ (_weights() * gap)
        linear[0] -= CHANGE_WEIGHT * asked_mps
        solver = self._solvers[axis]
        solver.update(q=linear)
        found = solver.solve(raise_error=False)
        value = float(found.x[0]) if found.x is not None else asked_mps
        return value if np.isfinite(value) else asked_mps


@cache
def _model(plant: str) -> tuple[Array, Array, Array]:
    """The future of place and speed as matrices: of the state, of the sticks; and the QP's own.

    The state is place, speed, what the sticks ask for (late), and the wind.
    """
    plane = PLANTS[plant].plane
    late_s = max(plane.late_s, SHORTEST_DELAY_S)
    change = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -plane.rate_ps, plane.rate_ps, 1.0],
            [0.0, 0.0, -1.0 / late_s, 0.0],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    push = np.array([[0.0], [0.0], [1.0 / late_s], [0.0]])
    seen = np.eye(2, 4)
    step, drive, *_ = cont2discrete((change, push, seen, np.zeros((2, 1))), STEP_S)
    powers = [np.linalg.matrix_power(step, k) for k in range(STEPS + 1)]
    free = np.vstack([seen @ powers[k + 1] for k in range(STEPS)])
    forced = np.zeros((2 * STEPS, STEPS))
    for row in range(STEPS):
        for column in range(row + 1):
            block = seen @ powers[row - column] @ drive
            forced[2 * row : 2 * row + 2, column] = block[:, 0]
    changes = np.eye(STEPS) - np.eye(STEPS, k=-1)
    cost = forced.T @ (_weights()[:, None] * forced) + CHANGE_WEIGHT * changes.T @ changes
    return free, forced, cost


def _weights() -> Array:
    return np.tile([PLACE_WEIGHT * STEP_S, SPEED_WEIGHT * STEP_S], STEPS)


def _solver(model: tuple[Array, Array, Array], top_mps: float) -> osqp.OSQP:
    solver = osqp.OSQP()
    solver.setup(
        P=sparse.triu(sparse.csc_matrix(model[2]), format="csc"),
        q=np.zeros(STEPS),
        A=sparse.eye(STEPS, format="csc"),
        l=np.full(STEPS, -top_mps),
        u=np.full(STEPS, top_mps),
        verbose=False,
        eps_abs=1e-4,
        eps_rel=1e-4,
    )
    return solver
