"""What no measurement of the tool tells apart has one name."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, diagnose, forward_kinematics, load_robot, predict
from beamstiff.diagnosis.decomposition.same_mechanics import other_mechanics, same_mechanics
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.measure.table import Measurements, make_measurements
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


AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))
PLACES = ((0, 0, 0.6), (0.32, 0, 0.13), (0, 0, 1.08), (0.2, 0, 0.17), (1.04, 0, 0), (0.2, 0, 0))


def six_axes(cutter: str) -> str:
    """A URDF of six joints with a cutter on the last link."""
    links = "".join(f'<link name="l{at}"/>' for at in range(7))
    joints = "".join(
        f'<joint name="j{at + 1}" type="revolute"><parent link="l{at}"/><child link="l{at + 1}"/>'
        f'<origin xyz="{" ".join(map(str, place))}"/><axis xyz="{" ".join(map(str, axis))}"/>'
        '<limit lower="-4" upper="4" effort="9000" velocity="1"/></joint>'
        for at, (axis, place) in enumerate(zip(AXES, PLACES, strict=True))
    )
    mount = '<parent link="l6"/><child link="cutter"/>'
    return (
        f'<robot name="mill">{links}<link name="cutter"/>{joints}'
        f'<joint name="mount" type="fixed">{mount}<origin xyz="{cutter}"/></joint></robot>'
    )


def test_a_tool_that_tilts_about_a_flange_far_behind_it_is_told_by_its_usual_name(tmp_path: Path) -> None:
    """Displacements under loads are all that is known, of a TCP off the last axis."""
    tip, seat = (tmp_path / name for name in ("cutter.urdf", "flange.urdf"))
    tip.write_text(six_axes("0.31 0 0.06"))
    seat.write_text(six_axes("0 0 0"))
    robot, flange = (load_robot(file, joint_stiffness="1e6 N*m/rad") for file in (tip, seat))
    rng = np.random.default_rng(1)
    q = np.repeat(rng.uniform(-1.0, 1.0, (18, 6)) * [2, 1, 1, 2.6, 1.7, 3.5], 4, axis=0)
    force = rng.normal(size=(72, 3))
    force *= rng.choice([400.0, 800.0, 1200.0], (72, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    cutter, seated = (forward_kinematics(one, q) for one in (robot, flange))
    lever, axes = cutter[:, :3, 3] - seated[:, :3, 3], seated[:, :3, :3]
    moment = np.einsum("nji,nj->ni", axes, np.cross(lever, force))
    turn = np.einsum("nij,nj->ni", axes, moment * [2.2e-6, 2.9e-6, 0.6e-6])
    wrench = np.concatenate([force, np.zeros((72, 3))], axis=1)

    def table(displacement: np.ndarray | None = None) -> Measurements:
        names = [variable.name for variable in robot.actuated]
        known = {"wrench": wrench, "displacement": displacement, "sigma_position": 6e-6}
        return make_measurements(names, q, tcp=robot.tcp, **known)

    moved = predict(robot, table()).displacement[:, :3] + np.cross(turn, lever)
    found = diagnose(robot, table(moved + 6e-6 * rng.standard_normal((72, 3))))
    assert found.verdict.key == "tool-compliance:null"
    assert "bearing-tilt:j6" in found.indistinguishable


def test_a_link_that_leads_nowhere_is_no_look_alike() -> None:
    """An antenna on the pedestal bends by itself: the tool stays."""
    fixed = (
        '<link name="{0}"/><joint name="to_{0}" type="fixed"><parent link="{1}"/><child link="{0}"/>'
        '<origin xyz="0.2 0 0.1"/></joint>'
    )
    branch = fixed.format("mast", "base") + fixed.format("antenna", "mast")
    robots = [parse_urdf(text) for text in (URDF, URDF.replace("</robot>", f"{branch}</robot>"))]
    bare, branched = (same_mechanics(robot)["base-compliance:null"] for robot in robots)
    assert "antenna" in str(robots[1].rigids)
    assert len(branched) == len(bare)
    assert not any("mast" in key for key in branched)
