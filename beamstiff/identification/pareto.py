"""Position against rotation: all compromises between the two errors (seed 003, eqs 31 and 32).

Where the model fits neither, positions and rotations ask for different stiffness. The front is that of their
root mean squares, each in standard deviations of its noise: every point minimises a weighted sum of both, the
weights found from the chord between two neighbours (Aneja & Nair, "Bicriteria transportation problem",
Management Science 25 (1979) 73). Such sums reach every compromise where the front is convex, as it is for
rigid links, whose displacements are linear in the compliances; a hollow of the front they leave out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identification.minimise import Effort, Progress, minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.problem import Problem
from beamstiff.identification.statement import state_identification
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

LITTLE = 1e-6  # weight of the other error at an end of the front: it decides between equals
SAME = 1e-7  # share of the front's width, or of an error, within which two points are one


@dataclass(frozen=True)
class Front:
    """Compromises between the position error and the rotation error, none better than another in both.

    Attributes
    ----------
    parameters : tuple of str (m)
    weight : (F,) array
        Of the rotations in the sum that each point minimises, 0 to 1; that of the positions is the rest.
    stiffness : (F, m) array, N/m, N m/rad or Pa
    position, rotation : (F,) arrays
        Root mean squares of the whitened residuals, standard deviations: one grows, the other falls.
    position_rms, rotation_rms : (F,) arrays, m and rad
        Root mean squares over the rows of the norms of both residuals.
    evaluations : int
    interrupted : bool
        Stopped by hand: the points found so far.
    notes : tuple of str
        What was left aside, and why, in sentences.
    """

    parameters: tuple[str, ...]
    weight: Array
    stiffness: Array
    position: Array
    rotation: Array
    position_rms: Array
    rotation_rms: Array
    evaluations: int
    interrupted: bool = False
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number F of points."""
        return self.weight.size

    def values(self, point: int) -> dict[str, float]:
        """Return the stiffness values of a point by name, as `Robot.with_parameters` takes them."""
        return dict(zip(self.parameters, self.stiffness[point].tolist(), strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return the front as plain data, SI."""
        return {
            "parameters": list(self.parameters),
            "points": [
                {
                    "weight": float(self.weight[at]),
                    "values": self.values(at),
                    "position_rms": float(self.position_rms[at]),
                    "rotation_rms": float(self.rotation_rms[at]),
                }
                for at in range(len(self))
            ],
            "evaluations": self.evaluations,
            "interrupted": self.interrupted,
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class _Point:
    weight: float
    theta: Array
    position: float  # mean squares
    rotation: float


def pareto_front(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    count: int = 11,
    method: str = "trust-region",
    *,
    fixed: Sequence[str] = (),
    ties: Sequence[Sequence[str]] = (),
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Front:
    """Return compromises between the position error and the rotation error of an identified robot.

    Parameters
    ----------
    robot, measurements, parameters, method, fixed, ties, bounds, effort, progress
        As of `identify`; the table states the noise of both.
    count : int
        Points, the two ends included; there are fewer where the front is shorter than rounding shows.

    Returns
    -------
    Front
        From the best positions to the best rotations. Of parameters that only act together the combination
        counts, as in `identify`.

    Raises
    ------
    BeamstiffError
        When the data cannot carry the identification, or positions or rotations are missing.

    Examples
    --------
    A robot measured with a tool that bends: the rotations ask for softer joints than the positions do.

    >>> from dataclasses import replace
    >>> from beamstiff import load_robot
    >>> from beamstiff.measure import make_measurements
    >>> from beamstiff.model.linear import predict_displacements
    >>> robot = load_robot("kr240-2")
    >>> random = np.random.default_rng(0)
    >>> table = make_measurements(
    ...     [variable.name for variable in robot.actuated],
    ...     random.uniform(-1, 1, (12, 6)),
    ...     tcp=robot.tcp,
    ...     wrench=random.normal(size=(12, 6)) * [900, 900, 900, 300, 300, 300],
    ...     displacement=np.zeros((12, 6)),
    ...     sigma_position=3e-5,
    ...     sigma_rotation=5e-5,
    ... )
    >>> bent = predict_displacements(robot, table) + 1e-6 * table.wrench @ np.diag([0, 0, 0, 1, 1, 1])
    >>> front = pareto_front(robot, replace(table, displacement=bent), count=5)
    >>> len(front), bool((np.diff(front.position) > 0).all()), bool((np.diff(front.rotation) < 0).all())
    (5, True, True)
    """
    stated = state_identification(
        robot, measurements, parameters, fixed=fixed, ties=ties, bounds=bounds, components="both"
    )
    front = front_of(stated.objective, count, method, effort, progress)
    return replace(front, notes=(*stated.problem.notes, *stated.plan.silent.values()))


def front_of(
    objective: Objective,
    count: int = 11,
    method: str = "trust-region",
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Front:
    """Return up to `count` compromises between the position error and the rotation error of an objective.

    Parameters
    ----------
    objective : Objective
        Of a problem with both measured, without robust loss, priors and errors of its inputs.
    count, method, effort, progress
        As of `pareto_front`; each point is sought from both of its neighbours.

    Raises
    ------
    BeamstiffError
        When positions or rotations are missing, or the objective has what a front does not know.
    """
    problem = objective.problem
    turns = np.nonzero(problem.used)[1] >= 3
    if turns.all() or not turns.any():
        missing = "positions" if turns.all() else "rotations with their noise (sigma_rotation)"
        raise BeamstiffError(f"{problem.source}: a front needs positions and rotations; found no {missing}")
    if objective.loss != "linear" or np.isfinite(objective.parameters.known_std).any():
        raise BeamstiffError("a front is one of squared errors: it knows no robust loss and no priors")
    if problem.disturbance is not None:
        raise BeamstiffError("a front knows no errors of the inputs: they mix positions and rotations")
    if count < 2:
        raise BeamstiffError(f"front: found count = {count}, expected 2 or more")
    search = _Search(objective, turns, method, effort or Effort(), progress)
    begin = objective.parameters.begin
    ends = [search.best(LITTLE, [begin])]
    ends.append(search.best(1 - LITTLE, [begin, ends[0].theta]))
    ends[0] = search.best(LITTLE, [ends[0].theta, ends[1].theta])
    points, interrupted = _refine(search, ends, count)
    stiffness = np.array([objective.parameters.stiffness(point.theta) for point in points])
    gaps = np.where(problem.used, problem.measured - problem.model.predict(stiffness), 0.0)
    return Front(
        parameters=problem.model.parameters,
        weight=np.array([point.weight for point in points]),
        stiffness=stiffness,
        position=np.sqrt([point.position for point in points]),
        rotation=np.sqrt([point.rotation for point in points]),
        position_rms=_rms(gaps[..., :3], problem.used[:, :3]),
        rotation_rms=_rms(gaps[..., 3:], problem.used[:, 3:]),
        evaluations=search.evaluations,
        interrupted=interrupted,
    )


@dataclass
class _Search:
    """Minimises weighted sums of both errors, and counts."""

    objective: Objective
    turns: NDArray[np.bool_]
    method: str
    effort: Effort
    progress: Progress | None = None
    evaluations: int = 0

    def best(self, weight: float, begins: list[Array]) -> _Point:
        problem = weighted(self.objective.problem, self.turns, weight)
        objective = replace(self.objective, problem=problem)
        found = [minimise(objective, self.method, begin, self.effort, self.progress) for begin in begins]
        if stopped := [one for one in found if one.interrupted]:
            raise KeyboardInterrupt(stopped[0].message)
        self.evaluations += sum(one.evaluations for one in found)
        theta = min(found, key=lambda one: one.cost).theta
        residuals = self.objective.residuals(theta)[: self.turns.size]
        return _Point(
            weight,
            theta,
            float((residuals[~self.turns] ** 2).mean()),
            float((residuals[self.turns] ** 2).mean()),
        )


def weighted(problem: Problem, turns: NDArray[np.bool_], weight: float) -> Problem:
    """Return the problem whose sum of squares is that of both mean squares, ``(1 - weight) P + weight R``.

    Parameters
    ----------
    problem : Problem
    turns : (n,) bool array
        Which of the residuals are rotations.
    weight : float
    """
    share = np.where(turns, weight / turns.sum(), (1 - weight) / (~turns).sum())
    # the whitening mixes rows of one component only, so that the order does not matter
    return replace(problem, whitening=problem.whitening.scaled(np.sqrt(share)))


def _refine(search: _Search, ends: list[_Point], count: int) -> tuple[list[_Point], bool]:
    """Return points from one end to the other, the widest gap always filled next; and whether stopped."""
    first, last = ends
    width = max(last.position - first.position, 0.0), max(first.rotation - last.rotation, 0.0)
    if width[0] <= SAME * last.position or width[1] <= SAME * first.rotation:
        return [last if width[0] <= SAME * last.position else first], False
    points, closed = [first, last], set[int]()
    while len(points) < count:
        gaps = [
            (
                0.0
                if id(b) in closed
                else (b.position - a.position) / width[0] + (a.rotation - b.rotation) / width[1]
            )
            for a, b in pairwise(points)
        ]
        at = int(np.argmax(gaps))
        a, b = points[at], points[at + 1]
        if gaps[at] <= SAME:
            break
        rise, fall = b.position - a.position, a.rotation - b.rotation
        try:
            new = search.best(rise / (rise + fall), [a.theta, b.theta])
        except KeyboardInterrupt:
            return points, True
        inside = (
            a.position + SAME * width[0] < new.position < b.position - SAME * width[0]
            and b.rotation + SAME * width[1] < new.rotation < a.rotation - SAME * width[1]
        )
        if inside:
            points.insert(at + 1, new)
        else:
            closed.add(id(b))  # a straight piece of the front, or a hollow one
    return points, False


def _rms(gaps: Array, used: NDArray[np.bool_]) -> Array:
    rows = used.any(axis=1)
    result: Array = np.sqrt((gaps[:, rows] ** 2).sum(axis=2).mean(axis=1))
    return result
