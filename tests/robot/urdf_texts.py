"""URDF texts of our own for the tests: one with everything, and trees that hypothesis makes up."""

import random

from hypothesis import strategies as st

# what our model has no use for (visuals, transmissions, comments, odd blanks) must survive
EVERYTHING = """<?xml version="1.0" ?>
<!-- made for tests: ä, quotes, and a > in a comment -->
<robot name="arm"   xmlns:x="http://example.org/x">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="foot">
    <visual><geometry><mesh filename="package://arm/foot.stl" scale="1e-3 1e-3 1e-3"/></geometry></visual>
  </link>
  <link name='upper'>
    <inertial>
      <origin xyz="0.1 0 0.25" rpy="0 0 0.3"/><mass value="12.5"/>
      <inertia ixx="0.1" ixy="0" ixz="0.01" iyy="0.2" iyz="0" izz="0.3"/>
    </inertial>
    <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
  </link>
  <link name="slide"/>
  <link name="jaw_a"/><link name="jaw_b"/>
  <link name="sensor mount"/>
  <joint name="base-yaw" type="revolute">
    <parent link="foot"/> <child link="upper"/>
    <origin xyz="0 0 0.4" rpy="0 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3.1" upper="3.1" effort="100" velocity="2"/>
    <dynamics damping="0.5" friction="0.1"/>
    <safety_controller k_position="100" k_velocity="10"/>
  </joint>
  <joint name="lift" type="prismatic">
    <parent link="upper"/><child link="slide"/>
    <origin xyz="0.5 0.1 0" rpy="0.2 -0.3 1.1"/>
    <axis xyz="0 1 1"/>
    <limit lower="0" upper="0.8" effort="1" velocity="1"/>
  </joint>
  <joint name="grip" type="continuous">
    <parent link="slide"/><child link="jaw_a"/><axis xyz="0 0 -1"/>
  </joint>
  <joint name="follow" type="continuous">
    <parent link="slide"/><child link="jaw_b"/><origin xyz="0 0.05 0"/>
    <mimic joint="grip" multiplier="-2" offset="0.1"/>
  </joint>
  <joint name="mount" type="fixed">
    <parent link="upper"/><child link="sensor mount"/><origin rpy="3.14159 0 0" xyz="0.1 0.2 0.3"/>
  </joint>
  <transmission name="t1"><type>transmission_interface/SimpleTransmission</type>
    <joint name="base-yaw"><hardwareInterface>PositionJointInterface</hardwareInterface></joint>
  </transmission>
  <gazebo reference="upper"><mu1>0.2</mu1></gazebo>
</robot>
"""

numbers = st.sampled_from(["0", "1.5707963", "-1.570796326794897", "3.14159", "1e-7"]) | st.floats(
    -3, 3, allow_nan=False
).map(lambda value: f"{value:.6g}")
triples = st.tuples(numbers, numbers, numbers).map(" ".join)


@st.composite
def trees(draw: st.DrawFn) -> str:
    """Draw the text of a URDF with 2 to 7 links."""
    count = draw(st.integers(2, 7))
    lines = [f'<link name="l{k}"/>' for k in range(count)]
    moving: list[str] = []
    for k in range(1, count):
        kind = draw(st.sampled_from(["fixed", "revolute", "continuous", "prismatic"]))
        axis = draw(triples.filter(lambda text: sum(float(x) ** 2 for x in text.split()) > 1e-3))
        parts = [
            f'<parent link="l{draw(st.integers(0, k - 1))}"/><child link="l{k}"/>',
            f'<origin xyz="{draw(triples)}" rpy="{draw(triples)}"/>',
            f'<axis xyz="{axis}"/>' if kind != "fixed" else "",
            '<limit lower="-1" upper="2.5" effort="1" velocity="1"/>'
            if kind in ("revolute", "prismatic")
            else "",
        ]
        if kind != "fixed" and moving and draw(st.booleans()):
            parts.append(f'<mimic joint="{draw(st.sampled_from(moving))}" multiplier="0.5" offset="-0.25"/>')
        elif kind != "fixed":
            moving.append(f"j{k}")
        lines.append(f'<joint name="j{k}" type="{kind}">{"".join(parts)}</joint>')
    random.Random(draw(st.integers(0, 99))).shuffle(lines)
    return '<robot name="tree">\n' + "\n".join(lines) + "\n</robot>\n"
