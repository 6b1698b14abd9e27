"""A place of a machine: what passes through it, and what a slip there moves."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.fem.constraints import RANK_TOLERANCE
from beamstiff.se3 import Array, rotate_screw


@dataclass(frozen=True)
class Place:
    """A place, for N rows, in its own axes.

    `load`: (N, 6) array, N and N m; wrench ``[f, m]`` that the row's load passes through it.
    `dead`: (N, 6) array; what the dead weight passes through it.
    `shift`: (N, 6, 6) array; displacement ``[d, r]`` of the row's point, base frame, per relative
        displacement of the place.
    `turn`: (N, 3, 3) array; its axes in the base frame, as columns.
    `length`: (N,) array, m; of a link: some grow with a slide; 0 for other places.
    `stressed`: (N, 6, 6) array or None; projector onto what self-stresses do there; None where statics and
        the springs determine all.
    """

    load: Array
    dead: Array
    shift: Array
    turn: Array
    length: Array
    stressed: Array | None = None

    @property
    def undetermined(self) -> NDArray[np.bool_]:
        """The directions (6,) whose wrench is not determined in some row: nothing passes there, or slips."""
        if self.stressed is None:
            return np.zeros(6, dtype=np.bool_)
        most = np.diagonal(self.stressed, axis1=1, axis2=2).max(axis=0, initial=0.0)
        return np.asarray(most > RANK_TOLERANCE)

    def along(self, turn: Array) -> Self:
        """Return the place in other axes, the columns of (N, 3, 3) in the base frame."""
        change = rotate_screw(turn.swapaxes(-1, -2) @ self.turn)  # components in new axes from those in old
        back = change.swapaxes(-1, -2)
        return replace(
            self,
            load=(change @ self.load[..., None])[..., 0],
            dead=(change @ self.dead[..., None])[..., 0],
            shift=self.shift @ back,
            turn=turn,
            stressed=None if self.stressed is None else change @ self.stressed @ back,
        )

    def beside(self, other: Self) -> Self:
        """Return the place under its load and that of another, in the same axes."""
        return replace(self, load=self.load + other.load)

    def determined(self) -> Self:
        """Return the place with nothing in the directions that are not determined."""
        some = ~self.undetermined
        return replace(self, load=self.load * some, dead=self.dead * some, shift=self.shift * some)


def nothing_of(rows: int) -> Place:
    """Return a place under so many rows of which nothing is determined."""
    axes, none = (np.broadcast_to(np.eye(size), (rows, size, size)) for size in (3, 6))
    load, shift = np.zeros((rows, 6)), np.zeros((rows, 6, 6))
    return Place(load, load, shift, axes, np.zeros(rows), stressed=none)
