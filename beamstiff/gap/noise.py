"""How large the noise is: what the table claims, what its repeats show, what scale the evidence may choose."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.evidence import Scales

STATED = 0.25  # standard deviation of the log scale of a claimed sigma
UNSTATED = 1.2
POINTS = 13


def scales_of(baseline: Baseline) -> Scales:
    """Return the prior of the noise scale against the sigma that the baseline counts with."""
    width = STATED if baseline.claimed else UNSTATED
    logs = np.linspace(-2.5 * width, 2.5 * width, POINTS)
    weight = -0.5 * (logs / width) ** 2
    return Scales(np.exp(logs), weight - np.log(np.exp(weight).sum()))
