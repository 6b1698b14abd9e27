"""`beamstiff deflect`: the displacement that the model predicts for each row of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from beamstiff.cli.options import (
    COLUMNS,
    Assembly,
    Html,
    Preload,
    Repaired,
    RobotFile,
    argument,
    flag,
    option,
)
from beamstiff.cli.output import Outputs, note, working, write
from beamstiff.cli.parse import parse_variables, parse_wrench, robot_file, without_repaired
from beamstiff.errors import BeamstiffError, optional

if TYPE_CHECKING:
    from beamstiff.measure.table import Measurements
    from beamstiff.robot.description import Robot


def deflect(
    robot: RobotFile,
    data: Annotated[
        str | None, argument("[DATA]", f"CSV table, {COLUMNS} Not needed with --wrench or --weight.")
    ] = None,
    q: list[str] | None = option(
        "NAME=VALUE,...",
        "With --wrench or --weight: actuated joint variables; a number is rad or m. Those not named are 0, "
        "passive ones are solved. Default: the reference posture of `beamstiff show`.",
    ),
    wrench: list[str] | None = option(
        "NAME=VALUE,...",
        "In place of DATA: a load on the TCP, base frame, such as fz=-900N,mx=20; the others are 0.",
    ),
    weight: bool = flag(
        "--weight", "In place of DATA: own weight and payload (`masses`), with --wrench that load as well."
    ),
    preload: Preload = False,
    assembly: Assembly = None,
    repaired: Repaired = None,
    out: str | None = option("FILE", "Write the loads with the predicted displacements as a CSV table."),
    vtu: str | None = option(
        "FILE", "Write the deformed structure of the row that moves most, or of --line, for ParaView (.vtu)."
    ),
    line: int | None = option("N", "With --vtu: the line of the row in DATA."),
    html: Html = None,
) -> None:
    """Predict displacements of a table of postures and loads, or of one load.

    The prediction is linear, loaded minus unloaded (C wrench), in the base frame. It is the
    displacement of the TCP, or of the row's `point`, under the wrench at the TCP, or at the row's
    `load_point`. Measured displacements may be missing; where present, the gap to the prediction is
    printed. For absolute positions (x y z), the places of the points in the base frame are predicted,
    under weight, payload and load.

    --preload calculates equilibria to second order in the loads, with the geometric stiffness K_C: the
    displacement under gravity, payload and the row's wrench, minus that under gravity and payload. A
    load under which the machine buckles is an error.

    Effects that the robot has (`effects:`, such as backlash) are added, but for those that are --repaired.

    \b
    Examples:
      beamstiff deflect cantilever loads.csv
      beamstiff deflect ir663 --q q2=10deg,q8=45deg --wrench fz=-900N
      beamstiff deflect kr240-2 --weight --q q2=30deg
      beamstiff deflect ir663 measured.csv --json predicted.json --out predicted.csv
      beamstiff deflect kr240-2 loads.csv --preload --html report.html
      beamstiff deflect kr240-2 loads.csv --vtu shape.vtu --line 3

    \b
    A table of loads (passive joint variables are solved, missing wrench columns are 0):
      q2 [deg],q8 [deg],fx [N],fz [N]
      1.37,48.63,-900,0
      12.54,33.04,0,-900
    """
    from beamstiff.functions.predict import predict
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.measure.writer import measurements_to_csv
    from beamstiff.report.deflection import deflection_told
    from beamstiff.robot.stiffness_parameters import check_stiffness

    machine = without_repaired(as_robot(robot, assembly=assembly), repaired)
    if not machine.effects:
        check_stiffness(machine)  # before the table: no table helps
    load = parse_wrench(wrench)
    if (data is None) == (load is None and not weight):
        found = (
            "neither DATA nor --wrench nor --weight" if data is None else "DATA beside --wrench or --weight"
        )
        raise BeamstiffError(f"found {found}, expected a table of loads, or one load")
    if data is not None and q is not None:
        raise BeamstiffError("--q: goes with --wrench or --weight; DATA has its own joint values")
    outputs = Outputs([robot_file(robot), *([data] if data else [])], out=out, vtu=vtu, html=html)
    if vtu is not None and Path(vtu).suffix.lower() != ".vtu":
        raise BeamstiffError(f"--vtu {vtu}: found the ending {Path(vtu).suffix!r}, expected .vtu")
    if line is not None and vtu is None:
        raise BeamstiffError("--line: goes with --vtu")
    if data is not None:
        (loads,) = as_tables(data, machine, require_measured=False)
    else:
        loads = _one_row(machine, parse_variables(machine, q), load, weight)
    shape_of = None if line is None else _row_of(loads, line)
    with working(f"deflecting {len(loads)} rows"):
        result = predict(machine, loads, preload=preload)
        shown = list(deflection_told(result))  # of numbers that may overflow
    outputs.result(result.notes, shown, result.to_dict())
    if out is not None:
        write(out, measurements_to_csv(result.to_measurements(), machine))
    if vtu is not None:
        most = int((result.displacement[:, :3] ** 2).sum(axis=1).argmax())
        with optional(vtu, note):
            _write_shape(machine, loads, most if shape_of is None else shape_of, vtu)
    outputs.page("deflection", result)


def _one_row(
    robot: Robot, values: Mapping[str, float], wrench: Sequence[float] | None, weight: bool
) -> Measurements:
    """Return the table of one posture, by default the reference posture, under one load on the TCP.

    `weight`: of a position, which own weight and payload move as well, in place of a displacement.
    """
    import numpy as np

    from beamstiff.measure.table import make_measurements
    from beamstiff.robot.kinematics import reference_posture

    names = [item.name for item in robot.actuated]
    row = np.array([values.get(name, 0.0) for name in names]) if values else reference_posture(robot)
    if not values and row.any():
        note("no --q: the reference posture, the middle of the joint limits where the loops close")
    unread = np.full((1, 3), np.nan) if weight else None
    source = "--wrench" if wrench is not None else "--weight"
    wrench = np.zeros(6).tolist() if wrench is None else wrench
    return make_measurements(names, row[None], tcp=robot.tcp, wrench=[wrench], position=unread, source=source)


def _row_of(loads: Measurements, line: int) -> int:
    """Return the row that stands on a line of the table."""
    lines: list[int] = loads.rows.tolist()
    if line not in lines:
        raise BeamstiffError(
            f"--line {line}: is no row of {loads.source}, expected a line from {lines[0]} to {lines[-1]}"
        )
    return lines.index(line)


def _write_shape(robot: Robot, loads: Measurements, row: int, path: str) -> None:
    """Write the structure as the load of a row deforms it."""
    from beamstiff.report.vtk import vtu_text

    shape = vtu_text(robot, loads.q[row], loads.wrench[row], point=str(loads.load_point[row]))
    where = f"the structure under the load of line {loads.rows[row]}"
    write(path, shape, f"{where}, linear, without gravity; warp by `displacement`")
