"""Fuzzy decision trees: rules for many inputs without a rule for every combination of sets.

A split parts one leaf by one input into a low and a high side, whose degrees sum to one: below `low` the
first holds fully, above `high` the second, in between they change over in a straight line. So the firing
strengths of the leaves sum to one as those of a strong partition do, with one rule a leaf (seed 003, 3.3.3,
asks for such trees once six joints are the inputs).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import finite
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Split:
    """A leaf that becomes two: the low side keeps its number, the high side gets the next free one.

    Attributes
    ----------
    leaf : int
    input : int
    low, high : float
        Where the high side begins, and from where on it holds fully.
    """

    leaf: int
    input: int
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Tree:
    """A fuzzy decision tree; its leaves are the premises of rules.

    Attributes
    ----------
    inputs : tuple of str
        n names.
    splits : tuple of Split
        In the order in which the tree grew.
    trained : (n, 2) array
        Least and largest value of each input in training.

    Examples
    --------
    >>> tree = Tree(("q1", "q2"), (Split(0, 1, 0.0, 1.0),), np.array([[0.0, 1.0], [0.0, 1.0]]))
    >>> tree.firing([[0.0, 0.25], [0.0, 2.0]])
    array([[0.75, 0.25],
           [0.  , 1.  ]])
    """

    inputs: tuple[str, ...]
    splits: tuple[Split, ...]
    trained: Array

    def __post_init__(self) -> None:
        """Check the splits."""
        for number, split in enumerate(self.splits):
            if not (0 <= split.leaf <= number and 0 <= split.input < len(self.inputs)):
                raise BeamstiffError(
                    f"tree: split {number}: found leaf {split.leaf} and input {split.input}, expected leaves "
                    f"up to {number} and inputs up to {len(self.inputs) - 1}"
                )
            if not split.low < split.high:
                raise BeamstiffError(
                    f"tree: split {number}: found {split.low} to {split.high}, expected low < high"
                )

    @property
    def count(self) -> int:
        """Number of leaves R."""
        return len(self.splits) + 1

    def firing(self, x: ArrayLike) -> Array:
        """Return how much of each leaf holds, (N, R), at inputs (N, n)."""
        values = finite(x, "inputs of the fuzzy tree", -1, len(self.inputs))
        leaves = [np.ones(len(values))]
        for split in self.splits:
            high = np.clip((values[:, split.input] - split.low) / (split.high - split.low), 0.0, 1.0)
            leaves.append(leaves[split.leaf] * high)
            leaves[split.leaf] = leaves[split.leaf] * (1.0 - high)
        return np.stack(leaves, axis=1)

    def differences(self) -> Array:
        """Return rows (R - 1, R): each leaf against the one that it was split from."""
        rows = np.zeros((len(self.splits), self.count))
        for number, split in enumerate(self.splits):
            rows[number, [split.leaf, number + 1]] = -0.1, 0.1
        return rows

    def grown(self, split: Split) -> Tree:
        """Return the tree with one more split."""
        return Tree(self.inputs, (*self.splits, split), self.trained)

    def text(self, conclusions: Sequence[str]) -> str:
        """Return the tree as people read it, with a text for the conclusion of each leaf."""
        paths: list[list[str]] = [[]]
        for split in self.splits:
            name = self.inputs[split.input]
            where = f"{split.low:.4g} to {split.high:.4g}"
            paths.append([*paths[split.leaf], f"{name} above {where}"])
            paths[split.leaf] = [*paths[split.leaf], f"{name} below {where}"]
        return "\n".join(
            f"{' and '.join(path) or 'always'}: {conclusion}"
            for path, conclusion in zip(paths, conclusions, strict=True)
        )
