"""What the reader makes of tables that can be used."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.description import Robot

TABLE = """\
# source: a bench, June
# sigma_position: 0.03 mm
# sigma_rotation: 0.002 deg
# sigma_load: 20 mN
q1 [deg],d2 [mm],fx,fz [kN],my [N*mm],dx [mm],dz [um],rx [deg],\
point,load_point,pose,step,t [min],temperature [K]
90,250,-5,1.5,2000,0.5,-30,0.1,tip,elbow,3,1,2,293.15
90,250,-5,1.5,2000,,-31,,,,3,2,,
"""


def test_header_units_become_si(arm: Robot) -> None:
    table = parse_measurements(TABLE, arm, "bench.csv")
    assert table.kind == "displacement"
    assert table.variables == ("q1", "d2")
    np.testing.assert_allclose(table.q, [[math.pi / 2, 0.25]] * 2, rtol=1e-15)
    np.testing.assert_allclose(table.wrench, [[-5, 0, 1500, 0, 2, 0]] * 2, rtol=1e-15)
    np.testing.assert_allclose(
        table.displacement,
        [
            [0.5e-3, np.nan, -30e-6, math.radians(0.1), np.nan, np.nan],
            [np.nan, np.nan, -31e-6, np.nan, np.nan, np.nan],
        ],
        rtol=1e-15,
    )
    assert np.isnan(table.position).all()
    assert np.isnan(table.rotation).all()
    np.testing.assert_allclose(table.time, [120, np.nan])
    np.testing.assert_allclose(table.temperature, [20, np.nan], atol=1e-9)
    np.testing.assert_array_equal(table.step, [1, 2])
    assert table.point.tolist() == ["tip", "tip"]
    assert table.load_point.tolist() == ["elbow", "tip"]
    assert table.pose.tolist() == [3, 3]
    assert table.rows.tolist() == [6, 7]
    assert table.place(1) == "bench.csv:7"


def test_metadata_is_kept_and_sigma_is_si(arm: Robot) -> None:
    table = parse_measurements(TABLE, arm, "bench.csv")
    assert table.metadata["source"] == "a bench, June"
    assert table.sigma_position == pytest.approx(3e-5, rel=1e-15)
    assert table.sigma_rotation == pytest.approx(math.radians(0.002), rel=1e-15)
    assert table.sigma_load == pytest.approx(0.02, rel=1e-15)
    np.testing.assert_allclose(table.sigma[0], [3e-5] * 3 + [math.radians(0.002)] * 3, rtol=1e-15)
    assert not table.shared_unloaded
    assert not table.continuous


def test_a_plain_number_is_si(arm: Robot) -> None:
    table = parse_measurements("# sigma_position: 2e-5\nq1,d2,fx,dx,rx,t\n0.5,0.25,10,0.001,0.002,3\n", arm)
    assert table.q.tolist() == [[0.5, 0.25]]
    assert table.displacement[0, [0, 3]].tolist() == [0.001, 0.002]
    assert (table.sigma_position, table.sigma_rotation) == (2e-5, None)
    assert table.time.tolist() == [3]


def test_millimetres_are_exact_decimals(arm: Robot) -> None:
    # 13 * 0.001 is 0.013000000000000001
    assert parse_measurements("q1,d2 [mm],dx\n0,13,0\n", arm).q[0, 1] == 0.013


@pytest.mark.parametrize("head", ["t", "time [s]", "Timestamp", "t [s]"])
def test_time_has_the_names_that_loggers_give_it(arm: Robot, head: str) -> None:
    assert parse_measurements(f"q1,d2,dx,{head}\n0,0,0,7\n", arm).time.tolist() == [7.0]


def test_declarations_of_reading_and_history(arm: Robot) -> None:
    table = parse_measurements("# unloaded_reading: shared\n# history: continuous\nq1,d2,dx\n0,0,0\n", arm)
    assert table.shared_unloaded
    assert table.continuous


def test_absolute_positions(arm: Robot) -> None:
    table = parse_measurements("q1,d2,x,z [mm],a [deg],b,c\n0,0,1,2000,90,0,0\n0,0,,,,,\n", arm)
    assert table.kind == "absolute"
    np.testing.assert_array_equal(table.position, [[1, np.nan, 2], [np.nan] * 3])
    np.testing.assert_allclose(table.rotation, [[math.pi / 2, 0, 0], [np.nan] * 3])
    assert np.isnan(table.displacement).all()
    assert table.measured_mask.tolist() == [[True, False, True, True, True, True], [False] * 6]


@pytest.mark.parametrize("names", ["A,B,C", "a,b,c"])
def test_declared_kuka_angles_are_z_y_x_euler_angles(names: str, arm: Robot) -> None:
    angles = np.random.default_rng(1).uniform(-170, 170, size=(50, 3))
    rows = "\n".join(f"0,0,1,{a!r},{b!r},{c!r}" for a, b, c in angles.tolist())
    header = ",".join(f"{name} [deg]" for name in names.split(","))
    table = parse_measurements(f"# orientation: KUKA ABC\nq1,d2,x,{header}\n{rows}\n", arm)
    expected = Rotation.from_euler("ZYX", angles, degrees=True)  # capitals: about the turned axes
    turned = (Rotation.from_rotvec(table.rotation).inv() * expected).magnitude()
    np.testing.assert_allclose(turned, 0, atol=1e-12)


@pytest.mark.parametrize(("said", "order"), [("Euler ZYZ", "ZYZ"), ("fixed XYZ", "xyz")])
def test_other_angles_may_be_declared(said: str, order: str, arm: Robot) -> None:
    table = parse_measurements(f"# orientation: {said}\nq1,d2,a [deg],b [deg],c [deg]\n0,0,20,-50,110\n", arm)
    expected = Rotation.from_euler(order, [20, -50, 110], degrees=True).as_rotvec()
    np.testing.assert_allclose(table.rotation, [expected], atol=1e-12)


def test_declared_rotation_vectors_may_be_called_a_b_c_and_turn_more_than_half(arm: Robot) -> None:
    table = parse_measurements("# orientation: rotation vector\nq1,d2,A,B,C\n0,0,4,0,0\n", arm)
    assert table.rotation.tolist() == [[4, 0, 0]]


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("q1,d2,dx\n0.5,0,0\n0.1,0,0\n0.5,-0,0\n0.5,1,0\n", [0, 1, 0, 2]),  # equal joints are one pose
        ("q1,d2,dx,pose\n0,0,0,P2\n1,0,0,P1\n0,0,0, P2\n2,0,0,7\n", [0, 1, 0, 2]),  # labels
        ("q1,d2,dx,pose\n0,0,0,7\n1,0,0,-2\n2,0,0,12.0\n", [7, -2, 12]),  # numbers are kept
        ("q1,d2,dx,pose\n0.5,0,0,1\n0.5001,0,0,1\n", [1, 1]),  # encoders read a little differently
    ],
)
def test_poses_are_numbered(text: str, pose: list[int], arm: Robot) -> None:
    assert parse_measurements(text, arm).pose.tolist() == pose


def test_a_row_may_have_its_own_sigma(arm: Robot) -> None:
    text = "# sigma_position: 0.03 mm\nq1,d2,dx,dy,rx,sigma_dx [mm]\n0,0,0,0,0,0.1\n0,0,0,0,0,\n"
    table = parse_measurements(text, arm)
    np.testing.assert_allclose(table.sigma[:, :2], [[1e-4, 3e-5], [3e-5, 3e-5]], rtol=1e-15)
    assert np.isnan(table.sigma[:, 3:]).all()


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffq1 [deg],d2,dx\n90,0,1\n",
        "q1 [deg],d2,dx\r\n90,0,1\r\n",
        "q1 [deg],d2,dx\r90,0,1\r",
        "q1 [deg];d2;dx\n90;0;1\n",
        "q1 [deg]\td2\tdx\n90\t0\t1\n",
        "# decimal: comma\nq1 [deg];d2;dx\n90,0;0;1\n",
        '"q1 [deg]","d2","dx"\n"90","0","1"\n',
        " q1[deg] , d2 , dx \n 90 , 0 , 1 \n",
        "\n\nq1 [deg],d2,dx\n\n90,0,1\n,,\n   \n",
        "q1 [deg],d2,dx\n# left out: 1,2,3\n90,0,1\n # the end",
        "q1 [deg],d2,dx\n+9.0e1,-0,1.\n",
        "# a line of words\n#\n##\nq1 [deg],d2,dx\n90,0,1",
    ],
)
def test_the_same_table_written_in_other_ways(text: str, arm: Robot) -> None:
    table = parse_measurements(text, arm)
    assert table.q.tolist() == [[math.pi / 2, 0]]
    assert table.displacement[0, 0] == 1


@pytest.mark.parametrize(
    ("text", "metadata"),
    [
        # quoted and padded by a spreadsheet
        ('# sigma_position: 0.03 mm,,,\n"# note: a, b",,,\n', {"sigma_position": "0.03 mm", "note": "a, b"}),
        ("# note: a\n# note: b\n", {"note": "a; b"}),  # of one name they are joined
    ],
)
def test_notes_before_the_header_are_kept(text: str, metadata: dict[str, str], arm: Robot) -> None:
    table = parse_measurements(f"{text}q1,d2,dx\n0,0,1\n", arm)
    assert table.metadata == metadata
    assert table.sigma_position == (pytest.approx(3e-5) if "sigma_position" in metadata else None)


def test_a_list_of_loads_can_be_read_where_nothing_need_be_measured(arm: Robot) -> None:
    for text in ("q1,d2,fx\n0,0,1\n", "q1,d2,fx,dx\n0,0,1,\n"):
        table = parse_measurements(text, arm, require_measured=False)
        assert not table.measured_mask.any()
        assert table.wrench[0, 0] == 1


def test_a_robot_without_joints_has_tables_too() -> None:
    post = Robot(
        name="post",
        nodes=[{"name": "root"}, {"name": "tip"}],
        rigids=[{"name": "post", "nodes": ["root", "tip"]}],
        fixed=["root"],
        tcp="tip",
    )
    table = parse_measurements("fx,dx [mm]\n1,2\n3,4\n", post)
    assert table.q.shape == (2, 0)
    assert table.pose.tolist() == [0, 0]


def test_a_file_is_named_as_it_was_given_and_line_numbers_count_what_is_skipped(
    arm: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xef\xbb\xbf\r\n# a: b\r\nq1,d2,dx\r\n\r\n0,0,1\r\n# no\r\n,,\r\n0,0,2\r\n")
    table = read_measurements(path, arm)
    assert table.source == str(path)
    assert [table.place(row) for row in (0, 1)] == [f"{path}:5", f"{path}:8"]


def test_thirty_thousand_rows_may_have_as_many_poses(arm: Robot) -> None:
    rows = "\n".join(f"{i * 1e-4!r},0.1,{-i},{i * 1e-9!r},0.001,,P{i}" for i in range(30_000))
    table = parse_measurements(f"q1,d2,fx,dx,dy,dz,pose\n{rows}\n", arm)
    assert len(table) == len(np.unique(table.pose)) == 30_000


def test_remarks_of_ones_own_are_passed_over(arm: Robot) -> None:
    plain = parse_measurements("q1,d2,dx\n0,0,1e-3\n", arm)
    told = parse_measurements("q1,remark,d2,dx\n0,tracker lost, 0,1e-3\n", arm)
    assert measurements_to_csv(told, arm) == measurements_to_csv(plain, arm)
    for name, part in (("comment", "did you mean 'remark'"), ("weather", "remark .for text of your own.")):
        with pytest.raises(BeamstiffError, match=part):
            parse_measurements(f"q1,d2,dx,{name}\n0,0,1e-3,x\n", arm)


def test_units_in_a_row_of_their_own_are_sent_to_the_header(arm: Robot) -> None:
    with pytest.raises(
        BeamstiffError, match=r":2: q1: found 'deg', expected a number: units stand in the header, q1 \[deg\]"
    ):
        parse_measurements("q1,d2,dx\ndeg,mm,mm\n90,0,1\n", arm)


def test_joints_of_another_robot_are_not_taken_for_other_columns(arm: Robot) -> None:
    for name in ("joint_a1", "A1"):
        with pytest.raises(BeamstiffError) as refused:
            parse_measurements(f"{name},d2,dx\n0,0,0\n", arm)
        assert "did you mean" not in str(refused.value)
    with pytest.raises(BeamstiffError, match="did you mean 'q1'"):
        parse_measurements("axis_q1,d2,dx\n0,0,0\n", arm)


def test_encoders_behind_gears_and_torques_are_read_in_their_units(arm: Robot) -> None:
    name = arm.actuated[0].name
    joints = ",".join(variable.name for variable in arm.actuated)
    zeros = ",".join("0" for _ in arm.actuated)
    text = f"{joints},{name}_link [deg],tau_{name} [kN*m],dz [mm]\n{zeros},90,1.2,-1\n{zeros},,,-1\n"
    table = parse_measurements(text, arm)
    assert table.link[0, 0] == pytest.approx(np.pi / 2)
    assert table.torque[0, 0] == 1200.0
    assert np.isnan(table.link[1]).all()
    again = parse_measurements(measurements_to_csv(table, arm), arm)
    np.testing.assert_array_equal(again.link, table.link)
    np.testing.assert_array_equal(again.torque, table.torque)
    assert {f"{name}_link", f"tau_{name}"} <= set(table.to_frame().columns)


def test_an_encoder_behind_no_gear_is_no_column(arm: Robot) -> None:
    with pytest.raises(BeamstiffError, match="unknown column"):
        parse_measurements("q99_link,dz\n0,1\n", arm)
