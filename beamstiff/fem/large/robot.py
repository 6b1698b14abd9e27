"""Robots and machines of many unknowns: the same answers from the sparse stiffness, pose by pose."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from beamstiff.errors import BeamstiffError
from beamstiff.fem.assembly import element_forces, gather, scatter, sparse_stiffness
from beamstiff.fem.large.memory import refuse_unless_fits
from beamstiff.fem.large.multifrontal import Plan, Softness, factorise, make_plan, refined
from beamstiff.fem.mechanism import SOFTEST, mechanism_error
from beamstiff.fem.placed_structure import Geometry
from beamstiff.fem.structure import Index, Structure
from beamstiff.se3 import Array

MANY_UNKNOWNS = 1200  # unknowns: with fewer, dense matrices are faster
DOUBTFUL = 1e-6  # relative error that shows
SHIFT = 1e-8  # of the diagonal, to find a motion that nothing resists


def solve_sparse(structure: Structure, geometry: Geometry, right: Array, rest: Index | None = None) -> Array:
    """Return the unknowns z (P, n, c) of ``K z = f``, those outside `rest` held; not for rigid loops."""
    some = np.arange(structure.unknowns.count) if rest is None else np.sort(rest)
    result = np.zeros(right.shape)
    plan = None
    for pose in range(len(right)):
        one = geometry.only(np.array([pose]))
        stiffness = sparse.csc_array(sparse_stiffness(structure, one)[some][:, some])
        if plan is None:
            plan = _plan(structure, one, stiffness, some)
            needed = plan.factor_bytes + plan.peak_bytes
            refuse_unless_fits(f"robot {structure.robot.name!r}: the factor", needed, some.size)
        try:
            solve = factorise(stiffness, plan).solve
        except Softness as soft:
            motion = np.zeros(structure.unknowns.count)
            motion[some] = _softest(stiffness, plan, soft.unknown)
            raise mechanism_error(structure, geometry, pose, motion) from None

        def forces(x: NDArray[Any], one: Geometry = one) -> NDArray[Any]:
            return _forces(structure, one, some, x)

        scale = np.sqrt(stiffness.diagonal())
        result[pose, some], quality = refined(scale, forces, solve, right[pose, some])
        if not quality.error <= DOUBTFUL:
            motion = np.zeros(structure.unknowns.count)
            most = np.abs(scale[:, None] * result[pose, some]).max(axis=1, initial=0.0)
            motion[some] = _softest(stiffness, plan, int(np.argmax(most)))
            energy = float(motion[some] @ forces(motion[some, None])[:, 0])
            if energy < SOFTEST * float(((scale * motion[some]) ** 2).sum()):
                raise mechanism_error(structure, geometry, pose, motion)
            raise BeamstiffError(
                f"robot {structure.robot.name!r}: the displacements at pose {geometry.number[pose]} may be "
                f"off by {quality.error:.1g} of themselves: parts too unlike, or nearly a mechanism"
            )
    return result


def _plan(structure: Structure, geometry: Geometry, stiffness: sparse.csc_array, some: Index) -> Plan:
    """Return the plan of elimination: the blocks of unknowns are the nodes of the graph."""
    unknowns, index = structure.unknowns, structure.kinematics.node_index
    points = geometry.posture.node_positions[0]
    labels = [unknowns.labels[int(numbers[numbers >= 0][0])][0] for numbers in unknowns.blocks]
    where = [
        points[index[label] if joint < 0 else structure.joint_nodes[joint, 1]]
        for joint, label in zip(unknowns.block_joint, labels, strict=True)
    ]
    owner = np.empty(unknowns.count, dtype=np.int64)
    for block, numbers in enumerate(unknowns.blocks):
        owner[numbers[numbers >= 0]] = block
    blocks, number = np.unique(owner[some], return_inverse=True)
    entries = stiffness.tocoo()
    pairs = np.unique(np.stack([number[entries.row], number[entries.col]]), axis=1)
    pairs = pairs[:, pairs[0] != pairs[1]]
    graph = sparse.coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(blocks),) * 2).tocsr()
    first = np.concatenate([[0], np.cumsum(np.bincount(number))])
    return make_plan(graph, np.array(where)[blocks], np.zeros(0, dtype=np.int64), first)


def _forces(structure: Structure, geometry: Geometry, some: Index, x: NDArray[Any]) -> NDArray[Any]:
    """Return ``K x`` by the deformation of the elements: a motion of the whole leaves no rounding errors."""
    result = np.zeros(x.shape)
    for column in range(x.shape[1]):
        moved = np.zeros((1, structure.unknowns.count))
        moved[0, some] = x[:, column]
        ends, _ = element_forces(structure, geometry, gather(structure, geometry, moved))
        nodal = np.zeros((1, len(structure.robot.nodes), 6))
        for end in (0, 1):
            np.add.at(nodal[0], structure.elements[:, end], ends[0, :, end])
        force = scatter(structure, geometry, nodal)
        force[:, structure.springs] += structure.spring_values * moved[:, structure.springs]
        result[:, column] = force[0, some]
    return result


def _softest(stiffness: sparse.csc_array, plan: Plan, unknown: int) -> Array:
    """Return a motion that meets nearly no stiffness, (n,), by inverse iteration on a shifted matrix."""
    diagonal = stiffness.diagonal()
    tiny = float(np.finfo(float).eps * diagonal.max(initial=1.0))
    shifted = sparse.csc_array(stiffness + SHIFT * sparse.diags_array(diagonal + tiny))
    motion = np.zeros((stiffness.shape[0], 1))
    motion[unknown] = 1.0
    try:
        solve = factorise(shifted, plan).solve
    except Softness:  # nothing resists at all
        return motion[:, 0]
    for _ in range(3):
        motion = solve(stiffness.diagonal()[:, None] * motion)
        motion /= np.abs(motion).max()
    return motion[:, 0]
