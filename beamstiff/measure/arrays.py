"""Checks of arrays that measurements are computed from, and rows that are equal."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

Integers = NDArray[np.int64]


def finite(value: ArrayLike, name: str, *tail: int, missing: bool = False) -> Array:
    """Return floats with last axes `tail` (-1: any), finite, or NaN if `missing`; messages say `name`."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise BeamstiffError(f"{name}: found {_shown(value)}, expected an array of numbers") from None
    found = array.shape[array.ndim - len(tail) :] if array.ndim >= len(tail) else ()
    if len(found) < len(tail) or any(n not in (-1, m) for n, m in zip(tail, found, strict=True)):
        expected = ", ".join(["...", *("any" if n < 0 else str(n) for n in tail)])
        raise BeamstiffError(f"{name}: found an array of shape {array.shape}, expected ({expected})")
    bad = np.isinf(array) if missing else ~np.isfinite(array)
    if bad.any():
        at = tuple(int(i) for i in np.argwhere(bad)[0])
        place = f" at {list(at)}" if at else ""
        raise BeamstiffError(f"{name}: found {array[at]}{place}, expected a finite number")
    return array


def positive(value: float, name: str) -> float:
    """Return a finite number above zero."""
    result = float(finite(value, name))
    if result <= 0.0:
        raise BeamstiffError(f"{name}: found {result}, expected a positive number")
    return result


def rotation_matrix(value: ArrayLike, name: str) -> Array:
    """Return `value` as rotation matrices (..., 3, 3): orthonormal to 1e-6, right-handed."""
    rotation = finite(value, name, 3, 3)
    error = np.abs(np.swapaxes(rotation, -1, -2) @ rotation - np.eye(3)).max(initial=0.0)
    if error > 1e-6:
        raise BeamstiffError(
            f"{name}: found columns that are not orthonormal (by {error:.2g}), expected a rotation"
        )
    if (np.linalg.det(rotation) < 0).any():
        raise BeamstiffError(f"{name}: found a reflection (left-handed axes), expected a rotation")
    return rotation


def equal_rows(values: Array) -> Integers:
    """Return an id for every row (N,), equal for equal rows, counted from 0 in order of appearance.

    >>> equal_rows(np.array([[2.0], [1.0], [2.0]]))
    array([0, 1, 0])
    """
    if values.shape[1] == 0:
        return np.zeros(len(values), dtype=np.int64)
    _, first, group = np.unique(values, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[group.reshape(-1)]


def places_of_each(number: NDArray[Any]) -> list[NDArray[np.intp]]:
    """Return where each value of an array (N,) stands, the least first.

    >>> [places.tolist() for places in places_of_each(np.array([7, 3, 7]))]
    [[1], [0, 2]]
    """
    order = np.argsort(number, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else []


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
