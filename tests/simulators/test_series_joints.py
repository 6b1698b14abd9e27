"""URDF and SDF with every compliance a joint in series."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff import load_robot, predict, tcp_compliance
from beamstiff.cli.main import app
from beamstiff.functions.convert import SERIES, applied_text
from beamstiff.measure.table import make_measurements
from beamstiff.measure.writer import write_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.sdf import parse_sdf
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.series_joints import robot_to_series

NAMES = ["kr240-2", "kr500"]


@pytest.mark.parametrize("kind", ["urdf", "sdf"])
@pytest.mark.parametrize("name", [*NAMES, "cantilever"])
def test_what_is_read_back_is_the_same_machine(name: str, kind: str) -> None:
    robot = load_robot(name).model_copy(update={"gravity": (0.0, 1.0, 2.0)})
    text, lost = robot_to_series(robot, kind)
    assert any("stiffness" in line for line in lost) == (kind == "urdf")  # told, not dropped
    again = (parse_urdf if kind == "urdf" else parse_sdf)(text)
    again = (parse_urdf if kind == "urdf" else parse_sdf)(robot_to_series(again, kind)[0])  # and once more
    assert (again.tcp, again.gravity, again.urdf) == (robot.tcp, robot.gravity, None)
    assert [v.name for v in again.actuated] == [v.name for v in robot.actuated]
    assert sum(one.mass for one in again.masses) == pytest.approx(weight(robot), rel=1e-9)
    q = np.random.default_rng(0).uniform(-1, 1, (4, len(robot.actuated)))
    ours, theirs = (compile_kinematics(one) for one in (robot, again))
    np.testing.assert_allclose(
        pose_of(theirs, posture(theirs, q), again.tcp), pose_of(ours, posture(ours, q), robot.tcp), atol=1e-9
    )
    np.testing.assert_allclose(tcp_compliance(again, q), tcp_compliance(robot, q), rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("name", ["kr240-2", "gantry", "ir663", "stewart"])
def test_mujoco_loads_every_urdf_with_its_links_and_masses(name: str) -> None:
    """Links that MuJoCo would refuse as weightless, and those that hold a frame alone, are there."""
    mujoco = pytest.importorskip("mujoco")
    robot = load_robot(name)
    plain = mujoco.MjModel.from_xml_string(robot_to_urdf(robot))
    assert plain.njnt == sum(variable.equals is None for variable in robot.variables)
    assert plain.body_mass.sum() == pytest.approx(sum(one.mass for one in robot.masses), abs=1e-6)
    series = mujoco.MjModel.from_xml_string(robot_to_series(robot, "urdf")[0])
    data = mujoco.MjData(series)
    mujoco.mj_kinematics(series, data)
    again = parse_urdf(robot_to_series(robot, "urdf")[0])
    kinematics = compile_kinematics(again)
    at_zero = posture(kinematics, np.zeros((1, len(again.actuated))))
    there = pose_of(kinematics, at_zero, robot.tcp)[0]
    np.testing.assert_allclose(data.body(robot.tcp).xpos, there[:3, 3], atol=1e-9)
    assert series.body_mass.sum() == pytest.approx(weight(robot), abs=1e-6)


def weight(robot: Robot) -> float:
    """Return the mass of a robot, its beams included."""
    return sum(mass for body in assemble(robot).bodies for mass, _ in body.masses)


def test_diagnose_takes_what_it_wrote(tmp_path: Path) -> None:
    """An SDF with joints in series, and one that a found effect was written into."""
    true = load_robot("kr240-2").with_parameters({"J2.torsional": 4e6})
    start, data, out = (tmp_path / name for name in ("start.sdf", "data.csv", "out.sdf"))
    start.write_text(robot_to_series(load_robot("kr240-2"), "sdf")[0])
    rng = np.random.default_rng(0)
    q = rng.uniform([-1, 0.3, -2, -1, -1, -1], [1, 1.5, -0.5, 1, 1, 1], (30, 6))
    names, wrench = [v.name for v in true.actuated], rng.normal(size=(30, 6)) * 500
    rows = make_measurements(names, q, tcp=true.tcp, wrench=wrench)
    seen = predict(true, rows).displacement + rng.normal(size=(30, 6)) * 1e-6
    rows = make_measurements(names, q, tcp=true.tcp, wrench=wrench, displacement=seen)
    write_measurements(rows, data, true)
    result = CliRunner().invoke(app, ["diagnose", str(start), str(data), "--apply", str(out)])
    assert result.exit_code == 0, result.output
    assert load_robot(out).parameter("J2.torsional") == pytest.approx(4e6, rel=0.02)


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
