"""What an identification says: values with their uncertainty, and what could not be known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from beamstiff.se3 import Array


@dataclass(frozen=True)
class Parameter:
    """An identified stiffness: value and standard deviation, N/m or N m/rad.

    `value` is None where the data do not bound the stiffness from above; `lower_bound` then holds with 95 %.
    """

    name: str
    unit: str
    value: float | None
    std: float | None
    identifiable: bool
    lower_bound: float | None = None


@dataclass(frozen=True)
class Identification:
    """Identified stiffness of a robot.

    Attributes
    ----------
    parameters : tuple of Parameter
    covariance : (m, m) array
        Of the logarithms of the stiffness values, in the order of `parameters`.
    stiffness : (m,) array
        Values at the optimum, also of those that are not identifiable.
    rms : float
        Root mean square of the position residual's norm over the fitted rows, m.
    rms_held_out : float or None
        The same on poses left out of the fit (k-fold by pose), m; None with fewer than three poses.
    chi_square : float
        Sum of squared whitened residuals over the degrees of freedom; near 1 when noise explains
        the residual.
    evaluations : int
        Evaluations of the model.
    predicted : (N, 6) array
        Displacement of every row at the optimum, m and rad.
    """

    parameters: tuple[Parameter, ...]
    covariance: Array
    stiffness: Array
    rms: float
    rms_held_out: float | None
    chi_square: float
    evaluations: int
    predicted: Array

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, in the contract's form (``beamstiff identify --json``)."""
        return {
            "parameters": {
                item.name: {
                    "value": item.value,
                    "std": item.std,
                    "unit": item.unit,
                    "identifiable": item.identifiable,
                    **({} if item.lower_bound is None else {"lower_bound": item.lower_bound}),
                }
                for item in self.parameters
            },
            "degenerate": [],
            "rms_mm": 1e3 * self.rms,
            "rms_held_out_mm": None if self.rms_held_out is None else 1e3 * self.rms_held_out,
        }
