"""Where the search starts for a stiffness that the robot calls rigid or free."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from beamstiff.identification.problem import Problem
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.se3 import Array

AS_GOOD_AS = 1e6  # times the stiffness that explains all of the displacements: as good as rigid


def start_values(robot: Robot, problem: Problem, held: Collection[str] = ()) -> Array:
    """Return the stiffness values (m,) to start from: the robot's; for what it calls rigid or free, a guess.

    With the guess the spring alone, carrying all of the load, would move the measured points as far as they
    were seen to move: what is measured is at least as stiff.

    `held`: parameters that will stay at their start: those stay as good as rigid, or free.
    """
    model = problem.model
    result = model.start.copy()
    unit = np.trace(model.springs, axis1=1, axis2=2)
    for number, name in enumerate(model.parameters):
        in_robot = robot.parameter(name)
        if in_robot not in (RIGID, FREE):
            continue
        spring = model.springs[number]
        alone = np.einsum("npa,pq,nq->na", model.motion, np.linalg.pinv(spring), model.force)
        seen = np.where(problem.used, problem.measured / problem.sigma, 0.0)
        moved = np.where(problem.used, alone / problem.sigma, 0.0)
        size, far = float(np.linalg.norm(seen)), float(np.linalg.norm(moved))
        guess = far / size if far > 0 and size > 0 else 1.0 / unit[number]
        if name in held:
            guess = guess * AS_GOOD_AS if in_robot == RIGID else guess / AS_GOOD_AS
        result[number] = guess
    return result
