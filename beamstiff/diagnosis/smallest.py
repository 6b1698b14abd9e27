"""How large an effect would have had to be for these rows to show it.

A cause counts where the criterion falls so far that it is there with a probability of `PRESENT`
(`decomposition.look_alikes`): by F = 2 TEMPERING logit PRESENT. With n values of sum of squares S that is
where it takes

    D = S (exp((F + k log n - 2 log prior) / n) - 1)

from it, k its parameters (`decomposition.fit`). Noise adds to the root of D, or takes from it, one standard
deviation. Where the table states its noise, all rows together have to leave more than chance does, first: S
is then noncentral chi-square, and D its noncentrality. That asks for nine of ten campaigns; of 24 simulated
ones (backlash, base, slip of a reflector; nonlinear machines) 19 showed an effect of just this size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.optimize import brentq
from scipy.special import logit

from beamstiff.diagnosis.decomposition.causes import PRESENT
from beamstiff.diagnosis.decomposition.decompose import CHANCE
from beamstiff.diagnosis.decomposition.fit import build_choice, fit_step, prior_of
from beamstiff.diagnosis.decomposition.forms import forms_of
from beamstiff.diagnosis.decomposition.open_model import open_stiffness
from beamstiff.diagnosis.effects import Quantity
from beamstiff.diagnosis.prior import TEMPERING

if TYPE_CHECKING:
    from beamstiff.diagnosis.result import Diagnosis

FALL = 2.0 * TEMPERING * float(logit(PRESENT))  # of the criterion
SEEN = 0.9  # share of campaigns
SURE = float(stats.norm.ppf(SEEN))  # standard deviations


@dataclass(frozen=True)
class Smallest:
    """The smallest size at which a cause would have shown in most such campaigns.

    `key`: ``effect:component``.
    `parameter`: that is hardest to see in the simplest form of the cause.
    `size`: in its unit.
    `realistic`: the largest realistic size.
    """

    key: str
    parameter: Quantity
    size: float
    realistic: float

    @property
    def hidden(self) -> bool:
        """Whether no realistic size would have shown."""
        return self.size > self.realistic


def smallest_sizes(result: Diagnosis) -> list[Smallest]:
    """Return the smallest sizes that the rows of a diagnosis would have shown, those seen best first."""
    found = {one.key: one for one in sorted(_of_forms(result), key=_rank, reverse=True)}
    return sorted(found.values(), key=_rank)


def beyond_chance(limit: float, freedom: float) -> float:
    """Return what an effect has to add to a chi-square for nine of ten to be beyond a limit.

    >>> round(beyond_chance(135.8, 100.0), 1)
    62.4
    """
    return float(brentq(lambda added: stats.ncx2.sf(limit, freedom, added) - SEEN, 1e-6, 10.0 * limit))


def _rank(one: Smallest) -> float:
    return one.size / one.realistic


def _of_forms(result: Diagnosis) -> Iterator[Smallest]:
    """Yield that of each of the simplest forms of every cause."""
    found = result.decomposition
    model = open_stiffness(result.baseline) if found is None else found.model
    choice = build_choice(model, forms_of(model))
    step, n = fit_step(choice, ()), max(choice.count, 1)
    basis, noise = step.basis, float(np.sqrt(step.squares / n))
    freedom = choice.freedom - step.determined
    limit = stats.chi2.isf(CHANCE, freedom)
    first = np.sqrt(beyond_chance(limit, freedom)) if model.baseline.claimed else 0.0
    few: dict[str, int] = {}
    for form in choice.forms:
        few[form.key] = min(few.get(form.key, form.sizes.size), form.sizes.size)
    for number, (form, at) in enumerate(zip(choice.forms, choice.at, strict=True)):
        if form.sizes.size > few[form.key]:
            continue
        columns = choice.columns[:, at]
        seen = np.linalg.norm(columns - basis @ (basis.T @ columns), axis=0)
        asked = FALL + form.sizes.size * np.log(n) - 2.0 * prior_of(choice, (number,))
        least = max(first, np.sqrt(step.squares * np.expm1(asked / n)) + SURE * noise)
        with np.errstate(divide="ignore"):
            size = least / seen * choice.units[at]
        _, realistic = form.realistic
        worst = int(np.argmax(size / realistic))
        yield Smallest(form.key, form.shape.parameters[worst], float(size[worst]), float(realistic[worst]))
