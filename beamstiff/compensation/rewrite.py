"""From a file to the corrected file: every target that has a command gets it, nothing else changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.correct import Correction, correct_path, errors_of
from beamstiff.compensation.editing import ENCODING
from beamstiff.compensation.formats import path_csv
from beamstiff.compensation.formats.program import Program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.load import FromPath, Process, Together
from beamstiff.compensation.resample import resample
from beamstiff.se3 import Array
from beamstiff.shown import Shown


@dataclass(frozen=True, eq=False)
class Compensated(Shown):
    """A corrected file, and what is known of it; N targets.

    Attributes
    ----------
    correction : Correction
    content : bytes
        Of the file.
    after : (N, 6) array
        Error of the real tool with the numbers as the file holds them, rounded. NaN where it cannot follow.
    """

    correction: Correction
    content: bytes
    after: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) bool array: targets that the robot can follow, corrected or not."""
        unknown = np.isnan(self.correction.before) | np.isnan(self.after)
        known: NDArray[np.bool_] = np.logical_not(unknown.any(axis=1))
        return known


def compensate_program(
    program: Program,
    machine: Machine,
    process: Process | None = None,
    *,
    steps: tuple[float, float] | None = None,
    start: Array | None = None,
    taught: bool = False,
    positions_only: bool = False,
) -> Compensated:
    """Return a program with its targets corrected.

    Parameters
    ----------
    program : Program
    machine : Machine
        Its `frames` say where the path lies and which tool it moves.
    process : Process, optional
        Load on the tool, on top of what columns of the path state.
    steps : (float, float), optional
        Resample to at most this distance, m, and turn, rad, a step: the result is a path table then.
    start, taught, positions_only
        As of `correct_path`.

    Raises
    ------
    BeamstiffError
        As of `correct_path` and `resample`. Targets out of reach raise nothing: they are in
        ``correction.reasons`` and stay as they are in the file.
    """
    path = program.path if steps is None else resample(program.path, *steps)
    parts = [FromPath(), *([process] if process is not None else [])]
    load = Together(tuple(parts))
    correction = correct_path(
        machine,
        machine.frames.to_base(path),
        load,
        start=start,
        taught=taught,
        positions_only=positions_only,
    )
    content, written = _written(program, machine, correction, path, steps is not None)
    after = errors_of(machine, correction, machine.frames.to_base(written).poses, load)
    lost = np.flatnonzero(correction.corrected & np.isnan(after).any(axis=1)).tolist()
    if lost:
        correction = correction.without(lost, "its command, rounded as the file needs it, is out of reach")
        content, written = _written(program, machine, correction, path, steps is not None)
        after = errors_of(machine, correction, machine.frames.to_base(written).poses, load)
    return Compensated(correction, content, after)


def _written(
    program: Program, machine: Machine, correction: Correction, path: ToolPath, as_table: bool
) -> tuple[bytes, ToolPath]:
    """Return the file with the commands, and the path that is read from it."""
    commands = machine.frames.to_path(correction.commands)
    if as_table:
        text = path_csv.write(path.moved_to(commands), f"commands that correct {path.source}")
        content = text.encode("utf-8")
        return content, path_csv.read(content.decode(ENCODING), path.source).path
    content = program.with_poses(commands, correction.corrected)
    return content, program.read_again(content).path
