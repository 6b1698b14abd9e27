"""The simulated machine: rigid bodies, held together by springs, beams and rods.

Made from a robot's description and then changed by effects: what is rigid in the model may bend here, and a
linear spring of the model may follow any law.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Self

import networkx as nx
import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array
from beamstiff.exam.laws import Law, Situation
from beamstiff.exam.placing import Placed, place, skeleton_of
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import JOINT_DIRECTIONS, Mass, Node
from beamstiff.robot.sections import section_properties

TURN = 3  # direction about the joint's axis
ALONG = 0
GAUSS = np.polynomial.legendre.leggauss(6)
Weight = float | Callable[[Situation], Array]
WIDE = np.deg2rad(60.0)  # stroke to either side where a variable has no limits
LONG = 0.4  # m, likewise of a prismatic one


@dataclass(frozen=True, eq=False)
class Hinge:
    """Springs in six directions between two nodes at one place."""

    name: str
    nodes: tuple[str, str]
    frame: str  # frame that `axes` are given in
    axes: Array  # (3, 3): its axes as columns, the joint's own first
    stiffness: Array  # (6,): infinity is rigid, 0 free; or (6, 6), without rigid directions; in these axes
    laws: Mapping[int, Law] = field(default_factory=dict)  # in place of their stiffness, by direction


@dataclass(frozen=True, eq=False)
class Profile:
    """A beam's compliance along its length, from the first end (0) to the second (1)."""

    stations: Array  # (G,): places along the beam, from 0 to 1
    # (G, 6): of unit length against stretch, shear (2), twist and bending (2), times the share of the length
    compliance: Array


@dataclass(frozen=True, eq=False)
class Bar:
    """A beam between two nodes."""

    name: str
    nodes: tuple[str, str]
    profile: Profile
    up: Array | None  # (3,): in the frame of the first node; local y lies in the plane of the axis and it
    weight: float = 0.0  # kg/m


@dataclass(frozen=True, eq=False)
class Rod:
    """A spring along the line between two nodes; its rest length follows the drives."""

    name: str
    nodes: tuple[str, str]
    stiffness: float  # N/m; infinity is rigid
    law: Law | None = None  # in place of the stiffness


@dataclass(frozen=True, eq=False)
class Cross:
    """Stiffness that links two directions of hinges."""

    first: tuple[str, int]  # hinge and direction
    second: tuple[str, int]
    added: Array  # (2, 2): added to the stiffness of the two


@dataclass(frozen=True, eq=False)
class Mesh:
    """A spring between two directions of hinges, as gears or a belt make one; it may follow any law.

    Its strain is the sum of the two strains, each times its weight: a number, or (P,) numbers from the
    situation where a lever arm changes with the pose.
    """

    first: tuple[str, int]  # hinge and direction
    second: tuple[str, int]
    weights: tuple[Weight, Weight]
    law: Law


@dataclass(frozen=True, eq=False)
class Hose:
    """A hose that a node lifts off the ground: the higher the node, the more of it hangs there."""

    node: str
    per_metre: float  # kg/m
    low: float  # m; height of the node, against gravity from the base frame's origin, at which nothing hangs


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine as its parts; see the classes of the parts."""

    robot: Robot
    nodes: tuple[Node, ...]
    rigids: tuple[tuple[str, tuple[str, str]], ...]
    hinges: tuple[Hinge, ...]
    bars: tuple[Bar, ...]
    rods: tuple[Rod, ...]
    crosses: tuple[Cross, ...]
    masses: tuple[Mass, ...]
    fixed: tuple[str, ...]
    tcp: str
    meshes: tuple[Mesh, ...] = ()
    hoses: tuple[Hose, ...] = ()

    def node(self, name: str) -> Node:
        """Return a node by name."""
        return next(node for node in self.nodes if node.name == name)

    def hinge(self, name: str) -> Hinge:
        """Return a hinge by name."""
        return next(hinge for hinge in self.hinges if hinge.name == name)

    def with_hinge(self, hinge: Hinge) -> Self:
        """Return the machine with the hinge of that name replaced."""
        hinges = tuple(hinge if h.name == hinge.name else h for h in self.hinges)
        return dataclasses.replace(self, hinges=hinges)

    def with_law(self, name: str, direction: int, law: Law) -> Self:
        """Return the machine with a law in one direction of a hinge."""
        hinge = self.hinge(name)
        return self.with_hinge(dataclasses.replace(hinge, laws={**hinge.laws, direction: law}))

    def with_stiffness(self, name: str, directions: int | slice, stiffness: Array | float) -> Self:
        """Return the machine with another stiffness in some directions of a hinge."""
        hinge = self.hinge(name)
        k = hinge.stiffness.copy()
        k[directions] = stiffness
        return self.with_hinge(dataclasses.replace(hinge, stiffness=k))

    def with_profile(self, name: str, change: Callable[[Profile], Profile]) -> Self:
        """Return the machine with the profile of the bar of that name changed."""
        bars = (
            dataclasses.replace(bar, profile=change(bar.profile)) if bar.name == name else bar
            for bar in self.bars
        )
        return dataclasses.replace(self, bars=tuple(bars))

    def plus(self, **parts: tuple[Any, ...]) -> Self:
        """Return the machine with further parts of some kinds, by the names of the attributes."""
        return dataclasses.replace(self, **{name: getattr(self, name) + more for name, more in parts.items()})

    def without(self, name: str) -> Self:
        """Return the machine without the rigid or the bar of that name."""
        rigids = tuple(rigid for rigid in self.rigids if rigid[0] != name)
        return dataclasses.replace(self, rigids=rigids, bars=tuple(b for b in self.bars if b.name != name))

    def free_name(self, wanted: str) -> str:
        """Return a node's name that the machine does not have yet."""
        taken = {node.name for node in self.nodes} | {hinge.name for hinge in self.hinges}
        return next(name for name in (f"{wanted}{i or ''}" for i in count()) if name not in taken)

    def with_node(self, wanted: str, frame: str, at: Array, *hosts: str) -> tuple[Self, str]:
        """Return the machine with a new node at a place (3,) in a frame, rigidly on others, and its name."""
        name = self.free_name(wanted)
        node = Node(name=name, frame=frame, at=tuple(at.tolist()))
        ties = tuple((f"{host} {name}", (host, name)) for host in hosts)
        return self.plus(nodes=(node,), rigids=ties), name

    def with_node_at(self, wanted: str, frame: str, at: Array, *hosts: str) -> tuple[Self, str]:
        """Return the same of a place in the base frame, where the machine is in the middle of its range."""
        placed = in_the_middle(self.robot)
        local = placed.rotations[frame][0].T @ (at - placed.origins[frame][0])
        return self.with_node(wanted, frame, local, *hosts)

    def seen_from(self, node: str, way: Array) -> Array:
        """Return a way (3,) of the base frame as a node's frame has it in the middle of the range."""
        return np.asarray(in_the_middle(self.robot).rotations[self.node(node).frame][0].T @ way)

    def places(self, *names: str) -> Array:
        """Return where nodes are in the middle of the range, (n, 3), base frame."""
        placed = in_the_middle(self.robot)
        return np.array([placed.node(self.node(name))[0] for name in names])

    def bodies(self) -> dict[str, int]:
        """Return the body of every node: those that rigids join are one, those that are fixed are body 0."""
        joined: nx.Graph[str] = nx.Graph()
        joined.add_nodes_from([self.fixed[0], *(node.name for node in self.nodes)])  # the ground comes first
        joined.add_edges_from(nodes for _, nodes in self.rigids)
        nx.add_path(joined, self.fixed)
        return {name: at for at, body in enumerate(nx.connected_components(joined)) for name in body}

    def held(self, *, but: str | None = None) -> set[str]:
        """Return the nodes that parts hold to the ground, those parts left out that end at one node."""
        ties = [nodes for _, nodes in self.rigids] + [hinge.nodes for hinge in self.hinges]
        ties += [bar.nodes for bar in self.bars] + [rod.nodes for rod in self.rods]
        tied: nx.Graph[str] = nx.Graph([nodes for nodes in ties if but not in nodes])
        nx.add_path(tied, self.fixed)
        return set(nx.node_connected_component(tied, self.fixed[0]))


def machine_of(robot: Robot) -> Machine:
    """Return the machine that is just as the robot's description says."""
    hinges = [
        Hinge(
            joint.name,
            joint.nodes,
            joint.frame,
            axes_from(np.array(joint.axis, dtype=np.float64)),
            np.array([getattr(joint.stiffness, kind) for kind in JOINT_DIRECTIONS], dtype=np.float64),
        )
        for joint in robot.joints
    ]
    bars = []
    for beam in robot.beams:
        material, section = robot.materials[beam.material], section_properties(robot.sections[beam.section])
        Ay, Az = (math.inf if area is None else area for area in (section.Ay, section.Az))
        E, G = material.E, material.G
        rigidity = [E * section.A, G * Ay, G * Az, G * section.J, E * section.Iy, E * section.Iz]
        profile = tapered(np.array(rigidity), np.ones_like)
        up = None if beam.up is None else np.array(beam.up, dtype=np.float64)
        bars.append(Bar(beam.name, beam.nodes, profile, up, material.density * section.A))
    if sprung := [strut.name for strut in robot.struts if strut.EA is not None]:
        raise BeamstiffError(f"strut {sprung[0]!r}: found EA, which simulated machines do not know")
    rigids = tuple((rigid.name, rigid.nodes) for rigid in robot.rigids)
    rods = tuple(Rod(strut.name, strut.nodes, strut.stiffness) for strut in robot.struts)
    held = (robot.masses, robot.fixed, robot.tcp)
    return Machine(robot, tuple(robot.nodes), rigids, tuple(hinges), tuple(bars), rods, (), *held)


def tapered(rigidity: Array, size: Callable[[Array], Array], bending: float = 4.0) -> Profile:
    """Return the profile of a beam whose cross-section changes its linear size, from 0 to 1 along it.

    `rigidity`: (6,) array; EA, G Ay, G Az (infinite: stiff in shear), GJ, E Iy, E Iz where `size` is 1.
    `bending`: power of the size that bending and twist grow with; stretch and shear grow with half of it.
    """
    stations = 0.5 * (GAUSS[0] + 1.0)
    scale = size(stations)[:, None]
    powers = np.array([0.5, 0.5, 0.5, 1.0, 1.0, 1.0]) * bending
    with np.errstate(divide="ignore"):
        return Profile(stations, 0.5 * GAUSS[1][:, None] / (rigidity * scale**powers))


def axes_from(axis: Array) -> Array:
    """Return right-handed axes as columns, the first along `axis`."""
    x = axis / np.linalg.norm(axis)
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y = y / np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def joints_of(robot: Robot, component: str) -> tuple[tuple[str, int], ...]:
    """Return the joints (name, own direction) that a component stands for: a variable's, or one by name.

    Raises BeamstiffError when no joint has that variable or name.
    """
    kinds = {variable.name: variable.type for variable in robot.variables}
    chosen = [j for j in robot.joints if j.variable == component] or [
        j for j in robot.joints if j.name == component
    ]
    if not chosen:
        raise BeamstiffError(f"robot {robot.name!r} has no joint {component!r}")
    return tuple((j.name, ALONG if kinds.get(j.variable or "") == "prismatic" else TURN) for j in chosen)


def own_stiffness(robot: Robot, joint: str, direction: int) -> float:
    """Return the stiffness of a joint in one direction, SI."""
    found = next(j for j in robot.joints if j.name == joint)
    return float(getattr(found.stiffness, JOINT_DIRECTIONS[direction]))


def components_of(robot: Robot) -> list[str]:
    """Return all joints, by their variables where they have one."""
    return list(dict.fromkeys(joint.variable or joint.name for joint in robot.joints))


def drives_of(robot: Robot) -> list[str]:
    """Return the components whose own direction is an elastic drive: neither rigid nor free."""
    every = ((name, joints_of(robot, name)) for name in components_of(robot))
    return [name for name, joints in every if all(0.0 < own_stiffness(robot, *j) < math.inf for j in joints)]


def stroke(robot: Robot, variable: str | None) -> tuple[float, float]:
    """Return the middle and half the width of a variable's range, rad or m."""
    found = next((v for v in robot.variables if v.name == variable), None)
    if found is None:
        return 0.0, float(WIDE)
    if found.limits is None:
        return found.guess, LONG if found.type == "prismatic" else float(WIDE)
    low, high = found.limits
    return 0.5 * (low + high), 0.5 * (high - low)


def in_the_middle(robot: Robot, **moved: float) -> Placed:
    """Return the robot in the middle of its range, one pose, with some variables moved from there."""
    q = np.array([[stroke(robot, v.name)[0] + moved.get(v.name, 0.0) for v in robot.actuated]])
    return place(skeleton_of(robot), q)
