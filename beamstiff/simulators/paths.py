"""The way from one frame to another: what is constant of it, and which variables move it."""

from dataclasses import dataclass

import networkx as nx
import numpy as np

from beamstiff.robot.coupling import coupling
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import (
    Kinematics,
    Posture,
    compile_kinematics,
    posture,
    reference_posture,
    sampled_postures,
)
from beamstiff.robot.urdf.export import Step, elementary_steps
from beamstiff.se3 import Array

SAME = 1e-9  # m and rad: what moves less between postures does not move
SAMPLES = 12  # postures in which that is looked at


@dataclass(frozen=True, eq=False)
class Move:
    """A constant transform and then a motion by a variable: none where `variable` is empty."""

    placed: Array  # (4, 4)
    variable: str = ""
    factor: float = 1.0  # of the motion, by the variable
    kind: str = ""  # "turn" or "shift"
    axis: int = 2


@dataclass(frozen=True, eq=False)
class Machine:
    """A robot in some postures, the first the reference; its frames as a tree of elementary motions."""

    robot: Robot
    kinematics: Kinematics
    where: Posture
    steps: dict[str, Step]  # by the link that each leads to

    def relative(self, one: str, other: str) -> Array:
        """Return the pose of a frame in another, (S, 4, 4), in every posture."""
        moves = moves_between(self, one, other)
        if not any(move.variable for move in moves):  # no rounding of products with postures
            pose = np.eye(4)
            for move in moves:
                pose = pose @ move.placed
            return np.repeat(pose[None], len(self.where.values), axis=0)
        index = self.kinematics.frame_index
        poses: Array = (
            np.linalg.inv(self.where.transforms[:, index[one]]) @ self.where.transforms[:, index[other]]
        )
        return poses

    def distance(self, one: str, other: str) -> Array:
        """Return the distance of two nodes in every posture, (S,), m."""
        index = self.kinematics.node_index
        ends = self.where.node_positions
        return np.asarray(np.linalg.norm(ends[:, index[other]] - ends[:, index[one]], axis=1))

    def value(self, variable: str) -> float:
        """Return the value of a variable in the reference posture."""
        return float(self.where.values[0, self.kinematics.coupling.names.index(variable)])


def machine_of(robot: Robot, q: Array | None = None) -> Machine:
    """Return a robot in its reference posture, or that of `q` (A,), and in some others that close."""
    from beamstiff.robot.closure import close_loops

    kinematics = compile_kinematics(robot)
    first = reference_posture(robot) if q is None else q
    others = sampled_postures(robot, 4 * SAMPLES, 0)
    unlimited = [item.kind == "length" and item.limits is None for item in robot.actuated]
    others[:, unlimited] += np.random.default_rng(1).uniform(-0.1, 0.1, others[:, unlimited].shape)
    if robot.loops:
        others = others[close_loops(kinematics, others, strict=False).closed]
    where = posture(kinematics, np.concatenate([first[None], others[:SAMPLES]]))
    steps = {step.child: step for step in elementary_steps(robot, coupling(robot))}
    return Machine(robot, kinematics, where, steps)


def constant(values: Array) -> bool:
    """Return whether values are the same in every posture (leading axis)."""
    return bool(np.ptp(values, axis=0).max(initial=0.0) < SAME)


def moves_between(machine: Machine, one: str, other: str) -> list[Move]:
    """Return the way from a frame to another through the tree of frames."""
    up, down = _ancestors(machine, one), _ancestors(machine, other)
    shared = next(name for name in up if name in down)
    moves = []
    for link in up[: up.index(shared)]:  # against the step's direction: its motion first, then its constant
        step = machine.steps[link]
        moves.append(Move(np.eye(4), step.variable, -step.coefficient, step.kind, step.axis))
        moves.append(Move(np.asarray(np.linalg.inv(step.placed), dtype=np.float64)))
    for link in reversed(down[: down.index(shared)]):
        step = machine.steps[link]
        moves.append(Move(step.placed, step.variable, step.coefficient, step.kind, step.axis))
    return moves


def _ancestors(machine: Machine, link: str) -> list[str]:
    names = [link]
    while names[-1] != "base":
        names.append(machine.steps[names[-1]].parent)
    return names


def over_a_loop(machine: Machine, one: str, other: str) -> bool:
    """Return whether fewer variables lie on a way between two frames that passes a closed loop's ends."""
    graph: nx.Graph[str] = nx.Graph()
    for step in machine.steps.values():
        graph.add_edge(step.parent, step.child, weight=float(bool(step.variable)))
    tree = graph.copy()
    names = machine.kinematics.frame_names
    for loop in machine.kinematics.loops:
        ends = names[loop.frame_a], names[loop.frame_b]
        if not graph.has_edge(*ends):
            graph.add_edge(*ends, weight=0.5)
    along = nx.dijkstra_path_length(tree, one, other)
    return bool(nx.dijkstra_path_length(graph, one, other) < along)
