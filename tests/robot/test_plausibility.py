"""What is allowed in a robot but hardly meant is said; the bundled robots leave no doubt."""

import re

import pytest

from beamstiff import load_robot, robot_names
from beamstiff.robot.parts import Rigid
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.urdf.reader import parse_urdf
from tests.robot.urdf_texts import EVERYTHING

ARM = """\
beamstiff: 1
name: arm
variables:
  - {name: q1, type: revolute, limits: ["-170 deg", "170 deg"]}
  - {name: q2, type: revolute}
  - {name: d3, type: prismatic, limits: [0, "500 mm"]}
frames:
  - {name: f1, theta: q1}
  - {name: f2, parent: f1, d: 1, theta: q2}
  - {name: f3, parent: f2, d: 0.5, r: d3}
nodes:
  - {name: foot}
  - {name: hub, frame: f1}
  - {name: elbow, frame: f1, at: [1, 0, 0]}
  - {name: hand, frame: f2}
  - {name: guide, frame: f2, at: [0.5, 0, 0]}
  - {name: tip, frame: f3}
rigids:
  - {name: upper, nodes: [hub, elbow]}
  - {name: fore, nodes: [hand, guide]}
joints:
  - {name: J1, nodes: [foot, hub], frame: f1, variable: q1, stiffness: {torsional: "1e6 N*m/rad"}}
  - {name: J2, nodes: [elbow, hand], frame: f2, variable: q2, stiffness: {torsional: "1e6 N*m/rad"}}
  - {name: J3, nodes: [guide, tip], frame: f3, variable: d3, stiffness: {axial: "1e8 N/m"}}
fixed: [foot]
tcp: tip
"""


def test_robots_that_are_as_they_should_be_leave_no_doubt() -> None:
    assert robot_doubts(parse_robot(ARM)) == ()
    for name in robot_names():
        assert robot_doubts(load_robot(name)) == (), name
    assert robot_doubts(parse_urdf(EVERYTHING, tcp="jaw_a")) == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"-170 deg", "170 deg"', "-170, 170", "limits of q1: -170 to 170 rad are 54 turns; .* '170 deg'"),
        ('"500 mm"', "500", "limits of d3: 0 to 500 m; .* '500 mm'"),
        (
            "f2, variable: q2",
            "f2, variable: q1",
            "'J2': its variable 'q1' .*'elbow' and 'hand', where q2 moves",
        ),
        ("f1, variable: q1", "f1, variable: q2", "joint 'J1': its variable 'q2' moves nothing"),
        ("f3, variable: d3", "f3, variable: q2", "joint 'J3': its variable 'q2' .* where d3 moves"),
    ],
)
def test_what_is_hardly_meant_is_said(old: str, new: str, message: str) -> None:
    assert old in ARM
    (found,) = robot_doubts(parse_robot(ARM.replace(old, new)))
    assert re.search(message, found), found


def test_a_modulus_without_its_unit_is_said() -> None:
    gantry = load_robot("gantry")
    (name, steel), *_ = gantry.materials.items()
    soft = gantry.model_copy(
        update={"materials": gantry.materials | {name: steel.model_copy(update={"E": 210.0})}}
    )
    (found,) = robot_doubts(soft)
    assert f"material {name}: E is 210 Pa; a number without a unit is in Pa" in found


def test_a_link_across_joints_that_turn_is_said() -> None:
    assert robot_doubts(parse_robot(ARM)) == ()
    arm = parse_robot(ARM)
    held = Rigid(name="weld", nodes=(arm.fixed[0], arm.tcp))
    (found,) = robot_doubts(arm.model_copy(update={"rigids": (*arm.rigids, held)}))
    assert "the rigid 'weld' would be" in found
    assert f"it holds {arm.fixed[0]!r} and {arm.tcp!r} together" in found
