"""A tool on a cantilever by Euler and Bernoulli: small deflections, on the straight beam."""

from __future__ import annotations

from beamstiff.se3 import Array


def normal_force(distance: Array, deflection: Array) -> Array:
    """Return the force across the undeformed beam over EI, 1/m^2: ``3 w / x^3``.

    Parameters
    ----------
    distance : (N,) array, m
        Of the tool from the clamp.
    deflection : (N,) array, m

    Examples
    --------
    >>> import numpy as np
    >>> normal_force(np.array([2.0]), np.array([0.1]))
    array([0.0375])
    """
    return 3.0 * deflection / distance**3
