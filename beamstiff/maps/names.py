"""Names in a map: those of its robot's variables beside those that every map has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from beamstiff.maps.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray

# what maps call their own: no axis is called so
OWN = (*QUANTITIES, "reason", "q", "joint", "motion", "load")


def dimension_names(variables: Iterable[str]) -> dict[str, str]:
    """Return what the axes of a map are called in its file, by variable.

    An axis has its variable's name, or ``variable_NAME`` where a map calls something else so.
    """
    names = tuple(variables)
    result = {}
    for name in names:
        called = name
        while called in OWN or (called != name and called in names):
            called = f"variable_{called}"
        result[name] = called
    return result


def variable_of(dataset: xarray.Dataset, axis: str) -> str:
    """Return the variable that an axis of a map stands for."""
    return str(dataset[axis].attrs.get("variable", axis))
