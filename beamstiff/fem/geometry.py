"""A structure put into its poses: rotations of joints and beams, and the terms that make nodes of unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam import beam_axes
from beamstiff.fem.structure import Index, Structure
from beamstiff.robot.kinematics import Posture
from beamstiff.se3 import Array, displacement_transport, rotate_screw

COINCIDENT = 1e-6  # m: farther apart than this, two nodes are no joint


@dataclass(frozen=True)
class Geometry:
    """What of the structure turns with the pose, batched over P poses.

    Attributes
    ----------
    posture : Posture
    joint_rotation : (P, J, 3, 3) array
        Base frame from joint frame (first axis along the joint).
    terms : (P, T, 6, 6) array
        ``u_node = sum over its terms of terms[t] @ z[block t]``.
    beam_rotation : (P, B, 3, 3) array
        Base frame from local beam axes.
    beam_length : (P, B) array, m
    """

    posture: Posture
    joint_rotation: Array
    terms: Array
    beam_rotation: Array
    beam_length: Array


def place(structure: Structure, posture: Posture) -> Geometry:
    """Put a structure into its poses.

    Parameters
    ----------
    structure : Structure
    posture : Posture
        P poses with closed loops.

    Raises
    ------
    BeamstiffError
        When the nodes of a joint do not coincide, a beam has zero length, or `up` is parallel to its beam.
    """
    robot, unknowns, positions = structure.robot, structure.unknowns, posture.node_positions
    rotations = posture.transforms[:, :, :3, :3]
    gap = np.linalg.norm(
        positions[:, structure.joint_nodes[:, 1]] - positions[:, structure.joint_nodes[:, 0]], axis=-1
    )
    if (gap > COINCIDENT).any():
        pose, at = np.argwhere(gap > COINCIDENT)[0]
        a, b = robot.joints[at].nodes
        raise BeamstiffError(
            f"joint {robot.joints[at].name!r}: its nodes {a!r} and {b!r} are {1e3 * gap[pose, at]:.4g} mm apart, "
            "expected to coincide; check the nodes' frames, or the loop that should join them"
        )
    joint_rotation = rotations[:, structure.joint_frame] @ structure.joint_axes
    arms = positions[:, unknowns.term_node] - positions[:, unknowns.term_origin]
    terms = displacement_transport(arms)
    of_joint = unknowns.block_joint[unknowns.term_block]
    jointed = np.flatnonzero(of_joint >= 0)
    if jointed.size:
        turn = rotate_screw(joint_rotation[:, of_joint[jointed]])
        terms[:, jointed] = terms[:, jointed] @ turn * unknowns.term_sign[jointed, None, None]
    ends = structure.elements[: len(structure.robot.beams)]
    axis = positions[:, ends[:, 1]] - positions[:, ends[:, 0]]
    length = np.linalg.norm(axis, axis=-1)
    if (length < 1e-9).any():
        at = int(np.argwhere(length < 1e-9)[0][1])
        raise BeamstiffError(f"beam {robot.beams[at].name!r} has zero length at this pose: its nodes coincide")
    up = np.einsum("pbij,bj->pbi", rotations[:, structure.beam_frame], np.nan_to_num(structure.beam_up))
    up[:, np.isnan(structure.beam_up).any(axis=1)] = np.nan
    across = np.linalg.norm(np.cross(axis, up), axis=-1)
    if (across < 1e-6 * length * np.linalg.norm(up, axis=-1)).any():
        at = int(np.argwhere(across < 1e-6 * length * np.linalg.norm(up, axis=-1))[0][1])
        raise BeamstiffError(f"beam {robot.beams[at].name!r}: `up` is parallel to the beam, expected a direction across it")
    return Geometry(posture, joint_rotation, terms, beam_axes(axis, up), length)


def strut_directions(structure: Structure, geometry: Geometry, struts: Index) -> Array:
    """Return the unit vectors along struts, first to second node, (P, S, 3), base frame.

    Raises
    ------
    BeamstiffError
        When a strut has zero length.
    """
    index = structure.kinematics.node_index
    ends = np.array([[index[name] for name in structure.robot.struts[at].nodes] for at in struts]).reshape(-1, 2)
    positions = geometry.posture.node_positions
    along = positions[:, ends[:, 1].astype(int)] - positions[:, ends[:, 0].astype(int)]
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    if (length < 1e-9).any():
        name = structure.robot.struts[struts[int(np.argwhere(length < 1e-9)[0][1])]].name
        raise BeamstiffError(f"strut {name!r} has zero length at this pose: its nodes coincide")
    return along / length
