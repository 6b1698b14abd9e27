"""`beamstiff deflect`: the displacement that the model predicts for each row of a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamstiff.cli.data import doubted, read_tables
from beamstiff.cli.options import DataFile, Debug, Html, Json, Preload, Quiet, RobotFile, robot_file
from beamstiff.cli.output import check_outputs, effects_text, people, say, source_of, working, write_json
from beamstiff.errors import BeamstiffError
from beamstiff.outputs import write_output
from beamstiff.report.tables import add_rows, number, table

if TYPE_CHECKING:
    from rich.table import Table

    from beamstiff.measure.table import Measurements
    from beamstiff.robot.description import Robot
    from beamstiff.se3 import Array


ROUNDING = 1e-12


def deflect(
    context: typer.Context,
    robot: RobotFile,
    data: DataFile,
    preload: Preload = False,
    json: Json = None,
    out: Annotated[
        str | None,
        typer.Option(
            "--out", metavar="FILE", help="Write the loads with the predicted displacements as a CSV table."
        ),
    ] = None,
    vtu: Annotated[
        str | None,
        typer.Option(
            "--vtu",
            metavar="FILE",
            help="Write the deformed structure for ParaView (.vtu): of the row that moves most, or --line.",
        ),
    ] = None,
    line: Annotated[
        int | None, typer.Option("--line", metavar="N", help="With --vtu: the line of DATA whose row it is.")
    ] = None,
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Predict the displacement of each row of a table of postures and loads.

    Linear, loaded minus unloaded: C wrench, base frame, at the TCP or the row's `point`, under the
    wrench at the TCP or the row's `load_point`. Columns of measured displacements may be missing;
    where they are there, the gap to the prediction is told.

    --preload adds the geometric stiffness K_C on the undeformed geometry: the displacement under
    gravity, payload and the row's wrench, less that under gravity and payload, each with the
    stiffness that its own loads leave. A load under which the machine buckles is refused.

    Effects that the robot has (`effects:`, such as backlash) are added.

    \b
    Examples:
      beamstiff deflect cantilever loads.csv
      beamstiff deflect ir663 measured.csv --json predicted.json --out predicted.csv
      beamstiff deflect kr240-2 loads.csv --preload --html report.html
      beamstiff deflect kr240-2 loads.csv --vtu shape.vtu --line 3

    \b
    A table of loads (passive joint variables are solved, missing wrench columns are 0):
      q2 [deg],q8 [deg],fx [N],fz [N]
      1.37,48.63,-900,0
      12.54,33.04,0,-900
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.model.linear import predict_displacements
    from beamstiff.robot.reader import load_robot
    from beamstiff.robot.stiffness import check_stiffness

    description = load_robot(robot)
    if not description.effects:
        check_stiffness(description)
    check_outputs([robot_file(robot), data], json, out=out, vtu=vtu, html=html)
    if vtu is not None and Path(vtu).suffix.lower() != ".vtu":
        raise BeamstiffError(f"--vtu {vtu}: found the ending {Path(vtu).suffix!r}, expected .vtu")
    if line is not None and vtu is None:
        raise BeamstiffError("--line: goes with --vtu")
    source = source_of(context, html, [robot_file(robot), data])
    (loads,), notes = read_tables([data], description, require_measured=False)
    shape_of = None if line is None else _row_of(loads, line)
    with doubted(notes), working(f"deflecting {len(loads)} rows", quiet):
        predicted = predict_displacements(description, loads, preload)
        if description.effects:
            from beamstiff.diagnosis.apply import effects_displacement

            predicted = predicted + effects_displacement(description, replace(loads, kind="displacement"))
        gap = gap_text(loads, predicted)

    for note in notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    console.print(_table(description, loads, predicted, preload))
    said = [gap] if gap else []
    if description.effects:
        said.append(f"With the robot's effects: {effects_text(description.effects)}.")
    console.print("\n".join(said))
    if out is not None:
        write_output(out, _csv(description, loads, predicted, preload))
    if vtu is not None:
        most = (predicted[:, :3] ** 2).sum(axis=1).argmax()
        console.print(_write_shape(description, loads, int(most) if shape_of is None else shape_of, vtu))
    facts = {"displacement": predicted.tolist()}
    if html is not None and source is not None:
        from beamstiff.report.html.deflection import deflection_html

        if preload:
            said.append("With gravity and K_C; the shape that is drawn is the linear one, without them.")
        write_output(html, deflection_html(description, loads, predicted, source, facts, notes, said))
    write_json(facts, json)


def _row_of(loads: Measurements, line: int) -> int:
    """Return the row that stands on a line of the table."""
    lines: list[int] = loads.rows.tolist()
    if line not in lines:
        raise BeamstiffError(
            f"--line {line}: is no row of {loads.source}, expected a line from {lines[0]} to {lines[-1]}"
        )
    return lines.index(line)


def _write_shape(robot: Robot, loads: Measurements, row: int, path: str) -> str:
    """Write the structure as the load of a row deforms it, and return what was written."""
    from beamstiff.report.vtk import vtu_text

    write_output(path, vtu_text(robot, loads.q[row], loads.wrench[row], point=str(loads.load_point[row])))
    where = f"the structure under the load of line {loads.rows[row]}"
    return f"{path}: {where}, linear, without gravity; warp by `displacement`."


def gap_text(measured: Measurements, predicted: Array) -> str:
    """Return a sentence on the gap between measured and predicted positions; empty where none is measured."""
    import numpy as np

    if measured.kind == "absolute" and measured.measured_mask.any():
        return "Its positions (x y z) are not compared: `beamstiff diagnose` and `calibrate` take them."
    known = measured.measured_mask[:, :3]
    rows = known.any(axis=1)
    if not rows.any():
        return ""
    gap = np.where(known, measured.displacement[:, :3] - predicted[:, :3], 0.0)
    norm = 1e3 * np.linalg.norm(gap[rows], axis=1)
    return (
        f"Gap between measured and predicted position: RMS {number(np.sqrt((norm**2).mean()))} mm, "
        f"at most {number(norm.max())} mm, over {norm.size} rows."
    )


def _table(robot: Robot, loads: Measurements, predicted: Array, preload: bool) -> Table:
    import numpy as np

    from beamstiff.measure.table import DISPLACEMENT

    units = ("mm",) * 3 + ("mrad",) * 3
    seen = loads.measured_mask & (loads.kind == "displacement")
    compared = np.flatnonzero(seen.any(axis=0)).tolist()
    columns = [f"{name} [{unit}]" for name, unit in zip(DISPLACEMENT, units, strict=True)]
    title = f"{robot.name}: predicted displacement, loaded minus unloaded, base frame"
    title += ", with gravity and K_C" if preload else ""
    result = table(title, "line", *columns, *(f"measured {columns[at]}" for at in compared))
    scaled, measured = 1e3 * without_rounding(predicted), 1e3 * loads.displacement
    add_rows(
        result,
        (
            [
                str(line),
                *map(number, scaled[row]),
                *("" if np.isnan(measured[row, at]) else number(measured[row, at]) for at in compared),
            ]
            for row, line in enumerate(loads.rows.tolist())
        ),
    )
    return result


def without_rounding(displacement: Array) -> Array:
    """Return displacements with what is rounding beside the largest of them (m, rad) set to 0."""
    import numpy as np

    size = np.abs(displacement)
    return np.where(size > ROUNDING * size.max(initial=0.0), displacement, 0.0)


def _csv(robot: Robot, loads: Measurements, predicted: Array, preload: bool) -> str:
    from beamstiff.measure import make_measurements, measurements_to_csv

    how = "predicted by beamstiff" + (" with --preload" if preload else "")
    table_of_predictions = make_measurements(
        loads.variables,
        loads.q,
        tcp=robot.tcp,
        wrench=loads.wrench,
        displacement=predicted,
        point=loads.point,
        load_point=loads.load_point,
        pose=loads.pose,
        step=loads.step,
        time=loads.time,
        temperature=loads.temperature,
        metadata={"source": f"{how}, robot {robot.name}; loads of {loads.source}"},
        source=loads.source,
        units=loads.units,
    )
    return measurements_to_csv(table_of_predictions, robot)
