"""Machines with parts that the robot lacks: under the base, across a joint, before the tool."""

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.components import stiffness_of
from beamstiff.exam.laws import Curved, Law, Situation, posed
from beamstiff.exam.machine import (
    Hinge,
    Machine,
    Mesh,
    Rod,
    axes_from,
    in_the_middle,
    joints_of,
    own_stiffness,
)
from beamstiff.exam.parameters import Parameters
from beamstiff.exam.rotations import cross_matrix
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Mass

UP = np.array([0.0, 0.0, 1.0])
NONE: Mapping[int, Law] = {}


def on_pedestal(machine: Machine, stiffness: Array, laws: Mapping[int, Law] = NONE) -> Machine:
    """Return the machine with its fixed nodes on one body, held by springs (6,) or (6, 6) in their middle."""
    foot = machine.places(*machine.fixed).mean(axis=0)
    machine, ground = machine.with_node("ground", "base", foot)
    machine, body = machine.with_node("foot", "base", foot, *machine.fixed)
    hinge = Hinge(body, (ground, body), "base", np.eye(3), stiffness, laws)
    return dataclasses.replace(machine.plus(hinges=(hinge,)), fixed=(ground,))


def behind_flange(machine: Machine) -> tuple[Machine, str]:
    """Return the machine cut open before its TCP and what hangs on that alone, and the node left there."""
    flange = machine.free_name("flange")
    tcp = machine.tcp
    held = machine.held(but=tcp)

    def moved(nodes: tuple[str, str]) -> tuple[str, str]:
        a, b = (flange if name == tcp and held & set(nodes) else name for name in nodes)
        return a, b

    node = machine.node(tcp).model_copy(update={"name": flange})
    cut = dataclasses.replace(
        machine,
        nodes=(*machine.nodes, node),
        rigids=tuple((name, moved(nodes)) for name, nodes in machine.rigids),
        hinges=tuple(dataclasses.replace(h, nodes=moved(h.nodes)) for h in machine.hinges),
        bars=tuple(dataclasses.replace(b, nodes=moved(b.nodes)) for b in machine.bars),
        rods=tuple(dataclasses.replace(r, nodes=moved(r.nodes)) for r in machine.rods),
    )
    return cut, flange


def sprung(
    machine: Machine, flange: str, at: Array, stiffness: Array, laws: Mapping[int, Law] = NONE
) -> Machine:
    """Return the machine with springs between flange and tool, at a place seen from the TCP in its frame."""
    tcp = machine.node(machine.tcp)
    machine, first = machine.with_node("held", tcp.frame, np.array(tcp.at) + at, flange)
    machine, second = machine.with_node("held", tcp.frame, np.array(tcp.at) + at, tcp.name)
    return machine.plus(hinges=(Hinge(first, (first, second), tcp.frame, np.eye(3), stiffness, laws),))


def with_loose_mass(
    machine: Machine, axis: Array, along: float, mass: float, stiffness: Array, laws: Mapping[int, Law] = NONE
) -> Machine:
    """Return the machine with a mass that springs hold to the tool, along an axis from the TCP."""
    tcp = machine.node(machine.tcp)
    at = np.array(tcp.at) + along * axis
    machine, seat = machine.with_node("seat", tcp.frame, at, tcp.name)
    machine, loose = machine.with_node("loose", tcp.frame, at)
    hinge = Hinge(loose, (seat, loose), tcp.frame, axes_from(axis), stiffness, laws)
    return machine.plus(hinges=(hinge,), masses=(Mass(node=loose, mass=mass),))


def tied_to_ground(
    machine: Machine, wanted: str, axis: Array, stiffness: Array, laws: Mapping[int, Law] = NONE
) -> Machine:
    """Return the machine whose TCP springs tie to the ground, the first along an axis of the base frame."""
    tcp = machine.node(machine.tcp)
    # a node of the base could not follow the poses, so the ground's end hangs on the tool's frame
    machine, end = machine.with_node(wanted, tcp.frame, np.array(tcp.at))
    hinge = Hinge(end, (end, tcp.name), "base", axes_from(axis), stiffness, laws)
    return machine.plus(hinges=(hinge,), fixed=(end,))


def seen_from_foot(at: Array, k: Array) -> Array:
    """Return the stiffness (6, 6) at the foot of springs (6, 6) at a place (3,) from it."""
    X = np.eye(6)
    X[:3, 3:] = -cross_matrix(at)
    return np.asarray(X.T @ k @ X)


def lever(near: float, far: float, angle: Array | float) -> tuple[Array, Array]:
    """Return a rod's lever about an axis and its length, m, whose ends' arms there are at an angle."""
    length = np.sqrt(near**2 + far**2 - 2.0 * near * far * np.cos(angle))
    return np.asarray(near * far * np.sin(angle) / length), np.asarray(length)


def axis_in_the_middle(machine: Machine, joint: str) -> tuple[Array, Array]:
    """Return a joint's axis (3,) and a point on it (3,), base frame, in the middle of the range."""
    placed, hinge = in_the_middle(machine.robot), machine.hinge(joint)
    axis = placed.rotations[hinge.frame][0] @ hinge.axes[:, 0]
    return axis, placed.node(machine.node(hinge.nodes[1]))[0]


def with_rod(
    machine: Machine, joint: str, arms: tuple[float, float], angle: float, stiffness: float, law: Law | None
) -> Machine:
    """Return the machine with a rod across a joint, rigidly on its nodes, by `arms` from the axis, m.

    `angle`: rad; from the arm before (the second) to the arm behind, in the middle of its range.
    """
    axis, point = axis_in_the_middle(machine, joint)
    up = UP if abs(axis[2]) < 0.7 else np.array([1.0, 0.0, 0.0])
    u = up - (up @ axis) * axis
    u = u / np.linalg.norm(u)
    behind_at = point + arms[0] * (-np.cos(angle) * u - np.sin(angle) * np.cross(axis, u))
    a, b = machine.hinge(joint).nodes
    machine, before = machine.with_node_at("rod_before", machine.node(a).frame, point - arms[1] * u, a)
    machine, behind = machine.with_node_at("rod_behind", machine.node(b).frame, behind_at, b)
    return machine.plus(rods=(Rod(machine.free_name("rod"), (before, behind), stiffness, law),))


def turned(p: Parameters, variable: str, situation: Situation) -> Array:
    """Return how far a balancer's crank has turned from the middle of the range, (P,), rad."""
    return np.asarray(p["way"] * (situation.values[variable] - p["middle"]))


def crank_stiffness(p: Parameters, robot: Robot, variable: str) -> float:
    """Return a balancer's stiffness against small strains, N/m."""
    return p["share"] * stiffness_of(robot, variable) / p["crank"] ** 2


def with_balancer(
    spring: Callable[[Parameters, float, Array], Curved], p: Parameters, machine: Machine, variable: str
) -> Machine:
    """Return the machine with a rod across each joint of a variable: `crank`, `frame` and `angle` of p.

    `spring`: stiffness and force, from p, that against small strains, and the stretch from mid-range, m.
    """
    strong = crank_stiffness(p, machine.robot, variable)
    middle = lever(p["crank"], p["frame"], p["angle"])[1]

    def curve(strain: Array, situation: Situation) -> Curved:
        now = lever(p["crank"], p["frame"], p["angle"] + turned(p, variable, situation))[1]
        k, pull = spring(p, strong, now - middle)
        return k * strain + pull, k

    for name, _ in joints_of(machine.robot, variable):
        machine = with_rod(machine, name, (p["crank"], p["frame"]), p["angle"], strong, posed(curve))
    return machine


def about_x(angle: float) -> Array:
    """Return the matrix (3, 3) that turns about x."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def across_link(a: Array, b: Array, side: float) -> Array:
    """Return a unit vector (3,) across the line from a to b, turned about it to a side, rad."""
    along = (b - a) / np.linalg.norm(b - a)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across = across / np.linalg.norm(across)
    return np.asarray(np.cos(side) * across + np.sin(side) * np.cross(along, across))


def pair_of(machine: Machine, component: str) -> tuple[tuple[str, int], tuple[str, int], float, float]:
    """Return two drives that are linked, as hinge and direction, and the stiffness of each."""
    one, two = (joints_of(machine.robot, name)[0] for name in component.split("+"))
    return one, two, own_stiffness(machine.robot, *one), own_stiffness(machine.robot, *two)


def beside(machine: Machine, hinge: str, direction: int, law: Law) -> Machine:
    """Return the machine with a law parallel to whatever a hinge has in a direction."""
    return machine.plus(meshes=(Mesh((hinge, direction), (hinge, direction), (1.0, 0.0), law),))


def round_about(machine: Machine, hinge: str, first: int, law: Law) -> Machine:
    """Return the machine with a law in every way of tilting about two directions of a hinge.

    `law`: of one of four springs on diameters 45 degrees apart, each with half of the stiffness.
    """
    for angle in 0.25 * np.pi * np.arange(4):
        weights = (float(np.cos(angle)), float(np.sin(angle)))
        machine = machine.plus(meshes=(Mesh((hinge, first), (hinge, first + 1), weights, law),))
    return machine
