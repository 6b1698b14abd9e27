"""Frames on the command line: ``x=1200mm,z=0.6,a=90deg``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamstiff.cli.options import parse_quantities
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.se3 import Array

KINDS = {
    **dict.fromkeys("xyz", "length"),
    **dict.fromkeys("abc", "angle"),
    **dict.fromkeys(("qw", "qx", "qy", "qz"), "number"),
}


def parse_frame(option: str, text: str) -> Array:
    """Return a transform (4, 4) from x, y, z and a, b, c (intrinsic Z-Y-X, KUKA's) or a quaternion qw to qz.

    Examples
    --------
    >>> parse_frame("--base", "x=1.2,a=90deg").round(9)[:, [0, 3]].tolist()
    [[0.0, 1.2], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    """
    import numpy as np

    from beamstiff.measure.orientation import KUKA, Quaternion
    from beamstiff.se3 import transform

    expected = "parts such as x=1200mm, a=90deg (x, y, z, a, b, c or qw to qz)"
    values = parse_quantities(option, [text], KINDS, expected, fold=True)
    position = np.array([values.get(axis, 0.0) for axis in "xyz"])
    quaternion = [values.get(name, 0.0) for name in ("qw", "qx", "qy", "qz")]
    if any(name.startswith("q") for name in values):
        if any(name in values for name in "abc"):
            raise BeamstiffError(f"{option}: found angles and a quaternion, expected one of the two")
        try:
            rotation = Quaternion().rotations(np.array([quaternion]))[0]
        except BeamstiffError as error:
            raise BeamstiffError(f"{option}: {error}") from None
    else:
        rotation = KUKA.rotations(np.array([[values.get(axis, 0.0) for axis in "abc"]]))[0]
    return transform(rotation, position)
