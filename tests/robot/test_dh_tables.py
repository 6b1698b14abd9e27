"""Tables of frames. Truth: products of the conventions' elementary motions, written with scipy."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff import Frame, Joint, JointStiffness, Node, Rigid, Robot, Variable, load_robot, robot_names
from beamstiff.errors import BeamstiffError
from beamstiff.robot.dh_output import robot_to_table
from beamstiff.robot.dh_tables import CONVENTIONS, parse_csv_table, parse_yaml_table
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.placement import (
    NEARLY_PARALLEL,
    elementary,
    frame_parameters,
    from_roll_pitch_yaw,
    roll_pitch_yaw,
    turned_to,
)
from beamstiff.se3 import Array, rotation_about, transform

# in the order in which they are multiplied
MOTIONS = {
    "classic": (("theta", "z"), ("d", "Z"), ("a", "X"), ("alpha", "x")),
    "modified": (("alpha", "x"), ("a", "X"), ("theta", "z"), ("d", "Z")),
    "khalil-kleinfinger": (
        ("gamma", "z"),
        ("b", "Z"),
        ("alpha", "x"),
        ("d", "X"),
        ("theta", "z"),
        ("r", "Z"),
    ),
}


def product(convention: str, rows: list[dict[str, float]]) -> Array:
    """Return the product of a table's motions, deg and mm."""
    result = np.eye(4)
    for row in rows:
        for key, axis in MOTIONS[convention]:
            step = np.eye(4)
            if axis.islower():
                step[:3, :3] = Rotation.from_euler(axis, row[key], degrees=True).as_matrix()
            else:
                step["XYZ".index(axis), 3] = row[key] * 1e-3
            result = result @ step
    return result


def tcp_pose(robot: Robot, q: dict[str, float]) -> Array:
    kinematics = compile_frames(robot)
    values = all_values(kinematics, np.array([[q[name] for name in kinematics.coupling.free]]))
    node = next(node for node in robot.nodes if node.name == robot.tcp)
    placed = forward(kinematics, values)[0, kinematics.frame_index[node.frame]]
    shift = np.eye(4)
    shift[:3, 3] = node.at
    return placed @ shift


numbers = st.sampled_from([0.0, 90.0, -90.0, 180.0, 350.5]) | st.integers(-3000, 3000).map(lambda k: k / 8)


@st.composite
def tables(draw: st.DrawFn) -> tuple[str, str, list[dict[str, float]], dict[str, float]]:
    """Draw a table: its convention, CSV text, rows of numbers at drawn joint values, and these (SI)."""
    convention = draw(st.sampled_from([*MOTIONS]))
    keys = [key for key, _ in MOTIONS[convention]]
    turning, sliding = "theta", "r" if convention == "khalil-kleinfinger" else "d"
    header = ",".join(f"{key} [{'deg' if axis.islower() else 'mm'}]" for key, axis in MOTIONS[convention])
    lines, rows, q = [f"# convention: {convention}", f"name,{header}"], [], {}
    for at in range(draw(st.integers(1, 5))):
        row = {key: draw(numbers) for key in keys}
        cells: dict[str, Any] = dict(row)
        kind = "theta" if at == 0 else draw(st.sampled_from(["theta", "slide", "fixed"]))
        if kind != "fixed":
            key = turning if kind == "theta" else sliding
            sign, name, value = draw(st.sampled_from(["", "-"])), f"q{at}", draw(numbers)
            cells[key] = f"{sign}{name} {'-' if row[key] < 0 else '+'} {abs(row[key])}"
            row[key] += -value if sign else value
            q[name] = np.radians(value) if kind == "theta" else value * 1e-3
        lines.append(",".join([f"f{at}", *(str(cells[key]) for key in keys)]))
        rows.append(row)
    return convention, "\n".join(lines), rows, q


@given(tables())
def test_a_table_means_its_motions(drawn: tuple[str, str, list[dict[str, float]], dict[str, float]]) -> None:
    convention, text, rows, q = drawn
    np.testing.assert_allclose(tcp_pose(parse_csv_table(text), q), product(convention, rows), atol=1e-11)


@given(tables(), st.sampled_from([*CONVENTIONS]))
def test_every_table_can_be_written_in_every_convention_without_loss(
    drawn: tuple[str, str, list[dict[str, float]], dict[str, float]], convention: str
) -> None:
    _, text, _, q = drawn
    robot = parse_csv_table(text)
    again = parse_csv_table(robot_to_table(robot, convention).text)
    np.testing.assert_allclose(tcp_pose(again, q), tcp_pose(robot, q), atol=1e-11)
    assert [v.name for v in again.variables] == [v.name for v in robot.variables]


def test_a_table_carries_what_gives_way_at_its_joints_and_says_what_it_leaves() -> None:
    arm = load_robot("kr500")
    made = robot_to_table(arm, "classic")
    again = parse_csv_table(made.text)
    assert [again.parameter(f"q{k}.torsional") for k in range(1, 7)] == [
        arm.parameter(f"J{k}.torsional") for k in range(1, 7)
    ]
    (note,) = (one for one in made.notes if "joints only" in one)
    assert note.endswith("not limits")
    freed = parse_csv_table(made.text.replace("479000.0", "free"))
    assert robot_to_table(freed, "classic").text.splitlines()[-1].endswith(",free")


def test_the_puma_560_in_both_dh_conventions_reaches_one_place() -> None:
    # Corke and Armstrong-Helouvry (1994): standard and modified tables of one arm, mm, deg
    standard = """# convention: classic
theta [deg],d [mm],a [mm],alpha [deg]
q1,0,0,90
q2,0,431.8,0
q3,150.05,20.3,-90
q4,431.8,0,90
q5,0,0,-90
q6,0,0,0
"""
    modified = """# convention: modified
alpha [deg],a [mm],theta [deg],d [mm]
0,0,q1,0
90,0,q2,0
0,431.8,q3,150.05
-90,20.3,q4,431.8
90,0,q5,0
-90,0,q6,0
"""
    q = {f"q{k}": 0.3 * k - 1 for k in range(1, 7)}
    one, other = parse_csv_table(standard), parse_csv_table(modified)
    np.testing.assert_allclose(tcp_pose(one, q), tcp_pose(other, q), atol=1e-14)
    assert robot_to_table(one, "modified").text.splitlines()[3:] == [
        f"f{k},{line}" for k, line in enumerate(modified.splitlines()[2:], start=1)
    ]
    assert robot_to_table(other, "classic").text.splitlines()[3:] == [
        f"f{k},{line}" for k, line in enumerate(standard.splitlines()[2:], start=1)
    ]


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize(
    "name",
    # the others have no joints, or some that slide or turn about x, which no table says
    [name for name in robot_names() if name not in ("cantilever", "delta", "gantry", "stewart", "tripod")],
)
def test_the_chain_of_a_robot_that_comes_along_reaches_its_tcp(name: str, convention: str) -> None:
    robot = load_robot(name)
    made = robot_to_table(robot, convention)
    again = parse_csv_table(made.text)
    names = compile_frames(robot).coupling.free
    q = {key: 0.1 + 0.2 * at for at, key in enumerate(names)}
    np.testing.assert_allclose(tcp_pose(again, q), tcp_pose(robot, q), atol=1e-12)
    assert any("loops" in note for note in made.notes) == bool(robot.loops)


def test_hayatis_beta_takes_a_row_without_a_joint() -> None:
    robot = Robot(
        name="parallel",
        variables=[Variable(name="q1", type="revolute"), Variable(name="q2", type="revolute")],
        frames=[
            Frame(name="f1", theta="q1", beta=0.01, r=0.3),
            Frame(name="f2", parent="f1", d=0.5, theta="q2"),
        ],
        nodes=[Node(name="n0"), Node(name="n1", frame="f1"), Node(name="n2", frame="f2", at=(0.1, 0.2, 0.3))],
        rigids=[Rigid(name="base", nodes=("n0", "n1"))],
        joints=[Joint(name="J2", nodes=("n1", "n2"), frame="f2", stiffness=JointStiffness())],
        fixed=["n0"],
        tcp="n2",
    )
    q = {"q1": 0.4, "q2": -0.9}
    for convention in CONVENTIONS:
        made = robot_to_table(robot, convention)
        np.testing.assert_allclose(tcp_pose(parse_csv_table(made.text), q), tcp_pose(robot, q), atol=1e-14)
        assert "hold no joint" in made.notes[0]


def test_yaml_rows_and_types_give_the_same_robot() -> None:
    one = parse_csv_table(
        "# name: arm\nsigma,alpha [deg],a [mm],theta [deg],d [mm],torsional [N*m/rad],axial [N/m]\n"
        "0,0,0,10,400,1e6,\n1,-90,50,0,100,,rigid\n2,0,0,0,20,,\n",
        "modified",
    )
    other = parse_yaml_table(
        """
convention: modified
name: arm
rows:
  - {theta: q1 + 10 deg, d: 400 mm, torsional: 1e6 N*m/rad}
  - {alpha: -90 deg, a: 50 mm, d: q2 + 100 mm, axial: rigid}
  - {d: 20 mm}
"""
    )
    assert one.joints == other.joints
    assert one.parameter("q1.torsional") == 1e6
    assert [v.type for v in one.variables] == ["revolute", "prismatic"]
    q = {"q1": 0.2, "q2": 0.3}
    np.testing.assert_allclose(tcp_pose(one, q), tcp_pose(other, q), atol=1e-15)


HEAD = "# convention: classic\n"
ROWS = "theta [deg],d [mm],a [mm],alpha [deg]\nq1,0,100,90\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ROWS, "convention is not said"),
        ("# convention: clasic\n" + ROWS, "did you mean 'classic'"),
        (HEAD + ROWS.replace("a [mm]", "a"), "a: its unit is missing, expected for instance a .mm"),
        (HEAD + ROWS.replace("a [mm]", "a [deg]"), "found the unit 'deg'"),
        (HEAD + ROWS.replace("a [mm]", "r [mm]"), "r: does not belong to classic"),
        (HEAD + ROWS.replace("a [mm]", "q [mm]"), "unknown column"),
        (HEAD + ROWS.replace("a [mm]", "d [mm]"), "found twice"),
        (HEAD + ROWS.replace("q1", "7"), "found no joint"),
        (HEAD + ROWS.replace("90", "q1"), "alpha: found 'q1'"),
        (HEAD + ROWS.replace("90", "nine"), "alpha: found 'nine'"),
        (HEAD + ROWS.replace("90", "90 90"), "expected a number, or a variable"),
        (HEAD + ROWS.replace("90", "nan"), "alpha"),
        (HEAD + ROWS.replace("q1", "nan"), "table.csv:3: theta: found 'nan', expected a finite number"),
        (HEAD + ROWS.replace("q1", "-Infinity"), "theta: found '-Infinity', expected a finite number"),
        (HEAD + ROWS.replace("q1", "q1 + 1e308"), "theta: found .* expected an angle of at most"),
        (HEAD + ROWS.replace("q1,0", "q1,q2"), "in theta and in d"),
        (HEAD + ROWS + "q1,0,0,0\n", "table.csv:4: q1 moves another row already"),
        (HEAD + "name," + ROWS.replace("q1", "base,q1"), "name: 'base' is taken"),
        (HEAD + ROWS + "q2,0,0\n", "found 3 cells, expected 4"),
        (HEAD + "theta [deg]\n", "found no rows"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message) as error:
        parse_csv_table(text, None, "table.csv")
    assert str(error.value).startswith("table.csv:")


def test_what_no_table_says_is_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"'fx': d moves .* expected joints about or along z"):
        robot_to_table(load_robot("gantry"), "classic")


def test_the_table_in_the_documentation_is_one() -> None:
    page = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```\n(# convention.*?)```", page, re.DOTALL)
    assert parse_csv_table(text).parameter("q3.torsional") == 8e5


@pytest.mark.parametrize("convention", ["classic", "modified"])
def test_masses_stand_in_the_frame_that_a_row_ends_in(convention: str) -> None:
    values = ((0.0, 450.0, 150.0, 90.0), (90.0, 20.0, 600.0, 30.0))
    rows = [dict(zip(("theta", "d", "a", "alpha"), row, strict=True)) for row in values]
    lines = [
        f"f{k},{row['theta']} + q{k},{row['d']},{row['a']},{row['alpha']},{10 * k},30,-20,{50 * k}"
        for k, row in enumerate(rows, start=1)
    ]
    header = "name,theta [deg],d [mm],a [mm],alpha [deg],mass [kg],cx [mm],cy [mm],cz [mm]"
    robot = parse_csv_table("\n".join([f"# convention: {convention}", header, *lines]))
    q = np.array([0.4, -0.7])
    kinematics = compile_frames(robot)
    placed = forward(kinematics, all_values(kinematics, q[None]))[0]
    assert [mass.mass for mass in robot.masses] == [10.0, 20.0]
    for count, mass in enumerate(robot.masses, start=1):
        node = next(node for node in robot.nodes if node.name == mass.node)
        frame = placed[kinematics.frame_index[node.frame]]
        at = frame[:3, :3] @ (np.array(node.at) + np.array(mass.at)) + frame[:3, 3]
        turned = [row | {"theta": row["theta"] + np.rad2deg(q[k])} for k, row in enumerate(rows[:count])]
        end = product(convention, turned)
        np.testing.assert_allclose(at, (end @ [0.03, -0.02, 0.05 * count, 1.0])[:3], atol=1e-12)


@pytest.mark.parametrize(("mass", "found"), [("-3", "-3 kg"), ("0", "0 kg"), ("heavy", "heavy")])
def test_a_mass_that_is_none_is_refused(mass: str, found: str) -> None:
    text = f"# convention: modified\ntheta [deg],a [mm],mass [kg],cx [mm]\nq1,100,{mass},5\n"
    with pytest.raises(BeamstiffError, match=f"mass: .*{found}"):
        parse_csv_table(text)


angles = st.floats(-7.0, 7.0) | st.sampled_from(
    [0.0, 1e-9, 1e-6, np.pi / 2, -np.pi / 2, np.pi, 3.14159, 1.5708]
)
lengths = st.floats(-3.0, 3.0) | st.just(0.0)
triples = st.tuples(angles, angles, angles)
points = st.tuples(lengths, lengths, lengths)


@given(triples, points)
@example((np.pi, 0.0, 0.0), (0.3, 0.2, 0.1))
@example((3.14159, 0.0, 0.0), (0.3, 0.2, 0.1))
@example((1e-7, 0.0, 0.4), (0.3, 0.2, 0.1))
@example((1e-7, 0.0, 0.4), (0.0, 0.0, 0.1))
def test_frames_of_a_transform_multiply_to_it(rpy: tuple[float, ...], xyz: tuple[float, ...]) -> None:
    # truth: scipy's rotation
    placed = transform(Rotation.from_euler("xyz", rpy).as_matrix(), np.array(xyz))
    parts = frame_parameters(placed)
    product = np.linalg.multi_dot([np.eye(4), np.eye(4), *map(elementary, parts)])
    assert np.abs(product - placed).max() < 1e-12
    assert len(parts) <= 2


@given(triples, points)
def test_one_frame_is_enough_unless_axes_are_parallel(rpy: tuple[float, ...], xyz: tuple[float, ...]) -> None:
    placed = transform(Rotation.from_euler("xyz", rpy).as_matrix(), np.array(xyz))
    lean = np.hypot(*placed[:2, 2])
    if len(frame_parameters(placed)) == 2:
        assert 0 < lean <= NEARLY_PARALLEL
    # and no parameter is far larger than the offset itself
    for part in frame_parameters(placed):
        assert all(abs(part.get(key, 0.0)) < 40 * max(np.linalg.norm(xyz), 1e-9) for key in ("b", "d", "r"))


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3), points)
def test_six_parameters_come_back_where_unique(turns: tuple[float, ...], shifts: tuple[float, ...]) -> None:
    given_ones = dict(zip(("gamma", "alpha", "theta", "b", "d", "r"), (*turns, *shifts), strict=True))
    if abs(np.sin(given_ones["alpha"])) <= NEARLY_PARALLEL:
        return
    (found,) = frame_parameters(elementary(given_ones))
    for key, value in given_ones.items():
        assert found.get(key, 0.0) == pytest.approx(value, abs=1e-12)


@given(triples)
def test_roll_pitch_yaw_come_back_as_the_same_rotation(rpy: tuple[float, ...]) -> None:
    rotation = Rotation.from_euler("xyz", rpy).as_matrix()
    np.testing.assert_allclose(from_roll_pitch_yaw(np.array(rpy), np.zeros(3))[:3, :3], rotation, atol=1e-14)
    again = from_roll_pitch_yaw(roll_pitch_yaw(rotation), np.zeros(3))[:3, :3]
    np.testing.assert_allclose(again, rotation, atol=1e-14)


@given(st.tuples(*[st.floats(-1, 1)] * 3))
@example((0.0, 0.0, -1.0))
@example((1e-9, 0.0, -1.0))
def test_z_is_carried_onto_the_axis_by_a_rotation(axis: tuple[float, ...]) -> None:
    if np.linalg.norm(axis) < 1e-3:
        return
    turn = turned_to(np.array(axis))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(turn[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-14)


def test_lengths_of_a_file_stay_the_decimals_that_they_are() -> None:
    """As origin xyz="0.2 0 0.12" with an axis along -x, which b, d and r are sums and products for."""
    turned = transform(rotation_about(1, np.asarray(np.pi / 2)), np.array([0.2, 0.0, 0.12]))
    (found,) = frame_parameters(turned)
    assert {repr(abs(value)) for name, value in found.items() if name in "bdr"} == {"0.12", "0.2"}
