"""The robot with other geometry: its rigid parts keep their lengths as the joints turn."""

import numpy as np
import pytest

from beamstiff.calibration.corrected import corrected
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.urdf.reader import parse_urdf

# whose second axis is no z: a frame that turns, and one of the link behind it
ARM = """<robot name="arm">
  <link name="foot"/><link name="upper"/><link name="fore"/><link name="tip"/>
  <joint name="j1" type="continuous"><parent link="foot"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="j2" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.1 0 0.4"/><axis xyz="0 1 0"/></joint>
  <joint name="j3" type="continuous"><parent link="fore"/><child link="tip"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 1 0"/></joint>
</robot>"""


@pytest.mark.parametrize("name", ["fore.d", "fore.r", "fore axis.beta", "fore axis.r", "tip.d", "j2"])
def test_no_rigid_part_changes_its_length_as_joints_turn(name: str) -> None:
    robot = parse_urdf(ARM, tcp="tip")
    moved = corrected(robot, {name: 3e-3}, np.zeros((1, 3)))
    kinematics = compile_kinematics(moved)
    at = posture(kinematics, np.random.default_rng(1).uniform(-2.0, 2.0, (20, 3))).node_positions
    for rigid in moved.rigids:
        first, second = (kinematics.node_index[node] for node in rigid.nodes)
        length = np.linalg.norm(at[:, first] - at[:, second], axis=-1)
        np.testing.assert_allclose(length, length[0], rtol=0.0, atol=1e-12)
    for joint in moved.joints:
        first, second = (kinematics.node_index[node] for node in joint.nodes)
        np.testing.assert_allclose(at[:, first], at[:, second], rtol=0.0, atol=1e-9)
