"""Solve one lattice and print as JSON what it took: `python -m benchmarks.large_frame KIND DOFS SOLVER`.

KIND is slender or cube, SOLVER multifrontal or condensation, which are ours, or one of `RIVALS`. In a process
of its own, so that the peak memory is that of this work; six unit wrenches at the tip, all displacements.
"""

from __future__ import annotations

import importlib.util
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from beamstiff.errors import BeamstiffError
from beamstiff.fem.large.frame import Frame, frame_stiffness
from beamstiff.fem.large.multifrontal import factorise
from beamstiff.fem.large.solvers import frame_plan, solve_frame
from beamstiff.se3 import Array, displacement_transport
from benchmarks.lattice import cube, slender, tip
from benchmarks.peers import ask, off

Row = tuple[str, ...]
FRAMES = {"slender": slender, "cube": cube}
DEFAULT, OPENSEES = "multifrontal", "OpenSeesPy, MUMPS"


def run(kind: str, dofs: float, solver: str) -> dict[str, object]:
    """Return seconds without and with refinement, errors, peak memory and the compliance at the tip."""
    frame = FRAMES[kind](dofs)
    node = tip(frame)
    loads = np.zeros((len(frame.points), 6, 6))
    loads[node] = np.eye(6)
    report: dict[str, object] = {"dofs": int(frame.unknowns.max()) + 1}
    start = time.process_time()
    try:
        if solver == "condensation":
            plan = frame_plan(frame, np.array([node]))
            compliance = np.linalg.inv(factorise(frame_stiffness(frame), plan, keep=False).rest)
            report["plain"] = time.process_time() - start
            report |= {"flops": plan.flops, "bytes": plan.peak_bytes}
        else:
            way = RIVALS.get(solver, _by_multifrontal)
            solution = way(frame, frame_stiffness(frame), loads.reshape(-1, 6)[frame.unknowns.ravel() >= 0])
            report["plain"] = time.process_time() - start
            compliance = solution[frame.unknowns[node]]
            if solver == DEFAULT:
                start = time.process_time()
                found = solve_frame(frame, loads)
                report["refined"] = time.process_time() - start
                report |= {"error": found.quality.error, "first_error": found.quality.first_error}
                report["refinements"] = found.quality.refinements
                compliance = found.displacement[node]
        report["compliance"] = np.asarray(compliance).tolist()
    except (BeamstiffError, MemoryError) as refused:
        report["refused"] = str(refused)
    report["peak"] = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return report


def _by_multifrontal(frame: Frame, stiffness: sparse.csc_array, right: Array) -> Array:
    return factorise(stiffness, frame_plan(frame)).solve(right)


def _by_splu(_: Frame, stiffness: sparse.csc_array, right: Array) -> Array:
    # symmetric and positive definite: pivots stay on the diagonal
    options = {"SymmetricMode": True}
    factor = splu(stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    solved: Array = factor.solve(right)
    return solved


def _by_pardiso(_: Frame, stiffness: sparse.csc_array, right: Array) -> Array:
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)  # symmetric and positive definite
    upper = sparse.csr_matrix(sparse.triu(stiffness, format="csr"))
    upper.sort_indices()
    solver.factorize(upper)
    solved: Array = solver.solve(upper, np.asfortranarray(right))
    return solved


def _by_multigrid(frame: Frame, stiffness: sparse.csc_array, right: Array) -> Array:
    import pyamg

    points = frame.points[~frame.fixed]
    levels = pyamg.smoothed_aggregation_solver(
        stiffness.tocsr().tobsr((6, 6)),
        B=displacement_transport(points - points.mean(axis=0)).reshape(-1, 6),
        smooth=("energy", {"degree": 2, "maxiter": 4}),
        max_coarse=600,
    )
    columns = [levels.solve(column, tol=1e-10, maxiter=500, accel="cg") for column in right.T]
    return np.stack(columns, axis=1)


RIVALS: dict[str, Callable[[Frame, sparse.csc_array, Array], Array]] = {
    "splu": _by_splu,
    "pardiso": _by_pardiso,
    "multigrid": _by_multigrid,
}


def in_a_process(kind: str, dofs: float, solver: str) -> dict[str, Any]:
    """Return the report of `run` from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.large_frame", kind, str(dofs), solver]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return report


def lattices(rates: tuple[float, float], peers: str | None, large: bool) -> Iterator[Row]:
    """Yield rows of large frames: assembly, factor and six right sides."""
    yield (
        "lattice",
        "unknowns",
        "solver",
        "s",
        "s refined",
        "error before, after",
        "peak GB",
        "GFlop, floor s",
        "beside the others of this run",
    )
    sizes = [("slender", 1e5), ("cube", 1e5)]
    sizes += [("slender", 3e5), ("cube", 3e5), ("slender", 1e6)] if large else []
    for kind, dofs in sizes:
        ways = [DEFAULT, "condensation", "splu"] if kind == "slender" else [DEFAULT, "condensation"]
        ways += ["multigrid"] * (kind == "cube" and importlib.util.find_spec("pyamg") is not None)
        ways += ["pardiso"] * (importlib.util.find_spec("pypardiso") is not None)
        reports = {solver: in_a_process(kind, dofs, solver) for solver in ways}
        if peers and (kind, dofs) != ("slender", 1e6):
            reports[OPENSEES] = _by_opensees(peers, kind, dofs)
        said = verdicts(kind, dofs, reports)
        known = next((np.array(one["compliance"]) for one in reports.values() if "compliance" in one), None)
        for solver, report in reports.items():
            yield (kind, *_row(solver, report, known, rates), said.get(solver, ""))


def _row(solver: str, report: dict[str, Any], known: Array | None, rates: tuple[float, float]) -> Row:
    if "refused" in report:
        return (f"{report['dofs']}", solver, str(report["refused"])[:60], "", "", "", "")
    found = np.array(report["compliance"])
    errors = f"{off(found, known):.0e}, not refined" if known is not None else "-"
    if "error" in report:
        errors = f"{report['first_error']:.0e}, {report['error']:.0e}"
    work = f"{report['flops'] / 1e9:.0f}, {report['flops'] / rates[0]:.1f}" if "flops" in report else ""
    return (
        f"{report['dofs']}",
        solver,
        f"{report['plain']:.1f}",
        f"{report['refined']:.1f}" if "refined" in report else "-",
        errors,
        f"{report['peak'] / 1e9:.2f}",
        work,
    )


def verdicts(kind: str, dofs: float, reports: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Return what was asked beside what was reached, by solver: ratios of seconds of the same run.

    Examples
    --------
    >>> verdicts("cube", 1e5, {"condensation": {"plain": 4.0}, "OpenSeesPy, MUMPS": {"plain": 10.0}})
    {'condensation': '0.40 of OpenSeesPy, MUMPS; asked 0.5: reached'}
    """
    seconds = {solver: report["plain"] for solver, report in reports.items() if "plain" in report}

    def beside(solver: str, others: list[str], asked: float) -> dict[str, str]:
        there = [other for other in others if other in seconds]
        if solver not in seconds or not there:
            return {}
        best = min(there, key=lambda other: float(seconds[other]))
        share = seconds[solver] / seconds[best]
        return {solver: f"{share:.2f} of {best}; asked {asked:g}: {_reached(share <= asked)}"}

    if kind == "slender":
        said = beside(DEFAULT, ["splu", "pardiso", OPENSEES], 1.5)
        if dofs >= 1e6 and said:
            ours = reports[DEFAULT]
            memory, error = ours["peak"] / 1e9, ours["error"]
            said[DEFAULT] += f"; {memory:.1f} GB, asked 6: {_reached(memory <= 6)}"
            said[DEFAULT] += f"; error {error:.0e}, asked 1e-09: {_reached(error <= 1e-9)}"
        return said
    others, asked = ([OPENSEES], 0.5) if dofs <= 1e5 else (["multigrid"], 1.0)
    return beside(DEFAULT, others, asked) | beside("condensation", others, asked)


def _reached(reached: bool) -> str:
    return "reached" if reached else "MISSED"


def _by_opensees(peers: str, kind: str, dofs: float) -> dict[str, Any]:
    frame = FRAMES[kind](dofs)
    # local z of ours: across the beam and `up`
    axis = frame.points[frame.beams[:, 1]] - frame.points[frame.beams[:, 0]]
    across = np.round(np.cross(axis, frame.up) / np.linalg.norm(axis, axis=1)[:, None])
    work = {
        "points": frame.points[None],
        "beams": frame.beams,
        "properties": np.stack([frame.properties[name] for name in ("E", "G", "A", "J", "Iy", "Iz")], axis=1),
        "across": across[None],
        "fixed": np.flatnonzero(frame.fixed),
        "tcp": np.array(tip(frame)),
    }
    report: dict[str, Any] = {"dofs": int(frame.unknowns.max()) + 1}
    try:
        found = ask(peers, "opensees_lattice", work)
    except subprocess.CalledProcessError as failed:
        return report | {"refused": f"ended with {failed.returncode}"}
    return report | {"compliance": found.compliance[0], "plain": found.seconds, "peak": found.peak}


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], float(sys.argv[2]), sys.argv[3])))
