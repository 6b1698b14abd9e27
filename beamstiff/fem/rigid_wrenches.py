"""Directions in which the TCP is rigid: wrenches that displace nothing."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from beamstiff.fem.condensation import STIFFEST
from beamstiff.se3 import Array

ROUNDING = 1e-9  # of the largest component of a wrench: what is smaller comes from the compliance's rounding


def rigid_wrenches(compliance: Array) -> Array:
    """Return a basis (R, 6) of the wrenches that displace nothing, of one compliance (6, 6).

    Each is 1 in a component that the others do not have, so that a rigid axis stands alone.
    """
    if not np.isfinite(compliance).all():
        return np.zeros((0, 6))
    size = np.abs(np.diagonal(compliance)).reshape(2, 3).max(axis=1)
    unit = np.repeat(np.sqrt(np.where(size > 0.0, size, 1.0)), 3)  # forces and moments of like effect
    _, singular, rows = np.linalg.svd(compliance / np.outer(unit, unit))
    basis = rows[singular <= STIFFEST * max(singular[0], 1e-300)]
    if not len(basis):
        return np.zeros((0, 6))
    pivots = qr(basis, mode="r", pivoting=True)[1][: len(basis)]
    basis = np.linalg.solve(basis[:, pivots], basis)[np.argsort(pivots)]
    basis = np.where(np.abs(basis) > ROUNDING, basis, 0.0) / unit
    return np.asarray(basis / basis[np.arange(len(basis)), np.sort(pivots)][:, None])
