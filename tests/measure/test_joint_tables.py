"""Joint values and loads beside a list of points. Truth: pairs and numbers written here by hand."""

import csv
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.joint_tables import joints_by_profile
from beamstiff.measure.point_lists import PointTable, convert_points, parse_points
from beamstiff.measure.profiles import parse_profile
from beamstiff.measure.text import split_table

LIST = parse_profile("columns: {pose: 1, x: 2, y: 3, z: 4}\nunits: {length: mm}\npoint: tip\n")
TRACE = """; KRC4 trace, $AXIS_ACT in deg
No;A1;load_kg
1;67.101;-0.00
2;33.521;122.32
"""
OF_TRACE = 'comment: ";"\nseparator: semicolon\ncolumns: {pose: No, q1: A1, fz: load_kg}\n'
OF_TRACE += "units: {joints: deg, fz: kg}\n"


def made(points: str, joints: str) -> PointTable:
    return parse_points(points, LIST, "list.txt", split_table(joints, "q.csv"))


def columns(table: PointTable) -> dict[str, list[str]]:
    head, *rows = csv.reader(table.text.splitlines())
    return dict(zip(head, map(list, zip(*rows, strict=True)), strict=True))


def test_a_trace_is_read_by_its_own_profile(tmp_path: Path) -> None:
    (tmp_path / "trace.log").write_text(TRACE)
    (tmp_path / "list.txt").write_text("p002, 1.5, 2.5, 3.5\np001, 4.5, 5.5, 6.5\n")
    found = convert_points(tmp_path / "list.txt", LIST, tmp_path / "trace.log", parse_profile(OF_TRACE))
    assert columns(found) == {
        "q1 [deg]": ["33.521", "67.101"],
        "fz [N]": [repr(-9.80665 * 122.32), "0.0"],
        "pose": ["p002", "p001"],
        "point": ["tip", "tip"],
        "x [m]": ["0.0015", "0.0045"],
        "y [m]": ["0.0025", "0.0055"],
        "z [m]": ["0.0035", "0.0065"],
    }
    assert found.notes == (
        "poses are paired by the number that their names end in: p002 is 2, p001 is 1",
        "load_kg: masses, taken as weight along -z of the base",
        "names of joints and points are not checked; --like ROBOT checks them",
    )


def test_a_trace_with_decimal_commas_is_written_with_points() -> None:
    text = TRACE.replace(".", ",")
    raw = joints_by_profile(text, parse_profile(f"{OF_TRACE}decimal: comma\n"), "trace.log")
    assert [row[1] for row in raw.cells] == ["67.101", "33.521"]
    with pytest.raises(BeamstiffError, match=r"trace\.log:3: q1: .*`decimal: comma` in the profile"):
        joints_by_profile(text, parse_profile(OF_TRACE), "trace.log")


@pytest.mark.parametrize("key", ["samples: true", "point: tip", "sigma_position: 1 mm"])
def test_what_a_profile_says_of_points_does_not_go_with_joint_values(key: str) -> None:
    with pytest.raises(BeamstiffError, match=rf"trace\.log: its profile states `{key.split(':')[0]}`"):
        joints_by_profile(TRACE, parse_profile(f"{OF_TRACE}{key}\n"), "trace.log")


@pytest.mark.parametrize(
    ("ours", "theirs", "pairs"),
    [
        (["p001", "p002"], ["2", "1"], [1, 0]),
        (["1", "2"], ["set 1", "set 2"], [0, 1]),
        (["001", "010", "100"], ["1", "10", "100"], [0, 1, 2]),
        (["home", "p1"], ["pose_1", "home"], [1, 0]),
        (["b", "a"], ["a", "b"], [1, 0]),
        (["p1", "p1", "p2"], ["1", "2"], [0, 0, 1]),  # two reflectors of a pose
        (["p1", "1"], ["1", "p1"], [1, 0]),  # as they are written
    ],
)
def test_poses_are_paired_by_name_or_else_by_number(
    ours: list[str], theirs: list[str], pairs: list[int]
) -> None:
    joints = "pose,q1\n" + "".join(f"{name},0.{at}\n" for at, name in enumerate(theirs))
    found = made("".join(f"{name},1,2,3\n" for name in ours), joints)
    assert columns(found)["q1"] == [f"0.{at}" for at in pairs]
    assert columns(found)["pose"] == ours
    told = any("paired by the number" in note for note in found.notes)
    assert told == any(name not in theirs for name in ours)


@pytest.mark.parametrize(
    ("ours", "theirs", "missing"),
    [
        (["p1"], ["a1", "b1"], "p1"),  # the number is that of two, here
        (["a1", "b1"], ["1"], "a1"),  # and there
        (["1", "p1"], ["1"], "p1"),
        (["28", "29"], ["28", "9"], "29"),
        (["1.5"], ["5"], "1.5"),  # no whole number
        (["p_1x"], ["1"], "p_1x"),
    ],
)
def test_a_pose_without_joint_values_is_named_with_its_line(
    ours: list[str], theirs: list[str], missing: str
) -> None:
    joints = "pose,q1\n" + "".join(f"{name},0.1\n" for name in theirs)
    points = "# made up\n" + "".join(f"{name},1,2,3\n" for name in ours)
    line = 2 + ours.index(missing)
    message = rf"q\.csv: pose: .* has the pose '{missing}' \(list\.txt:{line}\), which is missing here\Z"
    with pytest.raises(BeamstiffError, match=message):
        made(points, joints)


def test_a_name_that_is_no_number_is_suggested() -> None:
    with pytest.raises(BeamstiffError, match=r"'hom' .* missing here \(did you mean 'home'\?\)"):
        made("hom,1,2,3\n", "pose,q1\nhome,0\n")


def test_poses_without_a_point_are_named() -> None:
    found = made("2,1,2,3\n", "pose,q1\n1,0.1\n2,0.2\n3,0.3\n")
    assert found.notes == ("no point of the list belongs to 2 poses of q.csv: 1, 3",)


def test_a_table_of_decimal_commas_is_written_with_points() -> None:
    text = "# decimal: comma\npose;q1 [deg];fz;step\n1;67,101;-1,5;2\n"
    found = columns(made("1,1,2,3\n", text))
    assert (found["q1 [deg]"], found["fz"], found["step"]) == (["67.101"], ["-1.5"], ["2"])


def test_cells_of_a_table_stay_as_they_are() -> None:
    text = "pose,q1 [deg],q1_link [deg],temperature [degC],remark,tau_q1\n1,67.10,,,late,\n"
    found = columns(made("1,1,2,3\n", text))
    assert [found[head] for head in text.splitlines()[0].split(",")] == [
        [cell] for cell in text.splitlines()[1].split(",")
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "pose;q1 [deg]\n1;67,101\n",
            r"q\.csv:2: q1: found '67,101', .*'# decimal: comma' before the header",
        ),
        (
            "# decimal: comma\npose,q1\n1,2\n",
            r"q\.csv:1: decimal: found comma in a table separated by commas",
        ),
        ("# decimal: koma\npose;q1\n1;2\n", r"q\.csv:1: decimal: found 'koma', expected point or comma"),
        ("pose,q1,fz [kg]\n1,2,3\n", r"q\.csv:1: fz: found the unit 'kg'.*--joints-profile, with .*fz: kg"),
        ("pose,q1 [dgr]\n1,2\n", r"q\.csv:1: q1: unknown unit 'dgr', expected a unit of angle"),
        ("pose,q1,tau_q1 [s]\n1,2,3\n", r"q\.csv:1: tau_q1: .*a unit of moment"),
        ("pose,q1,time [m]\n1,2,3\n", r"q\.csv:1: time: found the unit 'm', expected a unit of time"),
        ("pose,q1 [deg\n1,2\n", r"q\.csv:1: column 2: found 'q1 \[deg'"),
        ("pose,q1,q1\n1,2,3\n", r"q\.csv:1: q1: found twice"),
        ("pose,q1\n1,nan\n", r"q\.csv:2: q1: found 'nan', expected a finite number"),
        ("pose,q1\n1,1e999\n", r"q\.csv:2: q1: found '1e999', expected a finite number"),
        ("pose,q1\n1,\n", r"q\.csv:2: q1: found an empty cell"),
        ("pose,q1,fz\n1,2,\n", r"q\.csv:2: fz: found an empty cell"),
    ],
)
def test_a_table_that_cannot_be_read_is_refused_at_once(text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        made("1,1,2,3\n", text)
