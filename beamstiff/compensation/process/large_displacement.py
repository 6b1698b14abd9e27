"""A tool on a cantilever, incrementally with large displacements: where it touches, and how hard.

The tool slides along the beam, so the length of beam that is bent is not known beforehand. But all beams
whose contact lies in the same direction from the clamp are alike: the ratio of deflection to distance alone
decides the dimensionless load, the length bent and the slope (`corotational`). These are tabulated once for
each friction.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from beamstiff.compensation.process.corotational import at_ratio, straight
from beamstiff.se3 import Array

LARGEST_RATIO = 0.8  # of deflection to distance
DEGREE = 24


@dataclass(frozen=True, eq=False)
class Contact:
    """A tool on N beams: normal force over EI, 1/m^2, length of beam up to it, m, and slope there, rad."""

    normal: Array
    length: Array
    slope: Array


def contact(distance: Array, deflection: Array, friction: float = 0.0) -> Contact:
    """Return where and how hard a tool at a place presses on a beam.

    `distance` (N,), m: of the tool from the clamp along the undeformed beam. `deflection` (N,), m: at most
    `LARGEST_RATIO` of the distance. `friction`: tangential over normal force on the beam, positive away from
    the clamp.
    """
    ratio = deflection / distance
    load, length, slope = (series(ratio) for series in _tables(friction))
    arc = distance * length
    return Contact(ratio * load / arc**2, arc, ratio * slope)


@lru_cache(maxsize=64)
def _tables(friction: float) -> tuple[Chebyshev, Chebyshev, Chebyshev]:
    """Return load over ratio, length over distance and slope over ratio, as functions of the ratio."""
    nodes = 0.5 * LARGEST_RATIO * (1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)))
    values, beam = [], straight()
    for ratio in nodes.tolist():
        beam = at_ratio(beam, ratio, friction)
        x, _, slope = beam.nodes[-1]
        values.append((beam.load / ratio, 1.0 / x, slope / ratio))
    domain = (0.0, LARGEST_RATIO)
    first, second, third = (
        Chebyshev.fit(nodes, column, DEGREE, domain=domain) for column in np.array(values).T
    )
    return first, second, third
