"""The fit with some causes, weighed by the Bayesian information criterion.

Residual r and forms X are projected off the open geometry once, and off the causes chosen, ``P``. The drives
are in every fit, as compliances that cannot be negative. All parameters are known beforehand to lie about
zero within ``D^-1/2`` (a few times their realistic sizes). A form takes ``b^T (G + D)^-1 b`` from the sum of
squares, with ``b = X^T P r`` and ``G = X^T P X``, and is weighed by ``BIC = n log(S / n) + k log n -
2 log prior`` (Schwarz, Ann. Statist. 6 (1978) 461), k the parameters that the data determine,
``tr G (G + D)^-1``. The noise variance is estimated from what is left: the scatter of the machine about any
smooth law, not what the tracker reads to.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from beamstiff.calibration.parameters import SOFTER
from beamstiff.diagnosis.decomposition.forms import Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.decomposition.passive import Matrix, matrix_of, passive
from beamstiff.diagnosis.decomposition.same_mechanics import other_mechanics, same_mechanics
from beamstiff.diagnosis.effects.effect import LARGEST
from beamstiff.measure.arrays import Integers
from beamstiff.non_negative import non_negative
from beamstiff.se3 import Array

UNSEEN = 1e6  # times the noise: what is known no better than so beforehand is not known, but for rounding
ROUNDING = 1e-12  # of the largest column of a form, at which one is 0
SURELY = 2.0  # standard deviations
DRIVES = -1  # number of the drives
KEPT = 2000  # fits that are remembered: of 200 parameters they take a gigabyte


@dataclass(frozen=True, eq=False)
class Choice:
    """Forms to choose from, projected off the open geometry.

    Attributes
    ----------
    forms : tuple of Form (f)
    open_basis : (n, t) array
        Of the open geometry, orthonormal.
    residual : (n,) array
        That rigid drives would leave.
    columns : (n, C) array
        Of the drives and all forms, one after another, of unit length before the projection.
    precision : (C,) array
        1 / variance of each parameter before the data, in units of the columns.
    units : (C,) array
        SI of each parameter's unit.
    at : tuple of slice (f)
        Where each form's columns stand.
    positive : (C,) bool array
        Parameters that cannot be negative.
    largest : (C,) array
        That parameters can be, SI.
    least : (C,) array
        Likewise.
    groups : tuple of (int array (g,), int array (g, c), array (g, c, c))
        Forms with c columns each, where these stand, and their products with one another.
    open_count : int
        Open parameters of the geometry.
    drives : int
        Open compliances, the first columns.
    count : int
        Measured values.
    independent : float
        As how many they count beside what is systematic.
    matrices : tuple of Matrix or None (f)
        Compliances whose parameters are coupled.
    alike : mapping of str to tuple of str
        Causes that are one mechanics.
    apart : (f,) bool array
        Forms of such causes that are another mechanics.
    kept : frozenset of int
        Errors of loads that no fit lacks: the columns of the others are under them.
    products : dict of int to array
        See `products_of`.
    fits : dict of tuple of int to Step
        See `fit_step`.
    larger : dict of tuple of int to (array, array)
        See `with_each`.
    """

    forms: tuple[Form, ...]
    open_basis: Array
    residual: Array
    columns: Array
    precision: Array
    units: Array
    at: tuple[slice, ...]
    positive: NDArray[np.bool_]
    largest: Array
    least: Array
    groups: tuple[tuple[Integers, Integers, Array], ...]
    open_count: int
    drives: int
    count: int
    independent: float
    matrices: tuple[Matrix | None, ...]
    alike: Mapping[str, tuple[str, ...]]
    apart: NDArray[np.bool_]
    kept: frozenset[int] = frozenset()
    products: dict[int, Array] = field(default_factory=dict, init=False)
    fits: dict[tuple[int, ...], Step] = field(default_factory=dict, init=False)
    larger: dict[tuple[int, ...], tuple[Array, NDArray[np.bool_]]] = field(default_factory=dict, init=False)

    @property
    def freedom(self) -> float:
        """Measured values less what of the open geometry they determine, and no prior, alone."""
        return self.count - float((self.open_basis[: self.count] ** 2).sum())

    @cached_property
    def pull(self) -> Array:
        """Products (C,) of the columns with the residual."""
        return np.asarray(self.residual @ self.columns)

    @cached_property
    def log_priors(self) -> tuple[Array, Array]:
        """Log prior (f,) of each form among those of its cause, and of its cause."""
        of_forms = np.array([(form.log_prior, form.cause_log_prior) for form in self.forms]).reshape(-1, 2)
        return of_forms[:, 0], of_forms[:, 1]

    @cached_property
    def of_cause(self) -> dict[str, Integers]:
        """Numbers of the forms of each cause."""
        keys = np.array([form.key for form in self.forms], dtype=object)
        return {key: np.flatnonzero(keys == key) for key in dict.fromkeys(keys.tolist())}

    def columns_like(self, other: Choice) -> Array:
        """Return the columns (n, C) as long as those of another choice of the same forms."""
        return self.columns * (other.units / self.units)

    def keeps(self, numbers: Iterable[int]) -> bool:
        """Return whether some forms are errors of loads that others are under."""
        return not self.kept.isdisjoint(numbers)

    def products_of(self, number: int) -> Array:
        """Return the products (c, C) of a form's columns, or the drives', with all columns; they are kept."""
        if number not in self.products:
            at = slice(0, self.drives) if number == DRIVES else self.at[number]
            self.products[number] = self.columns[:, at].T @ self.columns
        return self.products[number]


@dataclass(frozen=True, eq=False)
class Step:
    """A fit with some causes.

    Attributes
    ----------
    chosen : tuple of int
        Numbers of their forms.
    free : tuple of (c,) bool array
        Of each form, which parameters the fit uses; the others would be negative, which they cannot be.
    drives : (d,) bool array
        Likewise of the drives.
    choice : Choice
    at : (c,) int array
        Columns that are used.
    triangle : (c, c) array
        Of Cholesky, upper: of ``G + D``.
    unbounded : (array (a, a), array (a,))
        Triangle and parameters of the fit in which all are used.
    theta : (c,) array
        Parameters, per unit column.
    squares : float
        Sum of squares that is left, with that of the parameters over their sizes.
    determined : float
        Parameters of theirs that the data determine.
    bic : float
    """

    chosen: tuple[int, ...]
    free: tuple[NDArray[np.bool_], ...]
    drives: NDArray[np.bool_]
    choice: Choice
    at: Integers
    triangle: Array
    unbounded: tuple[Array, Array]
    theta: Array
    squares: float
    determined: float
    bic: float

    @property
    def scatter(self) -> float:
        """What is left over the stated noise."""
        return float(np.sqrt(self.squares / max(self.choice.freedom - self.determined, 1.0)))

    @property
    def columns(self) -> Array:
        """Columns (n, c) that are used."""
        return self.choice.columns[:, self.at]

    @property
    def basis(self) -> Array:
        """Columns (n, c), orthonormal together with what is known of their parameters beforehand."""
        return np.asarray(solve_triangular(self.triangle, self.columns.T, trans="T").T)

    @cached_property
    def moved(self) -> dict[int, Array]:
        """What each form moves, (n,), by its number."""
        return self.by_form(self.columns)

    def by_form(self, columns: Array) -> dict[int, Array]:
        """Return what columns (n, c) move by the fit's parameters, (n,), by the number of their form."""
        sizes = [int(self.drives.sum()), *(int(free.sum()) for free in self.free)]
        parts = np.split(columns, np.cumsum(sizes)[:-1], axis=1)[1:]
        thetas = np.split(self.theta, np.cumsum(sizes)[:-1])[1:]
        every = zip(self.chosen, parts, thetas, strict=True)
        return {number: np.asarray(own @ theta) for number, own, theta in every}

    def free_count(self, number: int) -> int:
        """Return how many parameters of a form the fit uses."""
        return int(self.free[self.chosen.index(number)].sum())

    @cached_property
    def left(self) -> Array:
        """What is left of the residual, (n,)."""
        return np.asarray(self.choice.residual - self.columns @ self.theta)


def build_choice(model: OpenModel, forms: Sequence[Form]) -> Choice:
    """Return the forms of an open model as one problem."""
    basis, drives = model.open_basis, model.present.size
    residual = model.residual + model.drives @ model.present
    residual = residual - basis @ (basis.T @ residual)
    sizes = [form.columns.shape[1] for form in forms]
    ends = np.cumsum([drives, *sizes])
    every = np.concatenate([model.drives, *(form.columns for form in forms)], axis=1)
    size = np.linalg.norm(every, axis=0)
    at = tuple(slice(a, b) for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
    largest = size.copy()
    for own in at:
        largest[own] = size[own].max(initial=0.0)
    unseen = size <= ROUNDING * largest  # nothing shows it but what it bounds
    size, every = np.where(unseen, 1.0, size), np.where(unseen, 0.0, every)
    every = every / size
    every = every - basis @ (basis.T @ every)
    known = np.concatenate([np.zeros(0), *(form.prior_std for form in forms)]) * size[drives:]
    spread = np.concatenate([SOFTER * model.realistic * size[:drives], known])
    parameters = [item for form in forms for item in form.shape.parameters]
    alike = same_mechanics(model.given)
    other = other_mechanics(alike)
    groups = []
    for count in sorted(set(sizes)):
        some = np.flatnonzero(np.array(sizes) == count)
        places = ends[some][:, None] + np.arange(count)
        columns = every.T[places]  # (g, c, n)
        groups.append((some, places, columns @ columns.swapaxes(1, 2)))
    units = np.concatenate([np.ones(drives), *(form.sizes for form in forms)]) / size
    return Choice(
        tuple(forms),
        basis,
        residual,
        every,
        1.0 / np.clip(spread, 1.0 / UNSEEN, UNSEEN) ** 2,
        units,
        at,
        np.concatenate([np.ones(drives, dtype=bool), *(form.positive for form in forms)]),
        np.array([np.inf] * drives + [LARGEST.get(item.unit, np.inf) for item in parameters]),
        np.array([-np.inf] * drives + [item.least for item in parameters]),
        tuple(groups),
        basis.shape[1],
        drives,
        model.count,
        model.independent,
        tuple(
            matrix_of(form.couplings, form.sizes, units[place]) if len(form.couplings) else None
            for form, place in zip(forms, at, strict=True)
        ),
        alike,
        np.array(
            [form.shape.turns is not None and form.shape.turns == other.get(form.key) for form in forms],
            dtype=bool,
        ),
    )


def fit_step(choice: Choice, chosen: Sequence[int]) -> Step:
    """Return the fit with some forms, in which no parameter is negative that cannot be; fits are kept."""
    key = tuple(chosen)
    if key not in choice.fits:
        if len(choice.fits) >= KEPT:
            del choice.fits[next(iter(choice.fits))]
        choice.fits[key] = _fitted(choice, key)
    return choice.fits[key]


def _fitted(choice: Choice, chosen: tuple[int, ...]) -> Step:
    at = np.concatenate(
        [np.arange(choice.drives), *(np.arange(choice.at[k].start, choice.at[k].stop) for k in chosen)]
    )
    ends = np.cumsum([choice.at[k].stop - choice.at[k].start for k in chosen], dtype=int)
    gram = np.concatenate([choice.products_of(k)[:, at] for k in (DRIVES, *chosen)])
    gram += np.diag(choice.precision[at])
    triangle, pull = _factor(gram, choice.pull[at])
    unbounded = (triangle, np.asarray(solve_triangular(triangle, pull, check_finite=False)))
    root = solve_triangular(triangle, np.eye(at.size), check_finite=False)
    # a sign that was left out is a choice too: it costs as much
    determined = float(at.size - choice.precision[at] @ (root**2).sum(axis=1))
    free, bound = _allowed(choice, chosen, at, ends, triangle, pull)
    variance = (root**2).sum(axis=1)[free]
    drives, each = free[: choice.drives], np.split(free[choice.drives :], ends)[:-1]
    if not free.all():
        at, gram = at[free], gram[np.ix_(free, free)]
        triangle, pull = _factor(gram, choice.pull[at])
    theta = np.asarray(solve_triangular(triangle, pull, check_finite=False))
    theta = theta if bound is None else bound[free]
    left = choice.residual - choice.columns[:, at] @ theta
    squares = float(left @ left + choice.precision[at] @ theta**2)
    prior = prior_of(choice, chosen)
    value = float(bic(squares, choice.open_count + determined, choice.independent, prior))
    if impossible(choice, at, theta, np.sqrt(variance * max(squares / max(choice.count, 1), 1.0))):
        value = np.inf
    return Step(
        chosen, tuple(each), drives, choice, at, triangle, unbounded, theta, squares, determined, value
    )


def impossible(choice: Choice, at: Integers, theta: Array, std: Array) -> NDArray[np.bool_]:
    """Return whether no machine is like that, (...), by parameters (..., c) of some columns."""
    value, up = theta * choice.units[at], SURELY * std * choice.units[at]
    wrong = (np.abs(value) > choice.largest[at]) | (value + up < choice.least[at])
    return np.asarray(wrong.any(axis=-1))


def prior_of(choice: Choice, chosen: Sequence[int]) -> float:
    """Return the log prior of some forms: of each among those of its cause, and of each cause once."""
    causes = {choice.forms[number].key: choice.forms[number].cause_log_prior for number in chosen}
    return sum(causes.values()) + sum(choice.forms[number].log_prior for number in chosen)


def _allowed(
    choice: Choice, chosen: tuple[int, ...], at: Integers, ends: Integers, triangle: Array, pull: Array
) -> tuple[NDArray[np.bool_], Array | None]:
    """Return which parameters (c,) a fit may use, 0 are those that would be negative, and their values.

    None, least squares of those that it may use; values are those of compliances that would give work away.
    """
    starts = choice.drives + np.concatenate([[0], ends]).astype(int)
    positive = choice.positive[at]
    of_forms = ((choice.matrices[k], start) for k, start in zip(chosen, starts.tolist(), strict=False))
    matrices = [one.moved(start) for one, start in of_forms if one is not None]
    found = np.asarray(solve_triangular(triangle, pull, check_finite=False))
    if (found[positive] < 0.0).any():
        found = _least_squares(triangle, pull, positive)
    if not any(one.gives_work_away(found) for one in matrices):
        return (found > 0.0) | ~positive, None
    found = passive(triangle, pull, positive, matrices)
    for one in matrices:
        positive[one.parameters] = True  # couplings of what is 0 are 0 as well
    return (found != 0.0) | ~positive, found


def _least_squares(matrix: Array, right: Array, positive: NDArray[np.bool_]) -> Array:
    """Return parameters (c,) of which some cannot be negative; the others are eliminated first."""
    basis, triangle = np.linalg.qr(matrix)
    found = np.asarray(np.linalg.solve(triangle, basis.T @ right))
    if (found[positive] < 0.0).any():
        basis, triangle = np.linalg.qr(matrix[:, ~positive])
        own = matrix[:, positive]
        found[positive] = non_negative(own - basis @ (basis.T @ own), right - basis @ (basis.T @ right))[0]
        found[~positive] = np.linalg.solve(triangle, basis.T @ (right - own @ found[positive]))
    return found


def _factor(gram: Array, pull: Array) -> tuple[Array, Array]:
    """Return the triangle R (c, c) of ``G + D`` and ``R^-T X^T r`` (c,)."""
    if not len(gram):
        return gram, pull
    triangle = np.asarray(np.linalg.cholesky(gram).T)
    return triangle, np.asarray(solve_triangular(triangle, pull, trans="T", check_finite=False))


def forms_in(choice: Choice, step: Step) -> dict[int, Form]:
    """Return the forms of a fit by number; columns of parameters that it does not use are 0 for good."""
    return {
        number: replace(form, columns=form.columns * free, used=free)
        for number, form, free in zip(
            step.chosen, (choice.forms[k] for k in step.chosen), step.free, strict=True
        )
    }


def bic(squares: Array | float, parameters: Array | float, values: float, log_prior: Array | float) -> Array:
    """Return the criterion of fits, ``n log(squares / n) + k log(n) - 2 log p`` (Schwarz 1978).

    `squares`: of residuals over the noise. `parameters` k. `values` n: as how many the readings count,
    `residual.repeats.independent`. `log_prior` log p.

    Examples
    --------
    >>> round(float(bic(100.0, 2, 100, 0.0)), 3)  # noise as stated: the cost of two parameters alone
    9.21
    """
    n = max(values, 1)
    result: Array = n * np.log(np.maximum(squares, 1e-12) / n) + parameters * np.log(n) - 2.0 * log_prior
    return result
