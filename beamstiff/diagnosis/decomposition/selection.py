"""Forward selection of causes with removal and exchange, by the Bayesian information criterion.

The residual r and every form X are projected off the open parameters and the causes chosen before, ``P``; a
form's gain is what it takes from the sum of squares,

    ``S(X) = S - |Q^T P r|^2``,  Q an orthonormal basis of P X,

and is weighed by ``BIC = n log(S / n) + k log n - 2 log prior`` (Schwarz, Ann. Statist. 6 (1978) 461), with
the noise variance estimated from what is left: the scatter of the machine about any smooth law, not what the
tracker reads to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.forms import SLIP, Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel, orthonormal
from beamstiff.se3 import Array

ENOUGH = 10.0  # fall of the BIC from which a cause counts: "very strong" (Kass and Raftery, JASA 90 (1995) 773)
MOST = 12  # causes
SHOWS = 1e-3  # singular value of a form's unit columns, beside what is open, below which they do not show


@dataclass(frozen=True, eq=False)
class Step:
    """A fit: what is open and the causes chosen.

    Attributes
    ----------
    chosen : tuple of Form
    basis : (n, k) array
        Orthonormal, of what is open and chosen.
    left : (n,) array
        What they leave of the residual.
    bic : float
    """

    chosen: tuple[Form, ...]
    basis: Array
    left: Array
    bic: float

    @property
    def squares(self) -> float:
        """Sum of squares that is left."""
        return float(self.left @ self.left)


def fit_step(model: OpenModel, chosen: Sequence[Form], values: int) -> Step:
    """Return the fit with some causes; `values` is how many values count as independent."""
    basis = orthonormal(model.tangent)
    for form in chosen:
        basis = np.concatenate([basis, orthonormal(form.columns, basis, SHOWS)], axis=1)
    left = model.residual - basis @ (basis.T @ model.residual)
    prior = sum(form.log_prior for form in chosen)
    return Step(tuple(chosen), basis, left, bic(float(left @ left), basis.shape[1], values, prior))


def bic(squares: float, parameters: int, values: int, log_prior: float) -> float:
    """Return the criterion of a fit.

    Examples
    --------
    >>> round(bic(100.0, 2, 100, 0.0), 3)  # noise as stated: the cost of two parameters alone
    9.21
    """
    n = max(values, 1)
    return float(n * np.log(max(squares, 1e-12) / n) + parameters * np.log(n) - 2.0 * log_prior)


def gains(step: Step, forms: Sequence[Form], values: int, log_priors: Sequence[float]) -> Array:
    """Return the BIC (f,) with each form added to a fit, inf where the form does not show."""
    result = np.full(len(forms), np.inf)
    base = sum(form.log_prior for form in step.chosen)
    for at, (form, prior) in enumerate(zip(forms, log_priors, strict=True)):
        own = orthonormal(form.columns, step.basis, SHOWS)
        if not own.shape[1] or not _signs_hold(form, step):
            continue
        squares = step.squares - float(((own.T @ step.left) ** 2).sum())
        result[at] = bic(squares, step.basis.shape[1] + own.shape[1], values, base + prior)
    return result


def _signs_hold(form: Form, step: Step) -> bool:
    """Return whether no parameter that must be positive comes out as negative beyond its own scatter."""
    if not form.positive.any():
        return True
    seen = form.columns - step.basis @ (step.basis.T @ form.columns)
    theta, *_ = np.linalg.lstsq(seen, step.left, rcond=SHOWS)
    return bool((theta[form.positive] >= -1e-9 * np.abs(theta).max(initial=0.0)).all())


def select(model: OpenModel, forms: Sequence[Form], values: int) -> Step:
    """Return the fit with the causes that the criterion asks for.

    After every cause that comes in, one that is not needed any more goes out, and one that another explains
    better is exchanged.
    """
    step = fit_step(model, (), values)
    priors = [form.log_prior for form in forms]
    while len(step.chosen) < MOST:
        open_forms = [at for at, form in enumerate(forms) if _may_join(form, step.chosen)]
        after = gains(step, [forms[at] for at in open_forms], values, [priors[at] for at in open_forms])
        if not after.size or after.min() > step.bic - ENOUGH:
            break
        step = fit_step(model, (*step.chosen, forms[open_forms[int(after.argmin())]]), values)
        step = _revised(model, forms, priors, step, values)
    return step


def _may_join(form: Form, chosen: Sequence[Form]) -> bool:
    """Return whether a form may stand beside others: one form a cause, but a target may slip again."""
    if form.effect == SLIP:
        return all(form.shape.name != one.shape.name or form.key != one.key for one in chosen)
    return all(form.key != one.key for one in chosen)


def _revised(
    model: OpenModel, forms: Sequence[Form], priors: Sequence[float], step: Step, values: int
) -> Step:
    """Return a fit whose causes are all needed, each in the form, and at the place, that explains most."""
    for _ in range(len(step.chosen)):
        best = step
        for at in range(len(step.chosen)):
            others = (*step.chosen[:at], *step.chosen[at + 1 :])
            without = fit_step(model, others, values)
            if without.bic < best.bic + ENOUGH and without.bic < step.bic + ENOUGH:
                best = without if without.bic < best.bic or best is step else best
                continue
            may = [k for k, form in enumerate(forms) if _may_join(form, others)]
            after = gains(without, [forms[k] for k in may], values, [priors[k] for k in may])
            if after.size and after.min() < min(best.bic, step.bic) - 1e-6:
                best = fit_step(model, (*others, forms[may[int(after.argmin())]]), values)
        if best is step:
            return step
        step = best
    return step
