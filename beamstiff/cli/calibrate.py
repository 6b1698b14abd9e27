"""`beamstiff calibrate`: geometry, and compliances if wanted, from measured absolute positions or poses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from beamstiff.cli.options import Assembly, Html, RobotFile, argument, flag, option
from beamstiff.cli.output import Outputs, working, write, write_robot
from beamstiff.cli.parse import file_names, named, parse_deviations, parse_names, robot_file
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from beamstiff.calibration.statement import Statement


def calibrate(
    robot: RobotFile,
    data: Annotated[
        list[str],
        argument(
            "DATA...",
            "CSV tables, one row a state: joint variables, measured position x y z (and rotation vector a b "
            "c), the reflector as `point`, wrench; units in the header, SI otherwise.",
        ),
    ],
    parameters: list[str] | None = option(
        "NAME,...",
        "What to estimate: f3.d, q2 (zero of an encoder), n7.x (place of a reflector), a frame, or the "
        "groups base, target, offsets, frames; default: all.",
    ),
    fix: list[str] | None = option(
        "NAME,...",
        "What to keep, named as in --parameters; `base` if the readings are in the robot's own base frame.",
    ),
    last: list[str] | None = option(
        "NAME,...", "Parameters to hold first where several are indistinguishable."
    ),
    compliances: list[str] | None = option(
        "NAME,...", "Stiffness values to estimate along with the geometry, such as J2.torsional."
    ),
    prior: list[str] | None = option(
        "NAME=STD",
        "Standard deviation about the robot's value, such as f3.d=0.2mm, or frames=0.5mm for all parameters "
        "of a group with this unit; repeatable.",
    ),
    method: str = option("NAME", "levenberg-marquardt or gauss-newton.", "levenberg-marquardt"),
    stations: bool = flag(
        "--stations",
        "The robot or the tracker was moved between the tables: estimate a base for each (base1, base2, "
        "...).",
    ),
    folds: int = option(
        "N", "Number of cross-validation folds for the held-out errors; 0 for none.", 5, min=0
    ),
    test: list[str] | None = option("CSV", "Readings to test the calibrated robot on; repeatable."),
    out: str | None = option("FILE", "Write the calibrated robot: YAML, or .urdf, .sdf, .xml (MJCF)."),
    readings: str | None = option("CSV", "Write the readings in the base frame that was found, for verify."),
    apply_to: list[str] | None = option(
        "CSV=CSV",
        "Write another table, which is not fitted, in the base frame that was found: fresh.csv=moved.csv; "
        "repeatable.",
    ),
    sensitivity: str | None = option("FILE", "Draw how far each parameter moves and turns the tool."),
    recursion: str | None = option("FILE", "Draw the residual over the number of poses used."),
    figure: str | None = option("FILE", "Draw errors and changes, before and after (.png, .svg or .pdf)."),
    assembly: Assembly = None,
    html: Html = None,
) -> None:
    """Calibrate the geometry from measured absolute positions.

    Poses work as well. Weighted least squares over the parameters that the poses can distinguish. The
    others keep their values and are listed with the parameters that they resemble. Gravity, payload
    and loads deform the robot according to its stiffness. By default, the place of the robot's base
    in the tracker's frame is estimated too.

    \b
    Examples:
      beamstiff calibrate robot.yaml poses.csv --out calibrated.yaml --html report.html
      beamstiff calibrate robot.yaml poses.csv --fix base --prior frames=0.5mm --test fresh.csv
      beamstiff calibrate robot.yaml loaded.csv unloaded.csv --compliances J2.torsional,J3.torsional
    """
    from beamstiff.calibration.validation import in_base_frame
    from beamstiff.functions.calibrate import calibrate as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables, refuse_fitted
    from beamstiff.measure.rows import concatenate
    from beamstiff.measure.writer import measurements_to_csv
    from beamstiff.report.geometry import calibration_told

    file = robot_file(robot)
    drawings: dict[str, Any] = {"figure": figure, "sensitivity": sensitivity, "recursion": recursion}
    moved = list(named("--apply-to", apply_to, "CSV=CSV such as fresh.csv=moved.csv", once=False))
    if moved and stations:
        raise BeamstiffError(
            "--apply-to: beside --stations it is not said where the robot stood; leave one out"
        )
    inputs: list[str | Path] = [file, *data, *(test or ()), *(source for source, _ in moved)]
    drawings |= {f"apply_to_{number}": path for number, (_, path) in enumerate(moved, 1)}
    outputs = Outputs(inputs, out=out, readings=readings, html=html, **drawings)
    machine = as_robot(file, assembly=assembly)
    refuse_fitted(test or (), data)
    tables = as_tables(data, machine)
    others = [as_tables(source, machine, what="--apply-to")[0] for source, _ in moved]
    with working(f"calibrating from {sum(map(len, tables))} rows"):
        found = run(
            machine,
            tables,
            parse_names(parameters),
            method,
            fixed=parse_names(fix, "--fix") or (),
            last=parse_names(last, "--last") or (),
            compliances=parse_names(compliances, "--compliances") or (),
            priors=parse_deviations(prior),
            stations=stations,
            folds=folds,
            test=test or (),
        )
    assert found.rows is not None
    assert found.statement is not None
    outputs.result(found.notes, calibration_told(found, [robot, *data]), found.to_dict())
    if out is not None:
        count = len(found.identifiability.identified)
        head = f"# Geometry calibrated by beamstiff: {count} parameters from {file_names(data)}.\n"
        write_robot(out, found.robot, file, found.written_std(machine), head)
    if readings is not None:
        write(readings, measurements_to_csv(in_base_frame(found, concatenate(tables)), machine))
    for (_, path), table in zip(moved, others, strict=True):
        write(path, measurements_to_csv(in_base_frame(found, table), machine))
    statement = found.statement
    outputs.draw("sensitivity", lambda: draw_sensitivity(statement, machine.name))
    outputs.draw("recursion", lambda: draw_recursion(statement, machine.name))
    outputs.draw("figure", found.plot)
    outputs.page("calibration", found, machine, found.rows, files=[robot, *data])


def draw_sensitivity(statement: Statement, name: str) -> Figure:
    """Draw the sensitivity indices of what was sought, and of what a frame needs."""
    from beamstiff.calibration.parameters import SPARE
    from beamstiff.calibration.sensitivity import sensitivity_indices
    from beamstiff.report.geometry import sensitivity_figure

    problem = statement.problem
    indices = sensitivity_indices(problem.geometry, problem.split(statement.begin)[0])
    shown = {item.name for item in problem.geometry.parameters if item.rank != SPARE}
    indices = indices.some(shown | set(statement.identified))
    return sensitivity_figure(indices, f"{name}: sensitivity to geometric errors")


def draw_recursion(statement: Statement, name: str) -> Figure:
    """Draw the way of the recursion."""
    from beamstiff.calibration.recursion import recursion
    from beamstiff.report.geometry import recursion_figure

    given = (statement.problem, statement.begin, statement.identified)
    ways = {"each pose alone": recursion(*given), "all poses so far": recursion(*given, memory=True)}
    return recursion_figure(ways, f"{name}: calibration pose by pose")
