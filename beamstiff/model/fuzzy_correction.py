"""The gray box of seed 003, 3.3.3: a parametric model whose joint compliances fuzzy rules correct.

The rules say by which factor each spring of the model is softer or stiffer in a configuration. Between rules
the logarithm of the factor is a mean, so compliances stay positive.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.model.fuzzy_compliance import inputs_of
from beamstiff.model.fuzzy_inference import FuzzySystem
from beamstiff.model.varying import displaced, ports_at
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class FuzzyCorrection:
    """A robot whose springs follow fuzzy rules, as a `Model`."""

    robot: Robot
    parameters: tuple[str, ...]  # m springs that vary
    compliance: Array  # (m,): theirs without correction, m/N or rad/(N m)
    # of joint variables; conclusions (R, m): logarithms of the factors on the compliances
    system: FuzzySystem
    # answer outside what was trained too (flagged by `outside`); else such rows are refused
    extrapolate: bool = False

    def extrapolating(self) -> Self:
        """Return the model that answers outside what was trained too."""
        return replace(self, extrapolate=True)

    def compliances(self, q: ArrayLike) -> Array:
        """Return the compliances (N, m) of the springs in postures (N, A)."""
        return self.compliance * np.exp(self.system(self._inputs(q), self.extrapolate))

    def outside(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Return which postures (N, A) lie outside what was trained, (N,)."""
        return self.system.outside(self._inputs(q))

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return displacements (N, 6), base frame, m and rad."""
        compliances = self.compliances(q)
        return displaced(ports_at(self.robot, self.parameters, q, wrench), compliances)

    def _inputs(self, q: ArrayLike) -> Array:
        variables = [variable.name for variable in self.robot.actuated]
        return inputs_of(self.system.premises.inputs, variables, q)
