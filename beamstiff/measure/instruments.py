"""Readings without a tracker: what a ball seat, a ball bar, a touch probe or a dial gauge says of the point.

Each says one number of where the point p is (a socket three), in the frame that the table is measured in::

    socket     p = s                        the point sits in an unknown fixed place s
    ball-bar   |p - s| = length + reading   the point's distance from a base ball s
    plane      n . (p - s) = reading        the point touches a plane, or stands `reading` off it
    gauge      n . (p - s) = reading        a dial gauge along a known direction n, zeroed anywhere

Loaded minus unloaded, all of them read ``n . d``, the displacement along one direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

Instrument = Literal["socket", "ball-bar", "plane", "gauge"]
Vector = tuple[float, float, float]
INSTRUMENTS: tuple[Instrument, ...] = ("socket", "ball-bar", "plane", "gauge")
PLACE = ("target_x", "target_y", "target_z")
COLUMNS = ("instrument", "target", "direction")  # of text
QUANTITIES = dict.fromkeys(("reading", "dreading", "sigma_reading", "length", *PLACE), "length")


@dataclass(frozen=True)
class Target:
    """What the readings of one set-up of an instrument share: known, or sought with everything else."""

    name: str
    instrument: Instrument
    # m: s of the equations above; None: not known, and nothing to begin with either
    place: Vector | None = None
    normal: Vector | None = None  # n, of a plane or gauge, unit length
    length: float | None = None  # m, of a ball bar
    sought: tuple[
        str, ...
    ] = ()  # of `x y z` of a place, `length`, and of planes and gauges `offset tilt1 tilt2`


def target(
    name: str,
    instrument: Instrument,
    *,
    place: Sequence[float] | Array | None = None,
    normal: Sequence[float] | Array | None = None,
    length: float | None = None,
) -> Target:
    """Return a target with what is known of it; all else is estimated.

    >>> target("bar", "ball-bar", length=0.3).sought, target("wall", "plane", normal=(2, 0, 0)).normal
    (('x', 'y', 'z'), (1.0, 0.0, 0.0))
    """
    along = None if normal is None else unit_vector(normal, name)
    sought: tuple[str, ...]
    if instrument in ("socket", "ball-bar"):
        sought = ("x", "y", "z") if place is None else ()
        sought += ("length",) if instrument == "ball-bar" and length is None else ()
    else:
        sought = ("offset",) if place is None else ()
        sought += ("tilt1", "tilt2") if along is None and instrument == "plane" else ()
    at = None if place is None else (float(place[0]), float(place[1]), float(place[2]))
    return Target(name, instrument, at, along, length, sought)


def axes_along(direction: Array) -> Array:
    """Return the axes (N, 3, 3) that rows are read in: the first along `direction` (N, 3), base axes for NaN.

    >>> axes_along(np.array([[0.0, 0.0, 1.0]]))[0, 0]
    array([0., 0., 1.])
    """
    result = np.broadcast_to(np.eye(3), (len(direction), 3, 3)).copy()
    for row in np.flatnonzero(np.isfinite(direction).all(axis=1)).tolist():
        result[row] = np.concatenate([direction[row : row + 1], across(direction[row])])
    return result


def across(normal: Array) -> Array:
    """Return two unit vectors (2, 3) that are perpendicular to one (3,) and to each other."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def joined_targets(tables: Sequence[tuple[str, tuple[Target, ...]]]) -> tuple[Target, ...]:
    """Return the targets of several tables; a name means the same in all of them."""
    found: dict[str, tuple[str, Target]] = {}
    for source, targets in tables:
        for one in targets:
            before, same = found.setdefault(one.name, (source, one))
            if same != one:
                raise BeamstiffError(
                    f"{before} and {source}: target {one.name!r} is not the same in both; another set-up "
                    "needs another name"
                )
    return tuple(one for _, one in found.values())


def unit_vector(vector: Sequence[float] | Array, name: str) -> Vector:
    """Return a direction as a unit vector; `name` is what it is, for the message."""
    values = np.asarray(vector, dtype=np.float64)
    size = float(np.linalg.norm(values))
    if values.shape != (3,) or not np.isfinite(size) or size == 0.0:
        raise BeamstiffError(f"{name}: found {vector}, expected a direction that is not zero")
    x, y, z = (values / size).tolist()
    return x, y, z
