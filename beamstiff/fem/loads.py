"""Dead loads: the weight of beams, masses and payload as consistent nodal wrenches."""

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam_element import uniform_load
from beamstiff.fem.placed_structure import Geometry
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.se3 import Array


def gravity_wrenches(structure: Structure, geometry: Geometry) -> Array:
    """Return the wrench of the dead weight on every node, (P, N, 6), base frame, N and N m.

    Beams carry ``rho A g`` a metre (seed 003: equivalent nodal loads); a mass off its node adds ``at x m g``.
    """
    result = mass_wrenches(structure, geometry)
    local = beam_weight(structure, geometry)
    triples = local.reshape(*local.shape[:2], 4, 3)  # forces and moments of both ends
    beams = (triples @ geometry.beam_rotation.swapaxes(-1, -2)).reshape(local.shape)
    for end in (0, 1):
        nodes = structure.elements[: len(structure.robot.beams), end]
        np.add.at(result.swapaxes(0, 1), nodes, beams[:, :, end].swapaxes(0, 1))
    return result


def mass_wrenches(structure: Structure, geometry: Geometry) -> Array:
    """Return the wrench of what masses weigh on every node, (P, N, 6), base frame, N and N m."""
    robot, positions = structure.robot, geometry.posture.node_positions
    gravity = np.array(robot.gravity)
    result = np.zeros((positions.shape[0], len(robot.nodes), 6))
    index = structure.kinematics.node_index
    turning = turning_nodes(robot)
    for mass in robot.masses:
        if mass.node not in turning and any(mass.at):
            raise BeamstiffError(
                f"the mass on node {mass.node!r} is off it, but struts alone hold that: it has no rotation"
            )
        node = index[mass.node]
        arm = geometry.node_rotation[:, node] @ np.array(mass.at)
        weight = mass.mass * gravity
        result[:, node, :3] += weight
        result[:, node, 3:] += np.cross(arm, weight)
    return result


def line_load(structure: Structure, geometry: Geometry) -> Array:
    """Return the weight of the beams a metre, (P, B, 3), local axes, N/m."""
    per_metre = structure.beam_density * np.nan_to_num(structure.beam_properties["A"], posinf=0.0)
    load = per_metre[:, None] * np.array(structure.robot.gravity)
    return np.asarray(np.einsum("pbji,bj->pbi", geometry.beam_rotation, load))


def beam_weight(structure: Structure, geometry: Geometry) -> Array:
    """Return the consistent nodal wrenches of the beams' own weight, (P, B, 2, 6), local axes."""
    load = line_load(structure, geometry)
    return uniform_load(load, geometry.beam_length).reshape(*load.shape[:2], 2, 6)


def total_mass(structure: Structure, geometry: Geometry) -> Array:
    """Return the mass of beams and masses at every pose, (P,), kg."""
    per_metre = structure.beam_density * structure.beam_properties["A"]
    beams: Array = geometry.beam_length @ per_metre
    return beams + sum(mass.mass for mass in structure.robot.masses)
