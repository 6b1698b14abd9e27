import json
from math import pi
from pathlib import Path

import numpy as np
import pytest

import beamstiff
from beamstiff.functions.stiffness import stiffness, tcp_compliance
from beamstiff.report.overview import describe
from beamstiff.report.stiffness import stiffness_tables
from beamstiff.robot.reader import load_robot
from beamstiff.robot.writer import save_robot
from tests.added import added
from tests.cli.conftest import Run


def test_the_json_of_a_cantilever_holds_the_closed_forms(run: Run) -> None:
    result = run("stiffness cantilever --json -")
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert list(answer) == ["stiffness", "compliance", "tcp", "variables"]
    assert (answer["tcp"], answer["variables"]) == ([1.0, 0.0, 0.0], {})
    outer, inner, E, G = 0.060, 0.052, 210e9, 80e9
    A, I = pi / 4 * (outer**2 - inner**2), pi / 64 * (outer**4 - inner**4)  # noqa: E741 (its usual name)
    compliance = np.array(answer["compliance"])
    closed = [1 / (E * A), 1 / (3 * E * I), 1 / (3 * E * I), 1 / (2 * G * I), 1 / (E * I), 1 / (E * I)]
    np.testing.assert_allclose(np.diagonal(compliance), closed, rtol=1e-9)
    np.testing.assert_allclose(np.array(answer["stiffness"]) @ compliance, np.eye(6), atol=1e-9)


@pytest.mark.parametrize("q", [["--q", "q1=90deg"], ["--q", "q1 = 1.5707963267948966"], ["--q", "q1=100gon"]])
def test_joint_values_take_units(told: Run, q: list[str]) -> None:
    answer = told("stiffness crane.yaml", *q)
    np.testing.assert_allclose(answer["tcp"], [0, 1, 0], atol=1e-15)
    assert answer["variables"]["q1"] == pytest.approx(pi / 2, rel=1e-15)
    # the arm along y: 1000 N along x turn the hub by 1000 N m / 1e6 N m/rad and push it by 1000 / 2e6 m
    np.testing.assert_allclose(answer["compliance"][0][0], 1 / 2e6 + 1 / 1e6, rtol=1e-12)
    np.testing.assert_allclose(answer["compliance"][1][1], 1 / 2e6, rtol=1e-12)


def test_an_elastic_effect_counts_as_the_spring_that_it_is(folder: Path) -> None:
    crane = load_robot(folder / "crane.yaml")
    sprung = crane.parameter("J1.torsional")
    effect = added("joint-compliance:q1", "linear", {"torque": 100.0}, compliance=1.0 / sprung)
    drift = added("angle-curve:q1", "order 1", sine_1=1e-3)
    rigid = crane.with_parameters({"J1.torsional": np.inf})
    found = stiffness(rigid.model_copy(update={"effects": (effect, drift)}), {"q1": 0.3})
    np.testing.assert_allclose(found.compliance, tcp_compliance(crane, {"q1": 0.3})[0], rtol=1e-6, atol=1e-12)
    assert any("not part of its stiffness" in note and "angle-curve:q1" in note for note in found.notes)


def test_what_a_pull_meets_is_told_with_the_share_that_start_values_make(folder: Path) -> None:
    """By hand: across the arm 1 / (2e6 N/m) + 1 m^2 / (1e6 N m/rad), two thirds of it by the torsion."""
    crane = load_robot(folder / "crane.yaml")
    found = stiffness(crane.model_copy(update={"unmeasured": ("J1.torsional",)}), {"q1": 0.0})
    np.testing.assert_allclose(found.guessed[[0, 1, 5]], [0.0, 2 / 3, 1.0], atol=1e-12)
    pulls = next(
        one for one in stiffness_tables(found) if getattr(one, "title", "").startswith("Stiffness agai")
    )
    rows = {row[0]: row[1:] for row in pulls.rows}
    assert rows["fx"] == ["2000", "N/mm", "0 %"]
    assert rows["fy"] == ["666.7", "N/mm", "67 %"]
    measured = next(
        one
        for one in stiffness_tables(stiffness(crane, {"q1": 0.0}))
        if one.title.startswith("Stiffness agai")
    )
    assert [len(row) for row in measured.rows] == [3] * 6


def test_a_pull_along_a_rigid_axis_meets_no_number(folder: Path) -> None:
    """The arm turned to y, whose hub only twists: nothing gives along y but rounding, 1e6 N m/rad along x."""
    crane = load_robot(folder / "crane.yaml").with_parameters({"J1.radial": np.inf})
    pulls = list(stiffness_tables(stiffness(crane, {"q1": pi / 2})))[1]
    rows = {row[0]: row[1:] for row in pulls.rows}
    assert rows["fx"] == ["1000", "N/mm"]
    assert rows["fy"] == ["rigid", ""]
    assert rows["mz"] == ["1e+06", "N*m/rad"]


def test_a_repaired_effect_is_as_if_it_were_not_there(folder: Path, told: Run) -> None:
    crane = load_robot(folder / "crane.yaml")
    effect = added("base-compliance", "tilt", tilting_compliance=3e-8)
    save_robot(crane.model_copy(update={"effects": (effect,)}), folder / "tilts.yaml")
    plain, tilting = told("stiffness crane.yaml --q q1=0.3"), told("stiffness tilts.yaml --q q1=0.3")
    repaired = told("stiffness tilts.yaml --q q1=0.3 --repaired base-compliance")
    assert repaired["compliance"] == plain["compliance"] != tilting["compliance"]
    moved = [
        told(f"deflect {robot} --q q1=0.3 --wrench fz=-1kN")["displacement"]
        for robot in ("crane.yaml", "tilts.yaml", "tilts.yaml --repaired base-compliance")
    ]
    assert moved[0] == moved[2] != moved[1]


def test_a_base_that_tilts_counts_in_every_posture_for_python_as_for_the_command() -> None:
    """Truth: a turn of the foot by ``C_b (p x f + m)`` moves the tool as a rigid body."""
    tilting = np.diag([3e-8, 3e-8, 0.0])
    robot = load_robot("kr500")
    effect = added("base-compliance", "tilt", tilting_compliance=3e-8)
    sprung = robot.model_copy(update={"effects": (effect,)})
    q = {"q1": np.array([0.2, -0.4, 0.6]), "q2": -0.3, "q3": 0.5}
    more = tcp_compliance(sprung, q) - tcp_compliance(robot, q)
    for pose, own in zip(beamstiff.forward_kinematics(robot, q), more, strict=True):
        x, y, z = pose[:3, 3]
        lever = np.hstack([[[0, -z, y], [z, 0, -x], [-y, x, 0]], np.eye(3)])
        np.testing.assert_allclose(own, lever.T @ tilting @ lever, atol=1e-12)
    alone = stiffness(sprung, {"q1": -0.4, "q2": -0.3, "q3": 0.5}).compliance
    np.testing.assert_allclose(tcp_compliance(sprung, q)[1], alone, rtol=1e-9, atol=1e-15)
    assert np.abs(np.linalg.inv(beamstiff.tcp_stiffness(sprung, q)[1]) - alone).max() < 1e-12


def test_joints_not_named_are_zero(told: Run) -> None:
    plain = told("stiffness crane.yaml")
    assert plain == told("stiffness crane.yaml --q q1=0")
    assert plain["variables"] == {"q1": 0.0}


def test_passive_variables_are_solved_and_told(told: Run) -> None:
    answer = told("stiffness ir663 --q q2=1.37deg --q q8=48.63deg")
    assert list(answer["variables"]) == ["q2", "q8", "th3", "th9"]
    # SEEDS of the shipped robot: 900 N along x move the tool by 0.96 mm here
    assert 900 * answer["compliance"][0][0] == pytest.approx(0.96e-3, abs=0.005e-3)


def test_people_get_tables_that_say_units_and_frame(succeed: Run) -> None:
    result = succeed("stiffness crane.yaml --q q1=30deg")
    for text in (
        "crane",
        "30 deg",
        "866.025, 500.000, 0.000 mm",
        "Stiffness at the TCP",
        "dx [m]",
        "mz [N m]",
    ):
        assert text in result.stdout
    assert "e-17" not in result.stdout  # rounding is shown as 0


def test_the_tables_hold_place_and_rotation_vector_of_the_tcp(run: Run) -> None:
    printed = run("stiffness kr240-2 --q q2=60deg,q3=-160deg,q5=30deg").stdout
    assert "2283.968, 0.000, 1699.348 mm" in printed
    assert "0.000, 70.000, 0.000 deg (rotation vector)" in printed  # pitch: -(60 - 160 + 30) deg


def test_json_goes_to_a_file_beside_the_tables(run: Run, folder: Path) -> None:
    assert "Compliance" in run("stiffness crane.yaml --json out.json").stdout
    printed = run("stiffness crane.yaml --json -").stdout
    *lines, seal, end = (folder / "out.json").read_text(encoding="utf-8").splitlines()
    assert "\n".join([*lines, end, ""]).replace("},\n}", "}\n}") == printed
    assert seal.startswith('  "written_by": "beamstiff-output sha256=')


def test_quiet_prints_nothing(run: Run, folder: Path) -> None:
    result = run("stiffness crane.yaml --quiet --q q1=200deg --json out.json")
    assert (result.exit_code, result.output) == (0, "")
    assert json.loads((folder / "out.json").read_text())["variables"]["q1"] == pytest.approx(200 * pi / 180)


def test_preload_lets_a_push_along_the_arm_soften_it_and_a_pull_stiffen_it(run: Run) -> None:
    push = 1e5  # N on an arm of 1 m and a spring of 1e6 N m/rad; gravity is along the joint's axis
    for q, wrench, load in (("0", "fx=-100kN", -push), ("90deg", "fy=1e5N", push)):
        result = run(f"stiffness crane.yaml --q q1={q} --preload --wrench", wrench, "--json", "-")
        assert (result.exit_code, result.stderr) == (0, "")
        answer = json.loads(result.stdout)
        assert list(answer) == ["stiffness", "compliance", "tcp", "variables"]
        across = 1 if q == "0" else 0
        assert answer["compliance"][5][5] == pytest.approx(1 / (1e6 + load), rel=1e-9)
        assert answer["compliance"][across][across] == pytest.approx(1 / 2e6 + 1 / (1e6 + load), rel=1e-9)
        np.testing.assert_allclose(
            np.array(answer["stiffness"]) @ np.array(answer["compliance"]), np.eye(6), atol=1e-9
        )


def test_preload_counts_the_payload(run: Run, told: Run, folder: Path) -> None:
    """An arm that hangs: its payload stiffens it like a pendulum."""
    text = (
        (folder / "crane.yaml").read_text().replace("tcp: tip", "tcp: tip\nmasses: [{node: tip, mass: 2 t}]")
    )
    (folder / "hanging.yaml").write_text(text.replace("name: crane", "name: crane\ngravity: [9.81, 0, 0]"))
    plain, loaded = (
        told("stiffness hanging.yaml", *option)["compliance"][5][5] for option in ([], ["--preload"])
    )
    assert plain == pytest.approx(1 / 1e6, rel=1e-12)
    assert loaded == pytest.approx(1 / (1e6 + 2000 * 9.81), rel=1e-9)
    assert "Tangent stiffness of the loaded machine" in run("stiffness hanging.yaml --preload").stdout


def test_a_value_outside_its_limits_is_noted(succeed: Run) -> None:
    result = succeed("stiffness crane.yaml --q q1=200deg")
    assert result.stderr == "note: q1 = 200 deg is outside its limits -170 deg to 170 deg\n"


def test_degrees_taken_for_radians_are_refused_with_what_to_write(run: Run, succeed: Run) -> None:
    result = run("stiffness crane.yaml --q q1=-90")
    assert result.exit_code == 2
    assert result.stderr == ("error: --q: q1: found -90 rad, beyond its limits; in degrees write q1=-90deg\n")
    succeed("stiffness crane.yaml --q q1=-90deg")
    succeed("stiffness crane.yaml --q q1=3.1")  # rad, a little outside


def test_a_note_says_where_one_beam_is_too_few_for_the_load(run: Run) -> None:
    light, heavy = (run(f"stiffness cantilever --preload --wrench fz={f}N") for f in ("-2000", "-20000"))
    assert light.stderr == ""
    assert heavy.stderr.startswith("note: beam 'tube': its moments are 13% of what buckles it")


@pytest.mark.parametrize("robot", ["five-bar", "gantry", "kr240-2", "stewart"])
def test_without_joint_values_the_posture_is_that_of_show_within_the_limits(succeed: Run, robot: str) -> None:
    """At zero these are outside their limits, cannot close their loops or have a beam without length."""
    result = succeed(f"stiffness {robot}")
    assert "outside its limits" not in result.stderr
    assert "the reference posture" in result.stderr
    machine = load_robot(robot)
    found = beamstiff.stiffness(machine)
    for item in describe(machine)["variables"]:
        assert found.variables[item["name"]] == pytest.approx(item["reference"], abs=1e-9)


@pytest.mark.parametrize("preload", [False, True])
def test_with_drive_springs_only_rigid_wrenches_move_nothing(succeed: Run, preload: bool) -> None:
    result = succeed("stiffness kr240-2 --q q1=0", *(["--preload"] if preload else []))
    assert (
        "Rigid: loads that do not displace the TCP (N, N m): mx. A stiffness matrix does not exist."
        in result.stdout
    )
    assert "Stiffness at the TCP" not in result.stdout
    (row,) = [line for line in result.stdout.splitlines() if line.startswith("rx [rad]")]
    assert row.split()[2:] == ["rigid"] * 6
    found = beamstiff.stiffness("kr240-2", preload=preload)  # its wrist is stretched: a combination
    assert found.stiffness is None
    assert len(found.rigid) == 1
    largest = np.abs(found.compliance) @ np.abs(found.rigid[0])
    assert (np.abs(found.compliance @ found.rigid[0]) <= 1e-8 * largest.max()).all()
    assert np.count_nonzero(found.rigid[0]) == 3


def test_what_closes_to_rounding_is_shown_as_zero(succeed: Run) -> None:
    assert "e-1" not in succeed("stiffness delta").stdout.split("Stiffness at")[0]


def test_a_drive_that_is_not_named_and_cannot_be_0_is_told_with_its_limits(run: Run) -> None:
    said = run("stiffness ir663-screws --q r8=800mm").stderr
    assert "cannot close at r2 = 0 m" in said
    assert "r2 is not named in --q and counts as 0, outside its limits 615 mm to 918 mm" in said
    assert "r8 is not named" not in said
