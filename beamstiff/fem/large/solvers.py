"""Displacements and compliance of large frames by our multifrontal factorisation.

With a few nodes alone by its condensation, which keeps no factor. On one core it is faster than splu, PARDISO
and a smoothed aggregation multigrid (benchmarks/README.md).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from beamstiff.errors import BeamstiffError
from beamstiff.fem.large.frame import Frame, Index, frame_stiffness, nodal_forces
from beamstiff.fem.large.memory import SHARE, free_bytes, refuse_unless_fits
from beamstiff.fem.large.multifrontal import Plan, Quality, Softness, Solve, factorise, make_plan, refined
from beamstiff.se3 import Array

DIRECTIONS = ("x", "y", "z", "about x", "about y", "about z")
STALLED = 1e-6  # relative error above which it is no solution


@dataclass(frozen=True, eq=False)
class Solution:
    """Displacement ``[d, r]`` of every node under each load (N, 6, c), m and rad, and how good it is."""

    displacement: Array
    quality: Quality


def solve_frame(frame: Frame, loads: Array) -> Solution:
    """Solve for the displacement of all nodes under several loads, with one factorisation.

    `loads`: (N, 6, c) array; wrenches ``[f, m]`` on the nodes, N and N m.
    """
    if loads.shape[:2] != (len(frame.points), 6) or not np.isfinite(loads).all():
        raise BeamstiffError(
            f"found loads of shape {loads.shape}, expected finite numbers of shape "
            f"({len(frame.points)}, 6, c)"
        )
    stiffness = frame_stiffness(frame)
    free = frame.unknowns.reshape(-1) >= 0
    right = loads.reshape(free.size, -1)[free]

    def whole(x: NDArray[Any]) -> NDArray[Any]:
        moved = np.zeros((free.size, x.shape[1]), dtype=x.dtype)
        moved[free] = x
        return moved.reshape(-1, 6, x.shape[1])

    def forces(x: NDArray[Any]) -> NDArray[Any]:
        return nodal_forces(frame, whole(x)).reshape(free.size, -1)[free]

    x, quality = refined(np.sqrt(stiffness.diagonal()), forces, _factored(frame, stiffness), right)
    if not quality.error <= STALLED or ((x * right).sum(axis=0) < 0.0).any():
        raise BeamstiffError(
            f"the solution of {len(x)} unknowns may be off by {quality.error:.1g} of itself, expected "
            f"{STALLED:g} or less: the frame is a mechanism or nearly one"
        )
    return Solution(whole(x), quality)


def interface_compliance(frame: Frame, nodes: Index) -> tuple[Array, float]:
    """Return the compliance (k, k) at some nodes, six rows each, and its relative error.

    By refined solutions for unit wrenches if the factor fits into memory. Else by the Schur complement
    ``K_ii - K_ir K_rr^-1 K_ri`` without a factor, which cannot be refined: it is done twice, once with all
    entries off in their last digit, and what that changes is the error.
    """
    wanted = np.asarray(nodes, dtype=np.int64)
    if frame.fixed[wanted].any():
        raise BeamstiffError(f"node {int(wanted[frame.fixed[wanted]][0])} is fixed: it has no compliance")
    plan = frame_plan(frame)
    if plan.factor_bytes + plan.peak_bytes <= SHARE * free_bytes():
        loads = np.zeros((len(frame.points), 6, 6 * len(wanted)))
        for number, node in enumerate(wanted):
            loads[node, :, 6 * number : 6 * number + 6] = np.eye(6)
        found = solve_frame(frame, loads)
        compliance = found.displacement[wanted].reshape(6 * len(wanted), -1)
        return 0.5 * (compliance + compliance.T), found.quality.error
    stiffness, plan = frame_stiffness(frame), frame_plan(frame, wanted)
    refuse_unless_fits("the condensation", plan.peak_bytes, stiffness.shape[0])
    digits = sparse.triu(stiffness).tocsc()
    digits.data = 1.0 + np.finfo(float).eps * np.random.default_rng(0).standard_normal(digits.nnz)
    other = stiffness.multiply(sparse.triu(digits) + sparse.triu(digits, 1).T).tocsc()
    try:
        one, two = (_inverse(factorise(K, plan, keep=False).rest) for K in (stiffness, other))
    except Softness as soft:
        raise _mechanism(frame, soft) from None
    scale = np.sqrt(np.diagonal(one))
    error = float((np.abs(one - two) / np.outer(scale, scale)).max())
    if not error <= STALLED:
        raise BeamstiffError(
            f"the compliance by condensation of {stiffness.shape[0]} unknowns is known to {error:.1g} "
            f"of itself, expected {STALLED:g} or less: it needs a factor, and memory for it"
        )
    return one, error


def _inverse(matrix: Array) -> Array:
    inverse: Array = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return 0.5 * (inverse + inverse.T)


def frame_plan(frame: Frame, last: Index | None = None) -> Plan:
    """Return the plan of elimination of a frame with some nodes last."""
    free = np.flatnonzero(~frame.fixed)
    number = np.full(len(frame.points), -1)
    number[free] = np.arange(len(free))
    ends = number[frame.beams]
    a, b = ends[(ends >= 0).all(axis=1)].T
    entries = (np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a])))
    graph = sparse.coo_array(entries, shape=(len(free), len(free))).tocsr()
    kept = np.zeros(0, dtype=np.int64) if last is None else number[last]
    return make_plan(graph, frame.points[free], kept, 6 * np.arange(len(free) + 1))


def _factored(frame: Frame, stiffness: sparse.csc_array) -> Solve:
    plan = frame_plan(frame)
    refuse_unless_fits(
        "the factor",
        plan.factor_bytes + plan.peak_bytes,
        stiffness.shape[0],
        f"; the compliance at a few nodes alone (interface_compliance) takes {plan.peak_bytes / 1e9:.2g} GB",
    )
    try:
        return factorise(stiffness, plan).solve
    except Softness as soft:
        raise _mechanism(frame, soft) from None


def _mechanism(frame: Frame, soft: Softness) -> BeamstiffError:
    node, direction = np.argwhere(frame.unknowns == soft.unknown)[0].tolist()
    return BeamstiffError(
        f"the frame is a mechanism: nothing resists node {node} {DIRECTIONS[direction]} once the nodes "
        "around it move; fix more of it, or check how it is connected"
    )
