"""How every joint variable follows from the free ones: coupled variables and the expressions of the frames."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.robot.expression import Expression, parse_expression
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


@dataclass(frozen=True)
class Coupling:
    """All variables as a linear map of the free ones: ``values = matrix @ free + offset``.

    Attributes
    ----------
    names : tuple of str
        All variables, in order of declaration (V).
    free : tuple of str
        Actuated variables first, then passive ones (A + Q = F).
    actuated : int
        Number of actuated variables, A.
    matrix : (V, F) array
    offset : (V,) array
    """

    names: tuple[str, ...]
    free: tuple[str, ...]
    actuated: int
    matrix: Array
    offset: Array


def variable_kinds(robot: Robot) -> dict[str, str]:
    """Return the kind, ``"angle"`` or ``"length"``, of every variable; a coupled one has that of its source.

    Raises
    ------
    BeamstiffError
        When a coupled variable follows itself or nothing.
    """
    declared = {variable.name: variable for variable in robot.variables}

    def kind_of(name: str, above: tuple[str, ...] = ()) -> str:
        variable = declared[name]
        if name in above:
            raise BeamstiffError(f"variable {name!r} is coupled to itself: {' -> '.join([*above, name])}")
        if variable.equals is None or variable.type is not None:
            return variable.kind
        used = [word for word in re.findall(r"[A-Za-z_]\w*", variable.equals) if word in declared]
        return kind_of(used[0], (*above, name)) if used else "angle"

    return {name: kind_of(name) for name in declared}


def coupling(robot: Robot) -> Coupling:
    """Return how all variables of a robot follow from the actuated and passive ones.

    Raises
    ------
    BeamstiffError
        When a coupled variable follows itself, or its expression is not linear.
    """
    kinds = variable_kinds(robot)
    declared = {variable.name: variable for variable in robot.variables}
    free = [v.name for v in robot.variables if v.actuated] + [v.name for v in robot.variables if v.passive]
    rows: dict[str, tuple[Array, float]] = {
        name: (row, 0.0) for name, row in zip(free, np.eye(len(free)), strict=True)
    }

    def resolve(name: str, above: tuple[str, ...] = ()) -> tuple[Array, float]:
        if name in rows:
            return rows[name]
        if name in above:
            raise BeamstiffError(f"variable {name!r} is coupled to itself: {' -> '.join([*above, name])}")
        expression = parse_expression(declared[name].equals or "", kinds[name], kinds)
        row, offset = np.zeros(len(free)), expression.constant
        for used, coefficient in expression.coefficients.items():
            used_row, used_offset = resolve(used, (*above, name))
            row, offset = row + coefficient * used_row, offset + coefficient * used_offset
        rows[name] = row, offset
        return rows[name]

    resolved = [resolve(name) for name in declared]
    return Coupling(
        names=tuple(declared),
        free=tuple(free),
        actuated=len(robot.actuated),
        matrix=np.array([row for row, _ in resolved]).reshape(len(declared), len(free)),
        offset=np.array([offset for _, offset in resolved], dtype=np.float64),
    )


def frame_expressions(robot: Robot) -> dict[str, dict[str, Expression]]:
    """Return, by frame, the linear expression of each of its Khalil-Kleinfinger parameters."""
    kinds = variable_kinds(robot)
    return {
        frame.name: {
            parameter: parse_expression(getattr(frame, parameter), kind, kinds)
            for parameter, kind in FRAME_PARAMETERS.items()
        }
        for frame in robot.frames
    }
