"""The stiffness of the loaded machine: geometric stiffness, K_C of any structure.

In equilibrium under nodal wrenches F the tangent stiffness in the unknowns z is::

    K_t = T^T (K + K_1) T + diag(k) - H,     H_ji = sum over nodes of r . dJ_j/dz_i,     r = F - f(u)

K_1 is the initial stress matrix of the elements (`initial_stress`), r what rigids and joints carry at a node,
and J_j = [v_j; a_j] the node's twist for unknown j. An unknown i that moves what j moves, and j itself, gives
``dJ_j/dz_i = [a_i x v_j; a_i x a_j]``, one that comes after j ``[a_j x v_i; 0]``, and two rotations of one
block (a rotation vector) half of both. All is on the geometry that is given and of first order in
the load, but exact in the axial forces of beams (`beam_column`). Loads keep their direction and go with their
nodes.

With rigid links and springs about the axes, H is K_C of seed 000 (eq. 9; Chen and Kao, Int. J. Robotics Res.
19 (2000) 835) and ``K_X = J^-T (K_theta - K_C) J^-1`` (eq. 10), which is not
symmetric when moments act.
"""

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.assembly import node_map, scatter
from beamstiff.fem.beam_column import beam_bending, check_beams, pulled_weight, stability_change
from beamstiff.fem.condensation import CHUNK
from beamstiff.fem.constraints import constraint_rows, has_constraints, scaled_inverse, unknown_sizes
from beamstiff.fem.finite_displacement import displaced, finite_displacement, second_order
from beamstiff.fem.initial_stress import (
    arm_initial_stress,
    beam_initial_stress,
    bending_stress,
    joint_initial_stress,
    strut_initial_stress,
)
from beamstiff.fem.loads import gravity_wrenches, line_load
from beamstiff.fem.mechanism import solve_stable
from beamstiff.fem.placed_structure import Geometry, place, strut_directions
from beamstiff.fem.static_response import beam_forces, check_moments, solve_constrained, solve_elements
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_values
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import Posture
from beamstiff.se3 import Array, displacement_transport, rotate_screw, skew

MOST_ENTRIES = 20_000_000  # of the nodes' initial stress matrices, at a time


def loaded_compliance(
    structure: Structure,
    posture: Posture,
    loads: Array,
    gravity: bool = False,
    chunk: int = CHUNK,
    *,
    moved: bool = True,
) -> Array:
    """Return the compliance at the TCP of the loaded machine, (P, 6, 6), base frame.

    For a small wrench on top of nodal loads (P, N, 6), and of the dead weight where `gravity` says so; not
    symmetric when moments are among the loads (seed 000, eq. 10). The posture is that under the loads, or
    where they have not `moved` the machine yet, that without.
    """
    tcp, parts = structure.kinematics.node_index[structure.robot.tcp], []
    for geometry, some in _chunks(structure, posture, loads, chunk):
        if not moved:
            unknowns = _loaded_unknowns(structure, geometry, some, gravity)
            geometry = displaced(structure, geometry, unknowns)
        by_load, _ = load_stiffness(structure, geometry, some, gravity)
        watch = node_map(structure, geometry, tcp)
        shift, _ = solve_constrained(structure, geometry, watch.swapaxes(-1, -2), by_load, True)
        parts.append(watch @ shift)
    return np.concatenate(parts)


def loaded_displacement(structure: Structure, posture: Posture, loads: Array, gravity: bool = False) -> Array:
    """Return the displacement of all nodes (P, N, 6) under loads that also stiffen or soften: ``K_t z = f``.

    Arguments as of `loaded_compliance`; the posture is that without any load. This is the equilibrium to
    second order in the loads (`finite_displacement`), and exact in the axial forces of straight beams.
    """
    parts = []
    for geometry, some in _chunks(structure, posture, loads, CHUNK):
        unknowns = _loaded_unknowns(structure, geometry, some, gravity)
        parts.append(finite_displacement(structure, geometry, unknowns))
    return np.concatenate(parts)


def _loaded_unknowns(structure: Structure, geometry: Geometry, loads: Array, gravity: bool) -> Array:
    """Return the unknowns (P, n) in equilibrium with nodal loads (P, N, 6), and with the weight."""
    by_load, pull = load_stiffness(structure, geometry, loads, gravity)
    total = loads + pulled_weight(structure, geometry, pull) if gravity else loads
    force = scatter(structure, geometry, total)[..., None]
    unknowns = solve_constrained(structure, geometry, force, by_load)[0][..., 0]
    return unknowns + second_order(structure, geometry, unknowns, by_load)


def _chunks(
    structure: Structure, posture: Posture, loads: Array, chunk: int
) -> Iterator[tuple[Geometry, Array]]:
    """Yield some of the poses at a time, with their loads."""
    poses, nodes = posture.node_positions.shape[:2]
    if poses == 0:
        raise BeamstiffError("no poses: expected at least one")
    if loads.shape != (poses, nodes, 6) or not np.isfinite(loads).all():
        raise BeamstiffError(
            f"found loads of shape {loads.shape}, expected finite numbers of shape {(poses, nodes, 6)}"
        )
    check_moments(structure, loads)
    chunk = max(1, min(chunk, MOST_ENTRIES // (6 * nodes) ** 2))
    for start in range(0, poses, chunk):
        some = slice(start, start + chunk)
        yield place(structure, posture.only(some), np.arange(poses)[some]), loads[some]


def loaded_stiffness(compliance: Array, robot: str = "robot") -> Array:
    """Return the stiffness at the TCP, (..., 6, 6), from the compliance of the loaded machine."""
    symmetric = 0.5 * (compliance + compliance.swapaxes(-1, -2))
    flat = symmetric.reshape(-1, 6, 6)
    if (stuck := solve_stable(flat, np.zeros((*flat.shape[:2], 0)))[1]) is not None:
        raise BeamstiffError(
            f"{robot}: singular compliance at pose {stuck[0]}: the TCP is rigid against some wrench; its "
            "stiffness there is infinite, use the compliance instead"
        )
    size = np.sqrt(np.diagonal(compliance, axis1=-2, axis2=-1))
    scaled = np.linalg.inv(compliance / (size[..., :, None] * size[..., None, :]))
    return np.asarray(scaled / (size[..., :, None] * size[..., None, :]))


def load_stiffness(
    structure: Structure, geometry: Geometry, loads: Array, gravity: bool = False
) -> tuple[Array, Array]:
    """Return what loads (P, N, 6) and weight add to the stiffness (P, n, n), and tensions (P, B)."""
    total = loads + gravity_wrenches(structure, geometry) if gravity else loads
    unknowns, forces, _ = solve_elements(structure, geometry, scatter(structure, geometry, total))
    rest = total.copy()
    for end in (0, 1):
        for element, node in enumerate(structure.elements[:, end].tolist()):
            rest[:, node] -= forces[:, element, end]
    poses, nodes = rest.shape[:2]
    stress = np.zeros((poses, nodes, 6, nodes, 6))
    pull = _add_elements(stress, structure, geometry, forces, gravity)
    if gravity:
        _add_payloads(stress, structure, geometry)
    if has_constraints(structure):
        rest = rest - _add_constraints(stress, structure, geometry, rest, unknowns)
    stiffness = -_path_stiffness(structure, geometry, rest)
    if stress.any():
        maps = [node_map(structure, geometry, node) for node in range(nodes)]
        everywhere = np.concatenate(maps, axis=1)
        nodal = stress.reshape(poses, 6 * nodes, 6 * nodes)
        stiffness = stiffness + everywhere.swapaxes(-1, -2) @ nodal @ everywhere
    return stiffness, pull


def _add_elements(
    stress: Array, structure: Structure, geometry: Geometry, forces: Array, gravity: bool
) -> Array:
    """Add the initial stress of beams, loop-closing joints and struts to (P, N, 6, N, 6).

    Returns the tension of the beams, (P, B).
    """
    beams, chords = len(structure.robot.beams), len(structure.chords)
    rotation, length = geometry.beam_rotation, geometry.beam_length
    local_ends = beam_forces(structure, geometry, forces, gravity)
    local_load = line_load(structure, geometry) * gravity
    pull = 0.5 * (local_ends[:, :, 1, 0] - local_ends[:, :, 0, 0])
    check_beams(structure, geometry, pull)
    bending, shear = beam_bending(structure, geometry)
    local = beam_initial_stress(length, local_ends, local_load, shear)
    local = local + bending_stress(length, *stability_change(bending, shear, pull, length))
    turn = np.zeros((*rotation.shape[:2], 12, 12))
    for at in (0, 6):
        turn[..., at : at + 6, at : at + 6] = rotate_screw(rotation)
    along, strut_length = strut_directions(structure, geometry, structure.struts)
    strut_pull = np.einsum("psa,psa->ps", along, forces[:, beams + chords :, 1, :3])
    blocks = [
        turn @ local @ turn.swapaxes(-1, -2),
        joint_initial_stress(forces[:, beams : beams + chords, 1]),
        strut_initial_stress(along, strut_length, strut_pull),
    ]
    blocks_by_element = np.moveaxis(np.concatenate(blocks, axis=1), 1, 0)
    for (first, second), block in zip(structure.elements.tolist(), blocks_by_element, strict=True):
        _add_between(stress, first, second, block)
    return pull


def _add_between(stress: Array, first: int, second: int, block: Array) -> None:
    """Add a matrix (P, 12, 12) between two nodes."""
    for i, row in enumerate((first, second)):
        for j, column in enumerate((first, second)):
            stress[:, row, :, column] += block[:, 6 * i : 6 * i + 6, 6 * j : 6 * j + 6]


def _add_payloads(stress: Array, structure: Structure, geometry: Geometry) -> None:
    """Add the turning arms of the masses that are off their nodes."""
    for mass in structure.robot.masses:
        node = structure.kinematics.node_index[mass.node]
        arm = geometry.node_rotation[:, node] @ np.array(mass.at)
        weight = mass.mass * np.array(structure.robot.gravity)
        stress[:, node, 3:, node, 3:] += arm_initial_stress(weight, arm)


def _add_constraints(
    stress: Array, structure: Structure, geometry: Geometry, rest: Array, unknowns: Array
) -> Array:
    """Add what the forces in rigid loops do, and return these forces as wrenches of the nodes (P, N, 6).

    The forces are Lagrange multipliers of the constraint rows, ``K z + G^T l = f``; where rows are redundant,
    the smallest that do. The order is that of `constraint_rows`.
    """
    robot, numbering = structure.robot, structure.unknowns
    index, positions = structure.kinematics.node_index, geometry.posture.node_positions
    missing = scatter(structure, geometry, rest)
    missing[:, structure.springs] -= structure.spring_values * unknowns[:, structure.springs]
    units = unknown_sizes(structure)
    inverse = scaled_inverse(constraint_rows(structure, geometry), units)
    forces = ((units * missing)[:, None] @ inverse)[:, 0]
    rigid_of = [joint_values(robot.joints[at]) == RIGID for at in numbering.chord_joints]
    rigid_struts = [at for at, strut in enumerate(robot.struts) if strut.rigid]
    sizes = [6] * (numbering.held.size + numbering.chord_rigids.size)
    sizes += [int(rigid.sum()) for rigid in rigid_of] + [1] * len(rigid_struts)
    parts = iter(np.split(forces, np.cumsum(sizes)[:-1], axis=1))
    wrenches = np.zeros_like(rest)
    for node in numbering.held:
        wrenches[:, node] += next(parts)
    for at in numbering.chord_rigids:
        a, b = (index[name] for name in robot.rigids[at].nodes)
        wrench, arm = next(parts), positions[:, b] - positions[:, a]
        wrenches[:, b] += wrench
        wrenches[:, a] -= (displacement_transport(arm).swapaxes(-1, -2) @ wrench[..., None])[..., 0]
        stress[:, a, 3:, a, 3:] += arm_initial_stress(wrench[:, :3], arm)
    for at, rigid in zip(numbering.chord_joints, rigid_of, strict=True):
        local = np.zeros((len(rest), 6))
        local[:, rigid] = next(parts)
        wrench = (rotate_screw(geometry.joint_rotation[:, at]) @ local[..., None])[..., 0]
        a, b = structure.joint_nodes[at]
        wrenches[:, b] += wrench
        wrenches[:, a] -= wrench
        _add_between(stress, a, b, joint_initial_stress(wrench))
    for at in rigid_struts:
        (along, length), pull = strut_directions(structure, geometry, np.array([at])), next(parts)
        a, b = (index[name] for name in robot.struts[at].nodes)
        wrenches[:, b, :3] += pull * along[:, 0]
        wrenches[:, a, :3] -= pull * along[:, 0]
        _add_between(stress, a, b, strut_initial_stress(along[:, 0], length[:, 0], pull[:, 0]))
    return wrenches


def _path_stiffness(structure: Structure, geometry: Geometry, rest: Array) -> Array:
    """Return H (P, n, n): the work of the rest wrenches on the second derivatives of the nodes' poses."""
    numbering, terms = structure.unknowns, geometry.terms
    count = numbering.count
    result = np.zeros((len(rest), count + 1, count + 1))
    loaded = rest.any(axis=(0, 2))
    for node in np.flatnonzero(loaded):
        path = np.flatnonzero(numbering.term_node == node)  # from the root on
        pull, twist = skew(rest[:, node, :3]), skew(rest[:, node, 3:])
        for place_t, t in enumerate(path):
            row = numbering.blocks[numbering.term_block[t]]
            by_force = terms[:, t, :3].swapaxes(-1, -2) @ pull  # v_j . (f x .)
            by_moment = terms[:, t, 3:].swapaxes(-1, -2) @ twist
            for s in path[:place_t]:
                column = numbering.blocks[numbering.term_block[s]]
                axes = terms[:, s, 3:]
                both = by_force @ axes
                result[:, row[:, None], column] += both + by_moment @ axes
                result[:, column[:, None], row] += both.swapaxes(-1, -2)
            axes = terms[:, t, 3:]
            own, spin = by_force @ axes, 0.5 * by_moment @ axes
            turning = 0.5 * (own + own.swapaxes(-1, -2)) + spin
            # a joint displaces along axes that turn with its first node: where the way meets the joint
            # from its second node, the rotation carries the displacement
            if numbering.term_sign[t] > 0:
                turning[:, :3] = turning[:, :, :3] = 0.0
            else:
                turning[:, :3, 3:] = own[:, :3, 3:]
                turning[:, 3:, :3] = own[:, :3, 3:].swapaxes(-1, -2)
            result[:, row[:, None], row] += turning
    return result[:, :-1, :-1]
