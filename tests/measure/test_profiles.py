"""Lists of points by a profile. Truth: numbers written here by hand, and rotations by scipy."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.functions.convert import convert_log
from beamstiff.measure.point_lists import convert_points, parse_points
from beamstiff.measure.profiles import parse_profile, read_profile
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.text import split_table
from beamstiff.robot.reader import parse_robot
from tests.cli.test_user_files import log

ROBOT = """
beamstiff: 1
name: axis
variables: [{name: q1, type: revolute}]
frames: [{name: f1, theta: q1}]
nodes: [{name: foot}, {name: hub, frame: f1}, {name: tip, frame: f1, at: [1, 0, 0]}]
rigids: [{name: arm, nodes: [hub, tip]}]
joints: [{name: J1, nodes: [foot, hub], frame: f1, variable: q1, stiffness: {torsional: 1e6}}]
fixed: [foot]
tcp: tip
"""
SA = """// SpatialAnalyzer, working frame: A::WORLD
A::Main Run1 SMR1 1250.5 -3.25 800.0
A::Main Run2 SMR1 1251.5 -3.25 800.0

A::Main Run2 SMR9 0 0 0
"""
SA_PROFILE = """
comment: "//"
separator: whitespace
columns: {pose: 2, point: 3, x: 4, y: 5, z: 6}
units: {length: mm}
points: {SMR1: tip}
sigma_position: 0.03 mm
"""
JOINTS = "pose,q1 [deg],fz [N]\nRun2,20,-500\nRun1,10,0\n"


def test_spatialanalyzer_ascii_joined_with_joint_values_is_a_table_of_measurements() -> None:
    made = parse_points(SA, parse_profile(SA_PROFILE), "sa.txt", split_table(JOINTS, "q.csv"))
    table = parse_measurements(made.text, parse_robot(ROBOT))
    np.testing.assert_allclose(np.degrees(table.q[:, 0]), [10, 20])
    np.testing.assert_allclose(table.position, [[1.2505, -0.00325, 0.8], [1.2515, -0.00325, 0.8]], rtol=1e-15)
    np.testing.assert_allclose(table.wrench[:, 2], [0, -500])
    assert table.sigma_position == pytest.approx(3e-5, rel=1e-15)
    assert table.point.tolist() == ["tip", "tip"]
    assert made.notes == ("1 of 3 rows skipped, as `points` does not name them: SMR9",)


def test_what_holds_for_all_rows_is_written_along() -> None:
    text = (
        "columns: {t: s, q1: A1, x: X, y: Y, z: Z, qw: qw, qx: qx, qy: qy, qz: qz, fz: kg}\n"
        "units: {time: s, joints: deg, length: mm, fz: kg}\n"
        "point: tip\nload_point: tip\nhistory: continuous\n"
        "sigma_position: 0.03 mm\nsigma_rotation: 0.1 mrad\n"
    )
    made = parse_points("s,A1,X,Y,Z,qw,qx,qy,qz,kg\n1,10,1,2,3,1,0,0,0,5\n", parse_profile(text), "m.csv")
    table = parse_measurements(made.text, parse_robot(ROBOT))
    assert (table.point[0], table.load_point[0], table.continuous) == ("tip", "tip", True)
    assert table.sigma_rotation == pytest.approx(1e-4, rel=1e-15)
    with pytest.raises(BeamstiffError, match=r"p\.yaml:7: sigma_rotation: found the unit 'mm'"):
        parse_profile(text.replace("0.1 mrad", "0.1 mm"), "p.yaml")


def test_displacements_from_one_unloaded_reading_say_so() -> None:
    profile = parse_profile(
        "columns: {pose: p, q1: A1, dx: X, dy: Y, dz: Z}\nunits: {joints: deg, length: mm}\n"
        "unloaded_reading: shared\n"
    )
    made = parse_points("p,A1,X,Y,Z\n1,10,1,2,3\n", profile, "pulls.csv")
    assert parse_measurements(made.text, parse_robot(ROBOT)).shared_unloaded


def test_an_axyz_like_list_has_semicolons_decimal_commas_and_deviations() -> None:
    profile = parse_profile(
        "{separator: semicolon, decimal: comma, skip: 2, columns: {point: 1, x: 2, y: 3, z: 4, sigma_x: 5},"
        " units: {length: mm}}"
    )
    text = "Job 7\nLaser 1, 20,5 C\nP1;1000,25;-2,5;0;0,02\n"
    assert parse_points(text, profile).text.splitlines() == [
        "point,x [m],y [m],z [m],sigma_x [m]",
        "P1,1.00025,-0.0025,0.0,2e-05",
    ]


@pytest.mark.parametrize(
    ("orientation", "order"),
    [
        ("KUKA ABC", "ZYX"),
        ("Euler ZYZ", "ZYZ"),
        ("Euler XYZ", "XYZ"),
        ("fixed XYZ", "xyz"),
        ("fixed ZYX", "zyx"),
    ],
)
def test_a_faro_like_table_goes_by_names_inches_and_a_named_order_of_turns(
    orientation: str, order: str
) -> None:
    profile = parse_profile(
        "columns: {x: X, y: Y, z: Z, a: Rx, b: Ry, c: Rz, t: Time}\n"
        f"units: {{length: mm, x: in, angle: deg, time: s}}\norientation: {orientation}\n"
    )
    made = parse_points("Name,Time,X,Y,Z,Rx,Ry,Rz\nP,1.5,10,20,30,11,-22,33\n", profile)
    header, row = (line.split(",") for line in made.text.splitlines())
    values = dict(zip(header, map(float, row), strict=True))
    assert (values["x [m]"], values["y [m]"], values["t [s]"]) == (0.254, 0.02, 1.5)
    expected = Rotation.from_euler(order, [11, -22, 33], degrees=True).as_rotvec()
    found = [values[f"{name} [rad]"] for name in "abc"]
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_a_quaternion_has_its_scalar_where_the_profile_says() -> None:
    profile = parse_profile("{columns: {x: 1, y: 2, z: 3, qw: 4, qx: 5, qy: 6, qz: 7}, units: {length: m}}")
    c, s = np.cos(0.2), np.sin(0.2)
    values = parse_points(f"1,2,3,{c},0,0,{s}\n", profile).text.splitlines()[1].split(",")
    np.testing.assert_allclose(list(map(float, values)), [1, 2, 3, 0, 0, 0.4], atol=1e-15)


def test_points_known_in_the_base_frame_carry_the_list_there() -> None:
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 1.1])
    shift = np.array([3.0, -1.0, 0.5])
    known = {"B1": [0.0, 0, 0], "B2": [1.0, 0, 0.2], "B3": [0, 1.5, 0], "P": [0.7, 0.2, 0.9]}
    lines = [
        f"{name} {' '.join(map(repr, (1e3 * (turn.apply(at) + shift)).tolist()))}"
        for name, at in known.items()
    ]
    profile = parse_profile(
        "{separator: whitespace, columns: {point: 1, x: 2, y: 3, z: 4}, units: {length: mm}, base: {"
        + ", ".join(f"{name}: {known[name]}" for name in ("B1", "B2", "B3"))
        + "}}"
    )
    made = parse_points("\n".join([*lines, lines[0]]), profile)  # B1 read twice
    (row,) = made.text.splitlines()[1:]
    np.testing.assert_allclose(list(map(float, row.split(",")[1:])), known["P"], atol=1e-14)
    assert "carried to the base frame by 3 points" in made.notes[0]


def test_orientations_are_carried_along() -> None:
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 1.1])
    tool = Rotation.from_rotvec([0.1, 0.2, -0.5])
    known = {"B1": [0.0, 0, 0], "B2": [1.0, 0, 0], "B3": [0, 1.0, 0]}
    angles = " ".join(map(repr, (turn * tool).as_euler("ZYX", degrees=True).tolist()))
    lines = [f"{name} {' '.join(map(repr, turn.apply(at).tolist()))} {angles}" for name, at in known.items()]
    lines.append(f"P 1 2 3 {angles}")
    profile = parse_profile(
        "{separator: whitespace, columns: {point: 1, x: 2, y: 3, z: 4, a: 5, b: 6, c: 7},"
        f" units: {{length: m, angle: deg}}, orientation: KUKA ABC, base: {known}}}"
    )
    row = parse_points("\n".join(lines), profile).text.splitlines()[1].split(",")
    np.testing.assert_allclose(list(map(float, row[4:])), [0.1, 0.2, -0.5], atol=1e-12)


GOOD = "columns: {point: 1, x: 2, y: 3, z: 4}\nunits: {length: mm}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "columns: {point: 1, x: 2, y: 3, z: 4}\nunits: {}\n",
            ":2: units: the units of x, y, z are missing, expected `units: {length: ...}`",
        ),
        ("columns: {point: 1, x: 2, y: 3, z: 4}\n", "units: is missing"),
        (GOOD.replace("mm", "deg"), "found the unit 'deg'"),
        (GOOD.replace("length", "lenght"), "the units of x, y, z are missing"),
        (GOOD.replace("mm}", "mm, angel: deg}"), "did you mean 'angle'"),
        (GOOD.replace("x: 2, ", ""), "found only y, z, expected x, y, z"),
        (GOOD.replace("x: 2", "x: 0"), "expected the number of a column"),
        (GOOD.replace("point: 1", "q1: 1"), "the unit of q1 is missing.*joint variable"),
        (
            GOOD.replace("z: 4", "z: 4, a: 5, b: 6, c: 7").replace("mm", "mm, angle: deg"),
            "`orientation` go together",
        ),
        (GOOD + "orientation: KUKA ABC\n", "`orientation` go together"),
        (GOOD + "separator: blanks\n", "separator: found 'blanks'"),
        (GOOD + "colums: {}\n", "unknown key"),
        (GOOD.replace("point: 1, ", "") + "points: {A: b}\n", "needs a column of names.*, or `point: NODE`"),
        (GOOD + "point: tip\n", "found beside a column of names"),
        ("- 1\n", "expected keys with values"),
    ],
)
def test_a_profile_that_leaves_something_open_is_refused(text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message) as error:
        parse_profile(text, "profile.yaml")
    assert str(error.value).startswith("profile.yaml:")


@pytest.mark.parametrize(
    ("points", "profile", "message"),
    [
        ("", GOOD, "found no points"),
        ("A,1,2\n", GOOD, ":1: found 3 cells separated by comma, expected at least 4"),
        ("A,1,2,x\n", GOOD, ":1: z: found 'x'"),
        ("Name,X,Y,Z\nA,1,2,3\n", GOOD, ":1: x: found 'X'"),
        ("Name,X,Y,Z\nA,1,2,3\n", GOOD.replace("x: 2", "x: x"), ":1: x: there is no column 'x'.*mean 'X'"),
        ("A,1,2,3\n", GOOD + "points: {B: tip}\n", "found no point that `points` names"),
        ("A,1,2,3\n", GOOD + "base: {B: [0, 0, 0]}\n", "the list has no point 'B'"),
        (
            "A,1,2,3\nB,2,2,3\nC,4,2,3\n",
            GOOD + "base: {A: [0, 0, 0], B: [1e-3, 0, 0], C: [3e-3, 0, 0]}\n",
            "line",
        ),
    ],
)
def test_a_list_that_does_not_follow_its_profile_is_refused(points: str, profile: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message) as error:
        parse_points(points, parse_profile(profile), "points.txt")
    assert str(error.value).startswith("points.txt:")


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ("pose,q1\nRun1,1\n", "which is missing here"),
        ("pose,q1\nRun1,1\nRun1,2\n", "a second time"),
        ("q1\n1\n", "found 1 rows for 2 points"),
        ("q1,x\n1,2\n2,3\n", r"the column .x .m.. stands in the list of points too"),
    ],
)
def test_joint_values_that_do_not_fit_are_refused(joints: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        parse_points(SA, parse_profile(SA_PROFILE), "sa.txt", split_table(joints, "q.csv"))


def documented() -> list[str]:
    page = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    return re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)


def test_the_profiles_in_the_documentation_are_profiles() -> None:
    assert len(documented()) == 6
    for text in documented():
        parse_profile(text)


def test_the_documented_export_and_trace_become_one_table(tmp_path: Path) -> None:
    export, trace = documented()[:2]
    (shown,) = re.findall("# SpatialAnalyzer ASCII: (.*)", export)
    (header,) = re.findall("from a controller: (.*)", trace)
    base = "A::B1::p0, 0, 0, 0\nA::B2::p0, 1000, 0, 0\nA::B3::p0, 0, 1000, 0\n"
    (tmp_path / "sa.txt").write_text(f"{base}{shown}\n", encoding="utf-8")
    (tmp_path / "trace.log").write_text(f"; trace\n{header}\n1;10;-20;30;100\n", encoding="utf-8")
    profiles = parse_profile(export), parse_profile(trace)
    made = convert_points(tmp_path / "sa.txt", profiles[0], tmp_path / "trace.log", profiles[1])
    head, row = made.text.splitlines()[1:]
    values = dict(zip(head.split(","), row.split(","), strict=True))
    assert [values[f"q{at} [deg]"] for at in (1, 2, 3)] == ["10", "-20", "30"]
    assert (values["pose"], values["point"], values["fz [N]"]) == ("p001", "tool", "-980.665")
    np.testing.assert_allclose(
        [float(values[f"{axis} [m]"]) for axis in "xyz"], [6.0514411, 0.1598802, 1.6342532], atol=1e-12
    )


def test_one_point_and_one_unit_may_hold_for_all_rows_and_joints() -> None:
    (profile,) = [parse_profile(text) for text in documented() if "point: reflector" in text]
    text = "joint_1;joint_2;joint_3;X;Y;Z;T_room\n0,5;1;-1;100;200;300;21,5\n"
    assert parse_points(text, profile).text.splitlines()[-2:] == [
        "point,q1 [rad],q2 [rad],q3 [rad],x [m],y [m],z [m],temperature [degC]",
        "reflector,0.5,1.0,-1.0,0.1,0.2,0.3,21.5",
    ]


def test_the_documented_profile_of_samples_makes_rows_of_plateaus(tmp_path: Path) -> None:
    (profile,) = [text for text in documented() if "samples: true" in text]
    (tmp_path / "samples.yaml").write_text(profile, encoding="utf-8")
    (tmp_path / "log.csv").write_text(log().replace("t,q1,x,y,z", "clock,axis1,X,Y,Z"), encoding="utf-8")
    found = convert_log(tmp_path / "log.csv", read_profile(tmp_path / "samples.yaml"))
    rows = np.genfromtxt(found.text.splitlines()[1:], delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(rows["q1"], [0.0, 0.5, -0.3], atol=1e-9)
    np.testing.assert_allclose(rows["x_[m]"], 1.5 * np.cos([0.0, 0.5, -0.3]), atol=1e-5)


@pytest.mark.parametrize(
    ("header", "points", "said"),
    [("pose,q1 [deg]", "tip", ""), ("pose,q2 [deg]", "tip", "'q2'"), ("pose,q1 [deg]", "tipp", "'tipp'")],
)
def test_with_a_robot_the_names_are_its_own(header: str, points: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "sa.txt").write_text(SA)
    (tmp_path / "q.csv").write_text(f"{header}\nRun2,20\nRun1,10\n")
    profile = parse_profile(SA_PROFILE.replace("SMR1: tip", f"SMR1: {points}"))
    of = tmp_path / "sa.txt", profile, tmp_path / "q.csv"
    assert any("--like ROBOT" in note for note in convert_points(*of).notes)
    if said:
        with pytest.raises(BeamstiffError, match=rf"sa\.txt, as a table:.*{said}"):
            convert_points(*of, robot=parse_robot(ROBOT))
    else:
        assert not any("--like" in note for note in convert_points(*of, robot=parse_robot(ROBOT)).notes)
