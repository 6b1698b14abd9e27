"""`beamstiff verify`: a robot with its effects on fresh rows, promised against true."""

from __future__ import annotations

import typer

from beamstiff.cli.options import Assembly, DataFiles, RobotFile, option, robot_file
from beamstiff.cli.output import QUIET, Outputs, say, working
from beamstiff.report.tables import add_rows, table

TOO_LARGE = 3  # exit code of a gap beyond --max-gap


def verify(
    robot: RobotFile,
    data: DataFiles,
    refit_frame: bool = typer.Option(
        False, "--refit-frame", help="The measuring frame is not the base frame: fit it first."
    ),
    max_gap: str | None = option("LENGTH", "Exit with 3 where a larger gap is left: 0.2mm."),
    assembly: Assembly = None,
) -> None:
    """Check a robot with its effects on fresh measurements.

    Compares the robot, without and with its effects, with rows that were not fitted. Rows are
    displacements or absolute positions. The effects are those that `diagnose --apply` wrote; each
    is added in turn. `promised` is the share of the gap that they closed on held-out postures when
    they were found, `true` the share that they close here.

    \b
    Examples:
      beamstiff verify real.yaml fresh.csv
      beamstiff verify real.yaml fresh.csv --refit-frame --max-gap 0.2mm
    """  # noqa: D301
    from beamstiff.diagnosis.verify import MODEL
    from beamstiff.functions.robots import as_robot
    from beamstiff.functions.verify import verify as run
    from beamstiff.units import in_unit

    outputs = Outputs([robot_file(robot), *data])
    limit = None if max_gap is None else in_unit(max_gap, "m")
    with working("verifying"):
        found = run(as_robot(robot, assembly=assembly), data, refit_frame=refit_frame)
    modelled = any(name.startswith(MODEL) for name, _, _ in found.causes)
    rows = table(f"Position error on {found.rows} rows, RMS", "robot", "error", "closes")
    lines = [
        ["without model and effects" if modelled else "without effects", f"{1e3 * found.before:.4f} mm", ""]
    ]
    lines += [
        [f"and {name}", f"{1e3 * after:.4f} mm", f"{closes:.0%}"] for name, after, closes in found.causes
    ]
    add_rows(rows, [*lines, ["noise as stated", f"{1e3 * found.noise:.4f} mm", ""]])
    known = found.causes and found.promised is not None
    said = [f"Promised {found.promised:.0%} of the gap, true {found.true:.0%}."] if known else []
    outputs.result(found.notes, [rows, *said], found.to_dict())
    if limit is not None and found.after > limit:
        say(f"gap: {1e3 * found.after:.4g} mm is left, more than {1e3 * limit:.4g} mm", QUIET.get())
        raise typer.Exit(TOO_LARGE)
