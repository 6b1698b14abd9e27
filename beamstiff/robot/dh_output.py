"""Frames of a robot to a table of frames: the chain from the base to the TCP, without loss.

A chain of Khalil-Kleinfinger frames is one of modified DH rows: gamma and b of a frame are about and along
the z axis of the frame before, and add to its theta and r. What has no frame before it takes a fixed row, and
so does Hayati's beta, rot(y, beta) = rot(z, 90 deg) rot(x, beta) rot(z, -90 deg). A frame that both turns
and slides takes two rows. A classic table is the modified one read at other cuts.
"""

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.dh_tables import CONVENTIONS, KINDS, known_convention
from beamstiff.robot.expression import Expression
from beamstiff.robot.parts import STIFFNESS_KINDS
from beamstiff.robot.placement import frame_parameters
from beamstiff.se3 import transform

ZERO = Expression()
WORDS = {np.inf: "rigid", 0.0: "free"}


BEYOND = ("loops", "beams", "struts", "masses", "effects", "model")  # what no table of frames says


@dataclass
class _Row:
    name: str
    values: dict[str, Expression] = field(default_factory=dict)

    def get(self, key: str) -> Expression:
        return self.values.get(key, ZERO)

    def add(self, key: str, value: Expression) -> None:
        self.values[key] = _sum(self.get(key), value)

    @property
    def variables(self) -> list[str]:
        return [name for value in self.values.values() for name in value.coefficients]

    @property
    def moves(self) -> bool:
        return bool(self.variables)


@dataclass(frozen=True)
class Table:
    """A table of frames as CSV, and what to know of it."""

    text: str
    notes: tuple[str, ...]


def robot_to_table(robot: Robot, convention: str) -> Table:
    """Return the chain from the base to the TCP as a table of frames in CSV, deg and mm (`CONVENTIONS`)."""
    convention = known_convention(convention, "convention")
    rows = _chain(robot)
    rows = [part for row in rows for part in _plain(row)]
    if convention != "khalil-kleinfinger":
        rows = _modified(rows)
        if convention == "classic":
            rows = _classic(rows)
    rows = [row for row in rows if any(value != ZERO for value in row.values.values())]
    fixed = [row.name for row in rows if not row.moves]
    notes = []
    if fixed:
        notes.append(
            f"{len(fixed)} of {len(rows)} rows hold no joint ({', '.join(fixed)}): programs that expect one "
            "row a joint need them as base and tool transforms"
        )
    stiffness = _stiffness(robot, rows)
    left = [what for what in BEYOND if getattr(robot, what)]
    left += ["limits"] * any(variable.limits is not None for variable in robot.variables)
    left += ["joints that no row moves"] * (len(stiffness) < len(robot.joints))
    for variable in robot.variables:
        if variable.equals is not None:
            left.append(f"that {variable.name} equals {variable.equals}")
        elif variable.passive:
            left.append(f"that {variable.name} is passive")
    if left:
        notes.append(
            "a table holds the frames to the TCP and the stiffness of their joints only, not "
            f"{listed(left, 12)}"
        )
    return Table(_csv(robot, rows, convention, stiffness), tuple(notes))


def _stiffness(robot: Robot, rows: list[_Row]) -> dict[str, dict[str, float]]:
    """Return the stiffness of the joint that each variable of the rows moves, by kind."""
    moved = [name for row in rows for name in row.variables]
    return {
        joint.variable: {kind: robot.parameter(f"{joint.name}.{kind}") for kind in STIFFNESS_KINDS}
        for joint in robot.joints
        if joint.variable is not None and moved.count(joint.variable) == 1
    }


def _chain(robot: Robot) -> list[_Row]:
    expressions = frame_expressions(robot)
    parents = {frame.name: frame.parent for frame in robot.frames}
    tcp = next(node for node in robot.nodes if node.name == robot.tcp)
    rows: list[_Row] = []
    name = tcp.frame
    while name != "base":
        rows.insert(0, _Row(name, {key: value for key, value in expressions[name].items() if value != ZERO}))
        name = parents[name]
    if any(tcp.at):
        (parameters,) = frame_parameters(transform(np.eye(3), np.array(tcp.at)))
        rows.append(_Row("tcp", {key: Expression(value) for key, value in parameters.items()}))
    for row in rows:
        for key in ("alpha", "d", "gamma", "b", "beta"):
            if row.get(key).coefficients:
                raise BeamstiffError(
                    f"frame {row.name!r}: {key} moves ({row.get(key)}), which no table of frames says: "
                    "expected joints about or along z"
                )
    return rows


def _plain(row: _Row) -> list[_Row]:
    """Return the row, or two where it has a beta, or both turns and slides."""
    both = row.get("theta").coefficients and row.get("r").coefficients
    if row.get("beta") == ZERO and not both:
        return [row]
    first = _Row(row.name, {key: row.get(key) for key in ("gamma", "b", "alpha", "d", "theta")})
    second = _Row(f"{row.name} 2", {"r": row.get("r")})
    if row.get("beta") != ZERO:
        first.add("theta", Expression(math.pi / 2))
        second.values |= {"alpha": row.get("beta"), "theta": Expression(-math.pi / 2)}
    return [first, second]


def _modified(rows: list[_Row]) -> list[_Row]:
    result: list[_Row] = []
    for row in rows:
        if row.get("gamma") != ZERO or row.get("b") != ZERO:
            if not result:
                result.append(_Row("mount"))
            result[-1].add("theta", row.get("gamma"))
            result[-1].add("d", row.get("b"))
        new = _Row(
            row.name,
            {"alpha": row.get("alpha"), "a": row.get("d"), "theta": row.get("theta"), "d": row.get("r")},
        )
        result.append(new)
    return result


def _classic(rows: list[_Row]) -> list[_Row]:
    result = [_Row("mount")]
    for row in rows:
        result[-1].values |= {"a": row.get("a"), "alpha": row.get("alpha")}
        result.append(_Row(row.name, {"theta": row.get("theta"), "d": row.get("d")}))
    if all(value == ZERO for value in result[-1].values.values()):
        result.pop()  # its x motions stand in the row before
    return result[1:] if all(value == ZERO for value in result[0].values.values()) else result


def _sum(one: Expression, other: Expression) -> Expression:
    coefficients = dict(one.coefficients)
    for name, value in other.coefficients.items():
        coefficients[name] = coefficients.get(name, 0.0) + value
    return Expression(
        one.constant + other.constant, {key: value for key, value in coefficients.items() if value}
    )


def _csv(
    robot: Robot, rows: list[_Row], convention: str, stiffness: Mapping[str, Mapping[str, float]]
) -> str:
    out = io.StringIO()
    out.write(f"# convention: {convention}\n# name: {robot.name}\n")
    writer = csv.writer(out, lineterminator="\n")
    keys = CONVENTIONS[convention]
    gives = [kind for kind in STIFFNESS_KINDS if any(np.isfinite(own[kind]) for own in stiffness.values())]
    units = {kind: "N*m/rad" if KINDS[kind] == "rotational stiffness" else "N/m" for kind in gives}
    frame = [f"{key} [{'deg' if KINDS[key] == 'angle' else 'mm'}]" for key in keys]
    writer.writerow(["name", *frame, *(f"{kind} [{unit}]" for kind, unit in units.items())])
    for row in rows:
        own = next((stiffness[name] for name in row.variables if name in stiffness), {})
        springs = [WORDS.get(own[kind], own[kind]) if own else "" for kind in gives]
        writer.writerow([row.name, *(_cell(row.name, key, row.get(key)) for key in keys), *springs])
    return out.getvalue()


def _cell(name: str, key: str, value: Expression) -> str:
    constant = math.degrees(value.constant) if KINDS[key] == "angle" else value.constant * 1e3
    exact = math.radians if KINDS[key] == "angle" else _millimetres
    short = float(f"{constant:.13g}")
    number = repr(short if exact(short) == value.constant else constant)
    number = number.removesuffix(".0")
    terms = list(value.coefficients.items())
    if not terms:
        return number
    if len(terms) > 1 or abs(terms[0][1]) != 1.0:
        raise BeamstiffError(
            f"frame {name!r}: {key} is {value}, which a table does not say: expected one variable and an "
            "offset"
        )
    text = terms[0][0] if terms[0][1] > 0 else f"-{terms[0][0]}"
    if value.constant:
        text += f" - {number[1:]}" if number.startswith("-") else f" + {number}"
    return text


def _millimetres(value: float) -> float:
    return value / 1e3
