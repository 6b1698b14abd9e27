"""What causes explain of postures that were held out, each fold of the postures by the fit without it.

Of a least squares fit with an orthonormal basis Q and residuals e the residuals of the rows F, predicted by
the fit without them, are ``(1 - Q_F Q_F^T)^-1 e_F`` (Cook and Weisberg, Residuals and Influence, 1982,
eq. 2.2.7, for several rows): one fit tells all folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.decomposition.fit import Choice, Step, build_choice, fit_step
from beamstiff.diagnosis.decomposition.open_model import OpenModel, orthonormal
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

FOLDS = 10
ALONE = 1e-2  # variance of a reading over that of its prediction, below which other folds do not tell it
ROUNDING = 1e-9  # of 1: what only the fold itself determines
# by which its joints differ from an earlier posture's, of what those of two at random do (RMS): nearer, in
# one motion, a posture says what that one said
FRESH = 0.25


@dataclass(frozen=True, eq=False)
class Folds:
    """The values of an open model, divided by postures into folds.

    Attributes
    ----------
    model : OpenModel
    choice : Choice
    fold : (n,) int array
    posture : (n,) int array
        Number of the posture of each value, from 0.
    position : (n,) bool array
        Which values are positions.
    carrying : OpenModel or None
        The same with drives that carry errors of loads, where there are any.
    stated : Folds or None
        The same under loads as stated, where the forms are under these with their errors: for fits without.
    known : dict of tuple of int to array
        See `squared_errors`: errors are kept by the forms of the fit.
    """

    model: OpenModel
    choice: Choice
    fold: Integers
    posture: Integers
    position: NDArray[np.bool_]
    carrying: OpenModel | None = None
    stated: Folds | None = None
    known: dict[tuple[int, ...], Array] = field(default_factory=dict, init=False)

    def squared_errors(self, step: Step) -> Array:
        """Return the sum of squared position errors of each posture, (P,), m^2, in fits without its fold."""
        if step.chosen not in self.known:
            left, basis = np.zeros(self.model.count), step.basis
            for out, root in self.parts:
                left[out] = root @ _predicted(root.T @ basis[out], root.T @ step.left[out])
            self.known[step.chosen] = self._by_posture(left)
        return self.known[step.chosen]

    def errors_with(self, numbers: Sequence[int]) -> Array:
        """Return these errors with some forms, without errors of loads under loads as stated."""
        folds = self if self.stated is None or self.choice.kept <= {*numbers} else self.stated
        return folds.squared_errors(fit_step(folds.choice, numbers))

    def errors_along(self, order: Sequence[tuple[int, ...]]) -> list[Array]:
        """Return these errors with no cause, with the first, the first two, and so on: their forms.

        Each is as large as all together say that it is, in the fit without the fold: fitted with those before
        it alone, it would take the share of others that it resembles, or cancel them less than it does. What
        is open, and the drives, take up what they can of those that are missing. With an error of a load goes
        what it deforms of causes that come after it.
        """
        step = fit_step(self.choice, [number for cause in order for number in cause])
        drives = int(step.drives.sum())
        columns, inside = step.columns, step.basis
        basis = orthonormal(columns[:, :drives])
        ends = drives + np.cumsum([sum(step.free_count(k) for k in cause) for cause in order], dtype=int)
        deformed = self.deformed(step)
        loads = [at for at, cause in enumerate(order) if self.choice.keeps(cause)]
        told = max(loads, default=len(order))
        left = np.zeros((len(ends), self.model.count))
        for out, root in self.parts:
            error = root @ _predicted(root.T @ inside[out], root.T @ step.left[out])
            theta = step.theta - np.linalg.solve(step.triangle, inside[out].T @ error)
            for at, (values, end) in enumerate(zip(left, ends.tolist(), strict=True)):
                own = self.choice.residual - columns[:, drives:end] @ theta[drives:end]
                own = own - deformed[:, end:] @ theta[end:] if at >= told else own
                own = own[out] - basis[out] @ (basis.T @ own)
                values[out] = root @ _predicted(root.T @ basis[out], root.T @ own)
        nothing = self.squared_errors(fit_step(self.choice, ()))  # drives are another matter there
        return [nothing, *map(self._by_posture, left)]

    def of_forms(self, numbers: Sequence[int]) -> Folds:
        """Return the same with some of the forms alone, in this order."""
        choice = build_choice(self.model, [self.choice.forms[number] for number in numbers])
        kept = frozenset(at for at, number in enumerate(numbers) if number in self.choice.kept)
        stated = None if self.stated is None else self.stated.of_forms(numbers)
        return replace(self, choice=replace(choice, kept=kept), stated=stated)

    def deformed(self, step: Step) -> Array:
        """Return what of the columns (n, c) of a fit errors of loads deform, and not the loads."""
        if self.stated is None:
            return np.zeros_like(step.columns)
        return step.columns - self.stated.choice.columns_like(self.choice)[:, step.at]

    def _by_posture(self, left: Array) -> Array:
        error = unweighed(self.model, left)
        return np.bincount(self.posture[self.position], weights=error[self.position] ** 2).astype(np.float64)

    @cached_property
    def parts(self) -> list[tuple[Integers, Array]]:
        """Return the values of each fold, and a root of ``(1 - Q_F Q_F^T)^-1``, Q of the open parameters.

        What other folds do not determine of the values is not in the root, and so not held out: a reflector
        that was read in one fold alone has to be found there.
        """
        result = []
        for one in range(int(self.fold.max()) + 1):
            out = np.flatnonzero(self.fold == one)
            own = self.choice.open_basis[out]
            values, vectors = np.linalg.eigh(np.eye(len(out)) - own @ own.T)
            told = values > ALONE
            result.append((out, vectors[:, told] / np.sqrt(values[told])))
        return result

    @property
    def rows(self) -> int:
        """Number of rows with a measured position."""
        return int(self.model.used[:, :3].any(axis=1).sum())


def _predicted(basis: Array, left: Array) -> Array:
    """Return ``(1 - Q Q^T)^-1 e``; the smaller of ``1 - Q Q^T`` and ``1 - Q^T Q`` is inverted (Woodbury)."""
    few = len(basis) <= basis.shape[1]
    inner = basis @ basis.T if few else basis.T @ basis
    values, vectors = np.linalg.eigh(np.eye(len(inner)) - inner)
    seen = vectors.T @ (left if few else basis.T @ left)
    inverse: Array = vectors @ (seen / np.maximum(values, ROUNDING))
    return inverse if few else left + basis @ inverse


def unweighed(model: OpenModel, values: Array) -> Array:
    """Return values (n,) in units of the noise as m and rad."""
    if (model.baseline.sharing < 0).all():
        return values * model.baseline.sigma[model.used]
    return model.weigh.solve(values)


def folds_of(model: OpenModel, choice: Choice, seed: int) -> Folds:
    """Return folds of whole postures, drawn at random; those of one short motion stay together."""
    _, posture = np.unique(model.pose, return_inverse=True)
    motion = _motions(model)
    count = int(motion.max()) + 1
    fold = np.random.default_rng(seed).permutation(count) % min(FOLDS, count)
    position = np.nonzero(model.used)[1] < 3
    return Folds(model, choice, fold[motion[posture]], posture, position)


def _motions(model: OpenModel) -> Integers:
    """Return the number of the short motion, from 0, that each posture (P,) was read in, by the rows' order.

    A table of one long motion has a posture beside every other: held out alone, each would be told by its
    neighbours, with all that changes slowly.
    """
    rows = model.baseline.rows
    first = np.array([np.flatnonzero(rows.pose == one)[0] for one in np.unique(model.pose)])
    joints = rows.q[first]
    spread = joints.std(axis=0)
    moves = spread > 0
    joints = joints[:, moves] / (spread[moves] * np.sqrt(2.0 * max(int(moves.sum()), 1)))
    motion, number = np.zeros(len(first), dtype=np.intp), 0
    start, *others = np.argsort(first).tolist()
    motion[start] = number
    for at in others:
        if np.linalg.norm(joints[at] - joints[start]) > FRESH:
            start, number = at, number + 1
        motion[at] = number
    return motion


def ordered(folds: Folds, causes: Sequence[tuple[int, ...]]) -> tuple[list[tuple[int, ...]], list[Array]]:
    """Return causes in the order in which taking one away leaves least, and the errors (P,) along them.

    The order of the fit first; then one that closes more on held-out postures goes before its neighbour.
    """
    order = _largest_first(folds, causes)
    errors = folds.errors_along(order)
    at = 0
    while at < len(order) - 1:
        left = [float(each.sum()) for each in errors[at : at + 3]]
        if left[1] - left[2] > left[0] - left[1]:
            other = [*order[:at], order[at + 1], order[at], *order[at + 2 :]]
            along = folds.errors_along(other)
            if along[at + 1].sum() < errors[at + 1].sum():
                order, errors, at = other, along, max(at - 1, 0)
                continue
        at += 1
    return order, errors


def closed(errors: Sequence[Array], noise: float) -> list[float]:
    """Return the share of the explainable gap that each cause closes after those before it."""
    sums = [float(each.sum()) for each in errors]
    explainable = sums[0] - noise
    return [(a - b) / explainable if explainable > 0.0 else 0.0 for a, b in pairwise(sums)]


def _largest_first(folds: Folds, causes: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return causes in the order in which taking one away leaves least.

    With the error of a load goes what it deforms of those that are still there.
    """
    choice = folds.choice
    step = fit_step(choice, [number for cause in causes for number in cause])
    drives = orthonormal(step.columns[:, : int(step.drives.sum())])
    deformed = step.by_form(folds.deformed(step))
    loads = [cause for cause in causes if choice.keeps(cause)]

    def beside_drives(moved: dict[int, Array], cause: tuple[int, ...]) -> Array:
        part = np.sum([moved[number] for number in cause], axis=0)
        return np.asarray(part - drives @ (drives.T @ part))

    parts = {cause: beside_drives(step.moved, cause) for cause in causes}
    under = {cause: beside_drives(deformed, cause) / max(len(loads), 1) for cause in causes}
    left = choice.residual - drives @ (drives.T @ choice.residual)
    order: list[tuple[int, ...]] = []
    while len(order) < len(causes):
        there = [cause for cause in causes if cause not in order]
        also = np.sum([under[cause] for cause in there], axis=0)
        rest = {cause: left - parts[cause] - (also if cause in loads else 0.0) for cause in there}
        order.append(min(rest, key=lambda cause: float(rest[cause] @ rest[cause])))
        left = rest[order[-1]]
        if order[-1] in loads:
            parts = {cause: part - under[cause] for cause, part in parts.items()}
    return order


def interval(before: Array, after: Array, first: Array, noise: float, seed: int) -> tuple[float, float]:
    """Return the 90 % interval, over the postures, of the share ``(before - after) / (first - noise)``.

    Bootstrap over postures (Efron and Tibshirani 1993, ch. 13): errors (P,) of each are drawn together, and
    `first`, those without any cause, with them; of draws without a gap nothing is closed.
    """
    drawn = np.random.default_rng(seed).integers(len(before), size=(400, len(before)))
    closed, gap = (before[drawn] - after[drawn]).sum(axis=1), first[drawn].sum(axis=1) - noise
    share = np.divide(closed, gap, out=np.zeros(len(drawn)), where=gap > 0.0)
    low, high = np.quantile(share, [0.05, 0.95])
    return float(low), float(high)
