"""Fuzzy compliance fitted to displacements: partition by random search, rules, structure against a test set.

As in seed 003, 2.2.2: begin with few sets, place their modal values by the random search of Solis and Wets,
fit the conclusions, add sets input by input while a test set improves. Here the conclusions of every
candidate are solved for exactly, so the search is over the modal values alone; and each input begins with one
set, which is none: of six joints those that count come in by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identify.fuzzy_rules import (
    Method,
    Readings,
    fit_conclusions,
    state_readings,
)
from beamstiff.identify.solis_wets import solis_wets
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy import FuzzySystem, Partition, Premises, equal_parts
from beamstiff.model.fuzzy_compliance import FuzzyCompliance, inputs_of
from beamstiff.model.fuzzy_tree import Split, Tree
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

BETTER = 0.03  # share of the test error that one more set must take away
PATIENCE = 2  # steps that may be for nothing: two sets may help where one does not
EVALUATIONS = 120  # of the random search, a partition
MOST_RULES = 64
CLOSEST = 0.02  # share of an input's range that modal values keep apart
RAMPS = ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (0.25, 0.75))  # of a tree's splits, shares of a leaf's range
LEAST_WEIGHT = 3.0  # rows, by firing strength, on either side of a split


@dataclass(frozen=True)
class Step:
    """A structure that was tried and taken.

    Attributes
    ----------
    rules : int
    sets : tuple of int
        Number of sets of each input; empty for a tree.
    train, test : float
        Root mean square of the whitened residuals over the training and the test set.
    """

    rules: int
    sets: tuple[int, ...]
    train: float
    test: float


@dataclass(frozen=True, eq=False)
class FuzzyFit:
    """A fitted fuzzy model, and how its structure grew.

    Attributes
    ----------
    model : FuzzyCompliance
    steps : tuple of Step
    test_rows : (N,) bool array
        The test set; its rows chose the structure, and count in the conclusions.
    """

    model: FuzzyCompliance
    steps: tuple[Step, ...]
    test_rows: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Task:
    """What is fitted to what: inputs (N, n) of the readings, and which rows are the training set."""

    names: tuple[str, ...]
    x: Array
    trained: Array
    readings: Readings
    train: NDArray[np.bool_]
    method: Method
    positive: bool

    def errors(self, premises: Premises) -> tuple[float, float]:
        """Return the mean squares over the training and the test set, rules fitted to the first."""
        firing = premises.firing(self.x)
        training, test = self.readings.rows(self.train), self.readings.rows(~self.train)
        found = fit_conclusions(training, premises, firing[self.train])
        return training.cost(firing[self.train], found), test.cost(firing[~self.train], found)

    @property
    def most_rules(self) -> int:
        """Rules whose conclusions the training set has enough readings for."""
        return int(self.readings.count[self.train].sum()) // len(self.readings.terms)

    def system(self, premises: Premises) -> FuzzySystem:
        """Return the rules fitted to all rows."""
        firing = premises.firing(self.x)
        found = fit_conclusions(self.readings, premises, firing, self.method, self.positive)
        return FuzzySystem(premises, self.readings.matrices(found), firing.max(axis=0))


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
    task = _state(robot, table, inputs, symmetric, positive, method, test_share, seed)
    random = np.random.default_rng([seed, 1])
    variable = np.ptp(task.trained, axis=1) > 0
    partition = best = equal_parts(task.names, task.trained, [1] * len(task.names))
    train, test = task.errors(partition)
    steps = [_step(partition, train, test)]
    for_nothing = 0
    while for_nothing <= PATIENCE:
        found: tuple[float, float, Partition] | None = None
        for at in np.flatnonzero(variable):
            sets = [count + (one == at) for one, count in enumerate(partition.sets)]
            if np.prod(sets) > min(most_rules, task.most_rules):
                continue
            tried = _placed(task, _with_one_more(task, partition, int(at)), evaluations, random)
            train, test = task.errors(tried)
            if found is None or test < found[1]:
                found = train, test, tried
        if found is None:
            break
        train, test, partition = found
        if test < (1 - BETTER) ** 2 * steps[-1].test ** 2:
            best, for_nothing = partition, 0
            steps.append(_step(partition, train, test))
        else:
            for_nothing += 1
    return _concluded(task, best, steps, table)


def fit_fuzzy_tree(
    robot: Robot,
    table: Measurements,
    inputs: Sequence[str] | None = None,
    *,
    symmetric: bool = True,
    positive: bool = True,
    method: Method = "exact",
    test_share: float = 0.3,
    most_rules: int = 16,
    seed: int = 0,
) -> FuzzyFit:
    """Fit fuzzy compliance rules on a decision tree: six joints, and the wrench, to six components.

    Each step takes the split of a leaf by an input that fits the training set best; the tree that is best on
    the test set is kept.

    Parameters
    ----------
    robot, table, inputs, symmetric, positive, method, test_share, most_rules, seed
        As of `fit_fuzzy`.

    Raises
    ------
    BeamstiffError
        As `fit_fuzzy`.
    """
    task = _state(robot, table, inputs, symmetric, positive, method, test_share, seed)
    tree = best = Tree(task.names, (), task.trained)
    train, test = task.errors(tree)
    steps = [_step(tree, train, test)]
    while tree.count < min(most_rules, task.most_rules):
        grown = [(task.errors(tree.grown(split)), split) for split in _splits(task, tree)]
        if not grown:
            break
        (train, test), split = min(grown, key=lambda one: one[0][0])
        tree = tree.grown(split)
        if test < (1 - BETTER) ** 2 * steps[-1].test ** 2:
            best = tree
            steps.append(_step(tree, train, test))
        elif tree.count > best.count + 2 * PATIENCE:
            break
    return _concluded(task, best, steps, table)


def _state(
    robot: Robot,
    table: Measurements,
    inputs: Sequence[str] | None,
    symmetric: bool,
    positive: bool,
    method: Method,
    test_share: float,
    seed: int,
) -> _Task:
    names = tuple(inputs) if inputs is not None else table.variables
    x = inputs_of(names, table.variables, table.q, table.wrench)
    if inputs is None and (varying := np.ptp(x, axis=0) > 0).any():
        names = tuple(name for name, varies in zip(names, varying, strict=True) if varies)
        x = x[:, varying]
    readings = state_readings(table, compile_kinematics(robot).size, robot.tcp, symmetric)
    poses = np.unique(table.pose)
    held = round(test_share * len(poses))
    if not 0 < held < len(poses):
        raise BeamstiffError(
            f"{table.source}: found {len(poses)} poses, expected enough to hold a share of {test_share:.2g} "
            "out as a test set of the fuzzy model"
        )
    chosen = np.random.default_rng(seed).permutation(poses)[:held]
    trained = np.stack([x.min(axis=0), x.max(axis=0)], axis=1)
    train = ~np.isin(table.pose, chosen)
    return _Task(names, x, trained, readings, train, method, positive and symmetric)


def _with_one_more(task: _Task, partition: Partition, at: int) -> Partition:
    """Return the partition with one more set of an input, its modal values in equal parts."""
    fresh = equal_parts(task.names, task.trained, [len(modal) for modal in partition.modal_values])
    more = equal_parts(task.names, task.trained, [count + 1 for count in fresh.sets])
    modal = list(partition.modal_values)
    modal[at] = more.modal_values[at]
    return Partition(task.names, tuple(modal), task.trained)


def _placed(task: _Task, partition: Partition, evaluations: int, random: np.random.Generator) -> Partition:
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

    found, _ = solis_wets(cost, begin, 0.15, evaluations, random)
    result = moved(found)
    return partition if result is None else result


def _splits(task: _Task, tree: Tree) -> list[Split]:
    """Return the splits of all leaves that leave enough rows on both sides."""
    firing = tree.firing(task.x)[task.train]
    x = task.x[task.train]
    found = []
    for leaf in range(tree.count):
        inside = firing[:, leaf] > 0.1
        if firing[:, leaf].sum() < 2 * LEAST_WEIGHT:
            continue
        for at in range(x.shape[1]):
            low, high = float(x[inside, at].min()), float(x[inside, at].max())
            for first, last in RAMPS:
                a, b = low + first * (high - low), low + last * (high - low)
                if b - a <= CLOSEST * float(np.ptp(task.trained[at])):
                    continue
                above = firing[:, leaf] * np.clip((x[:, at] - a) / (b - a), 0.0, 1.0)
                if LEAST_WEIGHT <= above.sum() <= firing[:, leaf].sum() - LEAST_WEIGHT:
                    found.append(Split(leaf, at, a, b))
    return found


def _step(premises: Premises, train: float, test: float) -> Step:
    sets = premises.sets if isinstance(premises, Partition) else ()
    return Step(premises.count, sets, float(np.sqrt(train)), float(np.sqrt(test)))


def _concluded(task: _Task, premises: Premises, steps: Sequence[Step], table: Measurements) -> FuzzyFit:
    model = FuzzyCompliance(table.variables, task.system(premises))
    return FuzzyFit(model, tuple(steps), ~task.train)
