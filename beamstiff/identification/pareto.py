"""Position against rotation: compromises between the two errors (seed 003, eqs 31 and 32).

Where the model fits neither, positions and rotations ask for different stiffness. Every point of the front
minimises a weighted sum of both mean squares, each in variances of its noise; the weight follows from the
chord between two neighbours (Aneja & Nair, "Bicriteria transportation problem", Management Science 25 (1979)
73). Such sums reach every compromise where the front is convex, as it is for rigid links, whose displacements
are linear in the compliances.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from beamstiff.errors import BeamstiffError, OptionError
from beamstiff.identification.minimise import minimise
from beamstiff.identification.problem import Problem
from beamstiff.identification.statement import Statement
from beamstiff.se3 import Array

LITTLE = 1e-6  # weight of the other error at an end of the front: it decides between equals
SAME = 1e-7  # share of the front's width, or of an error, within which two points are one


@dataclass(frozen=True, eq=False)
class Front:
    """F compromises, none better than another in both errors; the best positions come first."""

    parameters: tuple[str, ...]
    weight: Array  # (F,): of the rotations in the sum that a point minimises, 0 to 1
    stiffness: Array  # (F, m), N/m, N m/rad or Pa
    # (F, 2): root mean squares of both residuals in standard deviations of their noise, and as they are: over
    # the rows, of the residual's norm, m and rad
    relative: Array
    rms: Array

    def to_dict(self) -> list[dict[str, Any]]:
        """Return the points as plain data, SI."""
        return [
            {
                "rotation_weight": float(weight),
                "rms_mm": 1e3 * float(rms[0]),
                "rms_deg": float(np.degrees(rms[1])),
                "stiffness": dict(zip(self.parameters, values.tolist(), strict=True)),
            }
            for weight, rms, values in zip(self.weight, self.rms, self.stiffness, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class _Point:
    weight: float
    theta: Array
    squares: Array  # (2,): mean squares of positions and rotations


def pareto_front(statement: Statement, stiffness: Array, count: int) -> Front:
    """Return at most `count` points, both ends included, about the optimum at stiffness values (m,).

    Errors of the inputs, which mix positions and rotations, are no part of the statement.
    """
    if count < 2:
        raise OptionError("pareto", f"found {count}, expected 2 points or more")
    statement = statement.holding(stiffness)
    problem = statement.problem
    turns = np.nonzero(problem.used)[1] >= 3
    if turns.all() or not turns.any():
        missing = "positions" if turns.all() else "rotations with their noise (sigma_rotation)"
        raise BeamstiffError(f"{problem.source}: pareto: found no {missing}, expected both")

    def best(weight: float, *begins: Array) -> _Point:
        """Minimise ``(1 - weight) P + weight R`` of the mean squares P and R, from several starts."""
        objective = replace(statement, problem=_weighted(problem, turns, weight)).objective
        theta = min((minimise(objective, begin=begin) for begin in begins), key=lambda one: one.cost).theta
        left = problem.residuals(statement.parameters.stiffness(theta)) ** 2
        return _Point(weight, theta, np.array([left[~turns].mean(), left[turns].mean()]))

    optimum = statement.theta(stiffness)
    first = best(LITTLE, optimum)
    last = best(1.0 - LITTLE, optimum, first.theta)
    first = best(LITTLE, first.theta, last.theta)
    width = last.squares - first.squares  # one error grows, the other falls
    points = [first, last]
    if width[0] <= SAME * last.squares[0] or -width[1] <= SAME * first.squares[1]:
        points = [best(0.5, optimum, first.theta)]
    straight = set[int]()  # pieces of the front that hold no other point, by their end
    while 1 < len(points) < count:
        gaps = [
            0.0 if id(b) in straight else float(((b.squares - a.squares) / width).sum())
            for a, b in pairwise(points)
        ]
        at = int(np.argmax(gaps))
        if gaps[at] <= SAME:
            break
        a, b = points[at : at + 2]
        rise, fall = np.abs(b.squares - a.squares)
        new = best(float(rise / (rise + fall)), a.theta, b.theta)
        away = [(new.squares - a.squares) / width, (b.squares - new.squares) / width]
        if np.min(away) > SAME:
            points.insert(at + 1, new)
        else:
            straight.add(id(b))
    values = np.array([statement.parameters.stiffness(point.theta) for point in points])
    gap = np.where(problem.used, problem.measured - problem.model.predict(values), 0.0)
    parts = (slice(0, 3), slice(3, 6))
    rms = [np.sqrt((gap[:, problem.used[:, part].any(1), part] ** 2).sum(2).mean(1)) for part in parts]
    return Front(
        problem.model.parameters,
        np.array([point.weight for point in points]),
        values,
        np.sqrt([point.squares for point in points]),
        np.stack(rms, axis=1),
    )


def _weighted(problem: Problem, turns: NDArray[np.bool_], weight: float) -> Problem:
    """Return the problem whose sum of squares is that of both mean squares, weighted; `turns` (n,) bool."""
    share = np.where(turns, weight / turns.sum(), (1.0 - weight) / (~turns).sum())
    rows = sparse.diags_array(np.sqrt(share), format="csr")
    own = problem.whitening  # mixes rows of one component only, so that the order does not matter
    return replace(problem, whitening=replace(own, blocks=(rows @ own.blocks).tocsr(), left=rows @ own.left))
