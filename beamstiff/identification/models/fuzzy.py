"""Fuzzy compliance fitted to displacements: partition by random search, rules, structure against a test set.

As in seed 003, 2.2.2: begin with few sets, place their modal values by the random search of Solis and Wets,
fit the conclusions, add sets input by input while a test set improves. Here the conclusions of every
candidate are solved for exactly, so the search is over the modal values alone; and each input begins with one
set, which is none: of six joints those that count come in by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamstiff.identification.models.fuzzy_rules import Method, fit_conclusions
from beamstiff.identification.models.fuzzy_task import (
    BETTER,
    PATIENCE,
    FuzzyFit,
    Task,
    conclude,
    state_task,
    step_of,
)
from beamstiff.identification.solis_wets import solis_wets
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy import Partition, equal_parts
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

EVALUATIONS, LEAST_EVALUATIONS = 120, 20  # of the random search, a partition
MANY = 300  # unknown conclusions from which on fewer evaluations are spent
MOST_RULES = 64
CLOSEST = 0.02  # share of an input's range that modal values keep apart
CLOSER_LOOK = 2  # inputs whose one more set is placed by random search: those that equal parts favour


def fit_fuzzy(
    robot: Robot,
    table: Measurements,
    inputs: Sequence[str] | None = None,
    *,
    symmetric: bool = True,
    positive: bool = True,
    method: Method = "exact",
    test_share: float = 0.3,
    most_rules: int = MOST_RULES,
    evaluations: int = EVALUATIONS,
    seed: int = 0,
) -> FuzzyFit:
    """Fit fuzzy compliance rules on a partition of the inputs to measured displacements.

    Parameters
    ----------
    robot : Robot
        Names the variables and the TCP; nothing else of it is used.
    table : Measurements
        Displacements of the TCP under loads there.
    inputs : sequence of str, optional
        What the compliance may depend on: actuated variables, and components of the wrench; default the
        actuated variables that vary.
    symmetric, positive : bool
        The compliance is symmetric; and positive definite, as far as force and displacement are known in the
        same directions.
    method : "exact" or "gradient"
        How the conclusions are fitted in the end.
    test_share : float
        Share of the poses that choose the structure (36 of 126 rows in the paper).
    most_rules, evaluations, seed : int
        Limits of the structure and of the random search, and the seed of both.

    Returns
    -------
    FuzzyFit

    Raises
    ------
    BeamstiffError
        When the rows are no displacements of the TCP, or too few to hold a test set out.

    Examples
    --------
    >>> from beamstiff import load_robot
    >>> from beamstiff.measure import make_measurements
    >>> from beamstiff.model.linear import predict_displacements
    >>> robot, random = load_robot("ir663"), np.random.default_rng(0)
    >>> q = random.uniform([-0.2, 0.6], [0.4, 0.9], (60, 2))
    >>> wrench = np.tile([[900.0, 0, 0, 0, 0, 0], [0, 0, -900.0, 0, 0, 0]], (30, 1))
    >>> still = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench)
    >>> seen = predict_displacements(robot, still)[:, :3]
    >>> rows = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench, displacement=seen)
    >>> fit = fit_fuzzy(robot, rows)
    >>> gap = fit.model.predict(q, wrench)[:, :3] - seen
    >>> bool(np.abs(gap[:, [0, 2]]).max() < 0.02 * np.abs(seen).max())
    True
    """
    task = state_task(robot, table, inputs, symmetric, positive, method, test_share, seed)
    random = np.random.default_rng([seed, 1])
    variable = np.ptp(task.trained, axis=1) > 0
    partition = best = equal_parts(task.names, task.trained, [1] * len(task.names))
    train, test = task.errors(partition)
    steps = [step_of(partition, train, test)]
    for_nothing = 0
    while for_nothing <= PATIENCE:
        equal = [_with_one_more(task, partition, int(at)) for at in np.flatnonzero(variable)]
        equal = [one for one in equal if one.count <= min(most_rules, task.most_rules)]
        if not equal:
            break
        equal.sort(key=lambda one: task.errors(one)[1])
        placed = [_placed(task, one, evaluations, random) for one in equal[:CLOSER_LOOK]]
        partition = min(placed, key=lambda one: task.errors(one)[1])
        train, test = task.errors(partition)
        if test < (1 - BETTER) ** 2 * steps[-1].test ** 2:
            best, for_nothing = partition, 0
            steps.append(step_of(partition, train, test))
        else:
            for_nothing += 1
    return conclude(task, best, steps, table)


def _with_one_more(task: Task, partition: Partition, at: int) -> Partition:
    """Return the partition with one more set of an input, its modal values in equal parts."""
    fresh = equal_parts(task.names, task.trained, [len(modal) for modal in partition.modal_values])
    more = equal_parts(task.names, task.trained, [count + 1 for count in fresh.sets])
    modal = list(partition.modal_values)
    modal[at] = more.modal_values[at]
    return Partition(task.names, tuple(modal), task.trained)


def _placed(task: Task, partition: Partition, evaluations: int, random: np.random.Generator) -> Partition:
    """Return the partition with its inner modal values where the training set is fitted best."""
    low, high = task.trained.T
    span = np.where(high > low, high - low, 1.0)
    inner = [slice(1, -1)] * len(partition.sets)
    begin = np.concatenate(
        [
            (modal[part] - a) / s
            for modal, part, a, s in zip(partition.modal_values, inner, low, span, strict=True)
        ]
    )
    ends = np.cumsum([max(count - 2, 0) for count in partition.sets])[:-1]

    def moved(at: Array) -> Partition | None:
        modal = []
        for own, values, a, s in zip(np.split(at, ends), partition.modal_values, low, span, strict=True):
            placed = np.concatenate([values[:1], a + s * own, values[1:][-1:]])
            if placed.size > 1 and (np.diff(placed) < CLOSEST * s).any():
                return None
            modal.append(placed)
        return Partition(task.names, tuple(modal), task.trained)

    training = task.readings.rows(task.train)
    x = task.x[task.train]

    def cost(at: Array) -> float:
        tried = moved(at)
        if tried is None:
            return np.inf
        firing = tried.firing(x)
        return training.cost(firing, fit_conclusions(training, tried, firing))

    unknowns = partition.count * len(task.readings.terms)
    spent = max(int(evaluations * min(1.0, (MANY / unknowns) ** 2)), LEAST_EVALUATIONS)
    found, _ = solis_wets(cost, begin, 0.15, spent, random)
    result = moved(found)
    return partition if result is None else result
