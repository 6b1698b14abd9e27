"""What linear displacements leave out: curved paths of the nodes and strains of second order.

Unknowns z move a node by the product of the rigid motions along its path, ``u = T z + u_2(z)``. An element's
strain is then ``B u + e_2``, with e_2 of its initial stress matrix (K_1 of the wrench s, `initial_stress`):
``s . e_2 = u^T K_1(s) u / 2``. Loops of rigids ask for ``G z + c_2 = 0``. With the tangent stiffness K_t of
`geometric` the equilibrium is, to second order in the loads::

    K_t z + B^T K e_2 = f,     G z = -c_2
"""

from dataclasses import replace

import numpy as np

from beamstiff.fem.assembly import assemble, element_blocks, element_deformation, gather, scatter
from beamstiff.fem.beam_column import beam_bending
from beamstiff.fem.beam_element import beam_axes
from beamstiff.fem.constraints import constraint_rows, has_constraints, scaled_inverse, unknown_sizes
from beamstiff.fem.initial_stress import beam_initial_stress, joint_initial_stress, strut_initial_stress
from beamstiff.fem.placed_structure import Geometry, node_terms, strut_directions
from beamstiff.fem.static_response import solve_constrained
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_values
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import Posture
from beamstiff.se3 import Array, displacement_transport, rotate_screw, skew

UNIT_WRENCHES = np.eye(6)


def second_order(structure: Structure, geometry: Geometry, unknowns: Array, by_load: Array) -> Array:
    """Return what second order adds to the unknowns (P, n) of a first solution (P, n).

    `by_load` (P, n, n): what the loads add to the stiffness.
    """
    linear = gather(structure, geometry, unknowns)
    curved = finite_displacement(structure, geometry, unknowns) - linear
    strain = element_deformation(structure, geometry, curved) + _strains(structure, geometry, linear)
    ends = (element_blocks(structure, geometry)[:, :, :, 1] @ strain[:, :, None, :, None])[..., 0]
    nodal = np.zeros_like(linear)
    for end in (0, 1):
        np.add.at(nodal.swapaxes(0, 1), structure.elements[:, end], ends[:, :, end].swapaxes(0, 1))
    force, closing = -scatter(structure, geometry, nodal), np.zeros_like(unknowns)
    if has_constraints(structure):
        units = unknown_sizes(structure)
        inverse = scaled_inverse(constraint_rows(structure, geometry), units)
        gaps = _gaps(structure, geometry, linear, curved)
        closing = -units * (inverse @ gaps[..., None])[..., 0]
        stiffness = assemble(structure, geometry)[0] + by_load
        force = force - (stiffness @ closing[..., None])[..., 0]
    return closing + solve_constrained(structure, geometry, force[..., None], by_load)[0][..., 0]


def finite_displacement(structure: Structure, geometry: Geometry, unknowns: Array) -> Array:
    """Return the displacement of all nodes (P, N, 6) for unknowns of any size (P, n), r a rotation vector."""
    moved = motions(structure, geometry, unknowns)
    turned, positions = moved[..., :3, :3], geometry.posture.node_positions
    path = (turned @ positions[..., None])[..., 0] + moved[..., :3, 3]
    # r sin|r|/|r|, without the digits that the identity would cost
    sine = 0.5 * np.stack([turned[..., j, i] - turned[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], -1)
    size = np.linalg.norm(sine, axis=-1, keepdims=True)
    angle = np.arctan2(size, 1 + 0.5 * np.trace(turned, axis1=-2, axis2=-1)[..., None])
    return np.concatenate([path, np.divide(angle, size, out=np.ones_like(size), where=size > 0) * sine], -1)


def displaced(structure: Structure, geometry: Geometry, unknowns: Array) -> Geometry:
    """Return the geometry that unknowns (P, n) have moved; beams keep their unstressed length."""
    moved = np.eye(4) + motions(structure, geometry, unknowns)
    turned, was = moved[..., :3, :3], geometry.posture
    positions = (turned @ was.node_positions[..., None])[..., 0] + moved[..., :3, 3]
    joints = turned[:, structure.joint_nodes[:, 0]] @ geometry.joint_rotation
    terms, numbering = node_terms(structure, positions, joints), structure.unknowns
    on_tree = np.flatnonzero(numbering.block_joint >= 0)
    vectors = np.concatenate([unknowns, 0 * unknowns[:, :1]], axis=1)[:, numbering.blocks[on_tree, 3:]]
    rates = np.tile(np.eye(3), (len(unknowns), len(numbering.blocks), 1, 1))
    rates[:, on_tree] += 0.5 * skew(vectors) + skew(vectors) @ skew(vectors) / 6
    terms[..., 3:] = terms[..., 3:] @ rates[:, numbering.term_block]
    first, second = structure.elements[: len(structure.robot.beams)].T
    up = (turned[:, first] @ geometry.beam_rotation)[..., 1]
    return replace(
        geometry,
        posture=Posture(was.values, was.transforms, positions),
        node_rotation=turned @ geometry.node_rotation,
        joint_rotation=joints,
        terms=terms,
        beam_rotation=beam_axes(positions[:, second] - positions[:, first], up),
    )


def motions(structure: Structure, geometry: Geometry, unknowns: Array) -> Array:
    """Return the rigid motions of all nodes less the identity, (P, N, 4, 4), for unknowns (P, n).

    A joint moves what comes after it in its own frame, which turns with its first node.
    """
    numbering, positions = structure.unknowns, geometry.posture.node_positions
    padded = np.concatenate([unknowns, np.zeros((len(unknowns), 1))], axis=1)
    values = padded[:, numbering.blocks]
    jointed = np.flatnonzero(numbering.block_joint >= 0)
    turn = rotate_screw(geometry.joint_rotation[:, numbering.block_joint[jointed]])
    values[:, jointed] = (turn @ values[:, jointed, :, None])[..., 0]
    result = np.zeros((*positions.shape[:2], 4, 4))
    terms = (numbering.term_node, numbering.term_block, numbering.term_origin, numbering.term_sign)
    for node, block, origin, sign in zip(*(term.tolist() for term in terms), strict=True):  # from the root on
        step, at = np.zeros((len(unknowns), 4, 4)), positions[:, origin]
        shift, vector = values[:, block, :3], sign * values[:, block, 3:]
        angle, s = np.linalg.norm(vector, axis=-1)[:, None, None], skew(vector)
        turned = np.sinc(angle / np.pi) * s + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (s @ s)
        step[:, :3, :3] = turned
        if sign < 0:  # the inverse: the rotation carries the displacement
            shift = -shift - (turned @ shift[..., None])[..., 0]
        step[:, :3, 3] = shift - (turned @ at[..., None])[..., 0]
        before = result[:, node]
        result[:, node] = before + step + before @ step
    return result


def _strains(structure: Structure, geometry: Geometry, displacement: Array) -> Array:
    """Return the elements' own strains of second order, second end against the first, (P, E, 6)."""
    beams, chords = len(structure.robot.beams), len(structure.chords)
    ends = np.concatenate([displacement[:, structure.elements[:, end]] for end in (0, 1)], axis=-1)
    of_beams, of_chords, of_struts = np.split(ends, [beams, beams + chords], axis=1)
    along, length = strut_directions(structure, geometry, structure.struts)
    stretch = _form(strut_initial_stress(along, length, np.ones_like(length)), of_struts)
    struts = np.concatenate([stretch[..., None] * along, np.zeros_like(along)], axis=-1)
    turn, span = rotate_screw(geometry.beam_rotation), geometry.beam_length
    local = turn.swapaxes(-1, -2)[:, :, None] @ of_beams.reshape(*span.shape, 2, 6, 1)
    # row k: the wrench on the first end for a unit one k on the second
    first = -displacement_transport(span[..., None] * [1.0, 0.0, 0.0])
    unit = np.stack([first, np.broadcast_to(UNIT_WRENCHES, first.shape)], axis=-2)
    shear = beam_bending(structure, geometry)[1][..., None, :]
    forms = beam_initial_stress(span[..., None], unit, np.zeros(3), shear)
    beam = (turn @ _form(forms, local.reshape(*span.shape, 1, 12))[..., None])[..., 0]
    return np.concatenate([beam, _joint_strains(of_chords), struts], axis=1)


def _joint_strains(ends: Array) -> Array:
    return _form(joint_initial_stress(UNIT_WRENCHES), ends[..., None, :])


def _form(matrix: Array, ends: Array) -> Array:
    """Return half of the quadratic form of matrices (..., 12, 12) in displacements (..., 12)."""
    return 0.5 * np.asarray((ends[..., None, :] @ matrix @ ends[..., None])[..., 0, 0])


def _gaps(structure: Structure, geometry: Geometry, linear: Array, curved: Array) -> Array:
    """Return by how much the constraints are missed to second order, in the order of `constraint_rows`."""
    robot, unknowns = structure.robot, structure.unknowns
    index, positions = structure.kinematics.node_index, geometry.posture.node_positions
    gaps = [curved[:, node] for node in unknowns.held]
    for at in unknowns.chord_rigids:
        a, b = (index[name] for name in robot.rigids[at].nodes)
        arm, turned = positions[:, b] - positions[:, a], linear[:, a, 3:]
        gap = curved[:, b] - (displacement_transport(arm) @ curved[:, a, :, None])[..., 0]
        gap[:, :3] -= 0.5 * np.cross(turned, np.cross(turned, arm))
        gaps.append(gap)
    for at in unknowns.chord_joints:
        a, b = structure.joint_nodes[at]
        rigid = joint_values(robot.joints[at]) == RIGID
        gap = curved[:, b] - curved[:, a] + _joint_strains(np.concatenate([linear[:, a], linear[:, b]], -1))
        local = (rotate_screw(geometry.joint_rotation[:, at]).swapaxes(-1, -2) @ gap[..., None])[..., 0]
        gaps.append(local[:, rigid])
    rigid_struts = np.array([at for at, strut in enumerate(robot.struts) if strut.rigid], dtype=np.int64)
    for at in rigid_struts:
        along, length = strut_directions(structure, geometry, np.array([at]))
        a, b = (index[name] for name in robot.struts[at].nodes)
        ends = np.concatenate([linear[:, a], linear[:, b]], axis=-1)
        form = strut_initial_stress(along[:, 0], length[:, 0], np.ones(len(linear)))
        stretch = ((curved[:, b, :3] - curved[:, a, :3]) * along[:, 0]).sum(axis=-1)
        gaps.append((stretch + _form(form, ends))[:, None])
    return np.concatenate(gaps, axis=1)
