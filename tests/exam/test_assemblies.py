"""The simulated machine is put together as the robot is, also where a name says how."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.exam.designs import reachable, simulated_alike
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.robots import with_closed_guesses
from beamstiff.functions.examine import _machine, examine
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.robot.machines import LAMBDA2, slider_crank

CLOSED = [
    *(("ir663", "+"), ("ir663", "-"), ("five-bar", "-"), ("five-bar", "+"), ("delta", "-")),
    *(("palletizer", "--+"), ("stewart", "+")),
]


def named(name: str, assembly: str) -> Robot:
    return load_robot(name).model_copy(update={"assembly": assembly})


@pytest.mark.parametrize(("name", "assembly"), CLOSED)
def test_the_simulator_closes_the_named_assembly(name: str, assembly: str) -> None:
    robot = with_closed_guesses(named(name, assembly))
    q = reachable(np.random.default_rng(0), robot, 20)
    placed = place(skeleton_of(robot), q)
    found = np.stack([placed.node(node) for node in robot.nodes], axis=1)
    np.testing.assert_allclose(found, posture(compile_kinematics(robot), q).node_positions, atol=1e-11)


def test_poses_at_which_the_simulator_would_close_another_assembly_are_not_taken() -> None:
    robot = named("five-bar", "+")  # its guesses mean the other
    q = np.radians([[100.0, 80.0], [90.0, 90.0]])
    assert not simulated_alike(robot, q).any()
    assert simulated_alike(with_closed_guesses(robot), q).all()
    with pytest.raises(BeamstiffError, match="close alike in the simulator at 0 of 80 poses only"):
        reachable(np.random.default_rng(0), robot, 20)


def test_a_robot_without_loops_stays_as_it_is() -> None:
    robot = load_robot("kr240-2")
    assert with_closed_guesses(robot) is robot


def test_two_assemblies_equally_near_are_refused() -> None:
    # in line: both sides of the dead centre are mirror images of one another
    with pytest.raises(BeamstiffError, match="equally near to the guesses"):
        examine(slider_crank(float(np.pi / 2 - LAMBDA2), psi=0.0), cases=1, classes=["null"])


def test_guesses_that_are_far_off_are_noted() -> None:
    robot = load_robot("five-bar")
    off = [item.model_copy(update={"guess": 2.5 * item.guess}) for item in robot.variables]
    robot = robot.model_copy(update={"variables": tuple(off)})
    (note,) = (one for one in _machine(robot)[1] if "loops" in one)
    assert "the loops are put together at" in note
