"""A KR240-2 that weighs 0.8 t: what its drives hold, as derivatives of potential energies."""

from collections.abc import Callable

import numpy as np

from beamstiff.robot.parts import Mass
from beamstiff.se3 import Array
from tests.diagnosis.machines import arm_at, kr240

GRAVITY = 9.81
UPPER, ELBOW, FORE, TOOL = 350.0, 150.0, 200.0, 100.0  # kg
CENTRE = np.array([0.1, 0.0, 0.15])  # m, of the tool in its frame
MASSES = (
    Mass(node="n2b", mass=UPPER, at=(0.625, 0.0, 0.0)),
    Mass(node="n3b", mass=ELBOW),
    Mass(node="n4b", mass=FORE),
    Mass(node="n6b", mass=TOOL, at=tuple(CENTRE.tolist())),
)
ROBOT = kr240().model_copy(update={"masses": MASSES})
VARIABLES = [one.name for one in ROBOT.actuated]
STEP = 1e-5  # rad
Energy = Callable[[Array], Array]


def weights(upper: float = UPPER, elbow: float = ELBOW, tool: float = TOOL, centre: Array = CENTRE) -> Energy:
    def energy(q: Array) -> Array:
        arm = arm_at(q)
        shoulder, knee, wrist = arm.point[:, 1, 2], arm.point[:, 2, 2], arm.point[:, 3, 2]
        held = arm.tip[:, 2] + arm.tool[:, 2] @ centre
        return GRAVITY * (upper * (shoulder + knee) / 2 + elbow * knee + FORE * wrist + tool * held)

    return energy


def balancer(stiffness: float, free: float) -> Energy:
    """Return the energy of a spring across axis 2, from 0.3 m behind it to 0.25 m along the upper arm."""

    def energy(q: Array) -> Array:
        end = 0.25 * np.stack([np.cos(q[:, 1]), np.sin(q[:, 1])])
        return 0.5 * stiffness * (np.linalg.norm(end - [[-0.3], [0.1]], axis=0) - free) ** 2

    return energy


def held(energy: Energy, q: Array) -> Array:
    step = STEP * np.eye(q.shape[1])
    return np.stack([(energy(q + one) - energy(q - one)) / (2 * STEP) for one in step], axis=-1)


def postures(rng: np.random.Generator, count: int) -> Array:
    return rng.uniform([-2, 0.4, -2.5, -2, -1.8, -3], [2, 2.0, -0.3, 2, 1.8, 3], (count, 6))
