"""A plain method to compare with: ordinary regression on each effect's signature, the best BIC wins."""

from collections.abc import Sequence

import numpy as np

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.residual.whitened import orthonormal
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

ABSORBED = 1e-6  # share of a column that the fit leaves, below which it leaves nothing
ROUNDING = 1e-6  # of the BIC: two effects that move the same differ by less; the first is named


def plain_bic(robot: Robot, measurements: Measurements, withheld: Sequence[str] = ()) -> str:
    """Return the effect and component whose first-order signature has the best BIC, or that none has.

    The gap that the fitted model leaves is regressed on the model's tangent and the columns of one shape of
    one effect at one component, in units of the noise as the table states it, all values independent of one
    another. ``BIC = n log(RSS/n) + k log n`` (Schwarz, Ann. Statist. 6 (1978) 461); k counts the columns
    added.

    `withheld`: effects to do without.
    """
    baseline = fit_baseline(robot, measurements)
    used = baseline.used
    weight = 1.0 / baseline.sigma[used]
    tangent = orthonormal(baseline.tangent[used] * weight[:, None])
    gap = _left(baseline.gap[used] * weight, tangent)
    n = gap.size
    best, name = n * np.log(float(gap @ gap) / n), "none:null"
    for effect in EFFECTS.values():
        if effect.outside or effect.name in withheld:
            continue
        for component in effect.components(baseline):
            for shape in effect.shapes(baseline, component):
                whole = shape.columns[used] * weight[:, None]
                left = _left(whole, tangent)
                shown = np.linalg.norm(left, axis=0) > ABSORBED * np.linalg.norm(whole, axis=0)
                columns = orthonormal(left[:, shown])
                rest = gap - columns @ (columns.T @ gap)
                k = columns.shape[1]
                bic = n * np.log(max(float(rest @ rest), 1e-300) / n) + k * np.log(n)
                if k and bic < best - ROUNDING:
                    best, name = bic, f"{effect.name}:{component or 'null'}"
    return name


def _left(values: Array, basis: Array) -> Array:
    left: Array = values - basis @ (basis.T @ values)
    return left
