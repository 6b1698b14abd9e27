"""Many poses at once give what each gives by itself, and the size of the pieces does not show."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import compile_structure, robot_names
from beamstiff.fem.assembly import dense_stiffness
from beamstiff.fem.condensation import Condensed, Port, condense, tcp_compliance
from beamstiff.fem.placed_structure import place
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.model.ports import find_ports
from beamstiff.robot.kinematics import Posture, posture
from beamstiff.robot.reader import load_robot
from tests.fem.builders import at_rest, screw, some_rotation
from tests.fem.random_frames import machine_frame
from tests.fem.test_identities import machine, seeds

TOLERANCE = 1e-13  # other kernels multiply one matrix than many


def one(poses: Posture, at: int) -> Posture:
    return poses.only(slice(at, at + 1))


def same(found: Condensed, expected: Condensed, at: slice = slice(None)) -> bool:
    """Tell whether two condensations are alike but for the last digits."""
    for item in dataclasses.fields(Condensed):
        some, other = getattr(found, item.name), getattr(expected, item.name)[at]
        if np.abs(some - other).max(initial=0.0) > TOLERANCE * max(np.abs(other).max(initial=0.0), 1e-300):
            return False
    return True


def some_poses(name: str, count: int = 7) -> tuple[object, Posture]:
    """Return a shipped robot's structure at random poses near the middle of its limits."""
    structure = compile_structure(load_robot(name))
    rng = np.random.default_rng(3)
    middle = [np.mean(variable.limits or (-0.5, 0.7)) for variable in structure.robot.actuated]
    reach = [0.1 * np.ptp(variable.limits or (-1.0, 1.0)) for variable in structure.robot.actuated]
    q = middle + rng.uniform(-1, 1, (count, len(middle))) * reach
    return structure, posture(structure.kinematics, q)


@pytest.mark.parametrize("name", robot_names())
def test_shipped_robots(name: str) -> None:
    structure, poses = some_poses(name)
    robot = structure.robot
    observed = [robot.tcp, next(node.name for node in robot.nodes if node.name not in robot.fixed)]
    ports, _ = find_ports(robot, robot.identify)
    whole = condense(structure, poses, observed, ports)
    for chunk in (1, 2, 3, 7, 1000):
        assert same(condense(structure, poses, observed, ports, chunk), whole)
    for at in range(7):
        assert same(condense(structure, one(poses, at), observed, ports), whole, slice(at, at + 1))


@given(seed=seeds, count=st.integers(1, 5))
def test_random_machines_lying_in_different_ways(seed: int, count: int) -> None:
    """The same machine turned and shifted differently pose by pose: one call, and each pose its own."""
    structure = compile_structure(machine(seed, 5, 2).robot())
    rest = at_rest(structure)
    turns = np.array([some_rotation(seed + at) for at in range(count)])
    transforms = np.broadcast_to(np.eye(4), (count, 1, 4, 4)).copy()
    transforms[:, 0, :3, :3] = turns
    poses = Posture(np.zeros((count, 0)), transforms, rest.node_positions @ turns.swapaxes(-1, -2))
    rng = np.random.default_rng(seed)
    loads = nodal_loads(structure, count, {structure.robot.tcp: rng.normal(size=(count, 6))})
    together = respond(structure, poses, loads, gravity=True)
    C = tcp_compliance(structure, poses)
    for at in range(count):
        alone = respond(structure, one(poses, at), loads[at : at + 1], gravity=True)
        for name in ("displacement", "beam_forces", "joint_displacement", "element_energy", "spring_energy"):
            found, expected = getattr(together, name)[at], getattr(alone, name)[0]
            assert np.abs(found - expected).max(initial=0) <= TOLERANCE * np.abs(expected).max(initial=1e-20)
        expected = tcp_compliance(structure, one(poses, at))[0]
        assert np.abs(C[at] - expected).max() <= TOLERANCE * max(np.abs(expected).max(), 1e-20)
        still = screw(turns[at]) @ tcp_compliance(structure, rest)[0] @ screw(turns[at]).T
        assert np.abs(C[at] - still).max() <= 1e-8 * max(np.abs(still).max(), 1e-20)


def test_matrices_of_all_poses_at_once() -> None:
    structure, poses = some_poses("ir663")
    K = dense_stiffness(structure, place(structure, poses))
    for at in range(7):
        assert np.abs(K[at] - dense_stiffness(structure, place(structure, one(poses, at)))[0]).max() == 0.0


def test_open_ports_of_a_random_machine_in_pieces() -> None:
    made = machine_frame(11, 6, 1, rigid=0.0, free=0.0, rigid_loops=False)
    structure = compile_structure(made.robot())
    ports = [Port("j0.axial", "joint", 0, 0)]
    rest = at_rest(structure)
    many = rest.only(np.zeros(5, dtype=np.int64))
    whole = condense(structure, many, [structure.robot.tcp], ports)
    assert same(condense(structure, many, [structure.robot.tcp], ports, chunk=2), whole)
    assert same(condense(structure, rest, [structure.robot.tcp], ports), whole, slice(4, 5))
