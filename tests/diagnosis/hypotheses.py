"""Hypotheses and whitened gaps made of bare numbers: no robot behind them."""

from dataclasses import replace
from typing import Any

import numpy as np

from beamstiff.diagnosis.effects import Quantity, Shape
from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array


def hypothesis(
    columns: Any, effect: str = "a", spread: float = 3.0, prior: float = 1.0, **more: Any
) -> Hypothesis:
    """Return a hypothesis with whitened columns (n, c), realistic sizes 1."""
    columns = np.asarray(columns, dtype=np.float64)
    signed = more.pop("positive", False)
    names = tuple(Quantity(f"p{k}", "N", 1.0, signed) for k in range(columns.shape[1]))
    shape = Shape(more.pop("shape", "only"), columns[:, None, :], names, spread)
    places = more.pop("places", ())
    return Hypothesis(effect, more.pop("component", None), shape, prior, columns, places)


def of_any_sign(one: Hypothesis) -> Hypothesis:
    """Return a hypothesis of which every parameter may be negative."""
    parameters = tuple(replace(item, positive=False) for item in one.shape.parameters)
    return replace(one, shape=replace(one.shape, parameters=parameters))


def gap_of(gap: Any, tangent: Any = None, unknown: Any = None, component: Any = None) -> Whitened:
    """Return a gap (n,) of unit noise beside a tangent (n, t) and an unknown of some variances (n,)."""
    gap = np.asarray(gap, dtype=np.float64)
    n = gap.size
    tangent = np.zeros((n, 0)) if tangent is None else np.linalg.qr(np.asarray(tangent, dtype=np.float64))[0]
    used = np.zeros((n, 6), dtype=bool)
    used[:, 0] = True
    return Whitened(
        axes=((np.arange(n), np.eye(n)),),
        unknown=np.ones(n) if unknown is None else np.asarray(unknown, dtype=np.float64),
        component=np.zeros(n, dtype=np.intp) if component is None else np.asarray(component, dtype=np.intp),
        gap=gap,
        tangent=tangent,
        used=used,
        nuisance=np.zeros((n, 0)),
    )


def complement(tangent: Array) -> Array:
    """Return orthonormal columns (n, n - t) across a tangent."""
    whole, _ = np.linalg.qr(np.concatenate([tangent, np.eye(len(tangent))], axis=1))
    return whole[:, tangent.shape[1] : len(tangent)]
