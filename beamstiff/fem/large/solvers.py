"""Solvers of large frames, and which of them to use.

Direct ones by default: our multifrontal factorisation, or with the TCP alone its condensation, which keeps no
factor. A factor too large for memory goes to PARDISO (extra `pardiso`: MKL, free of charge but closed), whose
factor is smaller, and beyond that to a multigrid (extra `amg`), whose residual is checked: it is at its best
in huge cubes and stalls in slender frames. On one core the default is the fastest of them
(benchmarks/README.md).
"""

from __future__ import annotations

import importlib.util
import warnings
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.fem.large.frame import Frame, Index, frame_stiffness, nodal_forces, rigid_motions
from beamstiff.fem.large.memory import SHARE, free_bytes, refuse_unless_fits
from beamstiff.fem.large.multifrontal import Plan, Softness, factorise, make_plan
from beamstiff.fem.large.refinement import Quality, Solve, condition_estimate, refined
from beamstiff.se3 import Array

DIRECTIONS = ("x", "y", "z", "about x", "about y", "about z")
ITERATIONS = 500
POSITIVE_DEFINITE, ANALYSIS, FACTOR, SOLUTION = 2, 11, 22, 33  # by the numbers of PARDISO's manual
PARDISO_ERRORS = {
    -2: "it does not fit into memory",
    -4: "the frame is a mechanism; the multifrontal solver says where",
}
LESS = 0.65  # of our memory: what PARDISO takes, measured; it tells exactly once it has analysed
STALLED = 1e-6  # a residual above this is no solution


@dataclass(frozen=True, eq=False)
class Solution:
    """How a frame gives way.

    Attributes
    ----------
    displacement : (N, 6, c) array
        ``[d, r]`` of every node under each load, m and rad.
    quality : Quality
    solver : str
    """

    displacement: Array
    quality: Quality
    solver: str
    _stiffness: sparse.csc_array
    _solve: Solve

    def condition(self) -> float:
        """Return an estimate of the condition number, scaled to unit diagonal; takes some ten solutions."""
        return condition_estimate(self._stiffness, self._solve)


def solve_frame(frame: Frame, loads: Array, solver: str | None = None) -> Solution:
    """Solve for the displacement of all nodes under several loads, with one factorisation.

    Parameters
    ----------
    frame : Frame
    loads : (N, 6, c) array
        Wrenches ``[f, m]`` on the nodes, N and N m.
    solver : "multifrontal", "pardiso", "splu" or "multigrid", optional
        Default: the first if its factor fits into memory, else the second or the last if it is installed.

    Raises
    ------
    BeamstiffError
        When the frame is a mechanism, does not fit into memory, or the multigrid stalls.
    """
    if loads.shape[:2] != (len(frame.points), 6) or not np.isfinite(loads).all():
        raise BeamstiffError(
            f"found loads of shape {loads.shape}, expected finite numbers of shape "
            f"({len(frame.points)}, 6, c)"
        )
    stiffness = frame_stiffness(frame)
    free = frame.unknowns.reshape(-1) >= 0
    right = loads.reshape(free.size, -1)[free]
    if solver is not None and solver not in SOLVERS:
        raise BeamstiffError(f"there is no solver {solver!r}{suggest(solver, SOLVERS)}")
    if solver is None:
        plan = frame_plan(frame)
        chosen = _choice(plan)
        solve = (
            _by_multifrontal(frame, stiffness, plan)
            if chosen == "multifrontal"
            else SOLVERS[chosen](frame, stiffness)
        )
    else:
        chosen, solve = solver, SOLVERS[solver](frame, stiffness)

    def whole(x: NDArray[Any]) -> NDArray[Any]:
        moved = np.zeros((free.size, x.shape[1]), dtype=x.dtype)
        moved[free] = x
        return moved.reshape(-1, 6, x.shape[1])

    def forces(x: NDArray[Any]) -> NDArray[Any]:
        return nodal_forces(frame, whole(x)).reshape(free.size, -1)[free]

    x, quality = refined(np.sqrt(stiffness.diagonal()), forces, solve, right)
    if not quality.error <= STALLED or ((x * right).sum(axis=0) < 0.0).any():
        raise BeamstiffError(
            f"the solution of {len(x)} unknowns by {chosen!r} may be off by {quality.error:.1g} of itself, "
            f"expected {STALLED:g} or less: the frame is a mechanism or nearly one"
        )
    return Solution(whole(x), quality, chosen, stiffness, solve)


def interface_compliance(frame: Frame, nodes: Index) -> tuple[Array, float]:
    """Return the compliance (k, k) at some nodes, six rows each, and its relative error.

    By refined solutions for unit wrenches if the factor fits into memory. Else by the Schur complement
    ``K_ii - K_ir K_rr^-1 K_ri`` without a factor, which cannot be refined: it is done twice, once with all
    entries off in their last digit, and what that changes is the error.

    Raises
    ------
    BeamstiffError
        When the frame is a mechanism, does not fit into memory or is so slender that the error shows in the
        sixth digit, or a node is fixed.
    """
    wanted = np.asarray(nodes, dtype=np.int64)
    if frame.fixed[wanted].any():
        raise BeamstiffError(f"node {int(wanted[frame.fixed[wanted]][0])} is fixed: it has no compliance")
    plan = frame_plan(frame)
    if plan.factor_bytes + plan.peak_bytes <= SHARE * free_bytes():
        loads = np.zeros((len(frame.points), 6, 6 * len(wanted)))
        for number, node in enumerate(wanted):
            loads[node, :, 6 * number : 6 * number + 6] = np.eye(6)
        found = solve_frame(frame, loads, "multifrontal")
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


def _choice(plan: Plan) -> str:
    free, needed = SHARE * free_bytes(), plan.factor_bytes + plan.peak_bytes
    if needed > free:
        if LESS * needed <= free and _installed("pypardiso"):
            return "pardiso"
        if _installed("pyamg"):
            return "multigrid"
    return "multifrontal"


def _installed(package: str) -> bool:
    return importlib.util.find_spec(package) is not None


def _by_multifrontal(frame: Frame, stiffness: sparse.csc_array, plan: Plan | None = None) -> Solve:
    plan = plan or frame_plan(frame)
    refuse_unless_fits(
        "the factor",
        plan.factor_bytes + plan.peak_bytes,
        stiffness.shape[0],
        f"; the compliance at a few nodes alone (interface_compliance) takes {plan.peak_bytes / 1e9:.2g} GB"
        + ("" if _installed("pyamg") else ", and the multigrid (extra `amg`) less than a factor"),
    )
    try:
        return factorise(stiffness, plan).solve
    except Softness as soft:
        raise _mechanism(frame, soft) from None


def _by_splu(frame: Frame, stiffness: sparse.csc_array) -> Solve:  # noqa: ARG001
    # symmetric and positive definite: pivots stay on the diagonal
    try:
        factor = splu(
            stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # a pivot of zero
        raise BeamstiffError("the frame is a mechanism; the multifrontal solver says where") from None
    except MemoryError:
        raise BeamstiffError(
            f"the factor of {stiffness.shape[0]} unknowns does not fit into memory"
        ) from None
    solve: Solve = factor.solve
    return solve


def _by_pardiso(frame: Frame, stiffness: sparse.csc_array) -> Solve:  # noqa: ARG001
    if not _installed("pypardiso"):
        raise BeamstiffError("this solver needs pypardiso: pip install 'beamstiff[pardiso]'")
    from pypardiso.pardiso_wrapper import PyPardisoError, PyPardisoSolver

    upper = sparse.csr_matrix(sparse.triu(stiffness, format="csr"))
    upper.sort_indices()
    try:
        solver = PyPardisoSolver(mtype=POSITIVE_DEFINITE)
    except (ImportError, OSError):
        raise BeamstiffError("this solver finds no MKL: pip install mkl, or set PYPARDISO_MKL_RT") from None

    def run(phase: int, right: Array) -> Array:
        solver.set_phase(phase)
        found: Array = solver._call_pardiso(upper, right)
        return found

    nothing = np.zeros((stiffness.shape[0], 1))
    try:
        run(ANALYSIS, nothing)
        # of its own figures, in kB: the most that the analysis takes, or what stays of it and the factor
        needed = 1024.0 * max(solver.get_iparm(15), solver.get_iparm(16) + solver.get_iparm(17))
        refuse_unless_fits("the factor", needed, stiffness.shape[0])
        run(FACTOR, nothing)
    except (PyPardisoError, BeamstiffError) as failed:
        _release(solver)
        if isinstance(failed, BeamstiffError):
            raise
        code = int(failed.value)
        what = PARDISO_ERRORS.get(code, f"PARDISO failed with error {code}; take another solver")
        raise BeamstiffError(f"a factor of {stiffness.shape[0]} unknowns: {what}") from None

    def solve(right: Array) -> Array:
        return run(SOLUTION, np.asfortranarray(right, dtype=np.float64))

    weakref.finalize(solve, _release, solver)  # its memory is none of Python's
    return solve


def _release(solver: Any) -> None:
    solver.free_memory(everything=True)


def _by_multigrid(frame: Frame, stiffness: sparse.csc_array) -> Solve:
    if not _installed("pyamg"):
        raise BeamstiffError("the multigrid needs pyamg: pip install 'beamstiff[amg]'")
    import pyamg

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        levels = pyamg.smoothed_aggregation_solver(
            stiffness.tocsr().tobsr((6, 6)),
            B=rigid_motions(frame),
            smooth=("energy", {"degree": 2, "maxiter": 4}),
            max_coarse=600,
        )

    def solve(right: Array) -> Array:
        columns = []
        for column in right.T:
            x = levels.solve(column, tol=1e-10, maxiter=ITERATIONS, accel="cg")
            size = max(float(np.linalg.norm(column)), np.finfo(float).tiny)
            left = float(np.linalg.norm(column - stiffness @ x)) / size
            if not left <= STALLED:
                raise BeamstiffError(
                    f"the multigrid stalled with a residual of {left:.1g}, expected {STALLED:g} or less: "
                    "take a direct solver, slender frames need one"
                )
            columns.append(x)
        return np.stack(columns, axis=1)

    return solve


SOLVERS: dict[str, Callable[[Frame, sparse.csc_array], Solve]] = {
    "multifrontal": _by_multifrontal,
    "splu": _by_splu,
    "pardiso": _by_pardiso,
    "multigrid": _by_multigrid,
}


def _mechanism(frame: Frame, soft: Softness) -> BeamstiffError:
    node, direction = np.argwhere(frame.unknowns == soft.unknown)[0].tolist()
    return BeamstiffError(
        f"the frame is a mechanism: nothing resists node {node} {DIRECTIONS[direction]} once the nodes "
        "around it give way; fix more of it, or check how it is connected"
    )
