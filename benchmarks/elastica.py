"""The exact elastica of a cantilever under a load that follows its tip, by elliptic integrals.

The inextensible beam of Euler: ``theta'' = k^2 sin(theta - phi)`` with ``k^2 = P L^2 / EI``, P in the
direction phi. With ``theta - phi = chi - pi`` it is a pendulum, ``chi'' = -k^2 sin chi``, at rest at the tip,
where the load stands at a known angle to the tangent: so the amplitude is known, ``sin(chi / 2) = p sin u``,
and Jacobi's amplitude gives the root (A. E. H. Love, The mathematical theory of elasticity, 262).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ellipe, ellipeinc, ellipj, ellipk


def follower_tip(load: float, friction: float = 0.0) -> tuple[float, float, float]:
    """Return x, y and slope of the tip of a beam of length 1 and EI = 1.

    Parameters
    ----------
    load : float
        Normal to the beam at its tip, towards y.
    friction : float
        Tangential over normal force, along the tangent.

    Examples
    --------
    >>> x, y, slope = follower_tip(1e-6)
    >>> round(1e6 * y, 6), round(1e6 * slope, 6)
    (0.333333, 0.5)
    """
    k = np.sqrt(load * np.hypot(1.0, friction))
    angle = np.pi / 2 - np.arctan(friction)  # from the tangent at the tip to the load
    amplitude = np.pi - angle
    p = np.sin(amplitude / 2)
    m = p * p
    root = ellipj(ellipk(m) - k, m)[3]
    first = 2 * np.arcsin(p * np.sin(root))
    slope = amplitude - first
    along = (2 * (ellipe(m) - ellipeinc(root, m)) - k) / k
    across = 2 * p * np.cos(root) / k
    turn = slope + angle - np.pi
    x = np.cos(turn) * along - np.sin(turn) * across
    y = np.sin(turn) * along + np.cos(turn) * across
    return float(x), float(y), float(slope)
