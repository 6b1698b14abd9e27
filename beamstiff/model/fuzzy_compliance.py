"""Fuzzy compliance: ``d = C(q) w`` with a compliance matrix that fuzzy rules give (seed 003, eq. 38)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.measure.arrays import finite
from beamstiff.measure.table import WRENCH, Measurements
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class FuzzyCompliance:
    """A compliance matrix from fuzzy rules, as a `Model`: of the machine it knows the readings alone."""

    variables: tuple[str, ...]  # actuated joint variables, in the order of the columns of `predict`'s q
    # its inputs are some of the variables, and of the wrench (``fx`` to ``mz``) where the compliance depends
    # on the load; its conclusions (R, 6, 6) compliance matrices, NaN where nothing was trained
    system: FuzzySystem
    others: tuple[FuzzySystem, ...] = ()  # likewise, of terms that have a partition of their own
    # answer outside what was trained too (flagged by `outside`); else such rows are refused
    extrapolate: bool = False

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which terms of the compliance were trained, (6, 6)."""
        known = [np.isfinite(system.conclusions).all(axis=0) for system in self.systems]
        return np.asarray(np.any(known, axis=0))

    @property
    def systems(self) -> tuple[FuzzySystem, ...]:
        """All rules: each system says what terms it knows."""
        return (self.system, *self.others)

    def extrapolating(self) -> Self:
        """Return the model that answers outside what was trained too."""
        return replace(self, extrapolate=True)

    def compliance(self, q: ArrayLike, wrench: ArrayLike | None = None) -> Array:
        """Return the compliance matrices (N, 6, 6), base frame, NaN where nothing was trained."""
        result = np.full((len(np.atleast_2d(np.asarray(q))), 6, 6), np.nan)
        for system in self.systems:
            x = inputs_of(system.premises.inputs, self.variables, q, wrench)
            found = system(x, self.extrapolate)
            result = np.where(np.isnan(found), result, found)
        return result

    def outside(self, q: ArrayLike, wrench: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Return which rows lie outside what was trained, (N,)."""
        outside = [
            system.outside(inputs_of(system.premises.inputs, self.variables, q, wrench))
            for system in self.systems
        ]
        return np.asarray(np.any(outside, axis=0))

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return displacements (N, 6), base frame, m and rad; NaN for components that were never measured."""
        load = finite(wrench, "wrench", -1, 6)
        known = self.known
        idle = ~known.any(axis=0) & (load != 0)
        if idle.any():
            row, at = (int(i) for i in np.argwhere(idle)[0])
            raise BeamstiffError(
                f"row {row}: found a load {WRENCH[at]}, in which direction the fuzzy model was not trained; "
                f"trained: {listed(np.array(WRENCH)[known.any(axis=0)].tolist())}"
            )
        matrix = np.where(known, self.compliance(q, load), 0.0)
        result: Array = (matrix @ load[..., None])[..., 0]
        unknown = ((load[:, None, :] != 0) & ~known).any(axis=2) | ~known.any(axis=1)
        return np.where(unknown, np.nan, result)


def inputs_of(
    inputs: Sequence[str], variables: Sequence[str], q: ArrayLike, wrench: ArrayLike | None = None
) -> Array:
    """Return the inputs (N, n) of fuzzy rules, by name from joint values (N, A) and wrenches (N, 6)."""
    if not inputs:
        raise BeamstiffError("found no inputs for fuzzy rules, expected joint variables that they may follow")
    values = finite(q, "joint values", -1, len(variables))
    load = np.zeros((len(values), 6)) if wrench is None else finite(wrench, "wrench", len(values), 6)
    columns = dict(zip(variables, values.T, strict=True)) | dict(zip(WRENCH, load.T, strict=True))
    for name in inputs:
        if name not in columns:
            raise BeamstiffError(
                f"there is no input {name!r}{suggest(name, columns)}; known: {listed(columns, 20)}"
            )
    return np.stack([columns[name] for name in inputs], axis=1)


def rules_from_table(table: Measurements, inputs: Sequence[str]) -> FuzzyCompliance:
    """Return the rules that a table of conclusions states, as table 4 of seed 003 does.

    Parameters
    ----------
    table : Measurements
        One row a rule: the modal values of its inputs, a load along one axis, and the displacements there.
    inputs : sequence of str
        Joint variables that the rules look at.

    Returns
    -------
    FuzzyCompliance
        Exactly as in the table at the modal values.

    Examples
    --------
    >>> from beamstiff.measure.table import make_measurements
    >>> pull, seen = [[-900, 0, 0, 0, 0, 0]] * 2, [[-0.9e-3, np.nan, np.nan]] * 2
    >>> seen[1] = [-1.8e-3, np.nan, np.nan]
    >>> rules = make_measurements(["q2"], [[0.0], [1.0]], tcp="n7", wrench=pull, displacement=seen)
    >>> print(rules_from_table(rules, ["q2"]).compliance([[0.5]])[0, 0, 0].round(9))
    1.5e-06
    """
    loaded = np.flatnonzero((table.wrench != 0).any(axis=0))
    if loaded.size != 1:
        raise BeamstiffError(
            f"{table.source}: found loads along {listed(WRENCH[at] for at in loaded) or 'no axis'}, expected "
            "one axis in a table of fuzzy rules"
        )
    x = inputs_of(inputs, table.variables, table.q)
    premises = Partition(tuple(inputs), tuple(np.unique(column) for column in x.T))
    firing = premises.firing(x)
    if firing.shape[0] != firing.shape[1] or not (firing.max(axis=0) == 1.0).all():
        raise BeamstiffError(
            f"{table.source}: found {len(table)} rows for {premises.count} combinations of the modal values, "
            "expected each combination once"
        )
    load = table.wrench[:, loaded[0]]
    if (load == 0).any():
        raise BeamstiffError(f"{table.place(int(np.argmin(np.abs(load))))}: found a rule without load")
    conclusions = np.full((premises.count, 6, 6), np.nan)
    conclusions[firing.argmax(axis=1), :, loaded[0]] = table.displacement / load[:, None]
    return FuzzyCompliance(table.variables, FuzzySystem(premises, conclusions))
