"""What causes close on postures that had no say in their selection.

Held-out errors of causes that were selected on all postures flatter them: of some thousand forms those that
fit these postures by chance are among the best. So each third of the postures is predicted by the causes that
the others select (nested cross-validation: Varma and Simon, BMC Bioinformatics 7 (2006) 91).
"""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.apply import extended, predict_with_effects
from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset

PARTS = 3


def closes_unselected(baseline: Baseline, prior: Prior, seed: int) -> float:
    """Return the share of the gap of displacements that causes close where they were not selected.

    Where the others select causes that no machine can have, nothing is closed.
    """
    rows, used = baseline.rows, baseline.used[:, :3]
    _, posture = np.unique(rows.pose, return_inverse=True)
    left = np.where(used, baseline.gap[:, :3], 0.0)
    before = float((left**2).sum())
    for part in range(PARTS):
        out = posture % PARTS == part
        try:
            causes = decompose(baseline.nominal, subset(rows, ~out), prior=prior, seed=seed)
            predicted = predict_with_effects(extended(diagnosis_of(causes)), subset(rows, out))
        except BeamstiffError:
            continue
        left[out] = np.where(used[out], rows.displacement[out, :3] - predicted[:, :3], 0.0)
    return 1.0 - float((left**2).sum()) / before if before > 0.0 else 0.0
