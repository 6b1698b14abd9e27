"""Rods across a joint: from a point before it to a point behind it, at one height on the axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.effect import in_the_middle
from beamstiff.exam.laws import Law
from beamstiff.exam.machine import Machine, Rod, joints_of
from beamstiff.exam.pedestal import free_name, node_at
from beamstiff.robot.parts import Node


@dataclass(frozen=True)
class Across:
    """Where a rod's ends sit about a joint's axis in the middle of its range.

    `behind`, `before`: float, m; distances of the ends on the moved side and on the other from the axis.
    `angle`: float, rad; from the arm before to the arm behind, about the axis.
    """

    variable: str
    behind: float
    before: float
    angle: float


def lever(near: float, far: float, angle: Array | float) -> tuple[Array, Array]:
    """Return a rod's lever about an axis and its length, m, whose ends' arms there are at an angle."""
    length = np.sqrt(near**2 + far**2 - 2.0 * near * far * np.cos(angle))
    return np.asarray(near * far * np.sin(angle) / length), np.asarray(length)


def axis_in_the_middle(machine: Machine, joint: str) -> tuple[Array, Array]:
    """Return a joint's axis (3,) and a point on it (3,), base frame, in the middle of the range."""
    placed, hinge = in_the_middle(machine.robot), machine.hinge(joint)
    axis = placed.rotations[hinge.frame][0] @ hinge.axes[:, 0]
    return axis, placed.node(machine.node(hinge.nodes[1]))[0]


def across(machine: Machine, joint: str, place: Across) -> tuple[tuple[str, Node], tuple[str, Node]]:
    """Return the nodes that each of a rod's ends hangs on, and the ends as new nodes: before, behind."""
    placed, hinge = in_the_middle(machine.robot), machine.hinge(joint)
    axis, point = axis_in_the_middle(machine, joint)
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.7 else np.array([1.0, 0.0, 0.0])
    u = up - (up @ axis) * axis
    u = u / np.linalg.norm(u)
    v = np.cross(axis, u)
    before = point - place.before * u
    behind = point + place.behind * (-np.cos(place.angle) * u - np.sin(place.angle) * v)

    first, second = hinge.nodes
    a, b = (machine.node(name).frame for name in hinge.nodes)
    return (
        (first, node_at(machine, placed, a, before, "rod_before")),
        (second, node_at(machine, placed, b, behind, "rod_behind")),
    )


def with_rod(
    machine: Machine, ends: tuple[tuple[str, Node], tuple[str, Node]], stiffness: float, law: Law | None
) -> Machine:
    """Return the machine with a rod between two new nodes, each rigidly on its host."""
    (a, before), (b, behind) = ends
    name = free_name(machine, "rod")
    return machine.plus(
        nodes=(before, behind),
        rigids=((f"{a} {before.name}", (a, before.name)), (f"{b} {behind.name}", (b, behind.name))),
        rods=(Rod(name, (before.name, behind.name), stiffness, law),),
    )


def with_balancer(
    machine: Machine, variable: str, p: Mapping[str, float], stiffness: float, law: Law
) -> Machine:
    """Return the machine with a rod across each joint of a variable: `crank`, `frame` and `angle` of p."""
    for name, _ in joints_of(machine.robot, variable):
        place = Across(variable, p["crank"], p["frame"], p["angle"])
        machine = with_rod(machine, across(machine, name, place), stiffness, law)
    return machine
