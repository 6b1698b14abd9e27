"""SDF out: read back it is the same machine, and what it does not say is told."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from typer.testing import CliRunner

from beamstiff import Robot, compile_structure, load_robot, posture, save_robot, tcp_compliance
from beamstiff.cli.main import app
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.sdf import parse_sdf
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.se3 import Array
from tests.robot.test_sdf import SDF
from tests.robot.urdf_texts import EVERYTHING, trees


def places(robot: Robot, q: Array) -> dict[str, Array]:
    """Return where the frames of a robot are, (N, 4, 4) each."""
    kinematics = compile_frames(robot)
    placed = forward(kinematics, all_values(kinematics, q))
    return {name: placed[:, at] for name, at in kinematics.frame_index.items()}


def postures(robot: Robot) -> Array:
    return np.random.default_rng(4).uniform(-1, 1, (3, len(compile_frames(robot).coupling.free)))


def check_same_links(one: Robot, other: Robot, links: list[str]) -> None:
    q = postures(one)
    mine, theirs = places(one, q), places(other, q)
    for link in links:
        np.testing.assert_allclose(mine[link], theirs[link], atol=1e-9)


@given(trees())
def test_any_tree_of_links_comes_back_with_its_links_where_they_were(text: str) -> None:
    links = [item.get("name", "") for item in ET.fromstring(text).iter("link")]
    robot = parse_urdf(text, tcp=links[-1])
    again = parse_sdf(robot_to_sdf(robot).text, tcp=links[-1])
    assert again.variables == robot.variables
    check_same_links(robot, again, [name for name in links if name in places(robot, postures(robot))])


def test_masses_limits_mimic_and_stiffness_come_back_and_shapes_are_told() -> None:
    text = EVERYTHING.replace(
        '<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><beamstiff torsional="2e6 N*m/rad" tilting="free"/>'
    )
    robot = parse_urdf(text, tcp="jaw_a")
    written = robot_to_sdf(robot)
    again = parse_sdf(written.text)
    assert again.variables == robot.variables
    assert again.masses == robot.masses
    assert [joint.stiffness for joint in again.joints] == [joint.stiffness for joint in robot.joints]
    assert "meshes and other shapes of the URDF are not written" in written.lost
    assert again.tcp == "jaw_a"
    link = next(item for item in ET.fromstring(written.text).iter("link") if item.get("name") == "upper")
    assert [link.findtext(f"inertial/inertia/{name}") for name in ("ixx", "ixz")] == ["0.1", "0.01"]


def test_an_sdf_that_was_read_is_written_as_the_same_machine() -> None:
    robot = parse_sdf(SDF)
    written = robot_to_sdf(robot)
    assert written.lost == ()
    again = parse_sdf(written.text)
    assert again.variables == robot.variables
    assert [(mass.mass, mass.at) for mass in again.masses] == [(mass.mass, mass.at) for mass in robot.masses]
    assert again.parameter("yaw.torsional") == 1e6
    check_same_links(robot, again, ["upper", "tip"])


@pytest.mark.parametrize("name", ["kr240-2", "kr500"])
def test_a_serial_robot_keeps_its_compliance(name: str) -> None:
    robot = load_robot(name)
    written = robot_to_sdf(robot)
    assert written.lost == ()
    q = np.random.default_rng(1).uniform(0.1, 0.4, (4, 6))

    def compliance(one: Robot) -> Array:
        structure = compile_structure(one)
        return tcp_compliance(structure, posture(structure.kinematics, q))

    expected = compliance(robot)
    found = compliance(parse_sdf(written.text))
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_what_sdf_cannot_say_is_told() -> None:
    told = " ".join(robot_to_sdf(load_robot("ir663")).lost)
    for part in ("loops (1)", "beams (6)", "stiffness of J1010", "passive joints"):
        assert part in told


def test_names_are_escaped() -> None:
    text = EVERYTHING.replace("sensor mount", "a &lt;b&gt; &amp; c").replace("base-yaw", "yaw &quot;1&quot;")
    assert parse_sdf(robot_to_sdf(parse_urdf(text, tcp="a <b> & c")).text).tcp == "a <b> & c"


def test_the_command_converts_and_says_what_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save_robot(load_robot("ir663"), tmp_path / "arm.yaml")
    run = CliRunner().invoke
    result = run(app, ["convert", "arm.yaml", "--out", "arm.sdf", "--json", "facts.json"])
    assert result.exit_code == 0, result.output
    assert "note: loops (1) are not written" in result.stderr
    assert "written: arm.sdf (SDF)" in result.stdout
    assert "loops (1)" in json.loads((tmp_path / "facts.json").read_text())["notes"][0]
    assert run(app, ["convert", "arm.sdf", "--out", "again.yaml"]).exit_code == 0
    assert load_robot(tmp_path / "again.yaml").tcp == "n7"
