"""Tables of the stiffness at the TCP: the posture, and the two matrices."""

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


def stiffness_tables(found: TcpStiffness) -> Iterator[Table | str]:
    """Yield tables: posture, what a pull along one axis meets, stiffness, compliance; then what is rigid."""
    what = "Tangent stiffness of the loaded machine" if found.preload else "Stiffness"
    yield _posture_table(found.robot, found.variables, found.tcp, found.orientation)
    yield _free_table(found)
    if found.stiffness is not None:
        held = f"{what} at the TCP, all other motions held: row = K column"
        yield _matrix_table(held, FORCES, MOTIONS, found.stiffness)
    name = "Compliance of the loaded machine" if found.preload else "Compliance"
    yield _matrix_table(f"{name} at the TCP: row = C column", MOTIONS, FORCES, found.compliance, found.rigid)
    if len(found.rigid):
        yield (
            f"Rigid: loads that do not displace the TCP (N, N m): {'; '.join(_wrenches(found.rigid))}. "
            "A stiffness matrix does not exist."
        )


def _wrenches(rigid: Array) -> list[str]:
    """Return wrenches in words: ``fx``, or ``mx = 1 with mz = 0.6``, SI."""
    names = [name.split()[0] for name in FORCES]
    told = []
    for wrench in rigid:
        first = int(np.argmax(wrench == 1.0))
        rest = [f"{names[i]} = {wrench[i]:.3g}" for i in np.flatnonzero(wrench) if i != first]
        told.append(f"{names[first]} = 1 with {', '.join(rest)}" if rest else names[first])
    return told


def _posture_table(robot: Robot, variables: dict[str, float], tcp: Array, turned: Array) -> Table:
    result = table(f"{robot.name}: posture", "", "value", "", left=3)
    for variable in robot.variables:
        how = "" if variable.actuated else "solved" if variable.passive else f"= {variable.equals}"
        result.add_row(variable.name, shown_value(robot, variable.name, variables[variable.name]), how)
    result.add_row("TCP x, y, z", ", ".join(millimetres(tcp)) + " mm", "")
    angles = ", ".join(f"{angle + 0.0:.3f}" for angle in np.degrees(turned).round(3))
    result.add_row("TCP a, b, c", f"{angles} deg (rotation vector)", "")
    return result


def _free_table(found: TcpStiffness) -> Table:
    """Return what one force or moment meets where the tool may move aside in every direction: 1 / C."""
    title = "Stiffness against one force or moment, the tool free to move aside (1 / C)"
    columns = ("from start values",) if found.guessed.any() else ()
    result = table(title, "along", "stiffness", "", *columns, left=1)
    held = _rigid_axes(found.rigid)
    for at, own in enumerate(np.diagonal(found.compliance).tolist()):
        name = FORCES[at].split()[0]
        if at in held:  # what is left of its compliance is rounding
            result.add_row(name, "rigid", "", *("" for _ in columns))
            continue
        value, unit = (1e-3 / own, "N/mm") if at < 3 else (1.0 / own, "N*m/rad")
        result.add_row(name, number(value), unit, *(f"{100 * found.guessed[at]:.0f} %" for _ in columns))
    return result


def _rigid_axes(rigid: Array) -> list[int]:
    """Return the axes along or about which a load alone does not displace the TCP; `rigid` (R, 6)."""
    alone = rigid[np.count_nonzero(rigid, axis=1) == 1]
    return [int(at) for at in np.flatnonzero(alone.any(axis=0))]


def _matrix_table(
    title: str, rows: tuple[str, ...], columns: tuple[str, ...], matrix: Array, rigid: Array | None = None
) -> Table:
    # what is rounding beside the diagonal is shown as 0; JSON holds it as it is
    own = np.abs(np.diagonal(matrix))
    size = np.sqrt(np.maximum(own, ROUNDING * np.repeat(own.reshape(2, 3).max(axis=1), 3)))
    shown = np.where(np.abs(matrix) > ROUNDING * size[:, None] * size, matrix, 0.0)
    result = table(title, "", *columns)
    alone = () if rigid is None else _rigid_axes(rigid)
    for at, (name, row) in enumerate(zip(rows, shown, strict=True)):
        result.add_row(name, *(["rigid"] * len(row) if at in alone else map(number, row)))
    return result
