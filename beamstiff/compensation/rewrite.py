"""From a file to the corrected file: every target that has a command gets it, nothing else changes."""

import csv
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.editing import ENCODING
from beamstiff.compensation.follow import resample
from beamstiff.compensation.formats import path_csv
from beamstiff.compensation.formats.program import Program
from beamstiff.compensation.learn import Learned
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath, difference
from beamstiff.compensation.path_correction import Correction, correct_path, error_parts, errors_of
from beamstiff.compensation.process.load import Process, beside_columns
from beamstiff.compensation.uncertainty import correction_std, doubtful
from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.columns import fail
from beamstiff.model.correction import extrapolation_notes
from beamstiff.robot.kinematics import pose_of, posture
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.shown import Shown

ROUNDING = 1e-6  # mm: no error
MOST_TURNS = 3  # of a joint, either way: wrists of robots turn two
COMMON = 0.8  # of the error: where less than that differs along the path, how the base was taught matters


@dataclass(frozen=True)
class Size:
    """How large the errors of a path are: root mean square and largest, mm and degrees."""

    rms_mm: float
    max_mm: float
    rms_deg: float
    max_deg: float


def size_of(errors: Array) -> Size:
    """Return the size of errors (N, 6), m and rad; all zero where there is none."""
    if not len(errors):
        return Size(0.0, 0.0, 0.0, 0.0)
    far = 1e3 * np.linalg.norm(errors[:, :3], axis=1)
    turned = np.degrees(np.linalg.norm(errors[:, 3:], axis=1))
    rms = [float(np.sqrt((values**2).mean())) for values in (far, turned)]
    return Size(rms[0], float(far.max()), rms[1], float(turned.max()))


@dataclass(frozen=True, eq=False, repr=False)
class Compensated(Shown):
    """A corrected file, and what is known of it; N targets."""

    correction: Correction
    content: bytes  # of the file
    # (N, 6): error of the real tool with the numbers as in the file, rounded; NaN where it cannot follow
    after: Array
    machine: Machine
    notes: tuple[str, ...] = ()
    std: Array | None = None  # (N, 6), m and rad: standard deviation of every correction; None: not asked for
    learned: Learned | None = None  # from measured runs, where there were any
    points: bytes | None = None  # of the KRL `.dat` beside it, where targets stand in it
    left_alone: tuple[int, ...] = ()  # targets whose correction is below twice that, where these are to stay
    # (N, 6) each, `error_parts`: where the real robot is another one than the controller's
    parts: Mapping[str, Array] = field(default_factory=dict)
    # of the known targets, `base_errors`; None where it is known how the robot taught the base, or there are
    # several
    common: Array | None = None

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) bool array: targets that the robot can follow, corrected or not."""
        unknown = np.isnan(self.correction.before) | np.isnan(self.after)
        return np.logical_not(unknown.any(axis=1))

    @cached_property
    def extrapolated(self) -> tuple[str, ...]:
        """Which targets are beyond what the real robot's file was fitted at, in sentences."""
        return extrapolation_notes(self.machine.real, self.correction.q[self.known], "targets")

    @property
    def differs_mm(self) -> float | None:
        """RMS of what of the error before is not in a base that the robot itself taught, mm.

        It bends the path, or comes from the process load. None where that is most of the error.
        """
        if self.common is None:
            return None
        errors = self.correction.before[self.known, :3]
        rms, differs = (
            float(1e3 * np.sqrt((part**2).sum(axis=1).mean())) for part in (errors, errors - self.common)
        )
        return differs if rms > ROUNDING and differs < COMMON * rms else None

    @property
    def sizes_by_part(self) -> dict[str, Size]:
        """How large the parts of the error as programmed are, each by itself."""
        return {name: size_of(part[self.known]) for name, part in self.parts.items()}

    @property
    def taught_base(self) -> Array | None:
        """The frame of the path where the real robot taught it, (4, 4), m, base frame; None: it did not."""
        taught = self.correction.taught_base
        return None if taught is None else np.asarray(taught.motion @ self.machine.frames.base)

    def joint_table(self) -> str:
        """Return the joint values at which the controller has each command, CSV in deg and mm.

        Empty where a target was not corrected.
        """
        variables = self.machine.controller.actuated
        units = ["deg" if one.kind == "angle" else "mm" for one in variables]
        heads = [f"{one.name} [{unit}]" for one, unit in zip(variables, units, strict=True)]
        factor = np.array([180.0 / np.pi if unit == "deg" else 1e3 for unit in units])
        text = StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(["name", *heads])
        path = self.correction.path
        for row in range(len(path)):
            missing = row in self.correction.reasons
            values = [] if missing else [f"{value:.5f}" for value in self.correction.q[row] * factor]
            table.writerow([path.called(row), *(values or [""] * len(units))])
        return text.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: errors in mm and deg, everything of single targets in SI."""
        found, known = self.correction, self.known
        names = [variable.name for variable in self.machine.controller.actuated]
        before, after = size_of(found.before[known]), size_of(self.after[known])
        turns, base = vector_from_rotation(found.commands[:, :3, :3]), self.taught_base

        # zero everywhere: nothing states one, which is not to be certain
        stated = self.std is not None and bool(np.nan_to_num(self.std).any())

        def row_of(errors: Array, row: int) -> list[float] | None:
            return None if np.isnan(errors[row]).any() else errors[row].tolist()

        return {
            "format": "beamstiff-compensation/1",
            "before": asdict(before),
            "after": asdict(after),
            "before_by_part": {name: asdict(size) for name, size in self.sizes_by_part.items()},
            **(
                {}
                if base is None
                else {"base_taught": [*base[:3, 3].tolist(), *vector_from_rotation(base[:3, :3]).tolist()]}
            ),
            "improvement": 1 - after.rms_mm / before.rms_mm if before.rms_mm > 0 else None,
            "rounds": found.rounds,
            "unreachable": [
                {"line": int(found.path.lines[row]), "name": found.path.names[row], "reason": reason}
                for row, reason in found.reasons.items()
            ],
            "targets": [
                {
                    "name": name,
                    "line": int(found.path.lines[row]),
                    **({"file": found.path.files[row]} if found.path.files else {}),
                    "corrected": row not in found.reasons,
                    "reason": found.reasons.get(row),
                    "q": dict(zip(names, found.q[row].tolist(), strict=True)),
                    "command": [*found.commands[row, :3, 3].tolist(), *turns[row].tolist()],
                    "wrench": found.wrench[row].tolist(),
                    "before": row_of(found.before, row),
                    "after": row_of(self.after, row),
                    **({} if self.std is None else {"std": row_of(self.std, row) if stated else None}),
                    **({"left_alone": row in self.left_alone} if self.left_alone else {}),
                }
                for row, name in enumerate(found.path.names)
            ],
            **({} if self.learned is None else {"learned": self.learned.to_dict()}),
            "notes": [*self.extrapolated, *self.notes],
        }


def compensate_program(
    program: Program,
    machine: Machine,
    process: Process | None = None,
    *,
    steps: tuple[float, float] | None = None,
    start: Array | None = None,
    taught: bool = False,
    positions_only: bool = False,
    std: Mapping[str, float] | None = None,
    load_std: Array | None = None,
    leave_doubtful: bool = False,
    base_taught: Array | None = None,
) -> Compensated:
    """Return a program with its targets corrected.

    `machine`: its `frames` say where the path lies and which tool it moves. `process`: load on the tool, on
    top of what columns of the path state. `steps`: resample to at most this distance, m, and turn, rad, a
    step: the result is a path table then. `start`, `taught`, `positions_only`, `base_taught`: as of
    `correct_path`. `std`, `load_std`: of stiffness parameters and of the load (6,); with either, or
    `leave_doubtful`, the result has standard deviations. `leave_doubtful`: targets whose correction is below
    twice its own stay as they are.
    """
    path = with_joint_targets(program.path, machine)
    if steps is not None:
        path = resample(path, *steps)
    load = beside_columns(process)
    correction = correct_path(
        machine,
        machine.frames.to_base(path),
        load,
        start=start,
        taught=taught,
        positions_only=positions_only,
        base_taught=base_taught,
    )
    sure: Array | None = None
    left: tuple[int, ...] = ()
    if std is not None or load_std is not None or leave_doubtful:
        sure = _std(machine, correction, std or {}, np.zeros(6) if load_std is None else load_std)
        if leave_doubtful:
            moved = difference(correction.commands, correction.path.poses)
            left = tuple(np.flatnonzero(correction.corrected & doubtful(moved, sure)).tolist())
            commands = correction.commands.copy()
            commands[list(left)] = correction.path.poses[list(left)]
            correction = replace(correction, commands=commands)
    content, written = _written(program, machine, correction, path, steps is not None)
    after = errors_of(machine, correction, machine.frames.to_base(written).poses, load)
    lost = np.flatnonzero(correction.corrected & np.isnan(after).any(axis=1)).tolist()
    if lost:
        correction = correction.without(lost, "its command, rounded as the file needs it, is out of reach")
        content, written = _written(program, machine, correction, path, steps is not None)
        after = errors_of(machine, correction, machine.frames.to_base(written).poses, load)
    content, points = program.files(content)
    parts: dict[str, Array] = {}
    if machine.actual is not None:
        with suppress(BeamstiffError):  # without its effects the robot may find no equilibrium
            parts = error_parts(machine, correction, load, taught)
    return Compensated(
        correction, content, after, machine, std=sure, points=points, left_alone=left, parts=parts
    )


def _std(machine: Machine, found: Correction, std: Mapping[str, float], load_std: Array) -> Array:
    """Return the standard deviations (N, 6) of the corrections; NaN where there is none."""
    result = np.full((len(found.path), 6), np.nan)
    rows = np.flatnonzero(found.corrected & ~np.isnan(found.before[:, 0]))
    if rows.size:
        state = found.q[rows], found.wrench[rows], found.targets[rows]
        result[rows] = correction_std(machine, *state, std, load_std, found.taught_base)
    return result


def _written(
    program: Program, machine: Machine, correction: Correction, path: ToolPath, as_table: bool
) -> tuple[bytes, ToolPath]:
    """Return the file with the commands, and the path that is read from it."""
    commands = machine.frames.to_path(correction.commands)
    if as_table:
        text = path_csv.write(path.moved_to(commands), f"commands that correct {path.source}")
        content = text.encode("utf-8")
        return content, path_csv.read(content.decode(ENCODING), path.source).path
    content = program.with_poses(commands, correction.corrected, correction.q)
    return content, with_joint_targets(program.read_again(content).path, machine)


def with_joint_targets(path: ToolPath, machine: Machine) -> ToolPath:
    """Return a path with the poses of those targets that are written as joint values."""
    if path.joints is None:
        return path
    kinematics, count = machine.kinematics, len(machine.controller.actuated)
    if path.joint_names:
        _check_joint_columns(path, path.joints, machine)
    rows = np.flatnonzero(~np.isnan(path.joints[:, 0]))
    if path.joints.shape[1] != count:
        raise BeamstiffError(
            f"{path.place(int(rows[0]))}: found {path.joints.shape[1]} joint values, expected {count} as of "
            f"robot {machine.controller.name!r}"
        )
    poses, at = path.poses.copy(), machine.frames.to_base(path).poses
    node = pose_of(kinematics, posture(kinematics, path.joints[rows]), machine.controller.tcp)
    at[rows] = node @ machine.frames.tool
    poses[rows] = machine.frames.to_path(at)[rows]
    return path.moved_to(poses)


def _check_joint_columns(path: ToolPath, joints: Array, machine: Machine) -> None:
    """Refuse a table of joint values (N, c) whose columns are not the joints, or angles in degrees."""
    variables, names = machine.controller.actuated, path.joint_names
    numbered = [re.findall(r"\d+", name) for name in names] == [[str(k + 1)] for k in range(len(variables))]
    if not numbered and [*names] != [one.name for one in variables]:
        raise BeamstiffError(
            f"{path.source}: found the columns {listed(names)}, expected x, y, z of the tool, or the joints "
            f"of robot {machine.controller.name!r} in their order: {', '.join(one.name for one in variables)}"
        )
    for column, (name, variable) in enumerate(zip(names, variables, strict=True)):
        far = int(np.abs(joints[:, column]).argmax())
        if variable.kind == "angle" and abs(joints[far, column]) > MOST_TURNS * 2.0 * np.pi:
            found = f"found {joints[far, column]:.6g} rad, more than {MOST_TURNS} turns"
            fail(path.source, int(path.lines[far]), name, f"{found}; degrees have a header {name} [deg]")
