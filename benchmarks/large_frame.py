"""Solve one lattice and print as JSON what it took: `python -m benchmarks.large_frame KIND DOFS SOLVER`.

KIND is slender or cube, SOLVER one of `beamstiff.fem.large.solvers` or `condensation`. In a process of its
own, so that the peak memory is that of this work; six unit wrenches at the tip, all displacements.
"""

from __future__ import annotations

import importlib.util
import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.large.frame import frame_stiffness
from beamstiff.fem.large.multifrontal import factorise
from beamstiff.fem.large.solvers import SOLVERS, frame_plan, solve_frame
from benchmarks.lattice import cube, slender, tip
from benchmarks.peers import ask, off

Row = tuple[str, ...]
ASKED = {  # seconds of others are those of issue 6, measured on a machine like this one
    ("slender", 1e5): "best peer 3.0 s (CHOLMOD); 1.5 times that",
    ("slender", 3e5): "best peer 10.7 s (MUMPS); 1.5 times that",
    ("slender", 1e6): "best peer 34 s (PARDISO); 1.5 times that, below 6 GB, 1e-9",
    ("cube", 1e5): "half of OpenSeesPy's time",
    ("cube", 3e5): "68 s (multigrid) or less",
}


def run(kind: str, dofs: float, solver: str) -> dict[str, object]:
    """Return seconds without and with refinement, errors, peak memory and the compliance at the tip."""
    frame = {"slender": slender, "cube": cube}[kind](dofs)
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
            stiffness = frame_stiffness(frame)
            SOLVERS[solver](frame, stiffness)(loads.reshape(-1, 6)[frame.unknowns.reshape(-1) >= 0])
            report["plain"] = time.process_time() - start
            start = time.process_time()
            found = solve_frame(frame, loads, solver)
            report["refined"] = time.process_time() - start
            report |= {"error": found.quality.error, "first_error": found.quality.first_error}
            report["refinements"] = found.quality.refinements
            compliance = found.displacement[node]
        report["compliance"] = np.asarray(compliance).tolist()
    except (BeamstiffError, MemoryError) as refused:
        report["refused"] = str(refused)
    report["peak"] = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return report


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
        "asked",
    )
    sizes = [("slender", 1e5), ("cube", 1e5)]
    sizes += [("slender", 3e5), ("cube", 3e5), ("slender", 1e6)] if large else []
    for kind, dofs in sizes:
        ways = ["multifrontal", "condensation", "splu" if kind == "slender" else "multigrid"]
        ways += ["pardiso"] * (importlib.util.find_spec("pypardiso") is not None)
        expected = None
        for solver in ways:
            report = in_a_process(kind, dofs, solver)
            if "refused" in report:
                yield (kind, f"{report['dofs']}", solver, str(report["refused"])[:60], "", "", "", "", "")
                continue
            found = np.array(report["compliance"])
            expected = found if expected is None else expected
            errors = (
                f"{report['first_error']:.0e}, {report['error']:.0e}"
                if "error" in report
                else f"{off(found, expected):.0e}, not refined"
                if found is not expected
                else "-"
            )
            work = (
                f"{report['flops'] / 1e9:.0f}, {report['flops'] / rates[0]:.2f}" if "flops" in report else ""
            )
            yield (
                kind,
                f"{report['dofs']}",
                solver,
                f"{report['plain']:.1f}",
                f"{report['refined']:.1f}" if "refined" in report else "-",
                errors,
                f"{report['peak'] / 1e9:.2f}",
                work,
                ASKED[kind, dofs] if solver == ways[0] else "",
            )
    if peers:
        yield _peer_lattice(peers)


def _peer_lattice(peers: str) -> Row:
    frame = cube(1e5)
    up = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    along_z = np.abs(frame.points[frame.beams[:, 1]] - frame.points[frame.beams[:, 0]])[:, 2] > 0
    # local z of ours: across the beam and `up`
    axis = frame.points[frame.beams[:, 1]] - frame.points[frame.beams[:, 0]]
    work = {
        "points": frame.points[None],
        "beams": frame.beams,
        "properties": np.stack([frame.properties[name] for name in ("E", "G", "A", "J", "Iy", "Iz")], axis=1),
        "across": np.round(np.cross(axis, up[along_z.astype(int)]) / np.linalg.norm(axis, axis=1)[:, None])[
            None
        ],
        "fixed": np.flatnonzero(frame.fixed),
        "tcp": np.array(tip(frame)),
    }
    found, seconds = ask(peers, "opensees_lattice", work)
    ours = in_a_process("cube", 1e5, "condensation")
    share = ours["plain"] / seconds
    reached = "reached" if share <= 0.5 else "MISSED"
    dofs = f"{int(frame.unknowns.max()) + 1}"
    return (
        "cube",
        dofs,
        "OpenSeesPy with MUMPS",
        f"{seconds:.1f}",
        "-",
        f"{off(found[0], np.array(ours['compliance'])):.0e}",
        "",
        "",
        f"condensation takes {share:.2f} of it; asked 0.5: {reached}",
    )


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], float(sys.argv[2]), sys.argv[3])))
