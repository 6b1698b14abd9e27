"""Encoders behind the gears beside absolute positions: what is left of them once their own curve is gone.

The dead weight, which is what mostly loads a robot that is calibrated, does not cancel here as it does
between the loads of a posture; and a robot is mostly read once at a posture. So the readings of a joint are
taken together, and what a zero of each table and a curve of once and twice a turn could be (an eccentric
scale, two reading heads, the gear) is projected out: r readings count as r - 5 contrasts, orthonormal.
"""

import numpy as np
from scipy import sparse
from scipy.linalg import qr

from beamstiff.identification.wind_up import placed, readings, turned
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

MOST = 400  # readings of a joint that count, evenly spread: contrasts join all of them
ORDERS = (1, 2)  # of the curve, once and twice a turn
TOLD = "contrasts beside a curve of once and twice a turn"
DEPENDENT = 1e-10  # of a column of the curve, below which it is one of the others


def beside_curve(table: Measurements, at: int, turns: bool) -> tuple[sparse.csr_array, Array]:
    """Return orthonormal contrasts (E, N) of a joint's readings, and those of the differences, (E,)."""
    rows = readings(table, at)
    rows = rows[np.unique(np.linspace(0, max(len(rows) - 1, 0), min(len(rows), MOST)).astype(np.intp))]
    runs = table.run[rows][:, None] == np.unique(table.run[rows])
    curve = [runs.astype(np.float64)]
    value = np.zeros(len(rows))
    for own in runs.T:
        value[own] = turned(table, at, rows[own], turns)
    if turns:
        angle = table.q[rows, at][:, None] * np.array(ORDERS)
        curve += [np.sin(angle), np.cos(angle)]
    basis, triangle, _ = qr(np.concatenate(curve, axis=1), pivoting=True)
    rank = int((np.abs(np.diagonal(triangle)) > DEPENDENT * np.sqrt(len(rows))).sum())
    contrast = basis[:, rank:].T
    return placed([(contrast, rows)], len(table)), contrast @ value
