"""Names in a map, those of its robot's variables beside its own; and why a pose has no value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from beamstiff.maps.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray


from enum import IntEnum

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


class Reason(IntEnum):
    """What stands in `reason` at each pose of a map; 0 where all quantities are there."""

    COMPUTED = 0
    LIMITS = 1
    LOOP_OPEN = 2
    OUT_OF_REACH = 3
    OTHER_CONFIGURATION = 4
    SINGULAR = 5
    MECHANISM = 6
    RIGID = 7

    @property
    def label(self) -> str:
        """The name, as files have it."""
        return self.name.lower()


MEANING = {
    Reason.LIMITS: "a joint variable would be outside its limits",
    Reason.LOOP_OPEN: "a loop does not close",
    Reason.OUT_OF_REACH: "the TCP does not get there",
    Reason.OTHER_CONFIGURATION: "reached only in another configuration than that of the posture held",
    Reason.SINGULAR: "a loop leaves variables undetermined: no Jacobian",
    Reason.MECHANISM: "the structure is a mechanism",
    Reason.RIGID: "the TCP does not give way at all: infinite stiffness",
}
