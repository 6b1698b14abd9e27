"""The plain way, which the diagnosis is compared with: one regression a signature, the lowest BIC wins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamstiff.gap.baseline import fit_baseline
from beamstiff.gap.library import state_library
from beamstiff.gap.whitened import whiten
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot

NONE = "none:null"


def lowest_bic(robot: Robot, measurements: Measurements, without: Sequence[str] = ()) -> str:
    """Return ``effect:component`` of the first-order signature whose least-squares fit has the lowest BIC.

    The first shape of every effect at every component is fitted along with the model's own parameters, rows
    weighted by their claimed noise; no shape at all is ``none:null`` (Schwarz, Ann. Statist. 6 (1978) 461).
    """
    baseline = fit_baseline(robot, measurements)
    white = whiten(baseline)
    gap = white.leave(white.gap[:, None])[:, 0]
    n = gap.size
    best, found = n * np.log(float(gap @ gap) / n), NONE
    tried: set[str] = set()
    for one in state_library(baseline, white, without).hypotheses:
        if one.key in tried:
            continue
        tried.add(one.key)
        columns = white.leave(one.columns)
        theta = np.linalg.lstsq(columns, gap, rcond=None)[0]
        left = gap - columns @ theta
        bic = n * np.log(max(float(left @ left), 1e-300) / n) + columns.shape[1] * np.log(n)
        if bic < best:
            best, found = bic, one.key
    return found
