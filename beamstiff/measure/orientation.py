"""How files write an orientation: rotation vector, quaternion, Euler angles in a named order, tool axis.

Each convention turns rows of numbers into rotation matrices and back. Back, of all numbers that mean the same
rotation the ones nearest to those that stood there before are taken.

Columns may write a pose otherwise than x y z a b c: ``qw qx qy qz`` (unit quaternion), ``r11 .. r33`` (rows
of the rotation matrix) beside x y z, or ``m11 .. m34``: the upper rows of a homogeneous matrix, whose last
column is the position (``m14 [mm]``).
"""

import re
import warnings
from collections.abc import Container
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError, shown
from beamstiff.measure.text import RawTable, RowError, numbers
from beamstiff.se3 import Array, rotation_about, rotation_from_vector, vector_from_rotation

NORM_TOLERANCE = 5e-3  # of quaternions and axes as people write them: three digits
LOCKED = 1e-7  # rad: nearer to the pole, first and third angle turn about one line
_NAMED = re.compile(r"(?P<how>euler|intrinsic|fixed|extrinsic)[\s:,-]+(?P<axes>[xyz]{3})", re.IGNORECASE)
QUATERNION = ("qw", "qx", "qy", "qz")
MATRIX = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
POSE = tuple(f"m{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3, 4))
BOTTOM = ("m41", "m42", "m43", "m44")
ORTHOGONAL = 5e-3  # of a matrix as people write it: three digits


class Orientation(Protocol):
    """A convention for writing orientations, with numbers in SI (angles in rad)."""

    @property
    def count(self) -> int:
        """How many numbers an orientation takes."""

    def rotations(self, values: Array) -> Array:
        """Return rotation matrices (N, 3, 3) of numbers (N, count); raises what is wrong with one of them."""

    def numbers(self, rotations: Array, like: Array) -> Array:
        """Return numbers (N, count) of rotation matrices (N, 3, 3), the nearest to `like` (N, count)."""


def _unit_length(values: Array, what: str) -> Array:
    """Return the lengths of vectors, (N,), refused where they are not about 1."""
    length: Array = np.linalg.norm(values, axis=1)
    if (wrong := np.abs(length - 1) > NORM_TOLERANCE).any():
        row = int(np.argmax(wrong))
        raise RowError(row, f"found {what} of length {length[row]:.6g}, expected 1")
    return length


@dataclass(frozen=True)
class RotationVector:
    """Axis times angle, rad."""

    count: int = 3

    def rotations(self, values: Array) -> Array:
        """Return rotation matrices (N, 3, 3)."""
        return rotation_from_vector(values)

    def numbers(self, rotations: Array, like: Array) -> Array:
        """Return rotation vectors (N, 3); whole turns as in `like`."""
        vectors = vector_from_rotation(rotations)
        angle = np.linalg.norm(vectors, axis=1, keepdims=True)
        axis = np.where(angle > 0, vectors / np.where(angle > 0, angle, 1.0), 0.0)
        turns = np.round((np.sum(axis * like, axis=1, keepdims=True) - angle) / (2 * np.pi))
        return np.asarray(vectors + 2 * np.pi * turns * axis)


@dataclass(frozen=True)
class Quaternion:
    """Unit quaternion, scalar first as in RAPID (`q1` of `orient`), unless `scalar_last`."""

    scalar_last: bool = False
    count: int = 4

    def rotations(self, values: Array) -> Array:
        """Return rotation matrices (N, 3, 3)."""
        _unit_length(values, "a quaternion")
        ordered = values if self.scalar_last else np.roll(values, -1, axis=1)
        return np.asarray(Rotation.from_quat(ordered).as_matrix())

    def numbers(self, rotations: Array, like: Array) -> Array:
        """Return quaternions (N, 4), of the two signs the one of `like`."""
        quaternions = Rotation.from_matrix(rotations).as_quat()
        if not self.scalar_last:
            quaternions = np.roll(quaternions, 1, axis=1)
        sign = np.where(np.sum(quaternions * like, axis=1, keepdims=True) < 0, -1.0, 1.0)
        return np.asarray(sign * quaternions)


@dataclass(frozen=True)
class EulerAngles:
    """Three turns one after the other: `ZYX` about the turned axes (intrinsic), `xyz` about fixed ones."""

    order: str
    count: int = 3

    def rotations(self, values: Array) -> Array:
        """Return rotation matrices (N, 3, 3)."""
        result = np.broadcast_to(np.eye(3), (len(values), 3, 3))
        for axis, angle in zip(self.order, values.T, strict=True):
            turn = rotation_about("xyz".index(axis.lower()), angle)
            result = result @ turn if self.order.isupper() else turn @ result
        return np.array(result)

    def numbers(self, rotations: Array, like: Array) -> Array:
        """Return angles (N, 3): of the two solutions, and whole turns, those nearest to `like`."""
        with warnings.catch_warnings():  # of the pole, which is seen to below
            warnings.simplefilter("ignore", UserWarning)
            first = Rotation.from_matrix(rotations).as_euler(self.order)  # type: ignore[call-overload]  # literals in the stubs
        symmetric = self.order[0] == self.order[2]
        pole = np.sin(first[:, 1]) if symmetric else np.cos(first[:, 1])
        first = np.where((np.abs(pole) < LOCKED)[:, None], self._at_pole(rotations, first, like), first)
        middle = -first[:, 1] if symmetric else np.pi - first[:, 1]
        second = np.stack([first[:, 0] + np.pi, middle, first[:, 2] + np.pi], axis=1)
        near = [angles + 2 * np.pi * np.round((like - angles) / (2 * np.pi)) for angles in (first, second)]
        far = [np.abs(angles - like).sum(axis=1, keepdims=True) for angles in near]
        return np.asarray(np.where(far[0] <= far[1] + 1e-9, near[0], near[1]))

    def _at_pole(self, rotations: Array, angles: Array, like: Array) -> Array:
        """Return angles with the first as in `like` and the third what is left."""
        kept = np.stack([like[:, 0], angles[:, 1], np.zeros(len(angles))], axis=1)
        before = self.rotations(kept)
        intrinsic = self.order.isupper()
        left = before.swapaxes(1, 2) @ rotations if intrinsic else rotations @ before.swapaxes(1, 2)
        axis = "xyz".index(self.order[2].lower())
        kept[:, 2] = vector_from_rotation(left)[:, axis]
        return kept


KUKA = EulerAngles("ZYX")


@dataclass(frozen=True)
class ToolAxis:
    """The direction from the tool's tip to its holder, as in APT; the tool's z points the other way.

    What turn about the axis the file leaves open is chosen so that the tool's x lies in the plane of the axis
    and the x of the path's frame, or of its y where the axis runs along x.
    """

    count: int = 3

    def rotations(self, values: Array) -> Array:
        """Return rotation matrices (N, 3, 3)."""
        z = -values / _unit_length(values, "a tool axis")[:, None]
        along = np.where((np.abs(z[:, :1]) > 0.9), [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
        x = along - np.sum(along * z, axis=1, keepdims=True) * z
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        return np.stack([x, np.cross(z, x), z], axis=2)

    def numbers(self, rotations: Array, like: Array) -> Array:  # noqa: ARG002 (there is but one)
        """Return axes (N, 3)."""
        return np.asarray(-rotations[:, :, 2])


def named_orientation(name: str) -> Orientation:
    """Return the convention of three columns a b c by its name.

    `name`: ``rotation vector``; ``KUKA ABC`` (intrinsic Z-Y-X); ``Euler ZYX`` and the like (intrinsic, in the
    order of the columns); ``fixed XYZ`` and the like (about axes that stand still).
    """
    plain = re.sub(r"[\s_-]+", " ", name.strip().lower())
    if plain in ("rotation vector", "rotvec"):
        return RotationVector()
    if plain in ("kuka abc", "kuka a b c", "kuka"):
        return KUKA
    if match := _NAMED.fullmatch(name.strip()):
        axes = match["axes"].upper()
        if axes[0] != axes[1] and axes[1] != axes[2]:
            return EulerAngles(axes if match["how"].lower() in ("euler", "intrinsic") else axes.lower())
    raise BeamstiffError(
        f"found the orientation {shown(name)}, expected rotation vector, KUKA ABC, Euler ZYX (or another "
        "order, about turned axes) or fixed XYZ (about fixed axes)"
    )


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
