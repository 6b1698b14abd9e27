"""What scale of the noise the evidence may choose, and which one is left after a fit."""

from collections.abc import Sequence

import numpy as np

from beamstiff.diagnosis.held_out.score import Weighted
from beamstiff.diagnosis.inference.evidence import NoisePrior
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.whitened import Whitened

SEEN = 0.25  # standard deviation of the log scale of the noise, where the rows have shown it
UNSEEN = 0.6
UNCLAIMED = 2.0  # where no table states it and few values show it
ENOUGH = 60  # values less fitted ones that show it
POINTS = 15


def noise_prior_of(baseline: Baseline) -> NoisePrior:
    """Return the prior of the noise scale against the sigma that the baseline counts with."""
    few = baseline.used.sum() - len(baseline.fitted) < ENOUGH
    width = SEEN if not few else UNSEEN if baseline.claimed else UNCLAIMED
    logs = np.linspace(-2.5 * width, 2.5 * width, POINTS)
    weight = -0.5 * (logs / width) ** 2
    return NoisePrior(np.exp(logs), weight - np.log(np.exp(weight).sum()))


def scale_after(white: Whitened, models: Sequence[Sequence[Weighted]], scales: NoisePrior) -> float:
    """Return the noise scale that is left when effects are fitted, within what the claim allows."""
    for shapes in models:
        if shapes:
            white = white.with_fitted(max(shapes, key=lambda one: one.weight).hypothesis.columns)
    left = white.project_out(white.gap[:, None])
    square = float((left**2).sum())
    log_s = np.log(scales.value)
    weight = scales.log_weight - white.freedom * log_s - 0.5 * square / scales.value**2
    share = np.exp(weight - weight.max())
    return float(np.exp((share * log_s).sum() / share.sum()))
