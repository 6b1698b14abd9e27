"""Where local methods search: compliances in units of their standard deviations.

A displacement is linear in the compliances where forces are given by statics, and nearly so elsewhere: there
the cost is close to a parabola as steep in one value as in another, also where a spring is as good as rigid
and its logarithm says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.identification.objective import Objective
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Compliances:
    """Coordinates ``x = exp(-theta) / unit`` of the free values theta (t,).

    Attributes
    ----------
    unit : (t,) array
        Compliance that counts as one.
    lower, upper : (t,) arrays
        Bounds of theta.
    """

    unit: Array
    lower: Array
    upper: Array

    def at(self, theta: Array) -> Array:
        """Return x (t,) at theta (t,)."""
        result: Array = np.exp(-theta) / self.unit
        return result

    def theta(self, x: Array) -> Array:
        """Return theta (t,) at x (t,), within the bounds."""
        result: Array = np.clip(-np.log(x * self.unit), self.lower, self.upper)
        return result

    def slopes(self, x: Array, by_theta: Array) -> Array:
        """Return derivatives by x (t,) from those by theta."""
        result: Array = -by_theta / x
        return result

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of x, two (t,) arrays."""
        return self.at(self.upper), self.at(self.lower)


def compliances(objective: Objective, theta: Array) -> Compliances:
    """Return coordinates in which one is a standard deviation of each compliance by itself, at theta (t,)."""
    parameters = objective.parameters
    _, by_theta = objective.jacobian(theta)
    told = np.linalg.norm(by_theta, axis=0)
    unit = np.exp(-theta) / np.where(told > 0, told, 1.0)
    return Compliances(unit, parameters.lower, parameters.upper)
