"""A robot as a tree of bodies with every spring a joint in series; what closes loops becomes a constraint.

Rigids join nodes to bodies. A spanning tree of joints and beams hangs the bodies on one another: each brings
the variables that lie between its frames, then its compliance. An element that closes a loop becomes a chain
of its own, whose end is held to the body it leads to.
"""

from collections import deque

import numpy as np

from beamstiff.errors import listed
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.robot.description import Robot
from beamstiff.robot.sections import section_properties
from beamstiff.se3 import Array, transform
from beamstiff.simulators.bodies import (
    BodyJoint,
    BodyTree,
    Closure,
    Kind,
    few_joints,
    parents_first,
    placed_bodies,
)
from beamstiff.simulators.effects import add_effects, bare
from beamstiff.simulators.joints import Assembly, Element
from beamstiff.simulators.paths import machine_of
from beamstiff.simulators.struts import add_struts


def assemble(robot: Robot, q: Array | None = None) -> BodyTree:
    """Return the bodies of a robot; what varies is as in the posture `q` (A,), by default the reference."""
    robot = bare(robot)
    made = Assembly(machine_of(robot, q))
    elements: list[Element] = [*robot.rigids, *robot.joints, *robot.beams]
    chords = _spanning_tree(made, elements)
    for element in chords:
        _close(made, element)
    add_struts(made)
    add_effects(made)
    _masses(made)
    for node in robot.nodes:
        body, frame = made.of_node[node.name]
        made.site(node.name, body, transform(frame[:3, :3], made.point(node.name, frame)))
    for element in elements:
        first, second = element.nodes
        (one, a), (other, b) = made.of_node[first], made.of_node[second]
        if one == other:
            made.bodies[one].lines.append((made.point(first, a), made.point(second, b)))
    _idle_variables(made)
    if robot.unmeasured:
        made.lost.append(f"that no load touched {listed(robot.unmeasured)}: their stiffness is a start value")
    return BodyTree(
        robot.name,
        robot.tcp,
        robot.gravity,
        tuple(parents_first(few_joints(made.bodies))),
        tuple(made.closures),
        tuple(made.tendons),
        made.reference,
        tuple(dict.fromkeys(made.lost)),
        made.varies,
    )


def _spanning_tree(made: Assembly, elements: list[Element]) -> list[Element]:
    """Hang all nodes on the base, rigids before joints before beams; return the elements left over.

    Elements that close a loop of frames come last: their free directions are no variables.
    """
    robot = made.machine.robot
    of_node: dict[str, list[tuple[Element, str]]] = {node.name: [] for node in robot.nodes}
    for element in elements:
        for one, other in (element.nodes, element.nodes[::-1]):
            of_node[one].append((element, other))
    left = {id(element): element for element in elements}
    closing = {key for key, element in left.items() if made.closes(*element.nodes)}

    def grow(roots: list[str]) -> None:
        front = deque(roots)
        while front:
            node = front.popleft()
            for element, other in of_node[node]:
                if other in made.of_node or id(element) in closing:
                    continue
                del left[id(element)]
                made.of_node[other] = made.hang(element, node)
                same = made.of_node[other][0] == made.of_node[node][0]
                (front.appendleft if same else front.append)(other)

    def reach_over_loops() -> None:
        for key in [key for key in left if key in closing]:
            for node, other in (left[key].nodes, left[key].nodes[::-1]):
                if node in made.of_node and other not in made.of_node:
                    made.of_node[other] = made.hang(left.pop(key), node)
                    grow([other])
                    return reach_over_loops()

    for name in robot.fixed:
        frame = made.nodes[name].frame
        made.of_node[name] = made.move(0, np.eye(4), "base", frame, f"{name} carrier")[:2]
    grow(list(robot.fixed))
    reach_over_loops()
    turning = turning_nodes(robot)
    for name in [robot.tcp, *made.nodes]:
        if name not in made.of_node:
            made.of_node[name] = _loose_root(made, name, name in turning)
            grow([name])
            reach_over_loops()
    return list(left.values())


def _idle_variables(made: Assembly) -> None:
    """Give variables that move no body a joint of their own, where they are driven; tell of the others."""
    for variable in made.machine.robot.variables:
        if variable.name in made.joint_names or variable.equals is not None:
            continue
        if variable.actuated:
            kind: Kind = "hinge" if variable.kind == "angle" else "slide"
            idle = made.body(f"{variable.name} drive", 0, np.eye(4))
            made.join(idle, BodyJoint(variable.name, kind, np.zeros(3), np.eye(3)[2], "drive"))
        made.lost.append(f"{variable.name} moves no part of the structure")


def _loose_root(made: Assembly, node: str, turning: bool) -> tuple[int, Array]:
    """Hang a part that nothing but struts and loops hold on the base, with all its freedom."""
    frame = made.nodes[node].frame
    body, placed, anew = made.move(0, np.eye(4), "base", frame, node)
    if not anew:
        body, placed = made.body(node, body, placed), np.eye(4)
    turned = placed_bodies(made.bodies, made.reference)[body][:3, :3]
    at = made.point(node, placed)
    free: list[BodyJoint] = []
    for direction in range(6 if turning else 3):
        kind: Kind = "slide" if direction < 3 else "hinge"
        name = f"{node}.{'r' * (direction > 2)}{'xyz'[direction % 3]}"
        free.append(BodyJoint(name, kind, at, turned[direction % 3], "spring"))
    for joint in made.without_passive(0, body, free):
        made.join(body, joint)
    return body, placed


def _close(made: Assembly, element: Element) -> None:
    """Close a loop by an element: a chain from its first node, whose end is held to the second's body."""
    first, second = element.nodes
    count = len(made.bodies)
    body, frame = made.hang(element, first)
    to, there = made.of_node[second]
    if body == to and len(made.bodies) == count:
        return  # of one body: a loop of rigids
    end = transform(frame[:3, :3], made.point(second, frame))
    opposite = transform(there[:3, :3], made.point(second, there))
    sites = made.site(f"{element.name} end", body, end), made.site(f"{element.name} held", to, opposite)
    made.closures.append(Closure(element.name, "weld", *sites))


def _masses(made: Assembly) -> None:
    """Share out point masses and the weight of beams: half of it a sixth of the length from either end.

    So their weight acts on the nodes as the consistent loads do, q L/2 and q L^2/12.
    """
    robot = made.machine.robot
    for mass in robot.masses:
        body, frame = made.of_node[mass.node]
        made.bodies[body].masses.append(
            (mass.mass, made.point(mass.node, frame) + frame[:3, :3] @ np.array(mass.at))
        )
    index, frames = made.machine.kinematics.node_index, made.machine.kinematics.frame_index
    for beam in robot.beams:
        area = section_properties(robot.sections[beam.section]).A
        density = robot.materials[beam.material].density
        ends = made.machine.where.node_positions[0, [index[name] for name in beam.nodes]]
        weight = density * area * float(np.linalg.norm(ends[1] - ends[0]))
        if not weight > 0.0 or not np.isfinite(weight):
            continue
        for name, inward in zip(beam.nodes, (ends[1] - ends[0], ends[0] - ends[1]), strict=True):
            body, frame = made.of_node[name]
            turned = made.machine.where.transforms[0, frames[made.nodes[name].frame], :3, :3]
            at = made.point(name, frame) + frame[:3, :3] @ turned.T @ inward / 6
            made.bodies[body].masses.append((weight / 2, at))
