"""`beamstiff verify`: a robot with its effects on fresh rows, promised against true."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from beamstiff.cli.options import Assembly, DataFiles, RobotFile, flag, option
from beamstiff.cli.output import QUIET, Outputs, say, working
from beamstiff.cli.parse import robot_file

if TYPE_CHECKING:
    from rich.console import RenderableType

    from beamstiff.robot.description import Robot

REFITTED = (
    "The measuring frame was fitted to these rows, without and with the effects: an error shared by all rows "
    "disappears in that fit. The promised share still includes it."
)
NOTHING_TO_COMPARE = (
    "There is no before and after: the robot file holds no effects and no model (beamstiff diagnose --apply "
    "writes them)."
)
SQUARES = "Shares refer to squared errors: with 75 % closed, half of the gap is left."
TOO_LARGE = 3  # exit code of a gap beyond --max-gap


def verify(
    robot: RobotFile,
    data: DataFiles,
    refit_frame: bool = flag("--refit-frame", "The measuring frame is not the base frame: fit it first."),
    max_gap: str | None = option("LENGTH", "Exit with code 3 if a larger gap is left, such as 0.2mm."),
    engine: str | None = option(
        "NAME", "Compare deflections with those of a physics engine instead: mujoco (extra of this name)."
    ),
    assembly: Assembly = None,
) -> None:
    """Check a robot with its effects on fresh measurements.

    Compares the robot, without and with its effects, with rows that were not fitted. Rows are
    displacements or absolute positions. The effects are those that `diagnose --apply` wrote; each
    is added in turn. `promised` is the share of the gap that they closed on held-out postures when
    they were found, `true` the share that they close here.

    With --engine, rows are postures and loads only. The deflection (as of deflect --preload) is
    compared with that of the exported model (`beamstiff convert --out robot.xml`) in the engine, with
    its drives held exactly.

    \b
    Examples:
      beamstiff verify real.yaml fresh.csv
      beamstiff verify real.yaml fresh.csv --refit-frame --max-gap 0.2mm
      beamstiff verify kr240-2 loads.csv --engine mujoco
    """
    from beamstiff.diagnosis.notes import in_words
    from beamstiff.diagnosis.verify import MODEL
    from beamstiff.functions.robots import as_robot
    from beamstiff.functions.verify import verify as run
    from beamstiff.report.diagnosis_words import percent
    from beamstiff.report.tables import table
    from beamstiff.report.verdict import Level, Verdict, diagnose_command, level_of, rounded
    from beamstiff.units import in_unit

    outputs = Outputs([robot_file(robot), *data])
    if engine is not None:
        _second_opinion(outputs, as_robot(robot, assembly=assembly), data, engine)
        return
    limit = None if max_gap is None else in_unit(max_gap, "m")
    with working("verifying"):
        found = run(as_robot(robot, assembly=assembly), data, refit_frame=refit_frame)
    modelled = any(name.startswith(MODEL) for name, _, _ in found.causes)
    first = "without model and effects" if modelled else "without effects" if found.causes else "robot file"
    lines = [[first, f"{1e3 * found.before:.3f} mm", ""]]
    lines += [
        [f"{'and' if at else 'with'} {in_words([name])}", f"{1e3 * after:.3f} mm", percent(closes)]
        for at, (name, after, closes) in enumerate(found.causes)
    ]
    if found.noise > 0.0:
        lines.append(["noise as stated", f"{1e3 * found.noise:.3f} mm", ""])
    rows = table(f"Position error on {found.rows} rows, RMS", "robot", "error", "closes", rows=lines)
    level: Level = level_of(found.after / found.noise) if found.noise > 0.0 else "plain"
    with_them = "with the file's effects" if found.causes else "of the robot file as it is"
    times = f", {found.after / found.noise:.1f} times the noise" if found.noise > 0.0 else ""
    head = f"Position error {rounded(1e3 * found.after)} mm {with_them}{times}"
    files = ", ".join(Path(path).name for path in data)
    again = (  # beside effects that are known few rows tell little more
        "Take the robot file as it was before its effects were added, and diagnose its rows and these "
        f"together: {diagnose_command(['FIRST_ROBOT', 'FIRST_ROWS', *data])}"
        f"{' (--stations if the tracker has moved since)' * found.absolute}."
    )
    action = "Use the robot within these postures and loads."
    if found.causes:
        action += " This confirms what is predicted, not the cause: its look-alikes may predict as well."
    if level in ("doubtful", "differs"):
        action = f"Something is still missing: {diagnose_command([robot, *data])} finds what."
        if found.causes:
            action = f"Something is still missing, and these rows alone hardly tell what. {again}"
        elif found.absolute:
            action += " The place of a reflector is fitted there as well, if that is all."
    steps = pairwise([found.before, *(after for _, after, _ in found.causes)])
    worse = [
        name for (name, _, _), (before, after) in zip(found.causes, steps, strict=True) if after > before
    ]
    if worse:
        action = f"Remove from the robot file what makes these rows worse: {in_words(worse)}. {action}"
    if found.promised is not None and found.before > found.noise and found.true < 0.5 * found.promised:
        head += (
            f": its effects close {percent(found.true)} of the gap, promised were {percent(found.promised)}"
        )
        level = "differs"
    if found.after > found.before:
        level = "differs"
        head = (
            f"The file's effects make these rows worse: position error {rounded(1e3 * found.before)} mm "
            f"without them, {rounded(1e3 * found.after)} mm with them"
        )
        action = f"Do not use this robot. What makes these rows worse: {in_words(worse)}. {again}"
    if found.other_frame is not None:
        head = (
            f"The measuring frame is not exactly the robot's base frame: position error "
            f"{rounded(1e3 * found.after)} mm, {rounded(1e3 * found.other_frame)} mm with the frame fitted"
        )
        level, action = "differs", "Run it again with --refit-frame."
    doubt = ""
    if found.fitted:
        doubt = (
            f"The robot file was fitted to {found.fitted} of these {found.rows} rows, which cannot test it. "
            "Take rows that it has not seen."
        )
    verdict = Verdict(head, level, f"{files}, {found.rows} rows", action, doubt=doubt)
    said = [] if found.causes else [NOTHING_TO_COMPARE]
    if found.causes and found.promised is not None and found.other_frame is None:
        said = [f"Promised: {percent(found.promised)} of the gap closes. True: {percent(found.true)}."]
    if found.causes and refit_frame:
        said.append(REFITTED)
    said += [SQUARES] if found.causes else []
    told: list[RenderableType] = [*verdict.lines()]
    if found.other_frame is None:  # errors in another frame say nothing of the effects
        told += [rows, *said]
    outputs.result(found.notes, told, found.to_dict())
    if limit is not None and found.after > limit:
        say(f"gap: {1e3 * found.after:.4g} mm is left, more than {1e3 * limit:.4g} mm", QUIET.get())
        raise typer.Exit(TOO_LARGE)


def _second_opinion(outputs: Outputs, robot: Robot, data: list[str], engine: str) -> None:
    import numpy as np

    from beamstiff.functions.verify import second_opinion
    from beamstiff.report.tables import table

    with working(f"solving in {engine}"):
        found = second_opinion(robot, data, engine=engine)
    title = f"Deflection of {len(found.other)} rows, position"
    sizes = [np.linalg.norm(part[:, :3], axis=1) for part in (found.displacement, found.other)]
    worst = np.argsort(-found.difference, kind="stable")[:10]
    numbers = zip(worst.tolist(), *(1e3 * size[worst] for size in (*sizes, found.difference)), strict=True)
    lines = ([str(row + 1), *(f"{one:.4f} mm" for one in some)] for row, *some in numbers)
    rows = table(title, "row", "beamstiff", engine, "difference", rows=lines)
    said = f"The two differ by {found.relative:.2e} of the deflection (RMS); the table lists the worst rows."
    outputs.result(found.notes, [rows, said], found.to_dict())
