"""Why a pose of a map has no value."""

from __future__ import annotations

from enum import IntEnum


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
