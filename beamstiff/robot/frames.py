"""The geometry of a robot, compiled: frames parents first, their parameters linear in the variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from beamstiff.robot.coupling import Coupling, coupling, frame_expressions, variable_kinds
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.robot.assemblies import Closest
    from beamstiff.robot.branch import Assembly
    from beamstiff.robot.description import Robot

# parameter, whether it turns or shifts, and along which axis (0 x, 1 y, 2 z), in the order of the product
MOTIONS: tuple[tuple[str, Literal["turn", "shift"], int], ...] = (
    ("gamma", "turn", 2),
    ("b", "shift", 2),
    ("alpha", "turn", 0),
    ("d", "shift", 0),
    ("theta", "turn", 2),
    ("beta", "turn", 1),
    ("r", "shift", 2),
)


@dataclass(frozen=True)
class LoopEnds:
    """A loop with its two ends as points of frames."""

    name: str
    a: str
    b: str
    constrain: Literal["position", "pose", "plane"]
    frame_a: int  # that holds the end
    at_a: Array  # (3,), m: in that frame
    frame_b: int
    at_b: Array


class Motion(NamedTuple):
    """A motion that a frame makes from its parent: ``constant + values[:, used] @ coefficients``, rad, m."""

    number: int  # in `MOTIONS`
    kind: Literal["turn", "shift"]
    axis: int
    constant: np.float64
    used: NDArray[np.intp]  # variables
    coefficients: Array


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The geometry of a robot, compiled once; V variables, A actuated, Q passive, F frames, N nodes."""

    robot: Robot
    coupling: Coupling  # how all variables follow from the actuated and the passive ones
    prismatic: NDArray[np.bool_]  # (V,): whether a variable is a length, in the order of ``coupling.names``
    frame_names: tuple[str, ...]  # ``"base"`` first, every frame after its parent (F + 1)
    frame_index: Mapping[str, int]
    parents: NDArray[np.intp]  # (F + 1,): index of each frame's parent; -1 for the base
    constants: Array  # (F + 1, 7), rad or m: constant part of the parameters, in the order of `MOTIONS`
    # (F + 1, 7, V): their linear part: ``parameters = constants + coefficients @ values``
    coefficients: Array
    node_names: tuple[str, ...]
    node_index: Mapping[str, int]
    node_frame: NDArray[np.intp]  # (N,)
    node_at: Array  # (N, 3), m: position in the node's frame
    loops: tuple[LoopEnds, ...]
    size: float  # m: size of the machine: how far its longest chain of frames could reach
    # where the loops close and in which assembly branch; None without loops, or when the declared guess does
    # not close and the poses have to tell
    assembly: Assembly | None = None
    closest: tuple[Closest, ...] = ()  # that assembly where it comes nearest to the guess, and a rival

    @cached_property
    def motions(self) -> tuple[tuple[Motion, ...], ...]:
        """The motions that each frame makes; most of its seven are none."""
        return tuple(
            tuple(
                Motion(number, kind, axis, constants[number], used, coefficients[number, used])
                for number, (_, kind, axis) in enumerate(MOTIONS)
                if (used := np.flatnonzero(coefficients[number])).size or constants[number] != 0.0
            )
            for constants, coefficients in zip(self.constants, self.coefficients, strict=True)
        )


def same_geometry(one: Kinematics, other: Kinematics) -> bool:
    """Return whether equal values put the frames and nodes of both in the same places."""
    if one is other:
        return True
    if (one.coupling.names, one.frame_names, one.node_names) != (
        other.coupling.names,
        other.frame_names,
        other.node_names,
    ):
        return False
    names = ("parents", "constants", "coefficients", "node_frame", "node_at")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def compile_frames(robot: Robot) -> Kinematics:
    """Return the kinematics of a robot with its loops still to be assembled."""
    joined = coupling(robot)
    names = _frames_after_parents(robot)
    index = {name: at for at, name in enumerate(names)}
    parent_of = {frame.name: frame.parent for frame in robot.frames}
    parents = np.array([-1, *(index[parent_of[name]] for name in names[1:])], dtype=np.intp)
    column = {name: at for at, name in enumerate(joined.names)}
    constants = np.zeros((len(names), 7))
    coefficients = np.zeros((len(names), 7, len(joined.names)))
    for frame, expressions in frame_expressions(robot).items():
        for at, (parameter, _, _) in enumerate(MOTIONS):
            constants[index[frame], at] = expressions[parameter].constant
            for name, coefficient in expressions[parameter].coefficients.items():
                coefficients[index[frame], at, column[name]] = coefficient
    node_at = np.array([node.at for node in robot.nodes], dtype=np.float64).reshape(-1, 3)
    node_frame = np.array([index[node.frame] for node in robot.nodes], dtype=np.intp)
    node_index = {node.name: at for at, node in enumerate(robot.nodes)}

    def end(name: str) -> tuple[int, Array]:
        if name in index:
            return index[name], np.zeros(3)
        return int(node_frame[node_index[name]]), node_at[node_index[name]]

    kinds = variable_kinds(robot)
    return Kinematics(
        robot=robot,
        coupling=joined,
        prismatic=np.array([kinds[name] == "length" for name in joined.names], dtype=np.bool_),
        frame_names=tuple(names),
        frame_index=index,
        parents=parents,
        constants=constants,
        coefficients=coefficients,
        node_names=tuple(node_index),
        node_index=node_index,
        node_frame=node_frame,
        node_at=node_at,
        loops=tuple(
            LoopEnds(loop.name, loop.a, loop.b, loop.constrain, *end(loop.a), *end(loop.b))
            for loop in robot.loops
        ),
        size=_size(parents, constants, node_frame, node_at),
    )


def _frames_after_parents(robot: Robot) -> list[str]:
    order = {"base": 0} | {frame.name: at + 1 for at, frame in enumerate(robot.frames)}
    tree = nx.DiGraph([(frame.parent, frame.name) for frame in robot.frames])
    tree.add_node("base")
    return list(nx.lexicographical_topological_sort(tree, key=order.__getitem__))


def _size(parents: NDArray[np.intp], constants: Array, node_frame: NDArray[np.intp], node_at: Array) -> float:
    shifts = [at for at, (_, kind, _) in enumerate(MOTIONS) if kind == "shift"]
    reach = np.zeros(len(parents))
    for frame in range(1, len(parents)):
        reach[frame] = reach[parents[frame]] + np.abs(constants[frame, shifts]).sum()
    longest = float((reach[node_frame] + np.linalg.norm(node_at, axis=1)).max())
    return max(longest, float(reach.max())) or 1.0


def all_values(kinematics: Kinematics, free: Array) -> Array:
    """Return the values of all variables (P, V) from those of the free ones (P, A + Q)."""
    joined = kinematics.coupling
    return free @ joined.matrix.T + joined.offset


def widened(kinematics: Kinematics, parameters: Sequence[tuple[int, int]]) -> Kinematics:
    """Return the kinematics with parameters (frame, motion) as actuated variables, the last ones, now 0."""
    joined, extra = kinematics.coupling, len(parameters)
    variables, free, actuated = *joined.matrix.shape, joined.actuated
    matrix = np.zeros((variables + extra, free + extra))
    matrix[:variables, :actuated] = joined.matrix[:, :actuated]
    matrix[:variables, actuated + extra :] = joined.matrix[:, actuated:]
    matrix[variables:, actuated : actuated + extra] = np.eye(extra)
    coefficients = np.zeros((*kinematics.coefficients.shape[:2], variables + extra))
    coefficients[:, :, :variables] = kinematics.coefficients
    names = []
    for at, (frame, motion) in enumerate(parameters):
        coefficients[frame, motion, variables + at] = 1.0
        names.append(f"{kinematics.frame_names[frame]}.{MOTIONS[motion][0]}")
    shifts = [MOTIONS[motion][1] == "shift" for _, motion in parameters]
    return replace(
        kinematics,
        coupling=Coupling(
            names=(*joined.names, *names),
            free=(*joined.free[:actuated], *names, *joined.free[actuated:]),
            actuated=actuated + extra,
            matrix=matrix,
            offset=np.concatenate([joined.offset, np.zeros(extra)]),
        ),
        prismatic=np.concatenate([kinematics.prismatic, np.array(shifts, dtype=np.bool_)]),
        coefficients=coefficients,
    )
