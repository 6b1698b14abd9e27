"""`beamstiff stiffness`: the 6x6 stiffness and compliance at the tool."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from beamstiff.cli.options import Debug, Json, Preload, Quiet, RobotFile, robot_file
from beamstiff.cli.output import check_outputs, people, say, working, write_json
from beamstiff.errors import BeamstiffError, OptionError
from beamstiff.report.tables import Table, millimetres, number, table

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot
    from beamstiff.se3 import Array

FORCES = ("fx [N]", "fy [N]", "fz [N]", "mx [N m]", "my [N m]", "mz [N m]")
MOTIONS = ("dx [m]", "dy [m]", "dz [m]", "rx [rad]", "ry [rad]", "rz [rad]")
ROUNDING = 1e-12


def stiffness(
    robot: RobotFile,
    q: Annotated[
        list[str] | None,
        typer.Option(
            "--q",
            metavar="NAME=VALUE,...",
            help="Actuated joint variables; a number is rad or m. Those not named are 0, passive ones are "
            "solved.",
        ),
    ] = None,
    preload: Preload = False,
    wrench: Annotated[
        list[str] | None,
        typer.Option(
            "--wrench",
            metavar="NAME=VALUE,...",
            help="With --preload: a load on the TCP besides gravity and payload, base frame, such as "
            "fz=-900N,mx=20; components not named are 0.",
        ),
    ] = None,
    json: Json = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Print the 6 x 6 stiffness and compliance at the TCP in one posture.

    Stiffness K: wrench = K displacement, compliance C = K^-1: displacement = C wrench. Base frame,
    wrench [f, m] and displacement [d, r] at the TCP, SI. Undeformed geometry, without gravity. A
    mechanism is refused and its free motion named; so is a TCP that does not give way at all in
    some direction, such as that of a rigid-link arm in a singular posture.

    --preload gives the tangent stiffness of the loaded machine instead, for a small wrench on top
    of what loads it: gravity and payload always, and --wrench. It adds the geometric stiffness K_C
    of these loads on the undeformed geometry; K is not symmetric then if a moment acts.

    \b
    Examples:
      beamstiff stiffness cantilever
      beamstiff stiffness ir663 --q q2=10deg,q8=45deg
      beamstiff stiffness robot.yaml --q q1=0.3 --json stiffness.json
      beamstiff stiffness ir663 --q q2=10deg,q8=45deg --preload --wrench fz=-900N
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.cli.variables import note_limits, parse_variables, parse_wrench
    from beamstiff.functions.stiffness import stiffness as run
    from beamstiff.robot.coerce import as_robot

    machine = as_robot(robot)
    values = parse_variables(machine, q or [])
    load = parse_wrench(wrench or []) if wrench else None
    check_outputs([robot_file(robot)], json)
    with working("condensing the structure", quiet), _hint_at_q(machine, values):
        found = run(machine, values, preload=preload, wrench=load)
    note_limits(machine, found.variables, quiet)
    for note in found.notes:
        say(f"note: {note}", quiet)

    console = people(quiet, json)
    what = "Tangent stiffness of the loaded machine" if preload else "Stiffness"
    console.print(_posture_table(machine, found.variables, found.tcp))
    console.print(_matrix_table(f"{what} at the TCP: row = K column", FORCES, MOTIONS, found.stiffness))
    console.print(_matrix_table("Compliance at the TCP: row = C column", MOTIONS, FORCES, found.compliance))
    write_json(found.to_dict(), json)


@contextmanager
def _hint_at_q(robot: Robot, values: Mapping[str, float]) -> Iterator[None]:
    """Say of a posture that is refused where it comes from, if nobody chose it."""
    try:
        yield
    except BeamstiffError as error:
        if isinstance(error, OptionError) or values or not robot.actuated:
            raise
        names = ",".join(f"{item.name}=..." for item in robot.actuated[:6])
        raise BeamstiffError(f"{error}; all joint variables are 0 here, set them with --q {names}") from None


def _posture_table(robot: Robot, variables: dict[str, float], tcp: Array) -> Table:
    from beamstiff.functions.checks import shown_value

    result = table(f"{robot.name}: posture", "", "value", "", left=3)
    for variable in robot.variables:
        how = "" if variable.actuated else "solved" if variable.passive else f"= {variable.equals}"
        result.add_row(variable.name, shown_value(robot, variable.name, variables[variable.name]), how)
    result.add_row("TCP x, y, z", ", ".join(millimetres(tcp)) + " mm", "")
    return result


def _matrix_table(title: str, rows: tuple[str, ...], columns: tuple[str, ...], matrix: Array) -> Table:
    import numpy as np

    # what is rounding beside the diagonal is shown as 0; JSON holds it as it is
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    shown = np.where(np.abs(matrix) > ROUNDING * size[:, None] * size, matrix, 0.0)
    result = table(title, "", *columns)
    for name, row in zip(rows, shown, strict=True):
        result.add_row(name, *map(number, row))
    return result
