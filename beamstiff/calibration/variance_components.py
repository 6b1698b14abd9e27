"""How far a robot is from its description, beside how far its readings scatter: by restricted likelihood.

Lengths and angles theta, in realistic deviations, are `N(0, t^2)`; readings `y = F b + K theta + N(0, s^2)`,
base, reflectors and compliances b free. What F leaves of y says both variances (Patterson and Thompson,
Biometrika 58 (1971) 545)::

    -2 log L = n log(y' V^-1 y) + log |V|,   V = 1 + (t / s)^2 K K'
"""

import numpy as np

from beamstiff.se3 import Array

# t / s: from a robot that is as described to one whose readings are exact, in steps of a quarter
RATIOS = np.logspace(-6, 6, 121)


def spread_over_noise(left: Array, free: Array, known: Array) -> float:
    """Return t / s.

    `left` (n,): of the robot as described. `free` (n, f) and `known` (n, k): columns of what is free, and of
    lengths and angles in realistic deviations.
    """
    size = np.linalg.norm(free, axis=0)
    basis = np.linalg.qr(free / np.where(size > 0.0, size, 1.0))[0]
    left, known = left - basis @ (basis.T @ left), known - basis @ (basis.T @ known)
    axes, values, _ = np.linalg.svd(known, full_matrices=False)
    seen = axes.T @ left
    widened = 1.0 + (RATIOS[:, None] * values) ** 2
    squares = (seen**2 / widened).sum(axis=1) + max(float(left @ left - seen @ seen), 0.0)
    count = len(left) - free.shape[1]
    criterion = count * np.log(np.maximum(squares, 1e-300)) + np.log(widened).sum(axis=1)
    return float(RATIOS[int(np.argmin(criterion))])
