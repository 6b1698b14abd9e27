"""What fuzzy rules are fitted to, and what a fit says: shared by partitions and trees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identification.models.fuzzy_rules import Method, Readings, fit_conclusions, state_readings
from beamstiff.identification.models.split import configurations
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy import FuzzySystem, Partition, Premises
from beamstiff.model.fuzzy_compliance import FuzzyCompliance, inputs_of
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

BETTER = 0.03  # share of the test error that one more set must take away
PATIENCE = 2  # steps that may be for nothing: two sets may help where one does not


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
class Task:
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


def state_task(
    robot: Robot,
    table: Measurements,
    inputs: Sequence[str] | None,
    symmetric: bool,
    positive: bool,
    method: Method,
    test_share: float,
    seed: int,
) -> Task:
    """Return what is fitted, a share of the poses drawn as the test set.

    Parameters
    ----------
    robot, table, inputs, symmetric, positive, method, test_share, seed
        As of `beamstiff.identification.models.fuzzy.fit_fuzzy`.

    Raises
    ------
    BeamstiffError
        When the rows are no displacements of the TCP, or too few to hold a test set out.
    """
    names = tuple(inputs) if inputs is not None else table.variables
    x = inputs_of(names, table.variables, table.q, table.wrench)
    if inputs is None and (varying := np.ptp(x, axis=0) > 0).any():
        names = tuple(name for name, varies in zip(names, varying, strict=True) if varies)
        x = x[:, varying]
    readings = state_readings(table, compile_kinematics(robot).size, robot.tcp, symmetric)
    stood = configurations(table)
    poses = np.unique(stood)
    held = round(test_share * len(poses))
    if not 0 < held < len(poses):
        raise BeamstiffError(
            f"{table.source}: found {len(poses)} poses, expected enough to hold a share of {test_share:.2g} "
            "out as a test set of the fuzzy model"
        )
    chosen = np.random.default_rng(seed).permutation(poses)[:held]
    trained = np.stack([x.min(axis=0), x.max(axis=0)], axis=1)
    train = ~np.isin(stood, chosen)
    return Task(names, x, trained, readings, train, method, positive and symmetric)


def step_of(premises: Premises, train: float, test: float) -> Step:
    """Return a structure with its mean squared errors."""
    sets = premises.sets if isinstance(premises, Partition) else ()
    return Step(premises.count, sets, float(np.sqrt(train)), float(np.sqrt(test)))


def conclude(task: Task, premises: Premises, steps: Sequence[Step], table: Measurements) -> FuzzyFit:
    """Return the fit whose structure was chosen, its rules fitted to all rows."""
    model = FuzzyCompliance(table.variables, task.system(premises))
    return FuzzyFit(model, tuple(steps), ~task.train)
