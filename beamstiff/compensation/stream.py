"""Targets of a program on line, and the line protocol that a controller's program speaks.

Lines in, SI, blanks between; poses in the frame of the path, their orientation a rotation vector, loads on
the tool's tip in the base frame of the robot::

    target NAME [fx fy fz mx my mz]       of the path, by name (or #3, the third); default: its own load
    pose x y z a b c [fx fy fz mx my mz]  any other pose
    quit

Lines out, one each::

    ready beamstiff-stream/1 TARGETS JOINTS
    ok x y z a b c  sx sy sz sa sb sc  q1 ... qA  warm|cold  corrected|left
    error MESSAGE
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.compensation.formats.program import Program
from beamstiff.compensation.online import OnlineCompensation, OnlineCorrection
from beamstiff.compensation.process.load import Process, beside_columns
from beamstiff.compensation.rewrite import with_joint_targets
from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.se3 import Array, rotation_from_vector, transform, vector_from_rotation

FORMAT = "beamstiff-stream/1"


@dataclass(frozen=True, eq=False)
class OnlineTargets:
    """A program whose targets are corrected one by one."""

    program: Program
    online: OnlineCompensation
    poses: Array  # (N, 4, 4): targets, base frame
    wrench: Array  # (N, 6): what path and process say of their load

    def command(self, name: str | int, wrench: ArrayLike | None = None) -> OnlineCorrection:
        """Return the answer to a target, by name or number (0 the first), under a load (6,) or its own."""
        row = self.row(name)
        load = self.wrench[row] if wrench is None else np.asarray(wrench, dtype=np.float64)
        return self.online.correct(self.poses[row], load)

    def command_at(self, pose: Array, wrench: ArrayLike) -> OnlineCorrection:
        """Return the answer to any pose (4, 4) of the tool, base frame, m, under a load (6,)."""
        return self.online.correct(pose, np.asarray(wrench, dtype=np.float64))

    def row(self, name: str | int) -> int:
        """Return the number of a target."""
        names = self.program.path.names
        if isinstance(name, str):
            if name in names:
                return names.index(name)
            raise BeamstiffError(f"found no target {shown(name)}{suggest(name, names)}")
        if not 0 <= name < len(names):
            raise BeamstiffError(f"found target number {name + 1}, expected 1 to {len(names)}")
        return name

    def serve(self, lines: Iterable[str], write: Callable[[str], object]) -> None:
        """Answer every line until ``quit`` or the end; a faulty line gets an error and no command."""
        joints = len(self.online.machine.controller.actuated)
        write(f"ready {FORMAT} {len(self.poses)} {joints}")
        for line in lines:
            words = line.split()
            if not words:
                continue
            if words[0] == "quit":
                return
            try:
                write(self._reply(words))
            except BeamstiffError as error:
                write(f"error {error}")

    def _reply(self, words: list[str]) -> str:
        base = self.online.machine.frames.base
        if words[0] == "target" and len(words) > 1:
            name, load = " ".join(words[1:]), list[str]()
            if name not in self.program.path.names and len(words) > 7:  # names may hold blanks: LIN 14
                name, load = " ".join(words[1:-6]), words[-6:]
            row = self.row(int(name[1:]) - 1 if name[:1] == "#" and name[1:].isdigit() else name)
            frame = base[row] if base.ndim > 2 else base
            answer = self.command(row, _numbers(load) if load else None)
        elif words[0] == "pose" and len(words) in (7, 13):
            if base.ndim > 2:
                raise BeamstiffError("pose: the path has several frames, expected target NAME")
            frame, values = base, _numbers(words[1:])
            pose = transform(rotation_from_vector(values[None, 3:6]), values[None, :3])[0]
            answer = self.command_at(frame @ pose, values[6:] if len(values) > 6 else np.zeros(6))
        else:
            raise BeamstiffError(
                f"found {shown(' '.join(words))}, expected target NAME [6 numbers], pose with 6 or 12, "
                "or quit"
            )
        here = np.linalg.solve(frame, answer.command)
        turn = frame[:3, :3].T
        # in another frame, as those of independent components
        std = np.concatenate([np.sqrt(turn**2 @ part**2) for part in (answer.std[:3], answer.std[3:])])
        numbers = [*here[:3, 3], *vector_from_rotation(here[None, :3, :3])[0], *std, *answer.q]
        state = f"{'warm' if answer.warm else 'cold'} {'left' if answer.left_alone else 'corrected'}"
        return f"ok {' '.join(f'{value:.9g}' for value in numbers)} {state}"


def prepared(
    program: Program, online: OnlineCompensation, load: Process | None, start: Array | None
) -> OnlineTargets:
    """Return a program's targets, made ready under the loads that path and process say."""
    path = online.machine.frames.to_base(with_joint_targets(program.path, online.machine))
    wrench = beside_columns(load).wrench(path.poses, path)
    if reasons := online.prepare(path, wrench, start):
        row, reason = next(iter(reasons.items()))
        raise BeamstiffError(f"{path.place(row)}: {reason}")
    return OnlineTargets(program, online, path.poses, wrench)


def _numbers(words: list[str]) -> Array:
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise BeamstiffError(f"found {shown(' '.join(words))}, expected numbers, SI") from None
    if not np.isfinite(values).all():
        raise BeamstiffError("found a number that is not finite")
    return values
