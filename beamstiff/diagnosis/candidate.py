"""An explanation of a gap, how probable it is, and its sizes against realistic ones."""

from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.held_out.score import Fitted, HeldOutError
from beamstiff.diagnosis.prior import key_of

BEYOND_ALL = 10.0  # times the largest realistic size: no size, however uncertain


@dataclass(frozen=True)
class Estimate:
    """A parameter of an effect: value, standard deviation, unit; realistic sizes it is compared with.

    `positive` is whether it cannot be negative, as a compliant part moves with its load.
    """

    name: str
    value: float
    std: float
    unit: str
    realistic: tuple[float, float]
    positive: bool = False

    @property
    def plausible(self) -> bool:
        """Whether it is not larger than realistic, nor negative wrongly, by more than it is uncertain.

        That is two standard deviations; but what is known so badly that it came out ten times too large is no
        evidence of anything.
        """
        if self.positive and self.value < -2 * self.std:
            return False
        return abs(self.value) <= min(self.realistic[1] + 2 * self.std, BEYOND_ALL * self.realistic[1])


@dataclass(frozen=True)
class Candidate:
    """An explanation of the gap, with its probability.

    `effect`: name of the effect, ``none`` or ``unknown``.
    `shape`: the likeliest of its shapes; empty where it has none.
    """

    effect: str
    component: str | None
    probability: float
    shape: str = ""
    estimates: tuple[Estimate, ...] = ()
    shrink: HeldOutError | None = None

    @property
    def key(self) -> str:
        """``effect:component``."""
        return key_of(self.effect, self.component)


def estimates_of(fit: Fitted, which: int = 0) -> tuple[Estimate, ...]:
    """Return the parameters of one of the shapes of a fit, but those of the postures at hand alone."""
    start = sum(one.hypothesis.columns.shape[1] for one in fit.shapes[:which])
    shape = fit.shapes[which].hypothesis.shape
    factor = shape.realistic or shape.prior_factor
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))[fit.compliance.size :]
    return tuple(
        Estimate(
            name=item.name,
            value=float(fit.theta[start + k] * item.size),
            std=float(std[start + k] * item.size),
            unit=item.unit,
            realistic=(item.size / factor, item.size * factor),
            positive=item.positive,
        )
        for k, item in enumerate(shape.parameters)
        if not item.posture_specific
    )
