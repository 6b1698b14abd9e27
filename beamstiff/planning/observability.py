"""Observability indices: how well a set of measurements shows the parameters, from its singular values.

`calibration.identifiability` says what can be distinguished at all. With s_1 >= ... >= s_m the singular
values of the whitened sensitivity of n measurements:

=====  =========================  ===================================================================
index  value                      source
=====  =========================  ===================================================================
O1     (s_1 ... s_m)^(1/m)/n^1/2  Borm and Menq, Int. J. Robotics Res. 10 (1991) 51
O2     s_m / s_1                  Driels and Pathre, J. Robotic Systems 7 (1990) 155
O3     s_m                        Nahvi, Hollerbach and Hayward, IEEE ICRA 1994, p. 454
O4     s_m^2 / s_1                Nahvi and Hollerbach, IEEE ICRA 1996, p. 647 (noise amplification)
O5     1 / sum(1 / s_i)           Sun and Hollerbach, IEEE ICRA 2008, p. 831
=====  =========================  ===================================================================

All are better the larger, and depend on the units of the parameters: logarithms of stiffness values have no
unit. O1 belongs to D-optimal designs, O3 to E-optimal ones.
"""

from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Observability:
    """The five observability indices of a set of measurements."""

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float


def observability(sensitivity: Array, measurements: int | None = None) -> Observability:
    """Return the observability indices of a sensitivity.

    Parameters
    ----------
    sensitivity : (N, m) array
        Derivatives of all measured components by the parameters, divided by their standard deviations; or the
        root of an information matrix, ``R^T R``, (m, m).
    measurements : int, optional
        Number of measurements n for O1; default N.

    Raises
    ------
    BeamstiffError
        When there are fewer components than parameters, or entries that are no numbers.

    Examples
    --------
    >>> observability(np.array([[3.0, 0.0], [0.0, 4.0], [0.0, 0.0]])).O4
    2.25
    """
    matrix = np.asarray(sensitivity, dtype=np.float64)
    if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
        raise BeamstiffError(f"sensitivity: found shape {matrix.shape}, expected a table of finite numbers")
    if matrix.shape[0] < matrix.shape[1]:
        raise BeamstiffError(
            f"sensitivity: found {matrix.shape[0]} components for {matrix.shape[1]} parameters, too few"
        )
    values = np.linalg.svd(matrix, compute_uv=False)
    largest, smallest = float(values[0]), float(values[-1])
    if smallest == 0.0:
        return Observability(0.0, 0.0, 0.0, 0.0, 0.0)
    count = matrix.shape[0] if measurements is None else measurements
    return Observability(
        O1=float(np.exp(np.log(values).mean()) / np.sqrt(count)),
        O2=smallest / largest,
        O3=smallest,
        O4=smallest**2 / largest,
        O5=float(1 / (1 / values).sum()),
    )
