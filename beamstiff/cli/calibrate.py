"""`beamstiff calibrate`: geometry, and compliances if wanted, from measured absolute positions or poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamstiff.cli.options import Debug, Html, Json, Quiet, RobotFile, parse_names, robot_file
from beamstiff.cli.output import (
    check_once,
    check_outputs,
    people,
    say,
    source_of,
    working,
    write_figure,
    write_json,
)
from beamstiff.errors import BeamstiffError, suggest
from beamstiff.units import quantity

if TYPE_CHECKING:
    from beamstiff.calibration.parameters import Parameter
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
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--parameters",
            metavar="NAME,...",
            help="What to seek: f3.d, q2 (an encoder's zero), n7.x (a reflector's place), a frame, or base, "
            "target, offsets, frames; default all.",
        ),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            "--fix",
            metavar="NAME,...",
            help="What stays, likewise; `base` where the readings are in the robot's own base frame.",
        ),
    ] = None,
    last: Annotated[
        list[str] | None,
        typer.Option(
            "--last",
            metavar="NAME,...",
            help="Of parameters that cannot be told apart, hold these first.",
        ),
    ] = None,
    compliances: Annotated[
        list[str] | None,
        typer.Option(
            "--compliances",
            metavar="NAME,...",
            help="Stiffness values to estimate along with the geometry, such as J2.torsional.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            metavar="NAME=STD",
            help="Known to within a standard deviation, such as f3.d=0.2mm; of a group (frames=0.5mm) those "
            "of the unit; repeatable.",
        ),
    ] = None,
    method: Annotated[
        str, typer.Option("--method", metavar="NAME", help="levenberg-marquardt or gauss-newton.")
    ] = "levenberg-marquardt",
    stations: Annotated[
        bool,
        typer.Option(
            "--stations",
            help="Every table has a base of its own (base1, base2, ...): robot or tracker were moved.",
        ),
    ] = False,
    folds: Annotated[
        int, typer.Option("--folds", min=0, metavar="N", help="Folds of the errors held out; 0 for none.")
    ] = 5,
    test: Annotated[
        list[str] | None,
        typer.Option("--test", metavar="CSV", help="Readings to test the calibrated robot on; repeatable."),
    ] = None,
    out: Annotated[
        str | None, typer.Option("--out", metavar="FILE", help="Write the calibrated robot as YAML.")
    ] = None,
    readings: Annotated[
        str | None,
        typer.Option(
            "--readings", metavar="CSV", help="Write the readings in the base frame found, for diagnose."
        ),
    ] = None,
    sensitivity: Annotated[
        str | None,
        typer.Option(
            "--sensitivity", metavar="FILE", help="Draw how far each parameter moves and turns the tool."
        ),
    ] = None,
    recursion: Annotated[
        str | None,
        typer.Option("--recursion", metavar="FILE", help="Draw the residual, pose after pose counted in."),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure", metavar="FILE", help="Draw errors and changes, before and after (.png, .svg or .pdf)."
        ),
    ] = None,
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
    from beamstiff.calibration import calibrate as fit
    from beamstiff.calibration.statement import state_calibration
    from beamstiff.calibration.validation import errors_on, in_base_frame
    from beamstiff.cli.data import doubted, read_tables
    from beamstiff.measure import read_measurements
    from beamstiff.measure.rows import concatenate
    from beamstiff.measure.writer import measurements_to_csv
    from beamstiff.outputs import write_output
    from beamstiff.report.geometry import calibration_text, dependent_table, errors_table, parameters_table
    from beamstiff.robot.reader import load_robot
    from beamstiff.robot.writer import robot_to_yaml

    file = robot_file(robot)
    outputs = {"out": out, "readings": readings, "html": html}
    drawings = {"figure": figure, "sensitivity": sensitivity, "recursion": recursion}
    check_outputs([file, *data, *(test or ())], json, **outputs, **drawings)
    for drawing in drawings.values():
        if drawing is not None:
            from beamstiff.report.figures import check_format

            check_format(drawing)
    source = source_of(context, html, [file, *data, *(test or ())])
    machine = load_robot(file)
    check_once(data, test or ())
    tables, doubts = read_tables(data, machine)
    measured = concatenate(tables)
    tested = {path: read_measurements(path, machine) for path in test or ()}
    said: Any = {
        "parameters": parse_names(parameters),
        "fixed": parse_names(fix, "--fix") or (),
        "last": parse_names(last, "--last") or (),
        "compliances": parse_names(compliances, "--compliances") or (),
        "stations": stations,
    }
    if stations and tested:
        raise BeamstiffError("--test: beside --stations it is not said where the robot stood; leave one out")
    with doubted(doubts), working(f"calibrating from {len(measured)} rows", quiet):
        if prior:
            known = state_calibration(machine, measured, **said).problem.parameters
            said["priors"] = parse_priors(prior, known)
        found = fit(machine, measured, **said, method=method, folds=folds)
        tests = {path: errors_on(found, rows) for path, rows in tested.items()}
    found = replace(found, notes=(*doubts, *found.notes))
    for note in found.notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    console.print(parameters_table(found, f"{machine.name}: calibrated geometry"))
    console.print()
    if (dependent := dependent_table(found)) is not None:
        console.print(dependent)
        console.print()
    console.print(errors_table(found, {f"calibrated, {Path(path).name}": one for path, one in tests.items()}))
    console.print()
    for line in calibration_text(found):
        console.print(line)
    if out is not None:
        write_output(out, f"# {_head(found, data)}\n{robot_to_yaml(found.robot)}")
    if readings is not None:
        write_output(readings, measurements_to_csv(in_base_frame(found, measured), machine))
    if sensitivity is not None or recursion is not None:
        draw(state_calibration(machine, measured, **said), machine.name, sensitivity, recursion)
    facts = found.to_dict()
    if tests:
        facts["tests"] = {path: one.to_dict() for path, one in tests.items()}
    if figure is not None:
        write_figure(found.plot(), figure)
    if html is not None and source is not None:
        from beamstiff.report.html.calibration import calibration_html

        named = {Path(path).name: one for path, one in tests.items()}
        write_output(html, calibration_html(found, machine, measured, source, named, facts))
    write_json(facts, json)


def parse_priors(texts: Sequence[str], parameters: Sequence[Parameter]) -> dict[str, float]:
    """Return standard deviations, SI, by parameter, from texts such as ``"f3.d=0.2mm"``.

    Raises
    ------
    BeamstiffError
        When a text is no prior, a name is unknown, or no parameter of the name has the unit.
    """
    kinds = {"m": "length", "rad": "angle"}
    geometric = [item for item in parameters if item.unit in kinds]
    result: dict[str, float] = {}
    for text in texts:
        name, equals, value = (word.strip() for word in text.partition("="))
        if not (name and equals and value):
            raise BeamstiffError(f"--prior: found {text!r}, expected NAME=STD such as f3.d=0.2mm")
        own = [item for item in geometric if name in _names(item)]
        if not own:
            known = [one for item in geometric for one in _names(item)]
            raise BeamstiffError(
                f"--prior: {name!r} is no geometric parameter that is sought{suggest(name, known)}"
            )
        found, failure = {}, None
        for item in own:
            try:
                found[item.name] = quantity(value, kinds[item.unit])
            except BeamstiffError as error:  # a group has lengths and angles
                failure = error
        if not found:
            raise BeamstiffError(f"--prior: {name}: {failure}")
        if min(found.values()) <= 0:
            raise BeamstiffError(f"--prior: {name}: found {value!r}, expected a positive standard deviation")
        result |= found
    return result


def _names(item: Parameter) -> tuple[str, ...]:
    """Return what a parameter goes by: its name, its group, its frame."""
    group = f"{item.group}s" if item.group in ("offset", "frame") else item.group
    frame = item.name.rpartition(".")[0] if item.group == "frame" else item.name
    return item.name, group, frame


def draw(statement: Statement, name: str, sensitivity: str | None, recursion: str | None) -> None:
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
