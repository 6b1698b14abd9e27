"""Stiffness at the TCP told to people: the posture, and the two matrices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamstiff.functions.checks import shown_value
from beamstiff.functions.stiffness import TcpStiffness
from beamstiff.report.tables import Table, millimetres, number, table
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

FORCES = ("fx [N]", "fy [N]", "fz [N]", "mx [N m]", "my [N m]", "mz [N m]")
MOTIONS = ("dx [m]", "dy [m]", "dz [m]", "rx [rad]", "ry [rad]", "rz [rad]")
ROUNDING = 1e-12


def stiffness_tables(found: TcpStiffness) -> Iterator[Table]:
    """Yield tables: joint variables and place of the TCP, stiffness, compliance."""
    what = "Tangent stiffness of the loaded machine" if found.preload else "Stiffness"
    yield _posture_table(found.robot, found.variables, found.tcp)
    yield _matrix_table(f"{what} at the TCP: row = K column", FORCES, MOTIONS, found.stiffness)
    yield _matrix_table("Compliance at the TCP: row = C column", MOTIONS, FORCES, found.compliance)


def _posture_table(robot: Robot, variables: dict[str, float], tcp: Array) -> Table:
    result = table(f"{robot.name}: posture", "", "value", "", left=3)
    for variable in robot.variables:
        how = "" if variable.actuated else "solved" if variable.passive else f"= {variable.equals}"
        result.add_row(variable.name, shown_value(robot, variable.name, variables[variable.name]), how)
    result.add_row("TCP x, y, z", ", ".join(millimetres(tcp)) + " mm", "")
    return result


def _matrix_table(title: str, rows: tuple[str, ...], columns: tuple[str, ...], matrix: Array) -> Table:
    # what is rounding beside the diagonal is shown as 0; JSON holds it as it is
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    shown = np.where(np.abs(matrix) > ROUNDING * size[:, None] * size, matrix, 0.0)
    result = table(title, "", *columns)
    for name, row in zip(rows, shown, strict=True):
        result.add_row(name, *map(number, row))
    return result
