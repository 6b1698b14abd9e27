"""`beamstiff identify`: joint stiffness from measured displacements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamstiff.cli.options import DataFile, Debug, Json, Quiet, RobotFile, parse_names, robot_file
from beamstiff.cli.output import check_outputs, people, say, working, write_json
from beamstiff.errors import BeamstiffError
from beamstiff.files import write_whole

if TYPE_CHECKING:
    from beamstiff.identify.result import Identification
    from beamstiff.robot.description import Robot


def identify(
    robot: RobotFile,
    data: DataFile,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--parameters",
            metavar="NAME,...",
            help="Stiffness values to identify, such as J12.torsional (a joint's) or screw2 (a strut's); "
            "default: what the robot lists under `identify`.",
        ),
    ] = None,
    json: Json = None,
    out: Annotated[
        str | None,
        typer.Option("--out", metavar="FILE", help="Write the robot with the identified stiffness as YAML."),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="FILE",
            help="Draw measured against predicted displacements (.png, .svg or .pdf).",
        ),
    ] = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Identify joint stiffness from measured displacements, with uncertainty.

    DATA holds displacements dx dy dz (rx ry rz), loaded minus unloaded, in the base frame; the
    start are the robot's present values. Weighted least squares; rotations count where the table
    says sigma_rotation. The uncertainty is one standard deviation; where the data do not bound a
    stiffness from above, a lower bound is given instead. The held-out gap is that of poses left
    out of the fit.

    \b
    Examples:
      beamstiff identify ir663 examples/data/ir663_compliance_xx.csv
      beamstiff identify robot.yaml data.csv --parameters J1.torsional,J2.torsional \\
          --json found.json --out identified.yaml --figure fit.png
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.identify.stiffness import identify as fit
    from beamstiff.measure import doubts, read_measurements
    from beamstiff.report.identification import identification_table, identification_text
    from beamstiff.robot.reader import load_robot

    description = load_robot(robot)
    measured = read_measurements(data, description)
    names = parse_names(parameters)
    check_outputs([robot_file(robot), data], json, out=out, figure=figure)
    if figure is not None:
        from beamstiff.report.figures import check_format

        check_format(figure)
    with working(f"identifying from {len(measured)} rows", quiet):
        notes = doubts(measured, description)
        found = fit(description, measured, names)

    for note in notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    console.print(identification_table(found, description, f"{description.name}: identified stiffness"))
    console.print(identification_text(found, measured))
    if out is not None:
        write_whole(out, _yaml(description, found, data))
    if figure is not None:
        from beamstiff.report.figures import save_figure
        from beamstiff.report.parity import parity_figure

        save_figure(parity_figure(measured, found.predicted, description.name), figure)
    write_json(found.to_dict(), json)


def _yaml(robot: Robot, found: Identification, data: str) -> str:
    from beamstiff.robot.writer import robot_to_yaml

    values = {item.name: float(value) for item, value in zip(found.parameters, found.stiffness, strict=True)}
    unbounded = [item.name for item in found.parameters if not item.identifiable]
    source = str(BeamstiffError(Path(data).name))  # one line: a comment must not end early
    head = f"# Stiffness of {', '.join(values)} identified by beamstiff from {source}.\n"
    if unbounded:
        head += f"# Not bounded from above by the data, written as fitted: {', '.join(unbounded)}.\n"
    return head + robot_to_yaml(robot.with_parameters(values))
