"""A genetic search, as seed 003 identifies its IR-663: differential evolution, a population at a time.

Storn & Price, "Differential evolution", J. Global Optimization 11 (1997) 341, by scipy.
"""

from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from beamstiff.identification.minimise import LEAST, Effort, Search, searched
from beamstiff.se3 import Array

SIZE = 10  # candidates per free value
TOLERANCE = 1e-10  # spread of the population's costs over their mean at which it is done


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise within `minimise.searched`; `begin` is one of the first generation."""
    low, high = searched(search.objective.parameters, begin)
    size = min(effort.population or max(SIZE * begin.size, LEAST), max(effort.evaluations, LEAST))
    random = np.random.default_rng(effort.seed)
    first = qmc.scale(qmc.LatinHypercube(begin.size, rng=random).random(size), low, high)
    first[0] = np.clip(begin, low, high)

    def costs(columns: Array, /) -> Any:  # scipy's types know no population
        return search.costs(columns.T)

    found = differential_evolution(
        costs,
        Bounds(low, high),
        init=first,
        maxiter=max(effort.evaluations // size - 1, 0),
        tol=TOLERANCE,
        atol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=random,
    )
    return f"{'converged' if found.success else 'stopped'} after {found.nit} generations of {size}"
