"""Bodies and joints of a machine while it is put together: variables, springs of joints and beams.

A beam of constant length bends at its two Gauss points, L/2 -+ L/sqrt(12), by half of its compliance
L/EI each: its bending moment is linear, so Gauss's rule of two points makes ``integral M(x) m(x)/EI dx``
exact. What is constant along it (axial force, shear, torsion) is compliant at the middle. Bent by a
moment at its end a beam draws its ends together by theta^2 L/6; with two such hinges by 7 % more, with
one at the middle by 50 %: this part of what an axial load does to the stiffness is wrong.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamstiff.fem.beam_element import beam_axes
from beamstiff.fem.unknowns import joint_values
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.parts import JOINT_DIRECTIONS, Beam, Joint, Rigid
from beamstiff.robot.sections import section_properties
from beamstiff.se3 import Array
from beamstiff.simulators.bodies import Body, BodyJoint, Closure, Kind, Role, Tendon, free_name, placed_bodies
from beamstiff.simulators.paths import Machine, Move, constant, moves_between, over_a_loop

PARALLEL = 1e-6  # m and rad a unit rate: nearer than this, motions are the same
GAUSS = 12**-0.5  # of the length: from a beam's middle to where it bends
Element = Rigid | Joint | Beam


class Assembly:
    """The bodies of a machine while they are put together."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.bodies = [Body("base", -1, np.eye(4))]
        self.of_node: dict[str, tuple[int, Array]] = {}  # body, and the node's frame in it
        self.joint_names: set[str] = set()
        self.body_names = {"base", "world"}
        self.closures: list[Closure] = []
        self.tendons: list[Tendon] = []
        self.reference: dict[str, float] = {}
        self.lost: list[str] = []
        self.varies = False
        self.nodes = {node.name: node for node in machine.robot.nodes}
        self.variables = {variable.name: variable for variable in machine.robot.variables}

    # -- bodies and joints

    def body(self, name: str, parent: int, placed: Array) -> int:
        """Add a body; return its number."""
        self.bodies.append(Body(free_name(name, self.body_names), parent, placed))
        return len(self.bodies) - 1

    def join(self, body: int, joint: BodyJoint) -> None:
        """Add a joint to a body, after those that it has."""
        self.bodies[body].joints.append(replace(joint, name=free_name(joint.name, self.joint_names)))

    def move(self, body: int, frame: Array, one: str, other: str, name: str) -> tuple[int, Array, bool]:
        """Go from frame `one`, placed in a body, to `other`; return body, place there, whether it is new."""
        relative = self.machine.relative(one, other)
        if constant(relative):
            return body, frame @ relative[0], False
        anew = False
        for step in moves_between(self.machine, one, other):
            frame = frame @ step.placed
            if not step.variable:
                continue
            body, frame, anew = self.body(name, body, frame), np.eye(4), True
            self.join(body, self._variable(step))
        return body, frame, anew

    def _variable(self, move: Move) -> BodyJoint:
        """Return the joint of a variable: its own, or one that follows it where it moves several parts."""
        name, own = move.variable, self.moved_by(move)
        if abs(move.factor) != 1.0 or name in self.joint_names:
            follower = self._coupled(name, move.factor) or f"{name}.again"
            return replace(own, name=follower, role="follower", leader=name, factor=move.factor)
        self.reference[name] = self.machine.value(name)
        variable = self.variables[name]
        role: Role = "drive" if variable.actuated else "passive"
        return replace(own, axis=move.factor * own.axis, role=role, limits=variable.limits)

    def _coupled(self, leader: str, factor: float) -> str:
        """Return the coupled variable that moves so, where none of the joints is called after it yet."""
        joined = self.machine.kinematics.coupling
        wanted = factor * np.array([float(name == leader) for name in joined.free])
        for name, row in zip(joined.names, joined.matrix, strict=True):
            coupled = self.variables[name].equals is not None and name not in self.joint_names
            if coupled and np.allclose(row, wanted, rtol=1e-12, atol=0.0):
                return name
        return ""

    def moved_by(self, move: Move) -> BodyJoint:
        """Return the joint that moves as a move does, about or along its axis, of its own value."""
        of: Kind = "hinge" if move.kind == "turn" else "slide"
        return BodyJoint(move.variable, of, np.zeros(3), np.eye(3)[move.axis], "passive")

    def point(self, node: str, frame: Array) -> Array:
        """Return the place of a node in the body in which its frame is placed, (3,)."""
        return np.asarray(frame[:3, :3] @ np.array(self.nodes[node].at) + frame[:3, 3])

    def site(self, name: str, body: int, pose: Array) -> str:
        """Add a site to a body."""
        self.bodies[body].sites.append((name, pose))
        return name

    # -- elements

    def hang(self, element: Element, start: str) -> tuple[int, Array]:
        """Hang the other node of an element on the body of `start`; return its body and its frame there."""
        first, second = element.nodes
        end, sign = (second, 1.0) if start == first else (first, -1.0)
        root, frame = self.of_node[start]
        one, other = self.nodes[start].frame, self.nodes[end].frame
        closing = self.closes(first, second)
        if closing:  # the way through the tree of frames is the whole loop: free directions take its place
            body = self.body(element.name, root, frame @ self.machine.relative(one, other)[0])
            frame, anew = np.eye(4), True
        else:
            body, frame, anew = self.move(root, frame, one, other, element.name)
        springs = [*self._compliance(element, frame, end, sign)]
        if springs and not anew:
            body, frame = self.body(element.name, body, frame), np.eye(4)
            springs = [*self._compliance(element, frame, end, sign)]
        if closing and not any(joint.stiffness == 0.0 for joint in springs):
            self.lost.append(
                f"{element.name} closes a loop without a free direction: held as in the reference posture"
            )
        for joint in self.without_passive(root, body, springs):
            self.join(body, joint)
        return body, frame

    def closes(self, first: str, second: str) -> bool:
        """Return whether two nodes meet by closing a loop of frames, not by the variables between them."""
        one, other = self.nodes[first].frame, self.nodes[second].frame
        return not constant(self.machine.relative(one, other)) and over_a_loop(self.machine, one, other)

    def without_passive(self, root: int, body: int, springs: list[BodyJoint]) -> list[BodyJoint]:
        """Return springs without the free directions in which passive variables between two bodies move."""
        poses = placed_bodies(self.bodies, self.reference)
        there = poses[body]
        at = there[:3, 3]
        held: list[Array] = []
        while body != root:
            own = self.bodies[body]
            held += [twist(joint, poses[body], at) for joint in own.joints if joint.role == "passive"]
            body = own.parent
        if not held:
            return springs
        kept = []
        for joint in springs:
            moved = twist(joint, there, at)
            new = rank([*held, moved]) > len(held)
            if joint.stiffness == 0.0 and new:
                held.append(moved)
            if new or joint.stiffness > 0.0:
                kept.append(joint)
        return kept

    def _compliance(self, element: Element, frame: Array, end: str, sign: float) -> Iterator[BodyJoint]:
        """Yield the springs of an element in the body in which the frame of its node `end` is placed."""
        if isinstance(element, Joint):
            yield from self._joint_springs(element, frame, end, sign)
        elif isinstance(element, Beam):
            yield from self._beam_springs(element, frame, end, sign)

    def _joint_springs(self, joint: Joint, frame: Array, end: str, sign: float) -> Iterator[BodyJoint]:
        own = frame @ self.machine.relative(self.nodes[end].frame, joint.frame)[0]
        local = beam_axes(np.array(joint.axis), np.full(3, np.nan))
        axes, at = own[:3, :3] @ local, self.point(end, frame)
        letters = _letters(local)
        variable = self.variables.get(joint.variable or "")
        own_way = 0 if variable is not None and variable.kind == "length" else 3
        for direction, (kind, value) in enumerate(zip(JOINT_DIRECTIONS, joint_values(joint), strict=True)):
            if value == RIGID:
                continue
            if variable is not None and variable.passive and direction == own_way:
                if value == FREE:  # the variable's own joint takes its place
                    continue
                self.lost.append(f"{joint.name}.{kind} is unstressed in the reference posture alone")
            name = f"{joint.name}.{kind}" + (f".{letters[direction % 3]}" if direction % 3 else "")
            if joint.variable is None and "." in joint.name and direction in (0, 3):
                name = joint.name  # one that was read as a spring by itself
            of: Kind = "slide" if direction < 3 else "hinge"
            yield BodyJoint(name, of, at, sign * axes[:, direction % 3], "spring", float(value))

    def _beam_springs(self, beam: Beam, frame: Array, end: str, sign: float) -> Iterator[BodyJoint]:
        machine, robot = self.machine, self.machine.robot
        index = machine.kinematics.node_index
        ends = machine.where.node_positions[0, [index[name] for name in beam.nodes]]
        turned = machine.where.transforms[0, :, :3, :3]
        frames = machine.kinematics.frame_index
        up = np.full(3, np.nan)
        if beam.up is not None:
            up = turned[frames[self.nodes[beam.nodes[0]].frame]] @ np.array(beam.up)
        base = beam_axes(ends[1] - ends[0], up)
        axes = frame[:3, :3] @ turned[frames[self.nodes[end].frame]].T @ base
        lengths = machine.distance(*beam.nodes)
        length = float(lengths[0])
        middle = self.point(end, frame) - sign * axes[:, 0] * length / 2
        if not constant(lengths[:, None]):
            self.varies = True
            self.lost.append(
                f"beam {beam.name} has its compliance at {length:.4g} m in every posture (it has "
                f"{lengths.min():.4g} to {lengths.max():.4g} m)"
            )
        section, material = section_properties(robot.sections[beam.section]), robot.materials[beam.material]
        E, G = material.E, material.G
        bending = {"bending.y": 2 * E * section.Iy / length, "bending.z": 2 * E * section.Iz / length}
        constant_along = {
            "axial": E * section.A / length,
            "shear.y": G * (section.Ay or np.inf) / length,
            "shear.z": G * (section.Az or np.inf) / length,
            "torsion": G * section.J / length,
        }
        # hinges in reverse order behind the middle: what their order does cancels
        order = (bending, constant_along, dict(reversed(bending.items())))
        for values, place in zip(order, (-GAUSS, 0.0, GAUSS), strict=True):
            at = middle + sign * axes[:, 0] * length * place
            for name, value in values.items():
                if np.isfinite(value):
                    of: Kind = "slide" if name in ("axial", "shear.y", "shear.z") else "hinge"
                    axis = sign * axes[:, "yz".find(name[-1]) + 1]
                    yield BodyJoint(f"{beam.name}.{name}", of, at, axis, "spring", float(value))


def twist(joint: BodyJoint, pose: Array, at: Array) -> Array:
    """Return the velocity `[v, w]` of a point for a unit rate of a joint of a body, world frame."""
    axis = pose[:3, :3] @ joint.axis
    if joint.kind == "slide":
        return np.concatenate([axis, np.zeros(3)])
    arm = at - pose[:3, :3] @ joint.at - pose[:3, 3]
    return np.concatenate([np.cross(axis, arm), axis])


def rank(twists: list[Array]) -> int:
    """Return how many of the twists are independent."""
    return int(np.linalg.matrix_rank(np.array(twists), tol=PARALLEL))


def _letters(local: Array) -> str:
    """Return the letters of a joint's three axes, those of its frame that they lie nearest to.

    >>> _letters(beam_axes(np.array([0.0, 0.0, 1.0]), np.full(3, np.nan)))
    'zxy'
    """
    left, found = "xyz", ""
    for axis in local.T:
        letter = max(left, key=lambda one: abs(axis["xyz".index(one)]))
        left, found = left.replace(letter, ""), found + letter
    return found
