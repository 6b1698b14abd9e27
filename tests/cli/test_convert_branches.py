"""`beamstiff convert` of a URDF whose links branch: what is held, what moves along, what the file keeps."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array
from tests.cli.conftest import Refused, Run

# an arm of two joints, a balancer that follows the first, and a gripper with a finger that slides
ARM = """<robot name="arm">
  <link name="foot"><visual><geometry><mesh filename="foot.stl"/></geometry></visual></link>
  <link name="upper"><inertial><origin xyz="0.4 0 0"/><mass value="20"/></inertial></link>
  <link name="hand"><inertial><mass value="5"/></inertial></link>
  <link name="balancer"><inertial><origin xyz="-0.3 0 0"/><mass value="30"/></inertial></link>
  <link name="finger"><inertial><origin xyz="0 0.02 0"/><mass value="0.5"/></inertial>
    <visual><geometry><mesh filename="finger.stl"/></geometry></visual></link>
  <joint name="shoulder" type="revolute"><parent link="foot"/><child link="upper"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="0.8 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="rod" type="revolute"><parent link="upper"/><child link="balancer"/><axis xyz="0 1 0"/>
    <mimic joint="elbow" multiplier="0.5"/></joint>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/><origin xyz="0.1 0 0"/>
    <axis xyz="0 1 0"/><limit lower="0.01" upper="0.05" effort="1" velocity="1"/></joint>
</robot>
"""
Q = {"shoulder": 0.3, "elbow": -0.7}


@pytest.fixture
def arm(folder: Path, succeed: Run) -> str:
    """Return what `convert` says of the arm."""
    (folder / "model.urdf").write_text(ARM, encoding="utf-8")
    return succeed("convert model.urdf --tcp hand --joint-stiffness '1e6 N*m/rad' --out arm.urdf").stderr


def centre(robot: Robot) -> Array:
    """Return the mass of a robot and its first moment in the base frame, (4,), kg and kg m."""
    kinematics = compile_kinematics(robot)
    there = posture(kinematics, np.array([[Q[variable.name] for variable in robot.actuated]]))
    total = np.zeros(4)
    for mass in robot.masses:
        frame = next(node.frame for node in robot.nodes if node.name == mass.node)
        turn = np.eye(3)
        if frame != "base":
            turn = there.transforms[0, kinematics.frame_index[frame], :3, :3]
        at = there.node_positions[0, kinematics.node_index[mass.node]] + turn @ np.array(mass.at)
        total += mass.mass * np.append(1.0, at)
    return total


def by_hand() -> Array:
    """Return the same from the drawing; a turn about y takes x down."""

    def along(angle: float, x: float) -> Array:
        return x * np.array([np.cos(angle), 0.0, -np.sin(angle)])

    foot, (shoulder, elbow) = np.array([0.0, 0.0, 0.5]), Q.values()
    hand = foot + along(shoulder, 0.8)
    parts = [
        (20.0, foot + along(shoulder, 0.4)),
        (5.0, hand),
        (30.0, foot + along(shoulder + 0.5 * elbow, -0.3)),
        (0.5, hand + along(shoulder + elbow, 0.1) + [0.0, 0.02 + 0.01, 0.0]),  # held at its lower limit
    ]
    return np.asarray(sum(mass * np.append(1.0, at) for mass, at in parts))


def test_the_finger_is_held_and_weighs_on_the_hand(arm: str, folder: Path) -> None:
    assert "held grip at 0.01; their links (0.5 kg)" in arm
    np.testing.assert_allclose(centre(load_robot(folder / "arm.urdf")), by_hand(), atol=1e-9)


def test_the_balancer_moves_along(arm: str, folder: Path) -> None:
    robot = load_robot(folder / "arm.urdf")
    assert "rod" not in arm
    assert {one.name: one.equals for one in robot.variables}["rod"] == "0.5 * elbow"


def test_a_joint_that_only_follows_and_carries_no_tool_gets_no_stiffness(arm: str, folder: Path) -> None:
    assert load_robot(folder / "arm.urdf").identify == ("shoulder.torsional", "elbow.torsional")


def test_the_file_keeps_its_meshes_and_other_readers_see_the_finger_fixed(arm: str, folder: Path) -> None:
    text = (folder / "arm.urdf").read_text()
    assert "foot.stl" in text
    assert "finger.stl" in text
    assert '<joint name="grip" type="fixed">' in text
    assert 'xyz="0.1 0.01 0"' in text


def test_gravity_of_a_wall_goes_into_the_file(arm: str, succeed: Run, folder: Path) -> None:
    succeed("convert arm.urdf --gravity 9.81,0,0 --out wall.urdf")
    assert load_robot(folder / "wall.urdf").gravity == (9.81, 0.0, 0.0)


@pytest.mark.parametrize("gravity", ["9.81", "9.81,down,0", "9.81 m,0,0"])
def test_gravity_that_is_no_acceleration_is_refused(arm: str, refused: Refused, gravity: str) -> None:
    refused(["convert", "arm.urdf", "--gravity", gravity, "--out", "x.urdf"], ["--gravity: found", gravity])
