"""Tables of other programs and of other robots, told from spelling mistakes; the profile that reads them."""

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.foreign_tables import guessed_profile, refuse_points
from beamstiff.measure.point_lists import parse_points
from beamstiff.measure.profiles import parse_profile
from beamstiff.measure.reader import parse_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import load_robot

EXPORT = "Point;J1 [deg];J2 [mm];X [mm];Y [mm];Z [mm];weight [kg]\nP1;90;5;1000;0;-2;30\n"
# what is known of the columns, by heart
IN_SI = ["P1", "tip", 1.5707963267948966, 0.005, 1.0, 0.0, -0.002, -294.1995]


def test_an_export_is_told_from_a_spelling_mistake_and_its_profile_reads_it(arm: Robot) -> None:
    with pytest.raises(BeamstiffError) as caught:
        parse_measurements(EXPORT, arm, "run.csv")
    said = str(caught.value)
    assert said.startswith("run.csv:1: unknown columns 'Point', 'J1 [deg]', 'J2 [mm]' and 4 more")
    assert "beamstiff convert run.csv --profile profile.yaml" in said
    assert "docs/files.md" in said
    guess = said[said.index(": {") + 2 :]
    assert "q1: " in guess
    assert "d2: " in guess  # the robot's own names, in its order
    text = guess.replace("NODE", "tip").replace("NOISE", "0.02")
    row = parse_points(EXPORT, parse_profile(text)).text.splitlines()[2].split(",")
    assert row[:2] == IN_SI[:2]
    assert [float(cell) for cell in row[2:]] == pytest.approx(IN_SI[2:], rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("separator", [";", "\t", ","])
def test_the_separator_does_not_matter_where_most_columns_are_unknown(arm: Robot, separator: str) -> None:
    with pytest.raises(BeamstiffError, match=r"--profile.*docs/files.md"):
        parse_measurements(EXPORT.replace(";", separator), arm, "run.csv")


def test_decimal_commas_are_part_of_the_guess_and_units_that_are_missing_are_asked_for() -> None:
    cells = [["1,5", "2,5", "3,5"]]
    guess = guessed_profile(["X", "Y", "Z"], ";", (), cells)
    assert "decimal: comma" in guess
    assert "length: UNIT" in guess
    assert guessed_profile(["X", "Y", "load"], ";") == ""  # no position


def test_forces_and_names_of_reflectors_are_part_of_the_guess_which_reads_the_table(arm: Robot) -> None:
    lines = ["No\tTarget\tJ1\tJ2\tX\tY\tZ\tLoad\tFx\tFy\tFz"]
    lines += [f"{at}\t{name}\t9{at}\t5\t1\t2\t3\t7\t-10.5\t20\t-30" for at, name in enumerate("BABA")]
    with pytest.raises(BeamstiffError) as caught:
        parse_measurements("\n".join(lines), arm, "run.csv")
    said = str(caught.value)
    assert "(NODE_... are the nodes at the reflectors; NOISE is what the instrument reads to" in said
    guess = said[said.index(": {") + 2 :]
    assert guess.endswith("points: {A: NODE_A, B: NODE_B}, sigma_position: NOISE mm}")
    text = guess.replace("joints: UNIT", "q1: deg, d2: mm").replace("length: UNIT", "length: m")
    with pytest.raises(BeamstiffError, match="sigma_position"):
        parse_profile(text.replace("UNIT", "N"))
    made = parse_points("\n".join(lines), parse_profile(text.replace("UNIT", "N").replace("NOISE", "0.02")))
    head, first = (line.split(",") for line in made.text.splitlines()[1:3])
    row = {name.partition(" ")[0]: cell for name, cell in zip(head, first, strict=True)}
    assert [row[name] for name in ("pose", "point", "fx", "fy", "fz")] == [
        "0",
        "NODE_B",
        "-10.5",
        "20.0",
        "-30.0",
    ]
    assert made.notes == ("not used, as `columns` of the profile does not name them: Load",)


@pytest.mark.parametrize(
    ("name", "texts", "points"),
    [
        ("Marker", "left lower,left lower", 'points: {"left lower": NODE_left_lower}'),
        ("Which", "A,B,A,B", "points: {A: NODE_A, B: NODE_B}"),
        ("Operator", "Ann,Ann", "point: NODE"),  # one value, and not called like a point
        ("Pose", "P1,P2,P1,P2", "point: NODE"),
        ("Target", "P1,P2,P3", "point: NODE"),  # as many names as rows
        ("Target", "1,2,1,2", "point: NODE"),
    ],
)
def test_a_column_of_few_texts_names_the_reflectors(name: str, texts: str, points: str) -> None:
    cells = [[text, "1", "2", "3"] for text in texts.split(",")]
    guess = guessed_profile([name, "X", "Y", "Z"], ";", (), cells)
    assert guess.endswith(f"{points}, sigma_position: NOISE mm}}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("q1;d2;X\n1;2;3\n", r"'X': unknown column \(did you mean 'x'\?\)"),
        ("q1 (deg);d2 (mm);x (mm)\n1;2;3\n", "unit stands in square brackets"),
        ("No;q1;d2;dx\n1;2;3;4\n", "'No': unknown column"),
    ],
)
def test_a_few_misspelled_columns_are_no_export(arm: Robot, text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        parse_measurements(text, arm, "t.csv")


def test_poses_of_a_motion_capture_get_a_profile_with_the_noise_of_both() -> None:
    text = "frame;time_s;J1;px;py;pz;qw;qx;qy;qz;load_kg\n1;2;3;4;5;6;1;0;0;0;5\n"
    guess = guessed_profile(text.splitlines()[0].split(";"), ";", ["q1"])
    assert "t: time_s, q1: J1, x: px, y: py, z: pz, qw: qw, qx: qx, qy: qy, qz: qz, fz: load_kg" in guess
    assert guess.endswith("sigma_position: NOISE mm, sigma_rotation: NOISE mrad}")
    with pytest.raises(BeamstiffError, match="an export of a controller"):
        parse_measurements(text, load_robot("kr500"), "run.csv")


def test_a_table_of_another_robot_is_called_that() -> None:
    robot = load_robot("ir663")
    text = "joint_1,joint_2,joint_3,x,y,z,fz\n0,0,0,0,0,0,0\n"
    with pytest.raises(BeamstiffError, match=r"t\.csv:1: found the joints joint_1.*none of robot 'ir663'"):
        parse_measurements(text, robot, "t.csv")
    with pytest.raises(BeamstiffError, match="'A1': unknown column"):  # as many joints: other names of them
        parse_measurements("A1,A2,x,y,z\n0,0,0,0,0\n", robot, "t.csv")


def test_where_a_robot_is_expected_points_and_measurements_are_called_what_they_are() -> None:
    with pytest.raises(BeamstiffError, match=r"run\.csv:1: unknown columns 'Point'.*--profile"):
        refuse_points(EXPORT, "run.csv")
    with pytest.raises(BeamstiffError, match=r"data\.csv:2: found a table of measurements, expected a robot"):
        refuse_points("# sigma_position: 1 mm\nq1,x,y,z\n0,0,0,0\n", "data.csv")
    refuse_points("# convention: classic\nname,theta [deg],d [mm],a [mm],alpha [deg]\n", "frames.csv")


@pytest.mark.parametrize(("joints", "first"), [((), "q1"), (("E1", "A1", "A2"), "A1")])
def test_a_rail_is_no_turning_joint_and_a_time_of_day_needs_no_unit(
    joints: tuple[str, ...], first: str
) -> None:
    header = ["Time", "E1 [mm]", "A1", "A2", "X", "Y", "Z"]
    guess = guessed_profile(header, ";", joints, [["08:03:20", "1", "2", "3", "4", "5", "6"]])
    assert f'columns: {{t: Time, E1: "E1 [mm]", {first}: A1, ' in guess
    assert "units: {time: s, E1: mm, joints: UNIT, length: UNIT}" in guess
