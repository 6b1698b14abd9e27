"""The robot as calibrated: the same description with other numbers."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamstiff.calibration.parameters import AXES, Parameter
from beamstiff.fem.placed_structure import COINCIDENT
from beamstiff.robot.coupling import frame_expressions, variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import Expression, parse_expression
from beamstiff.robot.forward import Screw, screws_of
from beamstiff.robot.frames import MOTIONS, Kinematics
from beamstiff.robot.kinematics import Posture, compile_kinematics, posture
from beamstiff.robot.parts import Frame, Joint, Mass, Node, Rigid, Variable
from beamstiff.robot.planar_loops import joint_gaps
from beamstiff.se3 import Array

DUST = 1e-13  # m, rad: what a solution leaves of a parameter that nothing moves
JOINED = 1e-9  # m: nearer than this, the nodes of a joint are left where they are


def corrected(robot: Robot, changes: Mapping[str, float], q: Array) -> Robot:
    """Return a robot with other geometry.

    Where frames move, the first node of each joint follows the second one, so that joints stay whole; if it
    is another joint's too, it stays and bears a bracket. Masses stay where points move.

    `changes`: deviations by parameter, SI: frames' parameters, encoders' zeros, places of measured points.
    Those of the measuring frame and of the target are no part of a robot and left out. `q` (P, A): joint
    readings at which the loops close, one at least.
    """
    changes = {name: float(by) for name, by in changes.items() if abs(by) > DUST}
    robot = _apart_from_joints(robot, changes)
    declared = {variable.name for variable in robot.variables}
    zeros = {name: by for name, by in changes.items() if name in declared and by}
    result = robot.model_copy(
        update={
            "variables": tuple(_variable(robot, item, zeros) for item in robot.variables),
            "frames": tuple(_frame(robot, item, zeros, changes) for item in robot.frames),
            "nodes": tuple(_node(item, changes) for item in robot.nodes),
            "masses": tuple(_mass(item, changes) for item in robot.masses),
        }
    )
    return _joined(robot, result, q) if robot.joints else result


def nominal_value(robot: Robot, item: Parameter) -> float:
    """Return what the robot says of a parameter, SI."""
    owner, _, name = item.name.rpartition(".")
    if item.group == "frame":
        value = getattr(next(frame for frame in robot.frames if frame.name == owner), name)
        return frame_expressions(robot)[owner][name].constant if isinstance(value, str) else float(value)
    if item.group == "compliance":
        return 1.0 / robot.parameter(item.name)
    if item.group == "target" and owner != "target":
        place = next(node for node in robot.nodes if node.name == owner).at
        return float(place[AXES.index(name)])
    return 0.0


def _variable(robot: Robot, item: Variable, zeros: Mapping[str, float]) -> Variable:
    if item.equals is None or not zeros:
        return item
    kinds = variable_kinds(robot)
    exact = parse_expression(item.equals, kinds[item.name], kinds)
    if not set(exact.coefficients) & set(zeros):
        return item
    return item.model_copy(update={"equals": str(_text(_moved(exact, zeros)))})


def _frame(robot: Robot, item: Frame, zeros: Mapping[str, float], changes: Mapping[str, float]) -> Frame:
    update = {}
    for name, exact in frame_expressions(robot)[item.name].items():
        by = changes.get(f"{item.name}.{name}", 0.0)
        if by or set(exact.coefficients) & set(zeros):
            moved = _moved(exact, zeros)
            update[name] = _text(replace(moved, constant=moved.constant + by))
    return item.model_copy(update=update) if update else item


def _moved(exact: Expression, zeros: Mapping[str, float]) -> Expression:
    by = sum(factor * zeros.get(name, 0.0) for name, factor in exact.coefficients.items())
    return replace(exact, constant=exact.constant + by)


def _text(exact: Expression) -> float | str:
    """Return an expression as people write it: ``q2 - 1.5708``."""
    if not exact.coefficients:
        return exact.constant
    parts = []
    for name, factor in exact.coefficients.items():
        sign = "-" if factor < 0 else "+"
        parts.append(f"{sign} {name}" if abs(factor) == 1.0 else f"{sign} {abs(factor)!r}*{name}")
    if exact.constant:
        parts.append(f"{'-' if exact.constant < 0 else '+'} {abs(exact.constant)!r}")
    text = " ".join(parts)
    return text.removeprefix("+ ") if text.startswith("+") else f"-{text.removeprefix('- ')}"


def _node(item: Node, changes: Mapping[str, float]) -> Node:
    at = _shifted(item.at, item.name, changes, 1.0)
    return item if at == item.at else item.model_copy(update={"at": at})


def _mass(item: Mass, changes: Mapping[str, float]) -> Mass:
    """Return a mass that stays where it is: what was found is the place of the reflector."""
    at = _shifted(item.at, item.node, changes, -1.0)
    return item if at == item.at else item.model_copy(update={"at": at})


def _shifted(
    at: tuple[float, float, float], node: str, changes: Mapping[str, float], sign: float
) -> tuple[float, float, float]:
    x, y, z = (
        place + sign * changes.get(f"{node}.{axis}", 0.0) for place, axis in zip(at, AXES, strict=True)
    )
    return x, y, z


def _joined(nominal: Robot, robot: Robot, q: Array) -> Robot:
    """Return the robot with its joints' nodes together again."""
    was, now = compile_kinematics(nominal), compile_kinematics(robot)
    if (_gaps(was, posture(was, q), nominal.joints) > COINCIDENT).any():
        return robot  # they were apart before, by more than what a file rounds to
    where = posture(now, q)
    apart = _gaps(now, where, robot.joints).max(axis=0) > JOINED
    seats = _Seats(robot)
    joints = list(robot.joints)
    for number, joint in enumerate(robot.joints):
        if not apart[number]:
            continue
        first, second = (now.node_index[name] for name in joint.nodes)
        at = _on_axis(now, where, second)
        pose, back = (where.transforms[0, now.node_frame[node]] for node in (second, first))
        seen = pose[:3, :3] @ at + pose[:3, 3]
        nodes = (seats.at(joint, 0, back[:3, :3].T @ (seen - back[:3, 3])), seats.at(joint, 1, at))
        joints[number] = joint.model_copy(update={"nodes": nodes})
    return seats.robot.model_copy(update={"joints": tuple(joints)})


def _apart_from_joints(robot: Robot, changes: Mapping[str, float]) -> Robot:
    """Return the robot with joints on nodes of their own where they share one with a point that was moved."""
    points = {node.name for node in robot.nodes if any(f"{node.name}.{axis}" in changes for axis in AXES)}
    seats = _Seats(robot)
    place = {node.name: np.array(node.at) for node in robot.nodes}
    joints = [
        joint.model_copy(
            update={
                "nodes": tuple(
                    seats.new(joint, end, place[name]) if name in points else name
                    for end, name in enumerate(joint.nodes)
                )
            }
        )
        for joint in robot.joints
    ]
    return seats.robot.model_copy(update={"joints": tuple(joints)}) if points else robot


class _Seats:
    """Places of joints in a robot: a node that is the joint's alone is moved, another bears a bracket."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._users = Counter(name for joint in robot.joints for name in joint.nodes)
        self._users.update(name for strut in robot.struts for name in strut.nodes)
        self._users.update((robot.tcp, *(name for loop in robot.loops for name in (loop.a, loop.b))))
        self._nodes = {node.name: node for node in robot.nodes}
        self._brackets: list[Rigid] = []

    @property
    def robot(self) -> Robot:
        """The robot with the places taken so far."""
        rigids = (*self._robot.rigids, *self._brackets)
        return self._robot.model_copy(update={"nodes": tuple(self._nodes.values()), "rigids": rigids})

    def at(self, joint: Joint, end: int, place: Array) -> str:
        """Return the node for one end of a joint at a place (3,) of its frame."""
        name = joint.nodes[end]
        if np.abs(place - self._nodes[name].at).max() <= JOINED:
            return name
        if self._users[name] > 1:
            return self.new(joint, end, place)
        self._nodes[name] = self._nodes[name].model_copy(update={"at": _point(place)})
        return name

    def new(self, joint: Joint, end: int, place: Array) -> str:
        """Return a new node for one end of a joint, on a bracket from its old one."""
        old = self._nodes[joint.nodes[end]]
        name = f"{old.name} of {joint.name}"
        self._nodes[name] = Node(name=name, frame=old.frame, at=_point(place))
        self._brackets.append(Rigid(name=name, nodes=(old.name, name)))
        return name


def _on_axis(kinematics: Kinematics, where: Posture, node: int) -> Array:
    """Return a node's place (3,) in its frame, on the axis that the frame turns about.

    Parameters behind the joint's motion (beta and r behind theta, frames without a motion of their own) carry
    the frame off its axis.
    """
    at: Array = kinematics.node_at[node]
    moving, screws = int(kinematics.node_frame[node]), list[Screw]()
    while moving and not screws:
        chain = [int(kinematics.parents[moving]), moving]
        screws = screws_of(kinematics, where.values[:1], where.transforms[:1], chain)
        moving = chain[0]
    turns = [screw for screw in screws if MOTIONS[screw.motion][1] == "turn"]
    if len(turns) != 1:
        return at
    pose = where.transforms[0, kinematics.node_frame[node]]
    axis = pose[:3, :3].T @ turns[0].axis[:, 0]
    foot = pose[:3, :3].T @ (turns[0].point[:, 0] - pose[:3, 3])
    return np.asarray(foot + ((at - foot) @ axis) * axis)


def _point(at: Array) -> tuple[float, float, float]:
    x, y, z = np.where(np.abs(at) > DUST, at, 0.0).tolist()
    return x, y, z


def _gaps(kinematics: Kinematics, where: Posture, joints: tuple[Joint, ...]) -> Array:
    """Return how far the nodes of each joint are apart, (P, J), m."""
    nodes = np.array([[kinematics.node_index[name] for name in joint.nodes] for joint in joints])
    return joint_gaps(kinematics, where, nodes)
