"""Stiffness values at which every spring counts: where to look for dependences, and where to start from."""

from __future__ import annotations

import numpy as np

from beamstiff.model.ports import PortModel
from beamstiff.se3 import Array


def balanced_stiffness(model: PortModel) -> Array:
    """Return values (m,) with which no spring hides another: neither as good as rigid nor as good as free.

    A spring beside elastic parts gets the stiffness that these have at its port; one that carries all of the
    load gets a stiffness in proportion to what it would move the measured points by.
    """
    lever = model.lever
    both = np.outer(lever, lever)
    own = np.diagonal(model.springs, axis1=1, axis2=2) > 0  # (m, p)
    unit = np.trace(model.springs / both, axis1=1, axis2=2)
    beside = np.diagonal(model.port_stiffness / both, axis1=1, axis2=2).mean(axis=0)
    rest = (own @ beside) / unit
    carried = ((model.force / lever) ** 2) @ own.T  # (N, m)
    moved = ((model.motion[:, :, :3] / lever[:, None]) ** 2).sum(axis=2) @ own.T
    turned = (
        ((model.motion[:, :, 3:] / lever[:, None]) ** 2).sum(axis=2) @ own.T * lever.max(initial=1.0) ** 2
    )
    effect = np.sqrt((carried * (moved + turned)).mean(axis=0)) / unit
    held, acts = rest > 0, effect > 0
    if not acts.any():
        alone: Array = np.where(held, rest, 1.0 / unit)
        return alone
    ratio = float(np.median(rest[held & acts] / effect[held & acts])) if (held & acts).any() else 1.0
    effect = np.where(acts, effect, float(np.median(effect[acts] * unit[acts])) / unit)
    result: Array = np.where(held, rest, effect * ratio)
    return result
