"""How every joint variable follows from the free ones: coupled variables, expressions of the frames."""

from __future__ import annotations

import functools
import graphlib
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.robot.expression import Expression, parse_expression
from beamstiff.robot.fields import DescriptionError
from beamstiff.robot.parts import FRAME_PARAMETERS, Frame, Variable
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot

P = TypeVar("P")


@dataclass(frozen=True)
class Coupling:
    """All variables as a linear map of the free ones: ``values = matrix @ free + offset``."""

    names: tuple[str, ...]  # all variables, in order of declaration (V)
    free: tuple[str, ...]  # actuated variables first, then passive ones (A + Q = F)
    actuated: int  # number of actuated variables, A
    matrix: Array  # (V, F)
    offset: Array  # (V,)


def variable_kinds(robot: Robot) -> dict[str, str]:
    """Return the kind, ``"angle"`` or ``"length"``, of every variable; of a coupled one, its source's."""
    return dict(_kinds(_Same(robot.variables)))  # a caller's own


class _Same(Generic[P]):
    """Parts as the key of a cache by identity: they never change, and comparing them would take long."""

    def __init__(self, parts: tuple[P, ...]) -> None:
        self.parts = parts

    def __hash__(self) -> int:
        return id(self.parts)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.parts is self.parts


@functools.lru_cache(maxsize=8)  # asked for again for every variable of a robot
def _kinds(same: _Same[Variable]) -> dict[str, str]:
    declared = {variable.name: variable for variable in same.parts}
    kinds: dict[str, str] = {}
    for name in _dependence_order(same.parts):
        variable = declared[name]
        used = _used_variables(variable.equals, declared)
        untyped = variable.equals is not None and variable.type is None
        kinds[name] = kinds[used[0]] if untyped and used else variable.kind
    return {name: kinds[name] for name in declared}


def _used_variables(equals: str | None, declared: Collection[str]) -> list[str]:
    return [word for word in re.findall(r"[A-Za-z_]\w*", equals or "") if word in declared]


def _dependence_order(variables: Sequence[Variable]) -> list[str]:
    """Return all variables, each after those that it is coupled to."""
    declared = {variable.name for variable in variables}
    sorter = graphlib.TopologicalSorter(
        {variable.name: _used_variables(variable.equals, declared) for variable in variables}
    )
    try:
        return list(sorter.static_order())
    except graphlib.CycleError as error:
        cycle: list[str] = error.args[1][::-1]  # graphlib lists a variable after those that need it
        at = [variable.name for variable in variables].index(cycle[0])
        message = f"{cycle[0]!r} is coupled to itself: {' -> '.join(cycle[:20])}"
        raise DescriptionError([(("variables", at, "equals"), message)]) from None


def coupling(robot: Robot) -> Coupling:
    """Return how all variables of a robot follow from the actuated and passive ones."""
    kinds = variable_kinds(robot)
    declared = {variable.name: variable for variable in robot.variables}
    free = [v.name for v in robot.variables if v.actuated] + [v.name for v in robot.variables if v.passive]
    rows: dict[str, tuple[Array, float]] = {
        name: (row, 0.0) for name, row in zip(free, np.eye(len(free)), strict=True)
    }

    for name in _dependence_order(robot.variables):
        if name in rows:
            continue
        expression = parse_expression(declared[name].equals or "", kinds[name], kinds)
        row, offset = np.zeros(len(free)), expression.constant
        with np.errstate(over="ignore", invalid="ignore"):
            for used, coefficient in expression.coefficients.items():
                used_row, used_offset = rows[used]
                row, offset = row + coefficient * used_row, offset + coefficient * used_offset
        if not (np.isfinite(row).all() and math.isfinite(offset)):
            raise BeamstiffError(f"variable {name!r}: its coupling overflows, expected finite coefficients")
        rows[name] = row, offset

    resolved = [rows[name] for name in declared]
    return Coupling(
        names=tuple(declared),
        free=tuple(free),
        actuated=len(robot.actuated),
        matrix=np.array([row for row, _ in resolved]).reshape(len(declared), len(free)),
        offset=np.array([offset for _, offset in resolved], dtype=np.float64),
    )


def frame_expressions(robot: Robot) -> dict[str, dict[str, Expression]]:
    """Return, by frame, the linear expression of each of its Khalil-Kleinfinger parameters."""
    return _expressions(_Same(robot.frames), _Same(robot.variables))  # that no caller changes


@functools.lru_cache(maxsize=8)  # robots of other stiffness have the same frames
def _expressions(frames: _Same[Frame], variables: _Same[Variable]) -> dict[str, dict[str, Expression]]:
    kinds = _kinds(variables)
    return {
        frame.name: {
            parameter: parse_expression(getattr(frame, parameter), kind, kinds)
            for parameter, kind in FRAME_PARAMETERS.items()
        }
        for frame in frames.parts
    }
