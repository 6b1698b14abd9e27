"""SDF in: the same machine as its URDF twin, written out by hand."""

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.sdf import parse_sdf
from beamstiff.robot.urdf.reader import parse_urdf

SDF = """<?xml version="1.0"?>
<sdf version="1.9"><model name="arm">
  <link name="foot"/>
  <link name="upper"><pose>0 0 0.4 0 0 0</pose>
    <inertial><pose>0.1 0 0.2 0 0 0</pose><mass>5</mass></inertial></link>
  <link name="tip"><pose relative_to="upper">1 0 0.1 0.3 0 0.2</pose></link>
  <joint name="yaw" type="revolute"><parent>foot</parent><child>upper</child>
    <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis>
    <beamstiff torsional="1e6 N*m/rad"/></joint>
  <joint name="reach" type="prismatic"><parent>upper</parent><child>tip</child>
    <axis><xyz expressed_in="upper">1 0 0</xyz>
      <limit><lower>-1e16</lower><upper>1e16</upper></limit></axis></joint>
</model></sdf>
"""
# the axis along x of the upper arm, in the tip's own axes: R^T x of R = Rz(0.2) Rx(0.3)
URDF = """<robot name="arm"><link name="foot"/><link name="upper">
  <inertial><origin xyz="0.1 0 0.2"/><mass value="5"/></inertial></link><link name="tip"/>
  <joint name="yaw" type="revolute"><parent link="foot"/><child link="upper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="2"/><beamstiff torsional="1e6 N*m/rad"/></joint>
  <joint name="reach" type="prismatic"><parent link="upper"/><child link="tip"/>
    <origin xyz="1 0 0.1" rpy="0.3 0 0.2"/>
    <axis xyz="0.9800665778412416 -0.1897960609780889 0.05871080169382652"/></joint></robot>"""


def test_an_sdf_is_the_machine_of_its_urdf_twin() -> None:
    one, other = parse_sdf(SDF), parse_urdf(URDF)
    assert one.variables == other.variables
    assert one.masses == other.masses
    assert one.parameter("yaw.torsional") == 1e6
    q = np.array([[0.3, 0.5], [-1.0, 0.1]])
    for robot in (one, other):
        kinematics = compile_frames(robot)
        tip = forward(kinematics, all_values(kinematics, q))[:, kinematics.frame_index["tip"]]
        # by hand: the tip at 1 m + reach along the arm, turned by yaw
        for row, (yaw, reach) in enumerate(q):
            expected = [(1 + reach) * np.cos(yaw), (1 + reach) * np.sin(yaw), 0.5]
            np.testing.assert_allclose(tip[row, :3, 3], expected, atol=1e-12)
    assert [joint.axis for joint in one.joints] == [joint.axis for joint in other.joints]


def test_a_joint_beside_the_origin_of_its_link_turns_about_its_own_axis() -> None:
    text = SDF.replace("<child>upper</child>", "<child>upper</child><pose>0.3 0 0 0 0 0</pose>")
    robot = parse_sdf(text)
    kinematics = compile_frames(robot)
    q = all_values(kinematics, np.array([[0.0, 0.0], [np.pi / 2, 0.0]]))
    placed = forward(kinematics, q)[:, kinematics.frame_index["upper"], :3, 3]
    # a quarter turn about the axis at x = 0.3 m
    np.testing.assert_allclose(placed, [[0, 0, 0.4], [0.3, -0.3, 0.4]], atol=1e-12)
    joint, nodes = robot.joints[0], {node.name: node for node in robot.nodes}
    assert nodes[joint.nodes[0]].frame == nodes[joint.nodes[1]].frame == joint.frame


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="prismatic"', 'type="ball"', "found 'ball'"),
        ("<child>tip</child>", "<child>top</child>", "did you mean 'tip'"),
        ('relative_to="upper"', 'relative_to="reach"', "in a circle"),
        ("0 0 0.4 0 0 0", "0 0 0.4", "expected 6 numbers"),
        ('<link name="foot"/>', "<include><uri>x</uri></include>", "<include>: cannot be read"),
        ("<lower>-1</lower>", "<lower>3</lower>", "above upper"),
        ("<mass>5</mass>", "<mass>-5</mass>", "0 or more"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_line(old: str, new: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message) as error:
        parse_sdf(SDF.replace(old, new), "arm.sdf")
    assert str(error.value).startswith("arm.sdf:")
