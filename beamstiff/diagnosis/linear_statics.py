"""Displacements that a program calculated by linear statics, on the undeformed machine.

The diagnosis counts with the equilibrium of the loaded machine, as real readings are. What that adds to
linear statics is added to such readings: else it would be a gap, and look like one cause or another.
"""

from dataclasses import replace

import numpy as np
from scipy import stats

from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, linear_fit, predict
from beamstiff.identification.information import CHANCE
from beamstiff.identification.whitening import whitening
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

BETTER = 10.0  # of chi^2, at as many values: very strong (Kass and Raftery, JASA 90 (1995) 773)


def as_loaded(robot: Robot, rows: Measurements) -> tuple[Measurements, str] | None:
    """Return displacements of linear statics as the loaded machine has them, and a note; None: they are not.

    They are, where linear statics leaves no more than the stated noise, and the equilibrium clearly more.
    """
    if rows.kind == "absolute" or robot.effects or not robot.identify:
        return None
    fit = fit_baseline(robot, rows)
    if not fit.claimed or not fit.fitted:
        return None
    fitted, moved = linear_fit(fit)
    linear, loaded = (_squares(fit, gap) for gap in (fit.measured - moved, fit.gap))
    free = int(fit.used.sum()) - len(fit.fitted)
    if loaded - linear < BETTER or stats.chi2.sf(linear, free) < CHANCE:
        return None
    added = np.where(fit.used, predict(fitted, rows) - moved, 0.0)
    most = 1e3 * float(np.linalg.norm(added[:, :3], axis=1).max())
    note = (
        "these displacements are those of linear statics, on the undeformed machine: what the equilibrium of "
        f"the loaded machine adds, up to {most:.2g} mm, was added to them"
    )
    return replace(rows, displacement=rows.displacement + added), note


def _squares(fit: Baseline, gap: Array) -> float:
    left = whitening(fit.sigma, fit.used, fit.sharing) @ gap[fit.used]
    return float(left @ left)
