"""The reduced global stiffness: element matrices in the base frame, added up in a pattern found once."""

import numpy as np
from scipy import sparse

from beamstiff.fem.beam_element import beam_stiffness
from beamstiff.fem.placed_structure import Geometry, strut_directions, strut_stiffness
from beamstiff.fem.structure import Structure
from beamstiff.se3 import Array, displacement_transport, rotate_screw


def element_blocks(structure: Structure, geometry: Geometry) -> Array:
    """Return the stiffness of all elements (P, E, 2, 2, 6, 6), by end and end (seed 003, eqs 16 to 20)."""
    parts = (_beam_blocks, _joint_blocks, _strut_blocks)
    return np.concatenate([part(structure, geometry) for part in parts], axis=1)


def _beam_blocks(structure: Structure, geometry: Geometry) -> Array:
    local = beam_stiffness(geometry.beam_length, **structure.beam_properties)
    poses, beams = local.shape[:2]
    # four triples a side (displacement and rotation at either end): turn each of the sixteen 3x3 blocks
    triples = local.reshape(poses, beams, 4, 3, 4, 3).swapaxes(-3, -2)
    rotation = geometry.beam_rotation[:, :, None, None]
    turned: Array = rotation @ triples @ rotation.swapaxes(-1, -2)
    return turned.swapaxes(-3, -2).reshape(poses, beams, 2, 6, 2, 6).swapaxes(-3, -2)


def _joint_blocks(structure: Structure, geometry: Geometry) -> Array:
    """Return the blocks of joints that close a loop: ``D = R diag(k) R^T``, R from their axes to the base's.

    A joint of a tree has its displacements as unknowns, with k on the diagonal.
    """
    turn = rotate_screw(geometry.joint_rotation[:, structure.chords])
    return _between_ends(turn * structure.chord_values[:, None, :] @ turn.swapaxes(-1, -2))


def _strut_blocks(structure: Structure, geometry: Geometry) -> Array:
    along, _ = strut_directions(structure, geometry, structure.struts)
    stiffness, block = strut_stiffness(structure, geometry), np.zeros((*along.shape[:2], 6, 6))
    block[..., :3, :3] = stiffness[..., None, None] * along[..., :, None] * along[..., None, :]
    return _between_ends(block)


def _between_ends(block: Array) -> Array:
    """Return ``[[D, -D], [-D, D]]`` by end and end (seed 003, eq. 17)."""
    signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return signs[:, :, None, None] * block[:, :, None, None]


def dense_stiffness(structure: Structure, geometry: Geometry) -> Array:
    """Return the reduced global stiffness of every pose, (P, n, n)."""
    return assemble(structure, geometry)[0]


def assemble(structure: Structure, geometry: Geometry) -> tuple[Array, Array]:
    """Return the reduced global stiffness of every pose (P, n, n), and how large what went into it is (P, n).

    The latter sums, by element, the largest stiffness of like dimension at an unknown: what is left of it in
    the stiffness, turned into the base frame, is known to some 1e-16 of it.
    """
    count, pattern = structure.unknowns.count, structure.pattern
    blocks = element_blocks(structure, geometry)
    products = _products(structure, geometry, blocks)
    poses = products.shape[0]
    matrix = np.zeros((poses, count, count))
    matrix[:, pattern.rows, pattern.columns] = _add_up(structure, products)
    own = (pattern.end_i == pattern.end_j) & (pattern.term_i == pattern.term_j)
    element, end, term = pattern.element[own], pattern.end_i[own], pattern.term_i[own]
    force, cross, moment = (part[:, element, end] for part in _largest(blocks[:, :, (0, 1), (0, 1)]))
    # a rotation moves the element along an arm: crosswise, where nothing of it may be left in the product
    arm = np.linalg.norm(geometry.terms[:, term, :3, 3:], axis=(2, 3)) * np.sqrt(0.5)
    largest = np.stack([force, moment + 2 * arm * cross + arm**2 * force], axis=2)
    numbers = structure.unknowns.blocks[structure.unknowns.term_block[term]]
    size = np.zeros((poses, count + 1))
    np.add.at(size.T, numbers, np.moveaxis(largest.repeat(3, axis=2), 0, -1))
    size[:, structure.springs] += structure.spring_values
    return matrix, size[:, :-1]


def _largest(blocks: Array) -> tuple[Array, Array, Array]:
    """Return the largest entries of blocks (..., 6, 6): of forces, of couplings, of moments."""
    size = np.abs(blocks)
    parts = (size[..., :3, :3], size[..., :3, 3:], size[..., 3:, 3:])
    force, cross, moment = (part.max(axis=(-2, -1)) for part in parts)
    return force, cross, moment


def _products(structure: Structure, geometry: Geometry, blocks: Array) -> Array:
    """Return the products of element blocks and terms in the structure's pattern, (P, M, 6, 6)."""
    pattern = structure.pattern
    between = blocks[:, pattern.element, pattern.end_i, pattern.end_j]
    left = geometry.terms[:, pattern.term_i].swapaxes(-1, -2)
    return left @ between @ geometry.terms[:, pattern.term_j]


def _add_up(structure: Structure, products: Array) -> Array:
    pattern, poses = structure.pattern, products.shape[0]
    if pattern.starts.size == 0:
        return np.zeros((poses, 0))
    springs = np.broadcast_to(structure.spring_values, (poses, structure.springs.size))
    diagonal = np.zeros((poses, structure.unknowns.count))
    values = np.concatenate([products.reshape(poses, -1), springs, diagonal], axis=1)
    return np.add.reduceat(values[:, pattern.order], pattern.starts, axis=1)


def sparse_stiffness(structure: Structure, geometry: Geometry) -> sparse.csc_array:
    """Return the reduced global stiffness of the first pose, sparse (seed 003, eqs 21 to 23: its K_C)."""
    count, pattern = structure.unknowns.count, structure.pattern
    pointers = np.searchsorted(pattern.columns, np.arange(count + 1))
    products = _products(structure, geometry, element_blocks(structure, geometry))
    entries = _add_up(structure, products)[0]
    return sparse.csc_array((entries, pattern.rows, pointers), shape=(count, count))


def element_forces(structure: Structure, geometry: Geometry, displacement: Array) -> tuple[Array, Array]:
    """Return the wrenches on the ends of all elements (P, E, 2, 6), base frame, and their energy (P, E).

    For displacements (P, N, 6) of the nodes. Only the deformation counts, second end against the first
    carried along: what moves an element as a whole leaves no rounding errors of its stiffness behind.
    """
    deformation = element_deformation(structure, geometry, displacement)
    blocks = element_blocks(structure, geometry)[:, :, :, 1]
    forces: Array = (blocks @ deformation[:, :, None, :, None])[..., 0]
    return forces, 0.5 * np.einsum("pea,pea->pe", deformation, forces[:, :, 1])


def stiffness_between(structure: Structure, geometry: Geometry, motions: Array) -> tuple[Array, Array]:
    """Return ``Z^T K Z`` (P, c, c) and ``K Z`` (P, n, c) for motions Z (P, n, c) of the unknowns.

    As `element_forces` it takes the deformation alone, so that a motion that strains nothing meets no
    stiffness, however stiff the parts are that it moves.
    """
    first, second = structure.elements.T
    blocks = element_blocks(structure, geometry)
    own = motions[:, structure.springs]
    forces = np.zeros_like(motions)
    strains, held = [], []
    for at in range(motions.shape[2]):
        strain = element_deformation(structure, geometry, gather(structure, geometry, motions[:, :, at]))
        ends = (blocks[:, :, :, 1] @ strain[:, :, None, :, None])[..., 0]
        nodal = np.zeros((len(motions), len(structure.robot.nodes), 6))
        np.add.at(nodal.swapaxes(0, 1), first, ends[:, :, 0].swapaxes(0, 1))
        np.add.at(nodal.swapaxes(0, 1), second, ends[:, :, 1].swapaxes(0, 1))
        forces[:, :, at] = scatter(structure, geometry, nodal)
        strains.append(strain)
        held.append(ends[:, :, 1])
    forces[:, structure.springs] += structure.spring_values[:, None] * own
    stiffness: Array = own.swapaxes(-1, -2) @ (structure.spring_values[:, None] * own)
    if strains:
        stiffness = stiffness + np.einsum("peac,pead->pcd", np.stack(strains, -1), np.stack(held, -1))
    return stiffness, forces


def element_deformation(structure: Structure, geometry: Geometry, displacement: Array) -> Array:
    """Return the deformation of all elements, second end against the first carried along, (P, E, 6)."""
    first, second = structure.elements.T
    positions = geometry.posture.node_positions
    arm = positions[:, second] - positions[:, first]
    beams = len(structure.robot.beams)
    arm[:, beams:] = 0.0  # joints have none, and struts no stiffness against rotation
    carried = (displacement_transport(arm) @ displacement[:, first, :, None])[..., 0]
    return displacement[:, second] - carried


def gather(structure: Structure, geometry: Geometry, unknowns: Array) -> Array:
    """Return the displacement of all nodes (P, N, 6), base frame, from the unknowns (P, n): ``u = T z``."""
    numbering = structure.unknowns
    padded = np.concatenate([unknowns, np.zeros((unknowns.shape[0], 1))], axis=1)
    values = padded[:, numbering.blocks[numbering.term_block]]
    parts = (geometry.terms @ values[..., None])[..., 0]
    result = np.zeros((unknowns.shape[0], len(structure.robot.nodes), 6))
    np.add.at(result.swapaxes(0, 1), numbering.term_node, parts.swapaxes(0, 1))
    return result


def scatter(structure: Structure, geometry: Geometry, wrenches: Array) -> Array:
    """Return the generalised forces (P, n) of nodal wrenches (P, N, 6), base frame: ``f = T^T w``."""
    numbering = structure.unknowns
    parts = (geometry.terms.swapaxes(-1, -2) @ wrenches[:, numbering.term_node, :, None])[..., 0]
    result = np.zeros((wrenches.shape[0], numbering.count + 1))
    np.add.at(result.T, numbering.blocks[numbering.term_block], np.moveaxis(parts, 0, -1))
    return result[:, :-1]


def node_map(structure: Structure, geometry: Geometry, node: int) -> Array:
    """Return T of one node, (P, 6, n): its displacement ``[d, r]`` for the unknowns."""
    numbering = structure.unknowns
    result = np.zeros((geometry.terms.shape[0], 6, numbering.count + 1))
    for term in np.flatnonzero(numbering.term_node == node):
        result[:, :, numbering.blocks[numbering.term_block[term]]] += geometry.terms[:, term]
    result[:, :, -1] = 0.0
    return result[:, :, :-1]
