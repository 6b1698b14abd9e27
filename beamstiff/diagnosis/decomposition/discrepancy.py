"""Whether a cause is there, or whether a little of everything else explains the rows as well.

What no library holds is taken up by the causes that come nearest to it, each for a part. So each cause is
held against a model discrepancy (Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425) that is a mixture of
all forms of all other effects: ``y ~ N(X b, s^2 (1 + u^2 K))``, ``K`` the sum over the causes of ``p x x^T``,
p how likely a cause is beforehand, x the unit columns of its forms beside the open geometry. With and without
the cause, u is the one that explains the rows best. What is there is missed by the others; a stand-in is not.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from beamstiff.diagnosis.decomposition.fit import Choice, Step, bic, fit_step
from beamstiff.diagnosis.decomposition.forms import UNMODELLED
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

SIZES = (0.0, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 50.0)  # u: none to far above the noise
MOST_VALUES = 600  # that the mixture is weighed by: its cost grows with their third power
SHOWS = 1e-6  # of 1: what the open geometry leaves of a column, below which it is rounding


def presence_odds(
    choice: Choice, causes: Sequence[tuple[int, ...]], alike: Sequence[Collection[str]]
) -> list[float]:
    """Return the log odds of each cause against a mixture of everything else, as of `discrepancy_odds`.

    A cause that everything else explains as well is no reason to doubt another, whose part it could take: the
    unlikeliest is left out, and those that stay are weighed anew.
    """
    odds, left = [0.0] * len(causes), list(range(len(causes)))
    while left:
        step = fit_step(choice, [number for at in left for number in causes[at]])
        found = discrepancy_odds(choice, step, [causes[at] for at in left], [alike[at] for at in left])
        for at, value in zip(left, found, strict=True):
            odds[at] = value
        least = min(left, key=odds.__getitem__)
        if odds[least] >= 0.0:
            break
        left.remove(least)
    return odds


def discrepancy_odds(
    choice: Choice, step: Step, causes: Sequence[tuple[int, ...]], alike: Sequence[Collection[str]]
) -> list[float]:
    """Return the log odds of each cause of a fit against a mixture of everything else.

    Parameters
    ----------
    choice : Choice
    step : Step
        A fit with all causes.
    causes : sequence of tuple of int
        Their forms.
    alike : sequence of collection of str
        What each is not distinguished from, ``effect:component``: no part of the mixture either.
    """
    rows = np.arange(0, choice.count, -(-choice.count // MOST_VALUES))
    rows = np.concatenate([rows, np.arange(choice.count, len(choice.residual))])
    every, residual = choice.columns[rows], choice.residual[rows]
    count = max(len(rows) - choice.open_count, 1) * choice.independent / choice.count
    sizes = [part.stop - part.start for part in choice.at]
    of_form = np.repeat(np.arange(len(choice.forms)), sizes)
    unit, of_form = _unit_columns(every[:, choice.drives :], of_form, choice)
    keys = np.array([form.key for form in choice.forms])[of_form]
    kinds = [UNMODELLED if form.outside_library else form.effect for form in choice.forms]
    effects = np.array(kinds)[of_form]
    scale = len(rows) / max(float((unit**2).sum()), SHOWS)
    at = {
        number: np.arange(choice.at[number].start, choice.at[number].stop)[free]
        for number, free in zip(step.chosen, step.free, strict=True)
    }
    drives = np.arange(choice.drives)[step.drives]
    mixture = scale * unit @ unit.T
    result = []
    for cause, others in zip(causes, alike, strict=True):
        own = np.isin(effects, _same_kind(kinds[cause[0]])) | np.isin(keys, list(others))
        left_out = unit[:, own]
        rest = mixture - scale * left_out @ left_out.T
        without = [k for k in step.chosen if k not in cause]
        # the cause's own columns last: without them a fit is the first part of one triangle
        order = [*without, *cause]
        some = np.concatenate([drives, *(at[number] for number in order)])
        kept = len(some) - sum(len(at[number]) for number in cause)
        beside, whole = _least(rest, residual, every[:, some], choice.precision[some], kept, count)
        result.append(0.5 * (beside - whole))
    return result


def _same_kind(effect: str) -> list[str]:
    """Return the effects that are no part of the mixture: its own; beside a structure's all of structures.

    Links, bearings and drives carry one wrench and move the tool alike: that some of them are compliant is
    one question, which of them, and whether by a law that has a name, another.
    """
    if effect == UNMODELLED:
        return [effect]
    family = EFFECTS[effect].family
    alike = [name for name, other in EFFECTS.items() if other.family == family]
    return [*alike, UNMODELLED] if family == "structure" else [effect]


def _unit_columns(columns: Array, of_form: Integers, choice: Choice) -> tuple[Array, Integers]:
    """Return columns (m, c) that the open geometry leaves, and their forms; each cause as it is likely."""
    size = np.linalg.norm(columns, axis=0)
    shown = size > SHOWS
    own = of_form[shown]
    _, cause, count = np.unique(
        np.array([form.key for form in choice.forms])[own], return_inverse=True, return_counts=True
    )
    likely = np.array([form.likely for form in choice.forms])[own]
    return columns[:, shown] * (np.sqrt(likely / count[cause]) / size[shown]), own


def _least(
    mixture: Array, residual: Array, columns: Array, precision: Array, kept: int, count: float
) -> tuple[float, float]:
    """Return the least BIC over u of fits with the first columns of (m, c), and with all; mixture (m, m).

    Of the normal matrix ``G + D = L L^T`` a fit with the first columns has the first rows of L.
    """
    result = []
    for size in SIZES:
        root = cholesky(np.eye(len(residual)) + size**2 * mixture, lower=True)
        seen = solve_triangular(root, np.column_stack([residual, columns]), lower=True)
        left, fitted = seen[:, 0], seen[:, 1:]
        triangle = cholesky(fitted.T @ fitted + np.diag(precision), lower=True)
        pull = solve_triangular(triangle, fitted.T @ left, lower=True)
        known = solve_triangular(triangle, np.diag(np.sqrt(precision)), lower=True)
        values = []
        for some in (kept, len(precision)):
            squares = float(left @ left - pull[:some] @ pull[:some])
            determined = some - float((known[:some, :some] ** 2).sum())
            values.append(float(bic(squares, determined, count, 0.0)))
        result.append(np.array(values) + 2.0 * float(np.log(np.diag(root)).sum()))
    beside, whole = np.min(result, axis=0).tolist()
    return beside, whole
