"""`beamstiff convert` as a user runs it."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError, load_robot, read_measurements
from beamstiff.robot.start_stiffness import with_joint_stiffness
from beamstiff.robot.urdf.reader import parse_urdf
from tests.cli.conftest import Refused, Run
from tests.robot.urdf_texts import EVERYTHING

# the crane of conftest.py, said by a URDF
CRANE = """<robot name="crane">
  <link name="foot"/>
  <link name="arm"/>
  <link name="tip"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <joint name="q1" type="revolute"><parent link="foot"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-2.9" upper="2.9" effort="1" velocity="1"/></joint>
  <joint name="boom" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/></joint>
</robot>
"""


@pytest.fixture(autouse=True)
def urdf(folder: Path) -> None:
    (folder / "arm.urdf").write_text(EVERYTHING, encoding="utf-8")
    (folder / "crane.urdf").write_text(CRANE, encoding="utf-8")


def test_a_urdf_given_a_stiffness_is_identified_and_comes_back_fitted(succeed: Run, folder: Path) -> None:
    stiff = ("--joint-stiffness", "5e5 N*m/rad")
    succeed("convert crane.urdf", *stiff, "--out", "start.yaml")
    assert load_robot("start.yaml").unmeasured == ("q1.torsional",)
    # a push of 1 kN across the arm of 1 m turns it by 1 mrad: 1e6 N m/rad
    (folder / "data.csv").write_text(
        "# sigma_position: 0.01 mm\nq1,fy,dx [mm],dy [mm]\n0,1000,0,1\n0,-2000,0,-2\n"
    )
    succeed("identify start.yaml data.csv --out fitted.yaml --json fit.json")
    succeed("convert fitted.yaml --out fitted.urdf")
    text = (folder / "fitted.urdf").read_text()
    assert parse_urdf(text).parameter("q1.torsional") == pytest.approx(1e6, rel=1e-6)
    assert re.sub(r"\n *<beamstiff torsional=.*? N\*m/rad\"/>", "", text) == CRANE


def test_commands_take_a_urdf_as_it_is(succeed: Run, told: Run, folder: Path) -> None:
    text = CRANE.replace('velocity="1"/>', 'velocity="1"/><beamstiff torsional="1e6 N*m/rad"/>')
    (folder / "stiff.urdf").write_text(text)
    (folder / "loads.csv").write_text("q1,fy\n0,1000\n")
    answer = told("deflect stiff.urdf loads.csv")
    np.testing.assert_allclose(answer["displacement"], [[0, 1e-3, 0, 0, 0, 1e-3]], atol=1e-12)
    succeed("show stiff.urdf")


@pytest.mark.parametrize("command", ["stiffness", "identify", "deflect"])
def test_a_urdf_without_stiffness_says_which_joints_need_one(refused: Refused, command: str) -> None:
    arguments = [command, "crane.urdf", *([] if command == "stiffness" else ["crane.csv"])]
    refused(arguments, ["the joints q1 are rigid", "--joint-stiffness"])


def test_a_rigid_robot_is_shown_with_a_note_and_its_posture_is_not_blamed(run: Run, succeed: Run) -> None:
    assert "note: no compliance: the joints q1 are rigid" in succeed("show crane.urdf").stderr
    assert "--q" not in run("stiffness crane.urdf").stderr


def test_json_says_what_was_written(told: Run) -> None:
    answer = told("convert crane.urdf --out crane2.yaml")
    assert answer["variables"] == ["q1"]
    assert "--joint-stiffness" in answer["notes"][0]


def test_urdf_to_yaml_to_urdf_is_the_same_text(succeed: Run, folder: Path) -> None:
    succeed("convert crane.urdf --out crane2.yaml")
    succeed("convert crane2.yaml --out back.urdf")
    assert (folder / "back.urdf").read_text() == CRANE


def test_tables_go_in_and_out(succeed: Run, folder: Path) -> None:
    succeed("convert kr500 --convention modified --out kr500.csv")
    succeed("convert kr500.csv --out kr500.urdf")
    succeed("convert kr500.urdf --convention classic --out classic.csv")
    assert "f3,q3 - 90,0,-55,-90" in (folder / "classic.csv").read_text()
    (folder / "rows.yaml").write_text("{convention: modified, rows: [{theta: q1, a: 1 m}]}")
    succeed("convert rows.yaml --out one.yaml")
    assert load_robot(folder / "one.yaml").frames[0].d == 1.0


def test_points_and_joint_values_become_measurements(succeed: Run, folder: Path) -> None:
    (folder / "points.txt").write_text("tip 1000 1 0\ntip 0 1001 0\n")
    profile = "{separator: whitespace, columns: {point: 1, x: 2, y: 3, z: 4}, units: {length: mm}}"
    (folder / "p.yaml").write_text(profile)
    (folder / "q.csv").write_text("q1 [deg],fy\n0,1000\n90,0\n")
    arguments = ("--profile", "p.yaml", "--joints", "q.csv", "--out", "measured.csv")
    succeed("convert points.txt", *arguments)
    table = read_measurements(folder / "measured.csv", load_robot(folder / "crane.yaml"))
    np.testing.assert_allclose(table.position, [[1, 1e-3, 0], [0, 1.001, 0]])


def test_a_trackers_list_and_a_controllers_trace_need_a_profile_each(
    succeed: Run, refused: Refused, folder: Path
) -> None:
    (folder / "points.txt").write_text("// X Y Z\nA::tip::p001, 1000, 1, 0\nA::tip::p002, 0, 1001, 0\n")
    (folder / "trace.log").write_text("; trace\nNo;A1;load_kg\n1;0;-0.00\n2;90;10\n")
    (folder / "p.yaml").write_text(
        'comment: "//"\nseparator: ["::", comma]\ncolumns: {point: 2, pose: 3, x: 4, y: 5, z: 6}\n'
        "units: {length: mm}\n"
    )
    (folder / "j.yaml").write_text(
        'comment: ";"\nseparator: semicolon\ncolumns: {pose: No, q1: A1, fz: load_kg}\n'
        "units: {joints: deg, fz: kg}\n"
    )
    arguments = ("convert", "points.txt", "--profile", "p.yaml", "--joints-profile", "j.yaml")
    both = (*arguments, "--joints", "trace.log")
    result = succeed(*both, "--out", "measured.csv")
    assert "note: load_kg: masses, taken as weight along -z of the base" in result.stderr
    assert "p001 is 1, p002 is 2" in result.stderr
    table = read_measurements(folder / "measured.csv", load_robot(folder / "crane.yaml"))
    np.testing.assert_allclose(np.degrees(table.q[:, 0]), [0, 90])
    np.testing.assert_allclose(table.wrench[:, 2], [0, -98.0665])
    refused([*arguments, "--out", "x.csv"], "--joints-profile: goes with --joints")
    refused([*both, "--out", "j.yaml"], "would overwrite the input")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("arm.urdf", "--out", "x.yaml"), "found 3 ends of the chain (jaw_a, jaw_b, sensor mount)"),
        (("arm.urdf", "--tcp", "jaw", "--out", "x.yaml"), "unknown node 'jaw' (did you mean 'jaw_b'?)"),
        (
            ("crane.yaml", "--tcp", "tap", "--out", "x.yaml"),
            "--tcp: tcp: unknown node 'tap' (did you mean 'tip'?)",
        ),
        (("crane.urdf", "--out", "x.txt"), "found the ending '.txt'"),
        (("crane.urdf", "--out", "crane.urdf"), "would overwrite the input"),
        (("crane.urdf", "--out", "x.csv"), "--convention: is missing"),
        (("crane.urdf", "--convention", "clasic", "--out", "x.csv"), "convention: found 'clasic' (did you"),
        (
            ("classic.csv", "--convention", "modified", "--out", "x.yaml"),
            "classic.csv: convention: found classic in the file and modified asked for, expected one",
        ),
        (("crane.urdf", "--like", "arm.urdf", "--out", "x.yaml"), "--like: goes with"),
        (("crane.urdf", "--like", "arm.urdf", "--out", "x.urdf"), "has no joint variable base_yaw"),
        (("crane.urdf", "--joint-stiffness", "1e6", "--out", "x.yaml"), "expected a stiffness with its unit"),
        (("crane.urdf", "--joint-stiffness", "q2=1 N/m", "--out", "x.yaml"), "no moving joint 'q2'"),
        (("crane.urdf", "--joint-stiffness", "2e6 Nm", "--out", "x.yaml"), "a moment per angle, Nm/rad"),
        (("crane.urdf", "--joint-stiffness", "q1=1 N/m", "--out", "x.yaml"), "which is axial"),
        (("crane.urdf", "--joint-stiffness", "1 N/m", "--out", "x.yaml"), "no joint moves so"),
        (("crane.urdf", "--joints", "crane.csv", "--out", "x.yaml"), "--joints: goes with --profile"),
        (("nothing.urdf", "--out", "x.yaml"), "nothing.urdf: no such file"),
        (
            ("fitted.urdf", "--tcp", "tip", "--hold", "q1=0deg", "--out", "x.yaml"),
            "--hold: fitted.urdf has rigids written by beamstiff, which would be lost",
        ),
    ],
)
def test_bad_input_ends_with_a_line_and_2(refused: Refused, arguments: tuple[str, ...], message: str) -> None:
    Path("classic.csv").write_text(
        "# convention: classic\ntheta [deg],d [mm],a [mm],alpha [deg]\nq1,0,600,0\n"
    )
    Path("fitted.urdf").write_text("<robot name='a'><beamstiff tcp='tip'>rigids: []</beamstiff></robot>")
    refused(["convert", *arguments], message)


def test_stiffness_goes_to_the_joints_that_have_none_and_fit_its_unit() -> None:
    robot = parse_urdf(EVERYTHING, tcp="jaw_a").with_parameters({"base-yaw.torsional": 5e5})
    new = with_joint_stiffness(robot, ["1e6 N*m/rad", "lift=2e8 N/m"])
    assert new.parameter("base-yaw.torsional") == 5e5
    assert new.parameter("grip.torsional") == 1e6
    assert new.parameter("lift.axial") == 2e8


def test_a_value_for_one_joint_wins_over_that_for_all_in_any_order() -> None:
    robot = parse_urdf(EVERYTHING, tcp="jaw_a")
    texts = ["base-yaw=5e5 N*m/rad", "1e6 N*m/rad"]
    for given in (texts, texts[::-1]):
        new = with_joint_stiffness(robot, given)
        assert (new.parameter("base-yaw.torsional"), new.parameter("grip.torsional")) == (5e5, 1e6)
    with pytest.raises(BeamstiffError, match="N/m"):
        with_joint_stiffness(robot, ["1 N"])


@pytest.mark.parametrize("given", ["5e5 N*m/rad", ["q1=5e5 N*m/rad"], ["q1=5e5 N*m/rad", "1e6 N*m/rad"]])
def test_python_gives_the_start_values_that_the_command_gives(succeed: Run, given: str | list[str]) -> None:
    succeed("convert crane.urdf --joint-stiffness", "5e5 N*m/rad", "--out", "start.yaml")
    assert load_robot("crane.urdf", joint_stiffness=given) == load_robot("start.yaml")
    assert load_robot("crane.urdf", joint_stiffness=given).unmeasured == ("q1.torsional",)
    # it has its own
    assert load_robot("crane.yaml", joint_stiffness="5e5 N*m/rad") == load_robot("crane.yaml")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("5e5", "joint_stiffness: found '5e5', expected a stiffness with its unit"),
        (["q2=1 N/m"], "joint_stiffness: there is no moving joint 'q2'"),
        ([5e5], "joint_stiffness: found [500000.0], expected a list of texts"),
    ],
)
def test_start_values_that_make_no_sense_are_named_as_the_argument(given: Any, message: str) -> None:
    with pytest.raises(BeamstiffError) as raised:
        load_robot("crane.urdf", joint_stiffness=given)
    assert message in str(raised.value)


def test_a_table_says_that_it_drops_a_coupling(run: Run, folder: Path) -> None:
    crane = (folder / "crane.yaml").read_text()
    text = crane.replace("variables:\n", 'variables:\n  - {name: q0, equals: "-q1"}\n')
    (folder / "coupled.yaml").write_text(text)
    result = run("convert coupled.yaml --convention modified --out coupled.csv")
    assert result.exit_code == 0, result.output
    assert "not limits, that q0 equals -q1" in result.stderr


def test_exchanged_names_of_reflectors_are_put_back(succeed: Run, refused: Refused, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text()
    text = text.replace(
        "  - {name: tip,", "  - {name: m1, frame: f1}\n  - {name: m2, frame: f1}\n  - {name: tip,"
    )
    text = text.replace(
        "[hub, tip]}", "[hub, tip]}, {name: a, nodes: [hub, m1]}, {name: b, nodes: [hub, m2]}"
    )
    (folder / "marked.yaml").write_text(text)
    names = ["m1", "m2", "tip"] * 4 + ["m2", "m1", "tip"]
    cells = [f"{k // 3},{('0.1,0,0', '0,0.2,0', '0,0,0.4')[k % 3]},{name}\n" for k, name in enumerate(names)]
    (folder / "poses.csv").write_text("q1 [deg],x,y,z,point\n" + "".join(cells))
    arguments = ("convert", "poses.csv", "--mend-labels", "--out", "mended.csv")
    result = succeed(*arguments, "--like", "marked.yaml")
    assert "poses.csv:14, poses.csv:15: m2 is m1, m1 is m2" in result.stderr
    assert "the names of 4 of 5 states" in result.stderr
    mended = read_measurements(folder / "mended.csv", load_robot(folder / "marked.yaml"))
    assert mended.point.tolist() == ["m1", "m2", "tip"] * 5
    refused([*arguments], "--mend-labels: goes with --like ROBOT")
    of_loads = [*arguments[:1], "crane.csv", *arguments[2:]]
    refused([*of_loads, "--like", "crane.yaml"], "crane.csv: found no reflectors")
