"""`beamstiff verify`: a robot with its effects on fresh rows, promised against true."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from beamstiff.cli.options import Assembly, DataFiles, RobotFile, flag, option
from beamstiff.cli.output import QUIET, Outputs, say, working
from beamstiff.cli.parse import robot_file

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot

TOO_LARGE = 3  # exit code of a gap beyond --max-gap


def verify(
    robot: RobotFile,
    data: DataFiles,
    refit_frame: bool = flag("--refit-frame", "The measuring frame is not the base frame: fit it first."),
    nominal: str | None = option("ROBOT", "Show the error of this robot too: the file before calibration."),
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
      beamstiff verify real.urdf fresh.csv --refit-frame --nominal arm.urdf
      beamstiff verify kr240-2 loads.csv --engine mujoco
    """
    from beamstiff.functions.robots import as_robot
    from beamstiff.functions.verify import verify as run
    from beamstiff.report.verification import verification_told
    from beamstiff.units import in_unit

    outputs = Outputs([robot_file(robot), *data])
    if engine is not None:
        _second_opinion(outputs, as_robot(robot, assembly=assembly), data, engine)
        return
    limit = None if max_gap is None else in_unit(max_gap, "m")
    with working("verifying"):
        found = run(
            as_robot(robot, assembly=assembly),
            data,
            refit_frame=refit_frame,
            nominal=None if nominal is None else as_robot(nominal, "--nominal", assembly=assembly),
        )
    told = verification_told(found, robot, data, refit_frame)
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
