"""Run a finite element program of others on work stated in a file: what came out, and how long it took.

Run by `benchmarks.speed` with the Python that has the peers: `python peers_run.py PEER WORK.npz RESULT.npz`.
It needs nothing of beamstiff. OpenSeesPy is for non-commercial use; neither is a dependency.
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np


def opensees_poses(work):
    """Return the compliance at the TCP of each pose: beams, springs between coincident nodes, six loads."""
    import openseespy.opensees as ops

    result = np.zeros((len(work["points"]), 6, 6))
    start = time.process_time()
    for pose, points in enumerate(work["points"]):
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        for node, at in enumerate(points.tolist()):
            ops.node(node, *at)
        for node in work["fixed"].tolist():
            ops.fix(node, 1, 1, 1, 1, 1, 1)
        for beam, ((i, j), p, across) in enumerate(
            zip(
                work["beams"].tolist(),
                work["properties"].tolist(),
                work["across"][pose].tolist(),
                strict=True,
            )
        ):
            ops.geomTransf("Linear", beam, *across)
            E, G, A, J, Iy, Iz = p
            ops.element("elasticBeamColumn", beam, i, j, A, E, G, J, Iy, Iz, beam)
        material, element = 0, len(work["beams"])
        for joint, (i, j) in enumerate(work["joints"].tolist()):
            stiffness, axes = work["stiffness"][joint].tolist(), work["axes"][pose, joint].tolist()
            kept = [at for at in range(6) if stiffness[at] > 0]
            for at in kept:
                ops.uniaxialMaterial("Elastic", material + at, stiffness[at])
            ops.element(
                "zeroLength", element, i, j, "-mat", *[material + at for at in kept],
                "-dir", *[at + 1 for at in kept], "-orient", *axes[0], *axes[1],
            )  # fmt: skip
            material, element = material + 6, element + 1
        ops.system("BandSPD")
        ops.numberer("RCM")
        ops.constraints("Plain")
        ops.algorithm("Linear")
        ops.integrator("LoadControl", 1.0)
        ops.analysis("Static")
        tcp = int(work["tcp"])
        for load in range(6):
            ops.timeSeries("Constant", load)
            ops.pattern("Plain", load, load)
            ops.load(tcp, *np.eye(6)[load].tolist())
            ops.analyze(1)
            result[pose, :, load] = ops.nodeDisp(tcp)
            ops.remove("loadPattern", load)
    return result, time.process_time() - start


def _pynite_model(points, beams, properties, fixed):
    from Pynite import FEModel3D

    model = FEModel3D()
    for node, at in enumerate(points.tolist()):
        model.add_node(str(node), *at)
    for beam, ((i, j), (E, G, A, J, Iy, Iz)) in enumerate(
        zip(beams.tolist(), properties.tolist(), strict=True)
    ):
        model.add_material(f"m{beam}", E, G, 0.3, 1.0)
        model.add_section(f"s{beam}", A, Iy, Iz, J)
        model.add_member(f"b{beam}", str(i), str(j), f"m{beam}", f"s{beam}")
    for node in fixed.tolist():
        model.def_support(str(node), *[True] * 6)
    return model


def pynite_poses(work):
    """Return the compliance at the TCP of each pose of a frame whose joints are welded."""
    result = np.zeros((len(work["points"]), 6, 6))
    start = time.process_time()
    tcp = str(int(work["tcp"]))
    names = ("FX", "FY", "FZ", "MX", "MY", "MZ")
    for pose, points in enumerate(work["points"]):
        model = _pynite_model(points, work["beams"], work["properties"], work["fixed"])
        for name in names:
            model.add_node_load(tcp, name, 1.0, case=name)
            model.add_load_combo(name, {name: 1.0})
        model.analyze_linear()
        node = model.nodes[tcp]
        for load, name in enumerate(names):
            parts = (node.DX, node.DY, node.DZ, node.RX, node.RY, node.RZ)
            result[pose, :, load] = [part[name] for part in parts]
    return result, time.process_time() - start


def opensees_lattice(work):
    """Return the compliance at one node of a lattice, by MUMPS: assembly, factor and six right sides."""
    import openseespy.opensees as ops

    start = time.process_time()
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for node, at in enumerate(work["points"][0].tolist()):
        ops.node(node, *at)
    for node in work["fixed"].tolist():
        ops.fix(node, 1, 1, 1, 1, 1, 1)
    across = {}
    for vector in work["across"][0].tolist():
        if tuple(vector) not in across:
            across[tuple(vector)] = len(across)
            ops.geomTransf("Linear", across[tuple(vector)], *vector)
    for beam, ((i, j), p, vector) in enumerate(
        zip(work["beams"].tolist(), work["properties"].tolist(), work["across"][0].tolist(), strict=True)
    ):
        E, G, A, J, Iy, Iz = p
        ops.element("elasticBeamColumn", beam, i, j, A, E, G, J, Iy, Iz, across[tuple(vector)])
    ops.system("Mumps")
    ops.numberer("Plain")
    ops.constraints("Plain")
    ops.algorithm("Linear", "-factorOnce")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    tcp = int(work["tcp"])
    result = np.zeros((1, 6, 6))
    for load in range(6):
        ops.timeSeries("Constant", load)
        ops.pattern("Plain", load, load)
        ops.load(tcp, *np.eye(6)[load].tolist())
        ops.analyze(1)
        result[0, :, load] = ops.nodeDisp(tcp)
        ops.remove("loadPattern", load)
    return result, time.process_time() - start


if __name__ == "__main__":
    peer, source, target = sys.argv[1:]
    with np.load(source) as stored:
        found, seconds = globals()[peer](dict(stored))
    peak = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    np.savez(target, compliance=found, seconds=seconds, peak=peak)
