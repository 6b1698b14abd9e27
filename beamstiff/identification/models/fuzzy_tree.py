"""Fuzzy decision trees fitted to displacements: six joints and the wrench to six components (seed 003)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamstiff.identification.models.fuzzy_rules import Method, Readings, fit_conclusions
from beamstiff.identification.models.fuzzy_task import (
    BETTER,
    PATIENCE,
    FuzzyFit,
    Task,
    conclude,
    state_task,
    step_of,
)
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy_tree import Split, Tree
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

RAMPS = ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (0.25, 0.75))  # of splits, shares of a leaf's range
NARROWEST = 0.02  # share of an input's range
LEAST_WEIGHT = 3.0  # rows, by firing strength, on either side of a split
CLOSER_LOOK = 4  # splits for which all leaves are fitted anew: those that are best with the other leaves held


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

    Each step takes the split of a leaf by an input that fits the training set best (of those that look best
    with the other leaves held); the tree that is best on the test set is kept.

    Parameters
    ----------
    robot, table, inputs, symmetric, positive, method, test_share, most_rules, seed
        As of `fit_fuzzy`.

    Raises
    ------
    BeamstiffError
        As `fit_fuzzy`.
    """
    task = state_task(robot, table, inputs, symmetric, positive, method, test_share, seed)
    tree = best = Tree(task.names, (), task.trained)
    train, test = task.errors(tree)
    steps = [step_of(tree, train, test)]
    while tree.count < min(most_rules, task.most_rules):
        promising = _ranked(task, tree, _splits(task, tree))[:CLOSER_LOOK]
        if not promising:
            break
        tree = min((tree.grown(split) for split in promising), key=lambda one: task.errors(one)[0])
        train, test = task.errors(tree)
        if test < (1 - BETTER) ** 2 * steps[-1].test ** 2:
            best = tree
            steps.append(step_of(tree, train, test))
        elif tree.count > best.count + 2 * PATIENCE:
            break
    return conclude(task, best, steps, table)


def _splits(task: Task, tree: Tree) -> list[Split]:
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
                if b - a <= NARROWEST * float(np.ptp(task.trained[at])):
                    continue
                above = firing[:, leaf] * np.clip((x[:, at] - a) / (b - a), 0.0, 1.0)
                if LEAST_WEIGHT <= above.sum() <= firing[:, leaf].sum() - LEAST_WEIGHT:
                    found.append(Split(leaf, at, a, b))
    return found


def _ranked(task: Task, tree: Tree, splits: Sequence[Split]) -> list[Split]:
    """Return splits by what they leave of the training set with the other leaves held, the best first."""
    training, x = task.readings.rows(task.train), task.x[task.train]
    firing = tree.firing(x)
    conclusions = fit_conclusions(training, tree, firing)
    left = np.empty(len(splits))
    for leaf in range(tree.count):
        own = [at for at, split in enumerate(splits) if split.leaf == leaf]
        if own:
            others = np.delete(firing, leaf, axis=1) @ np.delete(conclusions, leaf, axis=0)
            sides = [_sides(splits[at], firing[:, leaf], x) for at in own]
            left[own] = pairs_leave(training, others, np.stack(sides))
    return [splits[at] for at in np.argsort(left, kind="stable")]


def _sides(split: Split, firing: Array, x: Array) -> Array:
    """Return how much of either side of a split holds, (2, N), from that of its leaf (N,)."""
    high = np.clip((x[:, split.input] - split.low) / (split.high - split.low), 0.0, 1.0)
    return np.stack([firing * (1.0 - high), firing * high])


def pairs_leave(readings: Readings, others: Array, sides: Array) -> Array:
    """Return the squares that pairs of rules leave, (C,), beside terms (N, K) that others make up.

    Parameters
    ----------
    readings : Readings
    others : (N, K) array
    sides : (C, 2, N) array
        Firing strengths of the pairs.
    """
    terms = readings.moment.shape[1]
    moved = (readings.gram @ others[..., None])[..., 0]
    base = float((others * (moved - 2 * readings.moment)).sum())
    right = (sides @ (readings.moment - moved)).reshape(len(sides), -1)
    products = (sides[:, :, None] * sides[:, None]).reshape(-1, sides.shape[2])
    blocks = (products @ readings.gram.reshape(len(readings.gram), -1)).reshape(-1, 2, 2, terms, terms)
    matrix = blocks.swapaxes(2, 3).reshape(-1, 2 * terms, 2 * terms)
    trace = np.trace(matrix, axis1=1, axis2=2) / (2 * terms)
    matrix = matrix + 1e-9 * trace[:, None, None] * np.eye(2 * terms)
    found = np.linalg.solve(matrix, right[..., None])[..., 0]
    result: Array = base - (found * right).sum(axis=1)
    return result
