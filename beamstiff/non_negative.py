"""Least squares with parameters that cannot be negative, checked.

scipy's `nnls` (1.15 to 1.17) rarely returns a point that is no minimum, with the norm of another one
(github.com/scipy/scipy/issues/25389); which problems it fails on depends on the processor. So the conditions
of a minimum (Karush, Kuhn and Tucker; Lawson & Hanson, Solving Least Squares Problems, ch. 23) are asked, and
where they do not hold, the problem is solved by another method.
"""

import numpy as np
from scipy.optimize import lsq_linear, nnls

from beamstiff.se3 import Array

ROUNDING = 1e-9  # of a column times what is left: up to which their product is 0


def non_negative(matrix: Array, right: Array) -> tuple[Array, float]:
    """Return x (c,), none negative, with the least ``|A x - b|``, and that norm.

    Parameters
    ----------
    matrix : (n, c) array
        A.
    right : (n,) array
        b.

    Returns
    -------
    (c,) array, float

    Examples
    --------
    >>> import numpy as np
    >>> x, norm = non_negative(np.array([[1.0, 1.0], [3.0, 2.0]]), np.array([2.0, 3.0]))
    >>> print(x.round(3), round(norm, 3))
    [0.  1.6] 0.447
    """
    try:
        found = np.asarray(nnls(matrix, right)[0])
    except RuntimeError:  # columns are all but one another: it went round
        found = np.zeros(matrix.shape[1])
    left = right - matrix @ found
    norm = float(np.linalg.norm(left))
    if not _is_minimum(matrix, right, found, left):
        count = 10 * matrix.shape[1]  # changes of the set of zeros; by default each parameter once
        other = lsq_linear(matrix, right, (0.0, np.inf), method="bvls", tol=1e-14, max_iter=count).x
        less = float(np.linalg.norm(right - matrix @ other))
        if less < norm:
            return np.asarray(other), less
    return found, norm


def _is_minimum(matrix: Array, right: Array, found: Array, left: Array) -> bool:
    """Return whether no parameter that may change makes what is left smaller."""
    downhill = matrix.T @ left
    slack = ROUNDING * np.linalg.norm(matrix, axis=0) * np.linalg.norm(right)
    return bool((np.where(found > 0.0, np.abs(downhill), downhill) <= slack).all())
