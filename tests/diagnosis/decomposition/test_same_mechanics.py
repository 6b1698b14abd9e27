"""What no measurement of the tool tells apart has one name."""

import pytest

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.decomposition.same_mechanics import other_mechanics, same_mechanics
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.urdf.reader import parse_urdf
from tests.diagnosis.machines import at_random, kr240, nominal, shape_of, unexplained

URDF = """<robot name="arm"><link name="base"/><link name="one"/><link name="two"/>
<joint name="a1" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.4"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>
<joint name="a2" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.1 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint></robot>"""
# as a table of frames is read: the seat of the first joint is named in the frame that turns
FRAMES = """
beamstiff: 1
name: arm
variables: [{name: a1, type: revolute}, {name: a2, type: revolute}]
frames: [{name: f1, theta: a1, r: 0.4}, {name: f2, parent: f1, alpha: -90 deg, d: 0.1, theta: a2, r: 0.3}]
nodes:
  - {name: foot}
  - {name: s1, frame: f1}
  - {name: n1, frame: f1}
  - {name: s2, frame: f2}
  - {name: n2, frame: f2}
rigids: [{name: base, nodes: [foot, s1]}, {name: one, nodes: [n1, s2]}]
joints:
  - {name: J1, nodes: [s1, n1], frame: f1, variable: a1, stiffness: {}}
  - {name: J2, nodes: [s2, n2], frame: f2, variable: a2, stiffness: {}}
fixed: [foot]
tcp: n2
"""


def test_behind_the_last_joint_and_in_front_of_the_first_there_is_one_mechanics_each() -> None:
    groups = same_mechanics(load_robot("kr240-2"))
    end = groups["tool-compliance:null"]
    assert end[0] == "tool-compliance:null"
    assert {"bearing-tilt:q6", "link-bending:link5"} <= set(end)
    ground = groups["base-compliance:null"]
    assert ground[0] == "base-compliance:null"
    assert set(ground) == {"base-compliance:null", "bearing-tilt:q1", "link-bending:link0"}
    assert groups["bearing-tilt:q6"] == end
    assert groups["link-bending:link0"] == ground


@pytest.mark.parametrize("robot", [parse_urdf(URDF), parse_robot(FRAMES)], ids=["URDF", "table of frames"])
def test_robots_of_other_files_stand_on_the_ground_as_ours_do(robot: Robot) -> None:
    ground = same_mechanics(robot)["base-compliance:null"]
    assert set(ground) == {"base-compliance:null", "bearing-tilt:a1", "link-bending:base"}


def test_a_link_between_two_joints_is_a_mechanics_of_its_own() -> None:
    groups = same_mechanics(load_robot("kr240-2"))
    assert not {f"link-bending:link{at}" for at in (1, 2, 3)} & set(groups)


NOT_LINEAR = ("stiffen", "soften")  # in the load


@pytest.mark.parametrize(("effect", "joint"), [("base-compliance", "q1"), ("tool-compliance", "q6")])
def test_a_bearings_forms_are_of_its_group_if_symmetric_compliances_are_all(effect: str, joint: str) -> None:
    """In three loads of forty postures: what turns with q1 no ground does, what stays beside q6 no tool."""
    there = nominal(kr240(), at_random(kr240(), 120, seed=7))
    whole = shape_of(there, effect, None, "all").columns
    apart = other_mechanics(same_mechanics(there.nominal))[f"bearing-tilt:{joint}"]
    shapes = EFFECTS["bearing-tilt"].shapes(there, joint)
    linear = [one for one in shapes if not any(how in one.name for how in NOT_LINEAR)]
    assert {one.turns for one in linear} == {None, True, False}
    for one in linear:
        left = max(unexplained(one.columns[..., at], whole) for at in range(len(one.parameters)))
        assert (left < 1e-6) == (one.turns is not apart), one.name
