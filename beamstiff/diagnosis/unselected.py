"""What causes close on postures that had no say in their selection.

Held-out errors of causes that were selected on all postures flatter them: of some thousand forms those that
fit these postures by chance are among the best. So each third of the postures is predicted by the causes that
the others select (nested cross-validation: Varma and Simon, BMC Bioinformatics 7 (2006) 91), and by the
model without a cause, fitted to the same others: of few postures the stiffness alone may go far astray.
"""

import numpy as np

from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, predict
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

PARTS = 3


def closes_unselected(baseline: Baseline, prior: Prior, seed: int) -> float:
    """Return the share of the gap of displacements that causes close where they were not selected.

    Of a typical posture: one minus the geometric mean, over the postures, of the squared error with causes
    over that without, neither less than the stated noise. A part of the postures whose others mislead would
    outweigh all others in a sum of squares. Where the others select causes that no machine can have, nothing
    is closed.
    """
    rows, used = baseline.rows, baseline.used[:, :3]
    _, posture = np.unique(rows.pose, return_inverse=True)
    noise = np.bincount(posture, np.where(used, baseline.sigma[:, :3] ** 2, 0.0).sum(axis=1))
    ratio = np.zeros(len(noise))

    def left(robot: Robot, part: int) -> Array:
        out = posture % PARTS == part
        predicted = predict(robot, subset(rows, out))
        error = np.where(used[out], rows.displacement[out, :3] - predicted[:, :3], 0.0)
        squares = np.bincount(posture[out], (error**2).sum(axis=1), len(noise))
        return np.asarray(np.maximum(squares, noise)[part::PARTS])

    for part in range(PARTS):
        others = subset(rows, posture % PARTS != part)
        try:
            alone = fit_baseline(baseline.nominal, others)
            causes = decompose(baseline.nominal, others, prior=prior, seed=seed, baseline=alone)
            before, after = left(alone.robot, part), left(extended(diagnosis_of(causes)), part)
        except BeamstiffError:
            continue
        told = before > 0.0
        ratio[part::PARTS][told] = np.log(after[told] / before[told])
    return 1.0 - float(np.exp(ratio.mean()))
