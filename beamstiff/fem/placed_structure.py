"""A structure put into its poses: rotations of joints and beams, terms that make nodes of unknowns."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam_element import beam_axes
from beamstiff.fem.structure import Index, Structure
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.planar_loops import in_plane, joint_gaps
from beamstiff.se3 import Array, displacement_transport, rotate_screw

COINCIDENT = 1e-6  # m: farther apart than this, two nodes are no joint
SHORTEST = 1e-9  # m: shorter than this, a beam or strut has no direction


@dataclass(frozen=True)
class Geometry:
    """What of the structure turns with the pose, batched over P poses."""

    posture: Posture
    node_rotation: Array  # (P, N, 3, 3): base frame from the frame of the node
    joint_rotation: Array  # (P, J, 3, 3): base frame from joint frame (first axis along the joint)
    terms: Array  # (P, T, 6, 6): ``u_node = sum over its terms of terms[t] @ z[block t]``
    beam_rotation: Array  # (P, B, 3, 3): base frame from local beam axes
    beam_length: Array  # (P, B), m
    # (P,): number of each pose in the whole list, for messages: long lists are placed in pieces
    number: Index

    def only(self, poses: Index) -> Geometry:
        """Return the same for some of the poses."""
        rest = (getattr(self, item.name)[poses] for item in fields(Geometry)[1:])
        return Geometry(self.posture.only(poses), *rest)


def place(structure: Structure, posture: Posture, number: Index | None = None) -> Geometry:
    """Put a structure into P poses with closed loops; `number` (P,) stands for them in messages."""
    robot, positions = structure.robot, posture.node_positions
    rotations = posture.transforms[:, :, :3, :3]
    number = np.arange(len(positions)) if number is None else number
    if (wrong := _first_where(~np.isfinite(positions.sum(axis=2)))) is not None:
        raise BeamstiffError(
            f"node {robot.nodes[wrong[1]].name!r}: its position at pose {number[wrong[0]]} is not a number; "
            "does the pose close its loops?"
        )
    _check_joints(structure, posture, number)
    joint_rotation = rotations[:, structure.joint_frame] @ structure.joint_axes
    if (plane := np.flatnonzero(structure.joint_normal >= 0)).size:
        normal = rotations[:, structure.joint_normal[plane]][..., 2]
        joint_rotation[:, plane] = in_plane(joint_rotation[:, plane], normal)
    axis, up = beam_directions(structure, posture)
    length = np.linalg.norm(axis, axis=-1)
    if (wrong := _first_where(length < SHORTEST)) is not None:
        beam = robot.beams[wrong[1]]
        raise BeamstiffError(
            f"beam {beam.name!r} has zero length at pose {number[wrong[0]]}: its nodes {beam.nodes[0]!r} and "
            f"{beam.nodes[1]!r} coincide"
        )
    across = np.linalg.norm(np.cross(axis, up), axis=-1)
    if (wrong := _first_where(across < 1e-6 * length * np.linalg.norm(up, axis=-1))) is not None:
        raise BeamstiffError(
            f"beam {robot.beams[wrong[1]].name!r}: `up` is parallel to the beam at pose {number[wrong[0]]}, "
            "expected a direction across it"
        )
    return Geometry(
        posture,
        rotations[:, structure.kinematics.node_frame],
        joint_rotation,
        node_terms(structure, positions, joint_rotation),
        beam_axes(axis, up),
        length,
        number,
    )


def beam_directions(structure: Structure, posture: Posture) -> tuple[Array, Array]:
    """Return where beams lead, and their `up`, (P, B, 3) each, base frame; NaN where it is not said."""
    positions, rotations = posture.node_positions, posture.transforms[:, :, :3, :3]
    ends = structure.elements[: len(structure.robot.beams)]
    up = np.einsum("pbij,bj->pbi", rotations[:, structure.beam_frame], np.nan_to_num(structure.beam_up))
    up[:, np.isnan(structure.beam_up).any(axis=1)] = np.nan
    return positions[:, ends[:, 1]] - positions[:, ends[:, 0]], up


def node_terms(structure: Structure, positions: Array, joint_rotation: Array) -> Array:
    """Return the terms (P, T, 6, 6) that make nodes at positions (P, N, 3) of the unknowns."""
    unknowns = structure.unknowns
    terms = displacement_transport(positions[:, unknowns.term_node] - positions[:, unknowns.term_origin])
    of_joint = unknowns.block_joint[unknowns.term_block]
    jointed = np.flatnonzero(of_joint >= 0)
    if jointed.size:
        turn = rotate_screw(joint_rotation[:, of_joint[jointed]])
        terms[:, jointed] = terms[:, jointed] @ turn * unknowns.term_sign[jointed, None, None]
    return terms


def _first_where(condition: NDArray[np.bool_]) -> tuple[int, int] | None:
    """Return pose and column of the first true entry of (P, ...), or None."""
    found = np.argwhere(condition)
    return (int(found[0][0]), int(found[0][1])) if found.size else None


def _check_joints(structure: Structure, posture: Posture, number: Index) -> None:
    """Refuse joints whose nodes lie apart."""
    gap = joint_gaps(structure.kinematics, posture, structure.joint_nodes)
    if (wrong := _first_where(gap > COINCIDENT)) is None:
        return
    joint = structure.robot.joints[wrong[1]]
    raise BeamstiffError(
        f"joint {joint.name!r}: its nodes {joint.nodes[0]!r} and {joint.nodes[1]!r} are "
        f"{1e3 * gap[wrong]:.4g} mm apart at pose {number[wrong[0]]}, expected to coincide; "
        "check the nodes' frames, or the loop that should join them"
    )


def rod_flexibility(structure: Structure, posture: Posture, struts: Index, number: Index) -> Array:
    """Return what the free length of struts adds to their compliance, (P, S), m/N; 0 without `EA`."""
    some = [structure.robot.struts[at] for at in struts]
    if not any(strut.EA for strut in some):
        return np.zeros((len(number), len(some)))
    length = np.linalg.norm(_strut_ways(structure, posture, struts), axis=-1)
    free = length - np.array([strut.fixed_length for strut in some])
    stretching = np.array([strut.EA or np.inf for strut in some])
    if (wrong := _first_where((free <= 0.0) & np.isfinite(stretching))) is not None:
        strut = some[wrong[1]]
        raise BeamstiffError(
            f"strut {strut.name!r} is {1e3 * length[wrong]:.4g} mm long at pose {number[wrong[0]]}, expected "
            f"more than its fixed_length, {1e3 * strut.fixed_length:.4g} mm"
        )
    return np.asarray(free / stretching)


def strut_stiffness(structure: Structure, geometry: Geometry) -> Array:
    """Return the stiffness of the elastic struts, (P, S), N/m."""
    k = structure.strut_values
    rod = rod_flexibility(structure, geometry.posture, structure.struts, geometry.number)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness: Array = np.where(k == RIGID, 1.0 / rod, k / (1.0 + k * rod))
    return stiffness


def _strut_ways(structure: Structure, posture: Posture, struts: Index) -> Array:
    """Return the ways along struts, first to second node, (P, S, 3), base frame, m."""
    index = structure.kinematics.node_index
    pairs = [[index[name] for name in structure.robot.struts[at].nodes] for at in struts]
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return posture.node_positions[:, ends[:, 1]] - posture.node_positions[:, ends[:, 0]]


def strut_directions(structure: Structure, geometry: Geometry, struts: Index) -> tuple[Array, Array]:
    """Return unit vectors along struts, first to second node, (P, S, 3), base frame, and lengths (P, S)."""
    along = _strut_ways(structure, geometry.posture, struts)
    length = np.linalg.norm(along, axis=-1)
    if (wrong := _first_where(length < SHORTEST)) is not None:
        strut = structure.robot.struts[struts[wrong[1]]]
        raise BeamstiffError(
            f"strut {strut.name!r} has zero length at pose {geometry.number[wrong[0]]}: its nodes "
            f"{strut.nodes[0]!r} and {strut.nodes[1]!r} coincide"
        )
    return along / length[..., None], length
