"""`beamstiff stiffness`: the 6x6 stiffness and compliance at the tool."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from beamstiff.cli.options import Debug, Json, Preload, Quiet, RobotFile, robot_file
from beamstiff.cli.output import check_outputs, note_effects, people, working, write_json
from beamstiff.errors import BeamstiffError
from beamstiff.report.tables import millimetres, number, table

if TYPE_CHECKING:
    from rich.table import Table

    from beamstiff.fem.structure import Structure
    from beamstiff.robot.description import Robot
    from beamstiff.robot.kinematics import Posture
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
    from beamstiff.diagnosis.reading import load_robot
    from beamstiff.fem.structure import compile_structure
    from beamstiff.robot.kinematics import posture

    description = load_robot(robot)
    values = parse_variables(description, q or [])
    load = parse_wrench(wrench or [])
    if wrench and not preload:
        raise BeamstiffError("--wrench: loads the machine before it is moved, which only --preload looks at")
    check_outputs([robot_file(robot)], json)
    with working("condensing the structure", quiet), _hint_at_q(description, values):
        structure = compile_structure(description)
        kinematics = structure.kinematics
        where = posture(kinematics, values)
        stiff, compliance = _matrices(structure, where, load if preload else None)
    tcp = where.node_positions[0, kinematics.node_index[description.tcp]]
    variables = dict(zip(kinematics.coupling.names, where.values[0].tolist(), strict=True))
    note_limits(description, variables, quiet)
    note_effects(description, "its stiffness", quiet)

    console = people(quiet, json)
    what = "Tangent stiffness of the loaded machine" if preload else "Stiffness"
    console.print(_posture_table(description, variables, tcp))
    console.print(_matrix_table(f"{what} at the TCP: row = K column", FORCES, MOTIONS, stiff))
    console.print(_matrix_table("Compliance at the TCP: row = C column", MOTIONS, FORCES, compliance))
    write_json(
        {
            "stiffness": stiff.tolist(),
            "compliance": compliance.tolist(),
            "tcp": tcp.tolist(),
            "variables": variables,
        },
        json,
    )


def _matrices(structure: Structure, where: Posture, load: list[float] | None) -> tuple[Array, Array]:
    """Return stiffness and compliance, (6, 6) each, of the machine under gravity and a load, or of none."""
    import numpy as np

    from beamstiff.fem.condensation import tcp_compliance, tcp_stiffness
    from beamstiff.fem.geometric import loaded_compliance, loaded_stiffness
    from beamstiff.fem.response import nodal_loads

    tcp, what = structure.robot.tcp, f"robot {structure.robot.name!r}"
    if load is None:
        compliance = tcp_compliance(structure, where)
    else:
        loads = nodal_loads(structure, 1, {tcp: np.array(load)})
        compliance = loaded_compliance(structure, where, loads, gravity=True)
    try:
        inverse = tcp_stiffness if load is None else loaded_stiffness
        return inverse(compliance, what)[0], compliance[0]
    except BeamstiffError as error:
        raise BeamstiffError(f"{error} (beamstiff deflect, which needs no stiffness)") from None


@contextmanager
def _hint_at_q(robot: Robot, values: Mapping[str, float]) -> Iterator[None]:
    """Say of a posture that is refused where it comes from, if nobody chose it."""
    try:
        yield
    except BeamstiffError as error:
        from beamstiff.robot.stiffness import check_stiffness

        check_stiffness(robot)
        if values or not robot.actuated:
            raise
        names = ",".join(f"{item.name}=..." for item in robot.actuated[:6])
        raise BeamstiffError(f"{error}; all joint variables are 0 here, set them with --q {names}") from None


def _posture_table(robot: Robot, variables: dict[str, float], tcp: Array) -> Table:
    from beamstiff.cli.variables import shown_value

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
