"""The answer of the whole structure to loads: nodal displacements, member forces, strain energy."""

from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.fem.assembly import assemble, element_forces, gather, scatter
from beamstiff.fem.constraints import constraint_rows, has_constraints, null_space, ranks, unknown_sizes
from beamstiff.fem.large.robot import MANY_UNKNOWNS, solve_sparse
from beamstiff.fem.loads import beam_weight, gravity_wrenches
from beamstiff.fem.mechanism import solve_firm
from beamstiff.fem.orthogonal_factor import factored_at, strain_forces
from beamstiff.fem.placed_structure import Geometry, place
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_unknowns, turning_nodes
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.se3 import Array, rotate_screw


@dataclass(frozen=True)
class Response:
    """How a structure deforms under loads at P poses."""

    structure: Structure
    geometry: Geometry
    displacement: Array  # (P, N, 6): ``[d, r]`` of every node, base frame, m and rad
    element_forces: Array  # (P, E, 2, 6): wrench on either end of every element, base frame, N and N m
    beam_forces: Array  # (P, B, 2, 6): wrench on either end of every beam in its local axes, N and N m
    joint_displacement: Array  # (P, J, 6): second node against first in the joint's frame
    # (P, E): strain energy of the structure's elements (beams, loop-closing joints, struts), J
    element_energy: Array
    spring_energy: Array  # (P, S): strain energy of the springs of the joints on the tree, J

    def energy_shares(self) -> dict[str, Array]:
        """Return the share of every component in the strain energy, (P,) each; joints by direction kind."""
        structure, robot = self.structure, self.structure.robot
        energy: dict[str, Array] = {}
        beams, chords = len(robot.beams), len(structure.chords)
        for at, beam in enumerate(robot.beams):
            energy[beam.name] = self.element_energy[:, at]
        for at, spring in enumerate(structure.springs):
            name, direction = structure.unknowns.labels[spring]
            key = f"{name}.{JOINT_DIRECTIONS[direction]}"
            energy[key] = energy.get(key, 0.0) + self.spring_energy[:, at]
        squares = self.joint_displacement[:, structure.chords] ** 2
        for at, chord in enumerate(structure.chords):
            for direction in np.flatnonzero(structure.chord_values[at]):
                key = f"{robot.joints[chord].name}.{JOINT_DIRECTIONS[direction]}"
                part = 0.5 * structure.chord_values[at, direction] * squares[:, at, direction]
                energy[key] = energy.get(key, 0.0) + part
        for at, strut in enumerate(structure.struts):
            energy[robot.struts[strut].name] = self.element_energy[:, beams + chords + at]
        total = np.sum(list(energy.values()), axis=0)
        return {name: value / np.where(total > 0.0, total, 1.0) for name, value in energy.items()}


def nodal_loads(structure: Structure, poses: int, wrenches: dict[str, Array]) -> Array:
    """Return nodal wrenches (P, N, 6) from wrenches by node name, (6,) or (P, 6), base frame."""
    index = structure.kinematics.node_index
    loads = np.zeros((poses, len(structure.robot.nodes), 6))
    for name, wrench in wrenches.items():
        if name not in index:
            raise BeamstiffError(f"robot {structure.robot.name!r} has no node {name!r}{suggest(name, index)}")
        loads[:, index[name]] += wrench
    return loads


def respond(structure: Structure, posture: Posture, loads: Array, gravity: bool = False) -> Response:
    """Return the response to wrenches (P, N, 6) on the nodes, base frame, and to the dead weight."""
    geometry = place(structure, posture)
    check_moments(structure, loads)
    total = loads + gravity_wrenches(structure, geometry) if gravity else loads
    unknowns, forces, energy = solve_elements(structure, geometry, scatter(structure, geometry, total))
    displacement = gather(structure, geometry, unknowns)
    return Response(
        structure,
        geometry,
        displacement,
        forces,
        beam_forces(structure, geometry, forces, gravity),
        _joint_displacement(structure, geometry, displacement, unknowns),
        energy,
        0.5 * structure.spring_values * unknowns[:, structure.springs] ** 2,
    )


def _joint_displacement(
    structure: Structure, geometry: Geometry, displacement: Array, unknowns: Array
) -> Array:
    """Return the relative displacement of all joints in their frames, (P, J, 6)."""
    a, b = structure.joint_nodes.T
    relative = displacement[:, b] - displacement[:, a]
    local: Array = (rotate_screw(geometry.joint_rotation).swapaxes(-1, -2) @ relative[..., None])[..., 0]
    # on the tree it is among the unknowns: the difference of two large displacements would lose digits
    local[:, structure.unknowns.tree_joints] = 0.0
    for (joint, direction), number in joint_unknowns(structure.unknowns).items():
        local[:, joint, direction] = unknowns[:, number]
    return local


def solve_elements(structure: Structure, geometry: Geometry, force: Array) -> tuple[Array, Array, Array]:
    """Return the unknowns (P, n), the wrenches on the elements' ends (P, E, 2, 6) and their energy (P, E)."""
    column, strains = force[..., None], dict[int, Array]()
    if structure.unknowns.count > MANY_UNKNOWNS and not has_constraints(structure):
        unknowns = solve_sparse(structure, geometry, column)[..., 0]
    else:
        solved, strains = solve_constrained(structure, geometry, column)
        unknowns = solved[..., 0]
    forces, energy = element_forces(structure, geometry, gather(structure, geometry, unknowns))
    for pose, some in strains.items():  # differences of displacements would be rounding
        one = geometry.only(np.array([pose]))
        forces[pose], energy[pose] = strain_forces(structure, one, some[:, 0])
    return unknowns, forces, energy


def solve_constrained(
    structure: Structure, geometry: Geometry, force: Array, by_load: Array | None = None, works: bool = False
) -> tuple[Array, dict[int, Array]]:
    """Return the unknowns (P, n, c) of ``K z = force`` under the constraints of rigid loops.

    And, of the poses at which rounding could show, the strains (m, c) of `orthogonal_factor`, by which these
    go.
    `by_load` (P, n, n) is what loads add to the stiffness, not symmetric where moments act; `works` says that
    the forces are those of a compliance, of which the works on one another are asked.
    """
    stiffness, size = assemble(structure, geometry)
    if by_load is not None:
        stiffness = stiffness + by_load
    groups, basis = [np.arange(len(force))], None
    if has_constraints(structure):
        rows, units = constraint_rows(structure, geometry), unknown_sizes(structure)
        rank = ranks(rows, units)
        # singular positions of a loop move in more ways: each number of ways by itself, all are exact
        groups = [np.flatnonzero(rank == value) for value in np.unique(rank)]
    result, strains = np.zeros_like(force), {}
    for some in groups:
        some_stiffness, some_force, some_size = stiffness[some], force[some], size[some]
        if has_constraints(structure):
            basis = null_space(rows[some], units, f"robot {structure.robot.name!r}")
            back = basis.swapaxes(-1, -2)
            some_stiffness, some_force = back @ some_stiffness @ basis, back @ some_force
            some_size = (some_size[:, None] @ basis**2)[:, 0]
        solved, firm = solve_firm(some_stiffness, some_force, some_size, symmetric=by_load is None)
        result[some] = solved if basis is None else basis @ solved
        for at in np.flatnonzero(~firm):
            pose = int(some[at])
            rest = np.diag(unknown_sizes(structure)) if basis is None else basis[at]
            added = None if by_load is None else by_load[pose]
            found = factored_at(structure, geometry, pose, rest, force[pose], by_load=added, works=works)
            result[pose], strains[pose] = found.solution, found.strains
    return result, strains


def check_moments(structure: Structure, loads: Array) -> None:
    """Refuse moments on nodes that only struts hold: they have no rotation."""
    turning = turning_nodes(structure.robot)
    for at, node in enumerate(structure.robot.nodes):
        if node.name not in turning and (loads[:, at, 3:] != 0.0).any():
            raise BeamstiffError(
                f"a moment acts on node {node.name!r}, which struts alone hold: it has no rotation"
            )


def beam_forces(structure: Structure, geometry: Geometry, forces: Array, gravity: bool) -> Array:
    """Return the end wrenches of the beams in local axes, (P, B, 2, 6), less the loads of their own weight.

    For the wrenches on the ends of all elements, base frame.
    """
    turn = rotate_screw(geometry.beam_rotation).swapaxes(-1, -2)[:, :, None]
    local: Array = (turn @ forces[:, : len(structure.robot.beams), :, :, None])[..., 0]
    return local - beam_weight(structure, geometry) if gravity else local
