"""What the methods minimise: half the sum of squares of whitened residuals, with robust losses and priors.

``F(theta) = 1/2 sum rho(r_i^2) + 1/2 sum prior_j^2``, rho as in Huber (1964), Cauchy and their smooth kin
(Triggs et al., "Bundle adjustment: a modern synthesis", 2000, section 3.2).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from beamstiff.identification.parameters import Parameters
from beamstiff.identification.problem import Problem
from beamstiff.se3 import Array

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]


def _linear(z: Array) -> Array:
    return np.stack([z, np.ones_like(z), np.zeros_like(z)])


def _soft_l1(z: Array) -> Array:
    root = np.sqrt(1 + z)
    return np.stack([2 * (root - 1), 1 / root, -0.5 / root**3])


def _huber(z: Array) -> Array:
    root = np.sqrt(np.maximum(z, 1))
    return np.stack([np.where(z <= 1, z, 2 * root - 1), 1 / root, np.where(z <= 1, 0.0, -0.5 / root**3)])


def _cauchy(z: Array) -> Array:
    return np.stack([np.log1p(z), 1 / (1 + z), -1 / (1 + z) ** 2])


AT_ONCE = 100_000  # numbers an array of the evaluation of several candidates may hold: it stays in the cache

# rho and its two derivatives by z, the square of the residual in units of the scale
LOSSES: dict[str, Callable[[Array], Array]] = {
    "linear": _linear,
    "soft_l1": _soft_l1,
    "huber": _huber,
    "cauchy": _cauchy,
}


@dataclass(frozen=True)
class Objective:
    """A problem in its free values theta (t,), ready to be minimised."""

    problem: Problem
    parameters: Parameters
    loss: Loss = "linear"  # "linear" (least squares), "soft_l1", "huber" or "cauchy"
    scale: float = 2.0  # residual, in standard deviations, from which on it counts for less; not for "linear"

    def residuals(self, theta: Array) -> Array:
        """Return the whitened residuals and then the priors', (..., n + m), at theta (..., t)."""
        stiffness = self.parameters.stiffness(theta)
        return np.concatenate([self.problem.residuals(stiffness), self.parameters.prior(stiffness)], axis=-1)

    def jacobian(self, theta: Array) -> tuple[Array, Array]:
        """Return residuals (n + m,) and their derivatives (n + m, t)."""
        stiffness = self.parameters.stiffness(theta)
        residual, by_log = self.problem.jacobian(stiffness)
        priors = np.diag(-1.0 / self.parameters.known_std)
        both = np.concatenate([by_log, priors]) @ self.parameters.sums
        return np.concatenate([residual, self.parameters.prior(stiffness)]), both

    def rho(self, z: Array) -> Array:
        """Return rho, rho' and rho'' (3, ..., n + m) of squares z (..., n + m); of priors, z."""
        n = self.problem.count
        return np.concatenate([LOSSES[self.loss](z[..., :n]), _linear(z[..., n:])], axis=-1)

    def weights(self, residuals: Array) -> Array:
        """Return rho' of each residual, (n + m,): what it counts; priors count in full."""
        return np.asarray(self.rho((residuals / self.scale) ** 2)[1])

    def cost(self, theta: Array) -> float:
        """Return F(theta)."""
        return self.cost_of(self.residuals(theta))

    def costs(self, thetas: Array) -> Array:
        """Return F of several candidates (K, t) at once, (K,)."""
        model = self.problem.model
        size = max(self.problem.used.size, len(model.port_stiffness) * len(model.lever) ** 2)
        some = max(1, AT_ONCE // size)
        blocks = [self.residuals(thetas[at : at + some]) for at in range(0, len(thetas), some)]
        return np.concatenate([self._costs_of(residuals) for residuals in blocks])

    def gradient(self, theta: Array) -> tuple[float, Array]:
        """Return F(theta) and its derivatives (t,)."""
        residuals, jacobian = self.jacobian(theta)
        return self.cost_of(residuals), jacobian.T @ (self.weights(residuals) * residuals)

    def cost_of(self, residuals: Array) -> float:
        """Return F from the residuals (n + m,)."""
        return float(self._costs_of(residuals))

    def _costs_of(self, residuals: Array) -> Array:
        if self.loss == "linear":
            return np.asarray(0.5 * np.einsum("...n,...n->...", residuals, residuals))
        rho = self.rho((residuals / self.scale) ** 2)[0]
        return np.asarray(0.5 * self.scale**2 * rho.sum(axis=-1))
