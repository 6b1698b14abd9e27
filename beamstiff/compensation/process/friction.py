"""Coulomb friction of a sliding tool: against the way it came."""

from __future__ import annotations

import numpy as np

from beamstiff.se3 import Array

STILL = 1e-9  # m: a way shorter than this is none


def sliding(place: Array) -> Array:
    """Return which way the tool slid to each place along a line, (N,): 1, -1, or 0 where it stood still.

    Parameters
    ----------
    place : (N,) array, m
        On the line, in the order of the path. To the first nothing slid.

    Examples
    --------
    >>> sliding(np.array([0.0, 0.1, 0.1, 0.05]))
    array([ 0., 1., 0., -1.])
    """
    way = np.diff(place, prepend=place[:1])
    return np.where(np.abs(way) > STILL, np.sign(way), 0.0)
