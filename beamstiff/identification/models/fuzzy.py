"""Fuzzy compliance fitted to displacements: partition by random search, rules, structure against a test set.

As in seed 003, 2.2.2: begin with few sets, place their modal values by the random search of Solis and Wets,
fit the conclusions, add sets input by input while a test set improves. Here the conclusions of every
candidate are solved for exactly, so the search is over the modal values alone; and each input begins with one
set, which is none: of six joints those that count come in by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identification.models.configuration import Begin, Varying, begin_with, fit_varying
from beamstiff.identification.models.fuzzy_rules import Readings, build_readings, fit_conclusions
from beamstiff.identification.models.split import configurations
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance, inputs_of
from beamstiff.model.fuzzy_correction import FuzzyCorrection
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition, equal_parts
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

TEST_SHARE = 0.3  # of the poses, that choose the structure; 36 of 126 rows in the paper
BETTER = 0.03  # share of the test error that one more set must take away
PATIENCE = 2  # steps that may be for nothing: two sets may help where one does not
EVALUATIONS, LEAST_EVALUATIONS = 120, 20  # of the random search, a partition
MANY = 300  # unknown conclusions from which on fewer evaluations are spent
MOST_RULES = 64
CLOSEST = 0.02  # share of an input's range that modal values keep apart
CLOSER_LOOK = 2  # inputs whose one more set is placed by random search: those that equal parts favour

WIDER, NARROWER, AFTER = 2.0, 0.5, (5, 3)  # the step after so many successes, failures
SMALLEST = 1e-4
WORTH = 6.0  # by how much one more set must raise the logarithm of the evidence: many are tried
MOST_RULES = 36
NEAR = 0.4  # share of an input's range over which the corrections of rules are alike


@dataclass(frozen=True)
class Step:
    """A structure that was taken: numbers of sets of the inputs, and its root mean square residuals."""

    sets: tuple[int, ...]
    train: float
    test: float


@dataclass(frozen=True, eq=False)
class FuzzyFit:
    """A fitted fuzzy model, and how its structure grew."""

    model: FuzzyCompliance
    steps: tuple[Step, ...]
    # (N,): the test set; its rows chose the structure, and count in the conclusions
    test_rows: NDArray[np.bool_]


def fit_fuzzy(
    robot: Robot,
    table: Measurements,
    seed: int = 0,
    each_term: bool = False,
) -> FuzzyFit:
    """Fit fuzzy compliance rules on a partition of the inputs to measured displacements.

    `robot`: names the variables and the TCP; nothing else of it is used. `table`: displacements of the TCP
    under loads there. The inputs are the actuated variables that vary. `seed`: of the test set and of the
    random search. `each_term`: a partition of its own for every term of the compliance, as in seed 003 (the
    matrix is symmetric, and positive definite where the readings say so); the steps of all terms stand one
    after the other.
    """
    whole = _state_task(robot, table, seed)
    tasks = [whole.term(at) for at in range(len(whole.readings.terms))] if each_term else [whole]
    systems, steps = zip(*(_grown(task, seed) for task in tasks), strict=True)
    model = FuzzyCompliance(table.variables, systems[0], tuple(systems[1:]))
    return FuzzyFit(model, tuple(step for some in steps for step in some), ~whole.train)


def _grown(task: _Task, seed: int) -> tuple[FuzzySystem, list[Step]]:
    """Return the rules of a task, and how their structure grew."""
    random = np.random.default_rng([seed, 1])
    variable = np.ptp(task.trained, axis=1) > 0
    partition = best = equal_parts(task.names, task.trained, [1] * len(task.names))
    most_rules = min(MOST_RULES, int(task.training.count.sum()) // len(task.training.terms))
    steps = [task.step(partition)]
    for_nothing = 0
    while for_nothing <= PATIENCE:
        equal = [_with_one_more(task, partition, int(at)) for at in np.flatnonzero(variable)]
        equal = [one for one in equal if one.count <= most_rules]
        if not equal:
            break
        equal.sort(key=lambda one: task.errors(one)[1])
        placed = [_placed(task, one, random) for one in equal[:CLOSER_LOOK]]
        partition = min(placed, key=lambda one: task.errors(one)[1])
        step = task.step(partition)
        if step.test**2 < (1 - BETTER) ** 2 * steps[-1].test ** 2:
            best, for_nothing = partition, 0
            steps.append(step)
        else:
            for_nothing += 1
    firing = best.firing(task.x)
    found = fit_conclusions(task.readings, best, firing, positive=True)
    return FuzzySystem(best, task.readings.matrices(found), firing.max(axis=0)), steps


@dataclass(frozen=True, eq=False)
class _Task:
    """What is fitted to what: inputs (N, n) of the readings, and which rows are the training set."""

    names: tuple[str, ...]
    x: Array
    trained: Array
    readings: Readings
    train: NDArray[np.bool_]
    training: Readings
    test: Readings

    def term(self, at: int) -> _Task:
        """Return the task of one term of the compliance."""
        readings = self.readings.term(at)
        return replace(
            self, readings=readings, training=readings.rows(self.train), test=readings.rows(~self.train)
        )

    def errors(self, premises: Partition) -> tuple[float, float]:
        """Return the mean squares over the training and the test set, rules fitted to the first."""
        firing = premises.firing(self.x)
        found = fit_conclusions(self.training, premises, firing[self.train])
        return self.training.cost(firing[self.train], found), self.test.cost(firing[~self.train], found)

    def step(self, premises: Partition) -> Step:
        train, test = np.sqrt(self.errors(premises))
        return Step(premises.sets, float(train), float(test))


def _state_task(robot: Robot, table: Measurements, seed: int) -> _Task:
    names = table.variables
    x = inputs_of(names, names, table.q)
    if (varying := np.ptp(x, axis=0) > 0).any():
        names = tuple(name for name, varies in zip(names, varying, strict=True) if varies)
        x = x[:, varying]
    readings = build_readings(table, compile_kinematics(robot).size, robot.tcp)
    stood = configurations(table)
    poses = np.unique(stood)
    held = round(TEST_SHARE * len(poses))
    if not 0 < held < len(poses):
        raise BeamstiffError(
            f"{table.source}: found {len(poses)} poses, expected enough to hold a share of {TEST_SHARE:.2g} "
            "out as a test set of the fuzzy model"
        )
    train = ~np.isin(stood, np.random.default_rng(seed).permutation(poses)[:held])
    trained = np.stack([x.min(axis=0), x.max(axis=0)], axis=1)
    return _Task(names, x, trained, readings, train, readings.rows(train), readings.rows(~train))


def _with_one_more(task: _Task, partition: Partition, at: int) -> Partition:
    """Return the partition with one more set of an input, its modal values in equal parts."""
    more = equal_parts(task.names, task.trained, [count + 1 for count in partition.sets])
    modal = list(partition.modal_values)
    modal[at] = more.modal_values[at]
    return Partition(task.names, tuple(modal), task.trained)


def _placed(task: _Task, partition: Partition, random: np.random.Generator) -> Partition:
    """Return the partition with its inner modal values where the training set is fitted best."""
    low, high = task.trained.T
    span = np.where(high > low, high - low, 1.0)
    begin = np.concatenate(
        [(modal[1:-1] - a) / s for modal, a, s in zip(partition.modal_values, low, span, strict=True)]
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

    x = task.x[task.train]

    def cost(at: Array) -> float:
        tried = moved(at)
        if tried is None:
            return np.inf
        firing = tried.firing(x)
        return task.training.cost(firing, fit_conclusions(task.training, tried, firing))

    unknowns = partition.count * len(task.readings.terms)
    spent = max(int(EVALUATIONS * min(1.0, (MANY / unknowns) ** 2)), LEAST_EVALUATIONS)
    return moved(solis_wets(cost, begin, 0.15, spent, random)[0]) or partition


def solis_wets(
    cost: Callable[[Array], float], begin: Array, step: float, evaluations: int, random: np.random.Generator
) -> tuple[Array, float]:
    """Return the best point (n,) found, and its cost, which is infinite where it is not allowed.

    Steps are normal about a bias that follows what went well; where one fails its opposite is tried.
    """
    at, best, bias = np.array(begin, dtype=np.float64), cost(begin), np.zeros(len(begin))
    good = bad = 0
    spent = 1
    while spent < evaluations and step > SMALLEST and len(begin):
        move = bias + step * random.standard_normal(at.size)
        for sign in (1.0, -1.0):
            value = cost(at + sign * move)
            spent += 1
            if value < best:
                at, best = at + sign * move, value
                bias = 0.2 * bias + 0.4 * move if sign > 0 else bias - 0.4 * move
                good, bad = good + 1, 0
                break
        else:
            bias *= 0.5
            good, bad = 0, bad + 1
        if good >= AFTER[0]:
            step, good = WIDER * step, 0
        elif bad >= AFTER[1]:
            step, bad = NARROWER * step, 0
    return at, best


@dataclass(frozen=True, eq=False)
class CorrectionFit:
    """A fitted gray box."""

    model: FuzzyCorrection
    varying: Varying  # what the fit says of the conclusions
    # numbers of sets of the inputs as the structure grew, with the logarithm of the evidence
    sets: tuple[tuple[tuple[int, ...], float], ...]


def fit_fuzzy_correction(
    robot: Robot, table: Measurements, parameters: Sequence[str] | None = None
) -> CorrectionFit:
    """Fit fuzzy corrections of joint compliances, default those of ``robot.identify``, to displacements.

    Sets are added input by input, one or two at a time (a wave shows with three only), while the evidence
    grows; the conclusions are shrunk towards no correction (see `configuration`): no test set is needed.
    """
    start = begin_with(robot, table, parameters)
    names = table.variables
    x = inputs_of(names, names, table.q)
    trained = np.stack([x.min(axis=0), x.max(axis=0)], axis=1)
    premises = equal_parts(names, trained, [1] * len(names))
    best = _fit(start, premises, x)
    grown = [(premises.sets, best.evidence)]
    while True:
        tried = []
        for at, more in product(np.flatnonzero(np.ptp(trained, axis=1) > 0), (1, 2)):
            sets = [count + more * (one == at) for one, count in enumerate(premises.sets)]
            if np.prod(sets) <= MOST_RULES:
                partition = equal_parts(names, trained, sets)
                tried.append((_fit(start, partition, x), partition))
        if not tried:
            break
        found, partition = max(tried, key=lambda one: one[0].evidence)
        if found.evidence < best.evidence + WORTH:
            break
        best, premises = found, partition
        grown.append((premises.sets, best.evidence))
    system = FuzzySystem(premises, best.change, premises.firing(x).max(axis=0))
    model = FuzzyCorrection(start.robot, start.parameters, start.compliance, system)
    return CorrectionFit(model, best, tuple(grown))


def _fit(start: Begin, premises: Partition, x: Array) -> Varying:
    corners, span = premises.corners(), np.ptp(premises.trained, axis=1)
    apart = (corners[:, None] - corners) / (NEAR * np.where(span > 0, span, 1.0))
    alike = np.exp(-0.5 * (apart**2).sum(axis=2)) + 1e-6 * np.eye(len(corners))
    return fit_varying(start.problem, premises.firing(x), start.compliance, alike)
