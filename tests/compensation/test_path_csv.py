"""Path tables: columns, units, conventions of orientation, and cells replaced in their place."""

import numpy as np
import pytest

from beamstiff.compensation.formats import path_csv
from beamstiff.errors import BeamstiffError


def test_units_loads_and_further_columns() -> None:
    text = "x [mm],y [cm],z,qw,qx,qy,qz,fz [kN],my [N*mm],depth [mm],note\n"
    text += "1000,50,0.25,0,0,1,0,-1.5,200,2,ok\n"
    path = path_csv.read(text, "a.csv").path
    np.testing.assert_allclose(path.poses[0, :3, 3], [1.0, 0.5, 0.25])
    np.testing.assert_allclose(path.poses[0, :3, 2], [0, 0, -1], atol=1e-15)
    assert path.wrench is not None
    np.testing.assert_allclose(path.wrench[0], [0, 0, -1500, 0, 0.2, 0])
    np.testing.assert_allclose(path.columns["depth"], [0.002])
    assert "note" not in path.columns


@pytest.mark.parametrize(
    ("declared", "sequence"),
    [("KUKA ABC", "ZYX"), ("Euler XYZ", "XYZ"), ("fixed XYZ", "xyz"), ("Euler ZYZ", "ZYZ")],
)
def test_a_declared_convention_is_that_of_scipy(declared: str, sequence: str) -> None:
    from scipy.spatial.transform import Rotation

    text = f"# orientation: {declared}\nx,y,z,a [deg],b [deg],c [deg]\n0,0,0,10,20,30\n"
    expected = Rotation.from_euler(sequence, [10, 20, 30], degrees=True).as_matrix()
    np.testing.assert_allclose(path_csv.read(text, "a.csv").path.poses[0, :3, :3], expected, atol=1e-15)


def test_without_a_declaration_a_b_c_are_a_rotation_vector() -> None:
    from scipy.spatial.transform import Rotation

    text = "x,y,z,a,b,c\n0,0,0,0.1,-0.2,0.3\n"
    expected = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    np.testing.assert_allclose(path_csv.read(text, "a.csv").path.poses[0, :3, :3], expected, atol=1e-15)


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_names_and_units_beyond_ascii(encoding: str) -> None:
    text = "# orientation: rotation vector\nname,x [mm],y,z,a [°],b,c,depth [µm]\nTür,1,2,3,90,0,0,50\n"
    program = path_csv.read(text.encode(encoding).decode("latin-1"), "a.csv")
    assert program.path.names == ("Tür",)
    np.testing.assert_allclose(program.path.columns["depth"], [5e-5])
    np.testing.assert_allclose(program.path.poses[0, :3, 1], [0, 0, 1], atol=1e-15)
    assert program.with_poses(program.path.poses) == text.encode(encoding)


def test_a_column_of_forces_that_is_no_load_is_told() -> None:
    text = "x [mm],y [mm],z [mm],{} [N],feed [mm]\n1,2,3,-900,5\n"
    (note,) = path_csv.read(text.format("gz"), "p.csv").notes
    assert note == "p.csv: gz: kept for the process, no load on the tool; loads are called fx fy fz mx my mz"
    assert path_csv.read(text.format("fz"), "p.csv").notes == ()


def test_temperatures_are_in_degrees_celsius() -> None:
    path = path_csv.read("x,y,z,room [degC],oil [K]\n1,2,3,21.5,300\n", "a.csv").path
    assert path.columns["room"] == [21.5]
    np.testing.assert_allclose(path.columns["oil"], [26.85])


def test_what_is_no_number_is_shown_as_people_wrote_it() -> None:
    text = "x,y,z\n1,drüben,3\n".encode().decode("latin-1")
    with pytest.raises(BeamstiffError, match=r"a.csv:2: y: found 'drüben', expected a number"):
        path_csv.read(text, "a.csv")


def test_positions_alone_are_known_to_be_so() -> None:
    path = path_csv.read("x,y,z\n1,2,3\n", "a.csv").path
    assert not path.stated
    assert not path.turns.any()


def test_a_table_written_is_read_again() -> None:
    text = 'name,x,y,z,a,b,c,fz,depth\n"a,b",1,2,3,0.1,0.2,0.3,-5,0.001\nc,1,2,3,0,0,0,-6,0.002\n'
    path = path_csv.read(text, "a.csv").path
    again = path_csv.read(path_csv.write(path, "test"), "a.csv").path
    assert again.names == path.names
    np.testing.assert_allclose(again.poses, path.poses, atol=1e-8)
    np.testing.assert_allclose(again.wrench, path.wrench)
    np.testing.assert_allclose(again.columns["depth"], path.columns["depth"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n1,2\n", "a.csv:1: z: this column is missing"),
        ("x,y,z,z\n1,2,3,4\n", "a.csv:1: z: found twice"),
        ("x [deg],y,z\n1,2,3\n", "a.csv:1: x: found the unit 'deg', expected a unit of length"),
        ("x,y,z,d [parsec]\n1,2,3,4\n", "a.csv:1: d: unknown unit 'parsec'"),
        ("1,2,3\n4,5,6\n", "a.csv:1: column 1: found '1', expected a name"),
        ("x,y,z\n1,2\n", "a.csv:2: found 2 cells, expected 3"),
        ("x,y,z\n1,2,3,4\n", "a.csv:2: found 4 cells, expected 3 .*decimal points"),
        ("x,y,z\n1,,3\n", "a.csv:2: y: found '', expected a number"),
        ("x;y;z\n1;2,5;3\n", "a.csv:2: y: found '2,5', expected a number; decimals follow a point"),
        ("x,y,z,a,b\n1,2,3,4,5\n", "a.csv:1: c: this column is missing, expected all of a b c"),
        ("x,y,z,a,b,c,i,j,k\n" + "0," * 8 + "1\n", "a.csv:1: i: found beside a, expected one orientation"),
        ("x,y,z,qw,qx,qy,qz\n1,2,3,1,1,0,0\n", "a.csv:2: row 1: found a quaternion of length 1.41421"),
        ("x,y,z,fz\n1,2,3,\n", "a.csv:2: fz: found '', expected a number"),
        (
            "# orientation: roll\nx,y,z,a,b,c\n1,2,3,0,0,0\n",
            "a.csv:1: orientation: found the orientation 'roll'",
        ),
        ("x,y,z\n", "a.csv: found no row"),
        ("x [mm],y,z\n1,2,3000\n", "a.csv:2: row 1: found a position 3e\\+03 m away"),
    ],
)
def test_a_broken_table_is_named(text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        path_csv.read(text, "a.csv")


@pytest.mark.parametrize(("header", "cells"), [("a,b,c", "173.87,0,46"), ("a [deg],b,c", "10,0,361")])
def test_angles_beyond_a_turn_are_degrees_that_nobody_declared(header: str, cells: str) -> None:
    with pytest.raises(BeamstiffError, match=r"p.csv:2: [ac]: found .*more than a turn.* \[deg\]"):
        path_csv.read(f"x [mm],y,z,{header}\n1,2,3,{cells}\n", "p.csv")
