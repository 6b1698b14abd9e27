"""MJCF in, and springs written into an MJCF that exists."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff import load_robot, predict, tcp_compliance
from beamstiff.cli.main import app
from beamstiff.errors import BeamstiffError
from beamstiff.functions.robots import load_robot as load_any
from beamstiff.measure.table import make_measurements
from beamstiff.measure.writer import write_measurements
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_reader import read_mjcf
from beamstiff.simulators.mjcf_writer import robot_to_mjcf
from beamstiff.simulators.statics import MujocoModel

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco model="arm">
  <compiler angle="degree"/>
  <worldbody>
    <!-- stays -->
    <body name="shoulder" pos="0 0 0.4" euler='0 0 30'>
      <joint name="q1" axis="0 0 1"   range="-170 170" limited="true"/>
      <inertial pos="0 0 0.1" mass="20" diaginertia="1 1 1"/>
      <body name="upper" pos="0.1 0 0.2">
        <joint name="q2" axis="0 1 0" pos="0.02 0 0.01" ref="10"/>
        <inertial pos="0.4 0 0" mass="30" diaginertia="1 2 2"/>
        <body name="fore" pos="0.8 0 0">
          <joint name="q3" type="slide" axis="0.6 0 0.8"/>
          <inertial pos="0.3 0 0" mass="10" diaginertia="1 1 1"/>
          <site name="tcp" pos="0.7 0 0" euler="0 40 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def test_bodies_joints_and_sites_are_where_mujoco_puts_them(arm: Path) -> None:
    read = read_mjcf(arm)
    robot = read.robot
    assert robot.tcp == "tcp"
    assert [v.name for v in robot.actuated] == ["q1", "q2", "q3"]
    assert sum(mass.mass for mass in robot.masses) == pytest.approx(60.0)
    assert any("moments of inertia" in line for line in read.lost)
    kinematics, model = compile_kinematics(robot), MujocoModel(ARM)
    for q in np.random.default_rng(1).uniform(-1, 1, (5, 3)):
        ours = pose_of(kinematics, posture(kinematics, q), "tcp")[0]
        position, rotation = model.site_pose("tcp", q)
        np.testing.assert_allclose(ours[:3, 3], position, atol=1e-9)
        np.testing.assert_allclose(ours[:3, :3], rotation, atol=1e-9)


@pytest.mark.parametrize("name", ["kr240-2", "kr500", "cantilever"])
def test_a_robot_that_is_written_and_read_is_the_same_machine(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    path = tmp_path / "robot.xml"
    path.write_text(robot_to_mjcf(robot)[0])
    again = load_any(path)
    q = np.full((1, len(robot.actuated)), 0.3)
    assert [v.name for v in again.actuated] == [v.name for v in robot.actuated]
    np.testing.assert_allclose(tcp_compliance(again, q), tcp_compliance(robot, q), rtol=1e-9, atol=1e-20)


def test_like_without_an_effect_changes_no_byte(arm: Path) -> None:
    robot = load_any(arm)
    assert mjcf_like(robot, ARM, str(arm))[0] == ARM


def test_like_adds_springs_alone_and_mujoco_deflects_as_we_do(arm: Path) -> None:
    robot = load_any(arm).with_parameters({"q1.torsional": 1e6, "q2.torsional": 8e5, "q3.axial": 5e7})
    text, lost = mjcf_like(robot, ARM, str(arm))
    assert lost == ()
    kept = iter(text.splitlines())
    assert all(line in kept for line in ARM.splitlines())  # every line of the file, in its order
    q, wrench = np.array([0.3, 0.2, 0.1]), np.array([30.0, 20.0, -40.0, 1.0, 2.0, 3.0])
    model, names = MujocoModel(text), ["q1", "q2", "q3"]
    held = dict(zip(names, q.tolist(), strict=True))
    rest = model.equilibrium(held, np.zeros(6), "tcp")
    moved = model.equilibrium(held, wrench, "tcp", rest)
    found = model.site_pose("tcp", moved)[0] - model.site_pose("tcp", rest)[0]
    rows = make_measurements(names, q[None], tcp="tcp", wrench=wrench[None])
    expected = predict(robot, rows, preload=True).displacement[0, :3]
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.linalg.norm(expected))


def test_springs_of_the_base_move_what_stands_on_it(arm: Path) -> None:
    """A site of the base link moves with the pedestal, with or without a mass of the link."""
    pedestal = AddedEffect(effect="base-compliance", shape="tilt", parameters={"tilting_compliance": 1e-6})
    for mass in ('<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>', ""):
        column = f'<worldbody>\n    <body name="plinth">{mass}<site name="plate" pos="0.3 0 0"/>'
        text = ARM.replace("<worldbody>", column).replace("</worldbody>", "</body></worldbody>")
        arm.write_text(text)
        robot = load_any(arm).model_copy(update={"effects": (pedestal,)})
        model = MujocoModel(mjcf_like(robot, text, str(arm))[0])
        held = dict.fromkeys(["q1", "q2", "q3"], 0.1)
        rest = model.equilibrium(held, np.zeros(6), "tcp")
        moved = model.equilibrium(held, np.array([0, 0, 0, 0, 100.0, 0]), "tcp", rest)
        found = model.site_pose("plate", moved)[0] - model.site_pose("plate", rest)[0]
        assert found[2] == pytest.approx(-0.3 * 1e-4, rel=1e-3)


def test_joints_whose_names_are_no_variables(arm: Path) -> None:
    text = ARM.replace('"q2"', '"axis-2"')
    arm.write_text(text)
    robot = load_any(arm).with_parameters({"axis-2.torsional": 1e6})
    assert [v.name for v in robot.actuated] == ["q1", "axis_2", "q3"]
    assert '<joint name="axis-2.torsional" type="hinge"' in mjcf_like(robot, text, str(arm))[0]


def test_springs_of_the_file_get_the_robots_stiffness(arm: Path) -> None:
    robot = load_any(arm).with_parameters({"q1.torsional": 1e6})
    once = mjcf_like(robot, ARM, str(arm))[0]
    arm.write_text(once)
    assert mjcf_like(load_any(arm), once, str(arm))[0] == once
    softer = mjcf_like(load_any(arm).with_parameters({"q1.torsional": 5e5}), once, str(arm))[0]
    assert softer == once.replace('stiffness="1000000.0"', 'stiffness="500000.0"')


def test_springs_of_any_name_and_class_stand(arm: Path) -> None:
    """One called as it likes, one without a name, and one whose stiffness its class says."""
    springs = (
        '<joint name="soft" type="slide" stiffness="1e6"/><joint axis="1 0 0" stiffness="2e6"/>'
        '<joint name="sprung" class="spring" axis="0 1 0"/>'
    )
    text = ARM.replace(
        "<worldbody>",
        '<default><default class="spring"><joint stiffness="3e6"/></default></default><worldbody>',
    ).replace('<inertial pos="0.3 0 0"', f'{springs}<inertial pos="0.3 0 0"')
    arm.write_text(text)
    robot = load_any(arm)
    assert mjcf_like(robot, text, str(arm))[0] == text
    softer = robot.with_parameters({"soft.axial": 5e5})
    assert mjcf_like(softer, text, str(arm))[0] == text.replace('"1e6"', '"500000.0"')


def test_a_file_with_other_joints_is_refused(arm: Path) -> None:
    with pytest.raises(BeamstiffError, match="expected joints named as the robot's variables"):
        mjcf_like(load_robot("kr240-2"), ARM.replace("q", "joint"), str(arm))


def test_diagnose_takes_an_mjcf_and_writes_what_it_found_into_it(tmp_path: Path) -> None:
    true = load_robot("kr240-2").with_parameters({"J2.torsional": 4e6})
    plain = tmp_path / "robot.xml"
    plain.write_text(robot_to_mjcf(load_robot("kr240-2"))[0])
    rng = np.random.default_rng(0)
    q = rng.uniform([-1, 0.3, -2, -1, -1, -1], [1, 1.5, -0.5, 1, 1, 1], (40, 6))
    rows = make_measurements(
        [v.name for v in true.actuated], q, tcp=true.tcp, wrench=rng.normal(size=(40, 6)) * 500
    )
    seen = predict(true, rows).displacement + rng.normal(size=(40, 6)) * 1e-6
    data = tmp_path / "data.csv"
    write_measurements(
        make_measurements(
            rows.variables, q, tcp=true.tcp, wrench=rows.wrench, displacement=seen, metadata={}
        ),
        data,
        true,
    )
    out = tmp_path / "closed.xml"
    result = CliRunner().invoke(app, ["diagnose", str(plain), str(data), "--apply", str(out)])
    assert result.exit_code == 0, result.output
    assert load_any(out).parameter("J2.torsional") == pytest.approx(4e6, rel=0.02)
    lines = zip(out.read_text().splitlines(), plain.read_text().splitlines(), strict=True)
    changed = [one for one, before in lines if one != before]
    assert all("stiffness=" in line for line in changed)
