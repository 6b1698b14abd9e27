"""Frames for the tests, written as lists of points and pairs of them, and short ways to their answers."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from beamstiff import Beam, Joint, Mass, Material, Node, Rigid, Robot, Section, Strut
from beamstiff.fem.large.frame import Frame
from beamstiff.fem.static_response import Response, nodal_loads, respond
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.robot.kinematics import Posture, posture
from benchmarks import lattice
from benchmarks.lattice import ROD, tip

Array = NDArray[np.float64]

STEEL = Material(E=210e9, G=80e9, density=7850.0)
# unlike in both directions, so that a swap of y and z shows
SECTION = Section(A=2.1e-3, Iy=3.4e-6, Iz=1.9e-6, J=2.7e-6)
SHEAR_SECTION = Section(A=2.1e-3, Iy=3.4e-6, Iz=1.9e-6, J=2.7e-6, Ay=1.3e-3, Az=0.9e-3)
LOADS = ("fx", "fy", "fz", "mx", "my", "mz")

RIGID, FREE = math.inf, 0.0


def frame(
    points: Sequence[Sequence[float]] | Array,
    *,
    fixed: Sequence[int] = (0,),
    tcp: int = -1,
    beams: Sequence[tuple[int, int]] = (),
    rigids: Sequence[tuple[int, int]] = (),
    joints: Sequence[tuple[int, int, Sequence[float], Sequence[float]]] = (),
    struts: Sequence[tuple[int, int, float]] = (),
    masses: Sequence[tuple[int, float, Sequence[float]]] = (),
    section: Section | Sequence[Section] = SECTION,
    material: Material | Sequence[Material] = STEEL,
    up: Sequence[Any] = (0.2, 0.3, 0.9),
    gravity: Sequence[float] = (0.0, 0.0, -9.81),
) -> Robot:
    """Return a frame at rest in the base frame; node k is called ``nk``, beam k ``bk`` and so on.

    A joint is (node, node, axis, (axial, radial, torsional, tilting)), a strut (node, node, stiffness), a
    mass (node, kg, offset). `section`, `material` and `up` hold for all beams, or list one a beam.
    """
    count = len(beams)
    sections = [section] * count if isinstance(section, Section) else list(section)
    materials = [material] * count if isinstance(material, Material) else list(material)
    ups = list(up) if len(up) and isinstance(up[0], Sequence | np.ndarray) else [up] * count
    names = [f"n{at}" for at in range(len(points))]

    def ends(pair: Sequence[Any]) -> tuple[str, str]:
        return names[pair[0]], names[pair[1]]

    return Robot(
        name="frame",
        gravity=tuple(gravity),
        materials={f"m{at}": item for at, item in enumerate(materials)},
        sections={f"s{at}": item for at, item in enumerate(sections)},
        nodes=[Node(name=name, at=tuple(map(float, at))) for name, at in zip(names, points, strict=True)],
        beams=[
            Beam(name=f"b{at}", nodes=ends(pair), section=f"s{at}", material=f"m{at}", up=tuple(ups[at]))
            for at, pair in enumerate(beams)
        ],
        rigids=[Rigid(name=f"r{at}", nodes=ends(pair)) for at, pair in enumerate(rigids)],
        joints=[
            Joint(
                name=f"j{at}",
                nodes=ends(item),
                frame="base",
                axis=tuple(item[2]),
                stiffness=stiffness(*item[3]),
            )
            for at, item in enumerate(joints)
        ],
        struts=[
            Strut(name=f"t{at}", nodes=ends(item), stiffness=stiffness_value(item[2]))
            for at, item in enumerate(struts)
        ],
        masses=[Mass(node=names[at], mass=mass, at=tuple(offset)) for at, mass, offset in masses],
        fixed=[names[at] for at in fixed],
        tcp=names[tcp],
    )


def robot_of(made: Frame) -> Robot:
    """Return a frame of the benchmarks' lattices as a robot, with its tip for the TCP."""
    return frame(
        made.points,
        beams=[tuple(pair) for pair in made.beams.tolist()],
        fixed=np.flatnonzero(made.fixed).tolist(),
        tcp=tip(made),
        up=[tuple(up) for up in made.up.tolist()],
        section=Section(**{name: ROD[name] for name in ("A", "Iy", "Iz", "J")}),
        material=Material(density=7850.0, **lattice.STEEL),
    )


def stiffness_value(value: float) -> Any:
    """Return a stiffness as a description takes it: inf is rigid, 0 is free."""
    return "rigid" if value == RIGID else "free" if value == FREE else float(value)


def stiffness(*values: float) -> dict[str, Any]:
    """Return the stiffness of a joint from (axial, radial, torsional, tilting)."""
    kinds = ("axial", "radial", "torsional", "tilting")
    return {kind: stiffness_value(value) for kind, value in zip(kinds, values, strict=True)}


def at_rest(structure: Structure) -> Posture:
    """Return the posture of a frame without variables."""
    return posture(structure.kinematics, np.zeros((1, 0)))


def solve(robot: Robot, loads: Mapping[str, Sequence[float]], gravity: bool = False) -> Response:
    """Return the response of a frame at rest to wrenches by node name."""
    structure = compile_structure(robot)
    wrenches = {name: np.asarray(wrench, dtype=float) for name, wrench in loads.items()}
    return respond(structure, at_rest(structure), nodal_loads(structure, 1, wrenches), gravity)


def displacement(
    robot: Robot, loads: Mapping[str, Sequence[float]], node: str | None = None, gravity: bool = False
) -> Array:
    """Return the displacement (6,) of a node (default the TCP) of a frame at rest."""
    response = solve(robot, loads, gravity)
    return response.displacement[0, response.structure.kinematics.node_index[node or robot.tcp]]


def compliance(robot: Robot) -> Array:
    """Return the TCP's displacement under each of the six unit loads, as columns (6, 6)."""
    structure = compile_structure(robot)
    rest, loads = at_rest(structure).only(np.zeros(6, dtype=np.int64)), {robot.tcp: np.eye(6)}
    moved = respond(structure, rest, nodal_loads(structure, 6, loads)).displacement
    return moved[:, structure.kinematics.node_index[robot.tcp]].T


def turned(robot: Robot, rotation: Array, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> Robot:
    """Return the whole frame turned and shifted in the base frame, its gravity too."""

    def turn(vector: Sequence[float]) -> tuple[float, ...]:
        return tuple(rotation @ np.asarray(vector, dtype=float))

    return robot.model_copy(
        update={
            "gravity": turn(robot.gravity),
            "nodes": tuple(
                node.model_copy(update={"at": tuple(np.add(turn(node.at), shift))}) for node in robot.nodes
            ),
            "beams": tuple(
                beam.model_copy(update={"up": turn(beam.up)}) if beam.up else beam for beam in robot.beams
            ),
            "joints": tuple(joint.model_copy(update={"axis": turn(joint.axis)}) for joint in robot.joints),
            "masses": tuple(mass.model_copy(update={"at": turn(mass.at)}) for mass in robot.masses),
        }
    )


def direct_error(found: Array, expected: Array) -> Array:
    """Return the error of each entry of a compliance (6, 6) by the two direct ones that it couples."""
    direct = np.sqrt(np.diag(expected))
    return np.abs(found - expected) / np.outer(direct, direct)


def screw(rotation: Array) -> Array:
    """Return blockdiag(R, R)."""
    return np.kron(np.eye(2), rotation)


def some_rotation(seed: int) -> Array:
    """Return a rotation drawn at random."""
    return Rotation.random(rng=np.random.default_rng(seed)).as_matrix()


def relative_error(found: Array, expected: Array) -> float:
    """Return the largest error of an array by its largest entry (m and rad: frames of about a metre)."""
    size = np.abs(expected).max(initial=0.0)
    error = float(np.abs(np.asarray(found) - expected).max(initial=0.0))
    return error / size if size > 1e-20 else error
