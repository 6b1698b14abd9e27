"""`beamstiff calibrate`: geometry, and compliances if wanted, from measured absolute positions or poses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamstiff.cli.options import Debug, Html, Json, Quiet, RobotFile, option, parse_names, robot_file
from beamstiff.cli.output import (
    check_outputs,
    optional_file,
    people,
    say,
    source_of,
    working,
    write_figure,
    write_json,
)
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.calibration.result import Calibration
    from beamstiff.calibration.statement import Statement


def calibrate(
    context: typer.Context,
    robot: RobotFile,
    data: Annotated[
        list[str],
        typer.Argument(
            metavar="DATA...",
            help="CSV tables, one row a state: joint variables, measured position x y z (and rotation vector "
            "a b c), the reflector as `point`, wrench; units in the header, SI otherwise.",
        ),
    ],
    parameters: list[str] | None = option(
        "NAME,...",
        "What to seek: f3.d, q2 (an encoder's zero), n7.x (a reflector's place), a frame, or base, "
        "target, offsets, frames; default all.",
    ),
    fix: list[str] | None = option(
        "NAME,...", "What stays, likewise; `base` where the readings are in the robot's own base frame."
    ),
    last: list[str] | None = option("NAME,...", "Of parameters that cannot be told apart, hold these first."),
    compliances: list[str] | None = option(
        "NAME,...", "Stiffness values to estimate along with the geometry, such as J2.torsional."
    ),
    prior: list[str] | None = option(
        "NAME=STD",
        "Known to within a standard deviation, such as f3.d=0.2mm; of a group (frames=0.5mm) those "
        "of the unit; repeatable.",
    ),
    method: str = option("NAME", "levenberg-marquardt or gauss-newton.", "levenberg-marquardt"),
    stations: bool = typer.Option(
        False,
        "--stations",
        help="Every table has a base of its own (base1, base2, ...): robot or tracker were moved.",
    ),
    folds: int = option("N", "Folds of the errors held out; 0 for none.", 5, min=0),
    test: list[str] | None = option("CSV", "Readings to test the calibrated robot on; repeatable."),
    out: str | None = option("FILE", "Write the calibrated robot as YAML."),
    readings: str | None = option("CSV", "Write the readings in the base frame found, for diagnose."),
    sensitivity: str | None = option("FILE", "Draw how far each parameter moves and turns the tool."),
    recursion: str | None = option("FILE", "Draw the residual, pose after pose counted in."),
    figure: str | None = option("FILE", "Draw errors and changes, before and after (.png, .svg or .pdf)."),
    json: Json = None,
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Calibrate the geometry of a robot from measured absolute positions, or poses.

    Weighted least squares over the parameters that the poses can tell apart; the others are named, with
    what they look like, and stay. Gravity, payload and loads act as the robot's stiffness says. Where
    the readings are in a frame of the tracker's own, the robot's base is sought in it (default).

    \b
    Examples:
      beamstiff calibrate robot.yaml poses.csv --out calibrated.yaml --html report.html
      beamstiff calibrate robot.yaml poses.csv --fix base --prior frames=0.5mm --test fresh.csv
      beamstiff calibrate robot.yaml loaded.csv unloaded.csv --compliances J2.torsional,J3.torsional
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.calibration.validation import in_base_frame
    from beamstiff.functions.calibrate import calibrate as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables, refuse_fitted
    from beamstiff.measure.writer import measurements_to_csv
    from beamstiff.outputs import write_output
    from beamstiff.report.geometry import calibration_text, dependent_table, errors_table, parameters_table
    from beamstiff.robot.yaml_edit import robot_yaml

    file = robot_file(robot)
    outputs = {"out": out, "readings": readings, "html": html}
    drawings = {"figure": figure, "sensitivity": sensitivity, "recursion": recursion}
    check_outputs([file, *data, *(test or ())], json, **outputs, **drawings)
    for drawing in drawings.values():
        if drawing is not None:
            from beamstiff.report.figures import check_format

            check_format(drawing)
    source = source_of(context, html, [file, *data, *(test or ())])
    machine = as_robot(file)
    refuse_fitted(test or (), data)
    tables = as_tables(data, machine)
    with working(f"calibrating from {sum(map(len, tables))} rows", quiet):
        found = run(
            machine,
            tables,
            parse_names(parameters),
            method,
            fixed=parse_names(fix, "--fix") or (),
            last=parse_names(last, "--last") or (),
            compliances=parse_names(compliances, "--compliances") or (),
            priors=parse_priors(prior or ()),
            stations=stations,
            folds=folds,
            test=test or (),
        )
    for note in found.notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    console.print(parameters_table(found, f"{machine.name}: calibrated geometry"))
    console.print()
    if (dependent := dependent_table(found)) is not None:
        console.print(dependent)
        console.print()
    console.print(errors_table(found))
    console.print()
    for line in calibration_text(found):
        console.print(line)
    assert found.rows is not None
    assert found.statement is not None
    write_json(found.to_dict(), json)
    if out is not None:
        write_output(
            out, robot_yaml(found.robot, file, found.written_std(machine), f"# {_head(found, data)}\n")
        )
    if readings is not None:
        write_output(readings, measurements_to_csv(in_base_frame(found, found.rows), machine))
    if sensitivity is not None:
        with optional_file(sensitivity, quiet):
            draw(found.statement, machine.name, sensitivity=sensitivity)
    if recursion is not None:
        with optional_file(recursion, quiet):
            draw(found.statement, machine.name, recursion=recursion)
    if figure is not None:
        with optional_file(figure, quiet):
            write_figure(found.plot(), figure)
    if html is not None and source is not None:
        from beamstiff.report.html.calibration import calibration_html

        with optional_file(html, quiet):
            write_output(html, calibration_html(found, machine, found.rows, source))


def parse_priors(texts: Sequence[str]) -> dict[str, list[str]]:
    """Return standard deviations by name, from texts such as ``"f3.d=0.2mm"``; a name may have several."""
    result: dict[str, list[str]] = {}
    for text in texts:
        name, equals, value = (word.strip() for word in text.partition("="))
        if not (name and equals and value):
            raise BeamstiffError(f"--prior: found {text!r}, expected NAME=STD such as f3.d=0.2mm")
        result.setdefault(name, []).append(value)
    return result


def draw(
    statement: Statement, name: str, sensitivity: str | None = None, recursion: str | None = None
) -> None:
    """Draw sensitivity indices, and the way of the recursion."""
    from beamstiff.calibration.parameters import SPARE
    from beamstiff.calibration.recursion import recursion as recur
    from beamstiff.calibration.sensitivity import sensitivity_indices
    from beamstiff.report.geometry import recursion_figure, sensitivity_figure

    problem = statement.problem
    if sensitivity is not None:
        indices = sensitivity_indices(problem.geometry, problem.split(statement.begin)[0])
        shown = {item.name for item in problem.geometry.parameters if item.rank != SPARE}
        indices = indices.some(shown | set(statement.identified))
        write_figure(sensitivity_figure(indices, f"{name}: sensitivity to geometric errors"), sensitivity)
    if recursion is not None:
        ways = {
            "each pose alone": recur(problem, statement.begin, statement.identified),
            "all poses so far": recur(problem, statement.begin, statement.identified, memory=True),
        }
        write_figure(recursion_figure(ways, f"{name}: calibration pose by pose"), recursion)


def _head(found: Calibration, data: Sequence[str]) -> BeamstiffError:
    count = len(found.observability.identified)
    files = ", ".join(Path(path).name for path in data)
    return BeamstiffError(f"Geometry calibrated by beamstiff: {count} parameters from {files}.")  # one line
