"""Springs that the data do tell apart, but hardly: badly known one by one, well known as a sum.

Near a singular posture the columns of two springs are nearly parallel, no more (joints 4 and 6 of a wrist
that is nearly stretched): nothing is degenerate, and yet either value may be anything while the sum of both
compliances is known. The covariance tells: among compliances that are badly known and correlated, the
combination of least variance (the last principal component, each in its standard deviations).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from beamstiff.identification.relations import INVERSE_UNITS, Spring, Sum
from beamstiff.identification.result import Combination
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness import parameter_unit
from beamstiff.se3 import Array

BADLY = 0.2  # relative standard deviation from which on a value is badly known
TOGETHER = 0.95  # correlation from which on compliances are known together only
BETTER = 4.0  # times, at least, that a sum is better known than the best of its terms


def find_ill_determined(
    robot: Robot, names: Sequence[str], stiffness: Array, covariance: Array
) -> tuple[Combination, ...]:
    """Return sums of compliances that are well known though none of their terms is.

    `stiffness` (m,): values at the optimum. `covariance` (m, m): of their logarithms; infinite
    variance of what is not identifiable at all, which is left aside.
    """
    std = np.sqrt(np.diagonal(covariance))
    bad = np.flatnonzero(np.isfinite(std) & (std > BADLY))
    if bad.size < 2:
        return ()
    # of the compliances 1/k, in their standard deviations: that of log k with the other sign, twice
    correlation = covariance[np.ix_(bad, bad)] / np.outer(std[bad], std[bad])
    groups = connected_components(csr_array(np.abs(correlation) > TOGETHER), directed=False)[1]
    result = []
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        if members.size < 2:
            continue
        variance, direction = np.linalg.eigh(correlation[np.ix_(members, members)])
        at = bad[members]
        spread = std[at] / stiffness[at]  # of the compliances
        first = int(np.argmax(np.abs(direction[:, 0] / spread)))
        coefficients = direction[:, 0] / spread
        lead = coefficients[first]
        coefficients = coefficients / lead
        error = float(np.sqrt(max(variance[0], 0.0)) / abs(lead))
        total = Sum(tuple(Spring(names[k]) for k in at), tuple(_plain(c) for c in coefficients.tolist()))
        value = float(coefficients @ (1.0 / stiffness[at]))
        if error * BETTER < abs(value) * std[at].min() and value > 0:
            unit = INVERSE_UNITS[parameter_unit(robot, names[at[first]])]
            result.append(Combination(total.members, total.text(), value, error, "ill-determined", unit))
    return tuple(result)


def _plain(coefficient: float) -> float:
    """Return a coefficient to the three digits that it is worth."""
    return float(f"{coefficient:.3g}")
