"""A file of targets that can be written again with other numbers, and nothing else changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.editing import ENCODING, Slot, replaced
from beamstiff.compensation.path import StatedFrame, ToolPath
from beamstiff.compensation.posture import StatedPosture
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import Orientation
from beamstiff.measure.text import RowError
from beamstiff.se3 import Array, transform

SEAM = "\n\0\n"  # between a file and the one beside it that holds its points, in one text
MOST = 1e3  # m
MOST_TURNED = 1e3  # rad: beyond, angles lose the decimals that count


@dataclass(frozen=True)
class Place:
    """A target in a text: its name, line, three numbers of position and those of its orientation, if any.

    Without numbers of its own, the target has the `inherited` ones (SI), which are not written. Or it is
    written as joint values: then it has numbers of `joints` alone.
    """

    name: str
    line: int
    position: tuple[Slot, ...] = ()
    orientation: tuple[Slot, ...] = ()
    inherited: tuple[float, ...] = ()
    joints: tuple[Slot, ...] = ()
    base: StatedFrame | None = None  # what the program says of the target's frame and tool; None: nothing
    tool: StatedFrame | None = None
    posture: StatedPosture | None = None
    file: str = ""  # in which it stands, if that is another than the path's
    external: Mapping[str, float] = field(default_factory=dict)  # axes beside the robot's, mm or deg


@dataclass(frozen=True, eq=False)
class Program:
    """A file as it was read."""

    text: str  # every byte a character (`editing`)
    path: ToolPath  # in the frame of the path
    places: tuple[Place, ...]  # one each target
    orientation: Orientation  # how the file writes orientations
    read: Callable[[str, str], Program]  # of the file's format
    notes: tuple[str, ...] = ()  # what is worth knowing, such as motions that are left as they are
    chosen: tuple[int, ...] = ()  # which of the file's targets these are, where it has others (`only`)

    def with_poses(
        self, poses: Array, which: NDArray[np.bool_] | None = None, joints: Array | None = None
    ) -> bytes:
        """Return the file with the numbers of targets replaced.

        `poses` (N, 4, 4): in the frame of the path. `which` (N,) bool: the targets to change; default all.
        `joints` (N, A): joint values for those that are written so; without it they stay.
        """
        chosen = np.flatnonzero(np.ones(len(self.path), dtype=np.bool_) if which is None else which).tolist()
        changes = []
        turned = [row for row in chosen if self.places[row].orientation]
        like = np.array([[slot.value for slot in self.places[row].orientation] for row in turned])
        if turned:
            numbers = self.orientation.numbers(poses[turned, :3, :3], like)
            # a rotation that did not change keeps its numbers, however they were rounded
            same = np.abs(poses[turned, :3, :3] - self.path.poses[turned, :3, :3]).max(axis=(1, 2)) < 1e-12
            numbers = np.where(same[:, None], like, numbers)
            for row, values in zip(turned, numbers.tolist(), strict=True):
                changes += list(zip(self.places[row].orientation, values, strict=True))
        for row in chosen:
            place = self.places[row]
            if place.position:
                changes += list(zip(place.position, poses[row, :3, 3].tolist(), strict=True))
            elif joints is not None:
                changes += list(zip(place.joints, joints[row].tolist(), strict=True))
        return replaced(self.text, changes).encode(ENCODING)

    @staticmethod
    def files(content: bytes) -> tuple[bytes, bytes | None]:
        """Return the file that `with_poses` made, and the one beside it that holds its points, if any."""
        file, _, beside = content.partition(SEAM.encode(ENCODING))
        return file, beside or None

    def read_again(self, content: bytes) -> Program:
        """Return the same targets of another version of the file, such as `with_poses` makes."""
        program = self.read(content.decode(ENCODING), self.path.source)
        return program.cut(self.chosen) if self.chosen else program

    def only(self, patterns: Sequence[str]) -> Program:
        """Return the program with those targets alone whose names match one of the patterns (``XP*``)."""
        names = self.path.names
        for pattern in patterns:
            if not any(fnmatchcase(name.upper(), pattern.upper()) for name in names):
                raise BeamstiffError(
                    f"{self.path.source}: found no target {pattern!r}{suggest(pattern, names)}, it has "
                    f"{listed(dict.fromkeys(names), 6)}"
                )
        rows = [
            row
            for row, name in enumerate(names)
            if any(fnmatchcase(name.upper(), pattern.upper()) for pattern in patterns)
        ]
        return self.cut(rows)

    def cut(self, rows: Sequence[int]) -> Program:
        """Return the program with some of its targets alone."""
        path = self.path.at(np.array(rows, dtype=np.intp))
        chosen = tuple(self.chosen[row] if self.chosen else row for row in rows)
        return replace(self, path=path, places=tuple(self.places[row] for row in rows), chosen=chosen)


def common_frame(frames: Sequence[StatedFrame | None], name: str, line: int) -> StatedFrame | None:
    """Return what holds at all motions to a target; where it differs, a frame of unknown pose."""
    found = dict.fromkeys(one.name if one else "none" for one in frames)
    if len(found) > 1:
        return StatedFrame(f"several for {name} ({' and '.join(found)})", line, None)
    return frames[0] if frames else None


def make_program(
    text: str,
    source: str,
    places: Sequence[Place],
    orientation: Orientation,
    read: Callable[[str, str], Program],
    notes: Sequence[str] = (),
    *,
    stated: bool = True,
    wrench: Array | None = None,
    columns: Mapping[str, Array] | None = None,
    joint_names: tuple[str, ...] = (),
) -> Program:
    """Return a program from the targets found in a text."""
    positions = np.array([[slot.value for slot in place.position] or [0.0] * 3 for place in places])
    numbers = np.zeros((len(places), orientation.count))
    for row, place in enumerate(places):
        if place.joints:  # its pose is the robot's to say
            continue
        numbers[row] = [slot.value for slot in place.orientation] or place.inherited
        if not (np.isfinite(numbers[row]).all() and np.isfinite(positions[row]).all()):
            fail(source, place.line, place.name, "found a number that is not finite")
        if np.abs(numbers[row]).max() > MOST_TURNED:
            fail(source, place.line, place.name, "found an angle of more than 100 turns; check the unit")
        if np.abs(positions[row]).max() > MOST:
            reach = "expected one that a robot reaches; check the unit"
            far = f"{np.abs(positions[row]).max():.3g} m away"
            fail(source, place.line, place.name, f"found a position {far}, {reach}")
    try:
        rotations = orientation.rotations(numbers)
    except RowError as error:
        place = places[error.row]
        raise BeamstiffError(f"{source}:{place.line}: {place.name}: {error}") from None
    path = ToolPath(
        source=source,
        names=tuple(place.name for place in places),
        lines=np.array([place.line for place in places], dtype=np.int64),
        poses=transform(rotations, positions),
        turns=np.array([bool(place.orientation or place.joints) for place in places]),
        stated=stated,
        wrench=wrench,
        columns=columns or {},
        stated_postures=tuple(place.posture for place in places) if any(p.posture for p in places) else (),
        joints=_joints(places),
        joint_names=joint_names,
        files=tuple(place.file or source for place in places) if any(place.file for place in places) else (),
        external=_external(places),
    )
    return Program(text, path, tuple(places), orientation, read, tuple(notes))


def _external(places: Sequence[Place]) -> dict[str, Array]:
    """Return where axes beside the robot's stand, (N,), mm or deg; an axis that is not stated stays."""
    result = {}
    for name in dict.fromkeys(name for place in places for name in place.external):
        values = [np.nan]
        for place in places:
            values.append(place.external.get(name, values[-1]))
        result[name] = np.array(values[1:])
    return result


def _joints(places: Sequence[Place]) -> Array | None:
    """Return the joint values (N, A) of targets that are written so, NaN elsewhere, or None."""
    count = max(len(place.joints) for place in places)
    if not count:
        return None
    values = np.full((len(places), count), np.nan)
    for row, place in enumerate(places):
        if place.joints:
            values[row] = [slot.value for slot in place.joints]
    return values
