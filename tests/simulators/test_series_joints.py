"""URDF and SDF with every compliance a joint in series."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.functions.written import SERIES, applied_text
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.simulators.series_joints import robot_to_series

NAMES = ["kr240-2", "kr500"]


@pytest.mark.parametrize("name", NAMES)
def test_a_urdf_has_the_drives_and_springs_and_the_same_kinematics(name: str) -> None:
    robot = load_robot(name)
    text, lost = robot_to_series(robot, "urdf")
    assert any("stiffness" in line for line in lost)  # told, not dropped
    again = parse_urdf(text, tcp=f"site {robot.tcp}")
    names = [variable.name for variable in again.actuated]
    assert names[:2] == ["q1", "J1_torsional"]
    q = np.random.default_rng(0).uniform(-1, 1, (4, 6))
    series = np.zeros((4, len(names)))
    series[:, [names.index(variable.name) for variable in robot.actuated]] = q
    ours, theirs = (compile_kinematics(one) for one in (robot, again))
    np.testing.assert_allclose(
        pose_of(theirs, posture(theirs, series), again.tcp),
        pose_of(ours, posture(ours, q), robot.tcp),
        atol=1e-9,
    )


def test_an_sdf_says_the_stiffness_itself() -> None:
    robot = load_robot("kr240-2")
    text, lost = robot_to_series(robot, "sdf")
    assert lost == ()
    springs = {
        joint.get("name"): float(joint.findtext("axis/dynamics/spring_stiffness", "0"))
        for joint in ET.fromstring(text).iter("joint")
    }
    assert springs["J2.torsional"] == robot.parameter("J2.torsional")
    assert springs["q2"] == 0.0


def test_an_sdf_that_is_diagnosed_gets_its_effect_as_joints_of_its_own(tmp_path: Path) -> None:
    start = tmp_path / "start.sdf"
    start.write_text(robot_to_sdf(load_robot("kr240-2")).text)
    play = {"effect": "backlash", "component": "q2", "shape": "flank within 0.03"}
    more = {"parameters": {"half_width": 4e-4}, "scales": {"torque": 4000.0}}
    robot = load_robot(start).model_copy(update={"effects": (AddedEffect.model_validate(play | more),)})
    text, lost = applied_text(robot, str(tmp_path / "out.sdf"), start)
    assert lost == (SERIES,)
    names = [item.get("name") for item in ET.fromstring(text).iter() if item.tag in ("link", "joint")]
    assert len(names) == len(set(names))
    (stop,) = (joint for joint in ET.fromstring(text).iter("joint") if "backlash" in str(joint.get("name")))
    assert float(stop.findtext("axis/limit/upper", "0")) == pytest.approx(4e-4)


def test_loops_are_cut_and_told() -> None:
    lost = robot_to_series(load_robot("ir663"), "sdf")[1]
    assert any("loops: cut open at J1010" in line for line in lost)
