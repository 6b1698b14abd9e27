"""Solve one lattice and print as JSON what it took: `python -m benchmarks.large_frame KIND DOFS SOLVER`.

KIND is slender or cube, SOLVER one of `beamstiff.fem.large.solvers` or `condensation`. In a process of its
own, so that the peak memory is that of this work; six unit wrenches at the tip, all displacements.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.large.frame import frame_stiffness
from beamstiff.fem.large.multifrontal import factorise
from beamstiff.fem.large.solvers import SOLVERS, frame_plan, solve_frame
from benchmarks.lattice import cube, slender, tip


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


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], float(sys.argv[2]), sys.argv[3])))
