"""What holds for every bundled robot: it loads, closes, stands, and is well conditioned."""

import numpy as np
import pytest

from beamstiff import Robot, load_robot, robot_names
from beamstiff.fem.condensation import tcp_stiffness
from beamstiff.fem.loads import total_mass
from beamstiff.fem.placed_structure import place
from beamstiff.robot.kinematics import twist_jacobian
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from benchmarks.condition_numbers import condition_numbers
from tests.robots.machine import at, compliance, corners, inside

NAMES = [
    *("cantilever", "delta", "five-bar", "gantry", "ir663", "ir663-screws", "ir663-screws-beams", "kr240-2"),
    *("kr500", "palletizer", "stewart", "tripod"),
]


def test_these_are_the_robots() -> None:
    assert robot_names() == NAMES


@pytest.fixture(params=NAMES)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


def test_it_is_called_as_its_file_and_survives_writing(robot: Robot, request: pytest.FixtureRequest) -> None:
    assert robot.name == request.node.callspec.params["robot"]
    assert parse_robot(robot_to_yaml(robot)) == robot


def test_its_drives_have_limits(robot: Robot) -> None:
    assert all(variable.limits is not None for variable in robot.actuated)


def test_it_stands_at_random_poses_and_in_every_corner(robot: Robot) -> None:
    C = compliance(robot, np.concatenate([inside(robot, 300), corners(robot)]))
    assert np.abs(C - C.swapaxes(1, 2)).max() <= 1e-12 * np.abs(C).max()
    scale = 1 / np.sqrt(np.diagonal(C, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(scale[:, :, None] * C * scale[:, None, :]).min() > 0.0


def test_stiffness_is_the_inverse_of_compliance(robot: Robot) -> None:
    C = compliance(robot, inside(robot, 50, seed=1))
    size = np.sqrt(np.diagonal(C, axis1=1, axis2=2))
    product = (C @ tcp_stiffness(C)) / size[:, :, None] * size[:, None, :]
    assert np.abs(product - np.eye(6)).max() < 1e-8


def test_its_loops_close_without_a_singular_position(robot: Robot) -> None:
    structure, posture = at(robot, np.concatenate([inside(robot, 300, seed=2), corners(robot)]))
    for loop in structure.kinematics.loops:
        gap = [
            posture.transforms[:, frame, :3, :3] @ there + posture.transforms[:, frame, :3, 3]
            for frame, there in ((loop.frame_a, loop.at_a), (loop.frame_b, loop.at_b))
        ]
        assert np.abs(gap[1] - gap[0]).max() < 1e-12
    twist_jacobian(
        structure.kinematics, posture, robot.tcp
    )  # refuses positions where passive joints may move


def test_the_condition_number_of_its_scaled_stiffness_is_below_1e10(robot: Robot) -> None:
    _, found = condition_numbers(robot, np.concatenate([inside(robot, 300), corners(robot)]))
    assert found.max() < 1e10


def test_its_mass_is_that_of_its_beams_and_masses(robot: Robot) -> None:
    structure, posture = at(robot, corners(robot))
    mass = total_mass(structure, place(structure, posture))
    assert (mass > 0.0).all() == bool(robot.beams or robot.masses)
    assert mass.max() < 10_000.0
