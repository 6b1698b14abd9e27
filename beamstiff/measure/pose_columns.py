"""Columns that write a pose otherwise than x y z a b c: quaternions, rotation matrices, 4 x 4 matrices.

``qw qx qy qz`` (unit quaternion), ``r11 .. r33`` (rows of the rotation matrix) beside x y z, or
``m11 .. m34``: the upper rows of a homogeneous matrix, whose last column is the position (``m14 [mm]``).
"""

import re
from collections.abc import Container
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.measure.orientation import Quaternion
from beamstiff.measure.text import RawTable, RowError, numbers
from beamstiff.se3 import Array, vector_from_rotation

QUATERNION = ("qw", "qx", "qy", "qz")
MATRIX = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
POSE = tuple(f"m{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3, 4))
BOTTOM = ("m41", "m42", "m43", "m44")
ORTHOGONAL = 5e-3  # of a matrix as people write it: three digits


def with_rotation_vectors(raw: RawTable, joints: Container[str] = ()) -> RawTable:
    r"""Return a table with such columns replaced by x y z and a b c; others are untouched.

    `joints`: names of the robot's variables, whose columns are its own: a gantry's axes may be qx, qy and qz.

    >>> from beamstiff.measure.text import split_table
    >>> table = with_rotation_vectors(split_table("q1,qw,qx,qy,qz\n0,0,0,0,1\n", "t"))
    >>> table.header, table.cells[0][1:3]
    (['q1', 'a [rad]', 'b [rad]', 'c [rad]'], ['0.0', '0.0'])
    """
    names = [re.split(r"\s*\[", cell)[0] for cell in raw.header]
    groups = (QUATERNION, MATRIX, POSE)
    found = [group for group in groups if any(name in names and name not in joints for name in group)]
    if not found:
        return raw
    group = found[0]
    missing = [name for name in group if name not in names]
    if missing:
        raw.fail_in_header(missing[0], f"this column is missing, expected all of {group[0]} to {group[-1]}")
    if len(found) > 1 or "a" in names:
        raw.fail_in_header(group[0], "found two ways of writing an orientation, expected one")
    if group == POSE and "x" in names:
        raw.fail_in_header("m14", "found beside x, expected the position once")
    decimal = raw.metadata.get("decimal", ("point", 0))[0] == "comma"
    values = {name: _column(raw, names.index(name), name, decimal) for name in group}
    table = np.stack([values[name] for name in group], axis=1)
    known = ~np.isnan(table).any(axis=1)
    vectors = np.full((len(table), 3), np.nan)
    if known.any():
        rows = np.flatnonzero(known)
        try:
            rotations = _rotations(table[known], group)
        except RowError as error:
            raw.fail_in_row(int(rows[error.row]), group[0], str(error))
        vectors[known] = vector_from_rotation(rotations)
    header: list[str] = []
    columns: list[list[str]] = []
    position = dict(zip(("m14", "m24", "m34"), "xyz", strict=True)) if group == POSE else {}
    for at, name in enumerate(names):
        if name in position:
            header.append(raw.header[at].replace(name, position[name]))
            columns.append([row[at] for row in raw.cells])
        elif name not in group and not (group == POSE and name in BOTTOM):
            header.append(raw.header[at])
            columns.append([row[at] for row in raw.cells])
    for name, turned in zip("abc", vectors.T, strict=True):
        texts = ["" if value != value else repr(float(value)) for value in turned]
        header.append(f"{name} [rad]")
        columns.append([text.replace(".", ",") for text in texts] if decimal else texts)
    return replace(raw, header=header, cells=[list(row) for row in zip(*columns, strict=True)])


def _column(raw: RawTable, at: int, name: str, decimal: bool) -> Array:
    try:
        return numbers([row[at] for row in raw.cells], may_be_empty=True, decimal_comma=decimal)
    except RowError as error:
        raw.fail_in_row(error.row, name, str(error))


def _rotations(table: Array, group: tuple[str, ...]) -> Array:
    if group == QUATERNION:
        return Quaternion().rotations(table)
    matrices = table.reshape(len(table), 3, -1)[:, :, :3]
    off = np.abs(matrices @ matrices.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    if (off > ORTHOGONAL).any():
        row = int(np.argmax(off > ORTHOGONAL))
        raise RowError(row, "found rows that are not of length 1 and at right angles, expected a rotation")
    if (np.linalg.det(matrices) < 0).any():
        row = int(np.argmax(np.linalg.det(matrices) < 0))
        raise RowError(row, "found a mirror image (determinant -1), expected a rotation")
    return np.asarray(Rotation.from_matrix(matrices).as_matrix())
