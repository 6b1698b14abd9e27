"""What a robot file means, as plain data: its parts, how they hang together, and numbers that follow."""

from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.assembly import dense_stiffness
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.constraints import constraint_rows, has_constraints, null_space
from beamstiff.fem.loads import total_mass
from beamstiff.fem.mechanism import scaled_condition
from beamstiff.fem.placed_structure import Geometry, place
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.robot.closure import close_loops, every_assembly
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import stiffness_text
from beamstiff.robot.frames import all_values
from beamstiff.robot.graph import structural_loops, structure_graph, support_tree
from beamstiff.robot.kinematics import Kinematics, Posture, forward, posture_at, sampled_postures
from beamstiff.robot.parts import STIFFNESS_KINDS, Variable
from beamstiff.se3 import Array

MOST_UNKNOWNS = 3000  # the condition is found from a dense matrix


def describe(robot: Robot, samples: int = 1000, seed: int = 0) -> dict[str, Any]:
    """Return what a robot file means as plain data, SI, base frame.

    `samples`: postures drawn for the reach, evenly within the limits of the actuated variables. `seed`: of
    the samples.

    >>> from beamstiff.robot.reader import load_robot
    >>> facts = describe(load_robot("cantilever"))
    >>> facts["unknowns"], facts["reach"]["upper"]
    (6, [1.0, 0.0, 0.0])
    """
    structure = compile_structure(robot)
    kinematics = structure.kinematics
    q = sampled_postures(robot, samples, seed)
    closure = close_loops(kinematics, q, strict=False)
    if not closure.closed.any():
        raise BeamstiffError(
            f"robot {robot.name!r}: none of {len(q)} postures closes the loops: {closure.reasons[0]}"
        )
    first = int(np.argmax(closure.closed))
    reference = posture_at(kinematics, closure.values[first : first + 1])
    tcp_compliance(structure, reference)  # a mechanism is named here
    geometry = place(structure, reference)
    values = dict(zip(kinematics.coupling.names, reference.values[0].tolist(), strict=True))
    return {
        "name": robot.name,
        "gravity": list(robot.gravity),
        "variables": [_variable(robot, item, values[item.name]) for item in robot.variables],
        "frames": _frames(kinematics, reference),
        "loops": [_told(item, "name", "a", "b", "constrain") for item in robot.loops],
        "assemblies": _assemblies(kinematics),
        "nodes": _nodes(robot, reference),
        "beams": [
            _told(item, "name", "nodes") | {"length": length, "section": item.section}
            for item, length in zip(robot.beams, geometry.beam_length[0].tolist(), strict=True)
        ],
        "rigids": [_told(item, "name", "nodes") for item in robot.rigids],
        "joints": [
            _told(item, "name", "nodes", "variable")
            | {"stiffness": {k: stiffness_text(getattr(item.stiffness, k)) for k in STIFFNESS_KINDS}}
            for item in robot.joints
        ],
        "struts": [
            _told(item, "name", "nodes")
            | {"stiffness": stiffness_text(item.stiffness)}
            | (_told(item, "EA", "fixed_length") if item.EA else {})
            for item in robot.struts
        ],
        "structural_loops": structural_loops(structure_graph(robot), robot.fixed),
        "tcp": {"node": robot.tcp, "position": _tcp(kinematics, reference.transforms)[0].tolist()},
        "identify": list(robot.identify),
        "mass": float(total_mass(structure, geometry)[0]),
        # their material has no density
        "weightless": [item.name for item in robot.beams if not robot.materials[item.material].density],
        "unknowns": structure.unknowns.count,
        "condition": _condition(structure, geometry),
        "reach": {**_reach(kinematics, closure.values[closure.closed]), "samples": len(q), "seed": seed},
    }


def _told(item: object, *names: str) -> dict[str, Any]:
    """Return what a part says under some names."""
    values = ((name, getattr(item, name)) for name in names)
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values}


def _assemblies(kinematics: Kinematics) -> list[dict[str, Any]]:
    """Return the ways to put the loops together, each where it comes nearest to the guesses."""
    found, names = every_assembly(kinematics), kinematics.coupling.free
    if not found:
        return []
    free = np.array([one.free for one in found])
    points = _tcp(kinematics, forward(kinematics, all_values(kinematics, free)))
    actuated, taken = kinematics.coupling.actuated, kinematics.closest[0].name
    return [
        {
            "name": one.name,
            "taken": one.name == taken,
            "q": dict(zip(names[:actuated], one.free[:actuated].tolist(), strict=True)),
            "passive": dict(zip(names[actuated:], one.free[actuated:].tolist(), strict=True)),
            "tcp": point.tolist(),
        }
        for one, point in zip(found, points, strict=True)
    ]


def _tcp(kinematics: Kinematics, transforms: Array) -> Array:
    """Return the position of the TCP, (P, 3); other nodes, of which there may be many, are not placed."""
    at = kinematics.node_index[kinematics.robot.tcp]
    frames = transforms[:, kinematics.node_frame[at]]
    return np.asarray(frames[:, :3, :3] @ kinematics.node_at[at] + frames[:, :3, 3])


def _reach(kinematics: Kinematics, values: Array) -> dict[str, Any]:
    points = _tcp(kinematics, forward(kinematics, values))
    return {
        "lower": points.min(axis=0).tolist(),
        "upper": points.max(axis=0).tolist(),
        "farthest": float(np.linalg.norm(points, axis=1).max()),
        "closing": len(points),
    }


def _condition(structure: Structure, geometry: Geometry) -> float | None:
    """Return the condition number of the reduced stiffness scaled to unit diagonal; None for large ones."""
    unknowns = structure.unknowns
    if not 0 < unknowns.count <= MOST_UNKNOWNS:
        return None
    stiffness = dense_stiffness(structure, geometry)
    if has_constraints(structure):
        size = max(float(np.ptp(geometry.posture.node_positions[0], axis=0).max()), 1e-3)
        units = np.array([size if direction < 3 else 1.0 for _, direction in unknowns.labels])
        basis = null_space(constraint_rows(structure, geometry), units, f"robot {structure.robot.name!r}")
        stiffness = basis.swapaxes(-1, -2) @ stiffness @ basis
    return float(scaled_condition(stiffness)[0]) if stiffness.size else None


def _variable(robot: Robot, variable: Variable, value: float) -> dict[str, Any]:
    turning = variable_kinds(robot)[variable.name] == "angle"
    return {
        "name": variable.name,
        "type": "revolute" if turning else "prismatic",
        "role": "actuated" if variable.actuated else "passive" if variable.passive else "coupled",
        "equals": variable.equals,
        "limits": None if variable.limits is None else list(variable.limits),
        "reference": value,
    }


def _frames(kinematics: Kinematics, reference: Posture) -> list[dict[str, Any]]:
    frames = kinematics.robot.frames
    placed = [reference.transforms[0, kinematics.frame_index[frame.name]] for frame in frames]
    return [
        _told(frame, "name", "parent") | {"position": at[:3, 3].tolist(), "rotation": at[:3, :3].tolist()}
        for frame, at in zip(frames, placed, strict=True)
    ]


def _nodes(robot: Robot, reference: Posture) -> list[dict[str, Any]]:
    """Return every node with the one it hangs on, on the shortest way to a fixed node, and through what."""
    graph = structure_graph(robot)
    tree = support_tree(graph, robot.fixed)
    rows = []
    for node, position in zip(robot.nodes, reference.node_positions[0].tolist(), strict=True):
        above = next(iter(tree.predecessors(node.name)), None)
        rows.append(
            {
                "name": node.name,
                "frame": node.frame,
                "position": position,
                "fixed": node.name in robot.fixed,
                "hangs_on": above,
                "through": [] if above is None else sorted(graph[above][node.name]),
            }
        )
    return rows
