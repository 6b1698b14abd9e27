"""Tempering of evidence: log odds between effects are divided by ``1 + E / (60 min(1, nu / 300))``.

E are the log odds of the best effect against the unknown, model discrepancy; nu the values less the fitted
ones. A form of an effect is never exact, and its error grows with the evidence: docs/diagnosis_method.md says
how the constants were found.
"""

from collections.abc import Mapping

import numpy as np

from beamstiff.diagnosis.inference.evidence import logsumexp

TEMPERING = 60.0
ENOUGH = 300  # values less fitted ones, below which shapes are believed less


def divisor_of(evidence: float, freedom: int = ENOUGH) -> float:
    """Return what log odds are divided by, for log odds E of the best and values less fitted ones."""
    return 1.0 + max(evidence, 0.0) / (TEMPERING * min(1.0, max(freedom, 1) / ENOUGH))


def tempered(log_weight: Mapping[str, float], divisor: float) -> dict[str, float]:
    """Return probabilities of candidates among themselves, from log weights over a divisor."""
    keys = list(log_weight)
    values = np.array([log_weight[key] for key in keys])
    values = (values - values.max()) / divisor
    share = np.exp(values - logsumexp(values))
    return dict(zip(keys, share.tolist(), strict=True))
