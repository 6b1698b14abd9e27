"""Stiffness values to start from: the robot's, or such that every spring counts."""

from collections.abc import Collection

import numpy as np

from beamstiff.identification.problem import Problem
from beamstiff.model.ports import PortModel
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


def balanced_stiffness(model: PortModel) -> Array:
    """Return values (m,) with which no spring hides another: neither as good as rigid nor as good as free.

    A spring beside elastic parts gets the stiffness that these have at its port; one that carries all of the
    load gets a stiffness in proportion to what it would move the measured points by.
    """
    lever = model.lever
    both = np.outer(lever, lever)
    own = np.diagonal(model.springs, axis1=1, axis2=2) > 0  # (m, p)
    unit = np.trace(model.springs / both, axis1=1, axis2=2)
    beside = np.diagonal(model.port_stiffness / both, axis1=1, axis2=2).mean(axis=0)
    rest = (own @ beside) / unit
    carried = ((model.force / lever) ** 2) @ own.T  # (N, m)
    moved = ((model.motion[:, :, :3] / lever[:, None]) ** 2).sum(axis=2) @ own.T
    turned = (
        ((model.motion[:, :, 3:] / lever[:, None]) ** 2).sum(axis=2) @ own.T * lever.max(initial=1.0) ** 2
    )
    effect = np.sqrt((carried * (moved + turned)).mean(axis=0)) / unit
    held, acts = rest > 0, effect > 0
    if not acts.any():
        return np.asarray(np.where(held, rest, 1.0 / unit))
    ratio = float(np.median(rest[held & acts] / effect[held & acts])) if (held & acts).any() else 1.0
    effect = np.where(acts, effect, float(np.median(effect[acts] * unit[acts])) / unit)
    return np.asarray(np.where(held, rest, effect * ratio))
