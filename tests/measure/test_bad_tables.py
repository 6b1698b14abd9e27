"""Tables that cannot be used, each refused in one line that says where, what was found and what is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure import parse_measurements, read_measurements
from beamstiff.measure.columns import RESERVED
from beamstiff.robot.checks import TABLE_COLUMNS
from beamstiff.robot.description import Robot

# name: text, what the message must hold; the file is called table.csv
BAD: dict[str, tuple[str, list[str]]] = {
    # the file as a whole
    "only spaces": (" \n\n  \n", ["table.csv", "empty file"]),
    "only comments": ("# sigma_position: 1 mm\n", ["table.csv", "only comments", "expected a header"]),
    "only a header": ("# a\nq1,d2,dx\n", ["table.csv:2:", "header without rows"]),
    "no header": ("0.1,0.2,0.3\n0.1,0.2,0.3\n", ["table.csv:1:", "'0.1'", "names of the columns"]),
    # rows
    "short row": ("q1,d2,dx\n1,2,3\n1,2\n", ["table.csv:3:", "found 2 cells, expected 3"]),
    "long row": ("q1,d2,dx\n\n1,2,3\n1,2,3,4\n", ["table.csv:4:", "found 4 cells, expected 3"]),
    "decimal commas between commas": ("q1,d2,dx\n1,5,2,3\n", ["table.csv:2:", "decimal points"]),
    "another separator in a row": ("q1,d2,dx\n1;2;3\n", ["table.csv:2:", "comma, this row by a semicolon"]),
    "two separators in the header": ("q1;d2,dx\n1,2\n", ["table.csv:1:", "one separator throughout"]),
    "open quote": ('q1,d2,dx\n1,2,3\n1,"2,3\n', ["table.csv:3:", "quote that does not end"]),
    "quote over two lines": ('q1,d2,dx\n1,"2\n",3\n', ["table.csv:2:", "quote that does not end"]),
    # numbers
    "text in a number": (
        "q1,d2,fz,dx\n1,2,3,4\n1,2,heavy,4\n",
        ["table.csv:3: fz: found 'heavy', expected a number"],
    ),
    "a unit in a cell": ("q1,d2,dx\n1,2,3 mm\n", ["table.csv:2: dx: found '3 mm'", "in the header"]),
    "nan measured": (
        "q1,d2,dx\n1,2,nan\n",
        ["table.csv:2: dx: found 'nan'", "an empty cell where there is none"],
    ),
    "NA measured": ("q1,d2,dx\n1,2,NA\n", ["table.csv:2: dx: found 'NA'", "empty cell"]),
    "nan joint": ("q1,d2,dx\nnan,2,3\n", ["table.csv:2: q1: found 'nan', expected a finite number"]),
    "inf load": ("q1,d2,fx,dx\n1,2,inf,3\n", ["table.csv:2: fx: found 'inf', expected a finite number"]),
    "overflow": ("q1,d2,dx\n1,2,1e999\n", ["table.csv:2: dx: found '1e999', expected a finite number"]),
    "overflow by the unit": (
        "q1,d2,dx [km]\n1,2,1e307\n",
        ["table.csv:2: dx: found '1e307'", "finite in SI"],
    ),
    "underscore in a number": ("q1,d2,dx\n1_0,2,3\n", ["table.csv:2: q1: found '1_0', expected a number"]),
    "digits of another script": ("q1,d2,dx\n\u0661,2,3\n", ["table.csv:2: q1: found", "expected a number"]),
    "hexadecimal": ("q1,d2,dx\n0x10,2,3\n", ["table.csv:2: q1: found '0x10', expected a number"]),
    "two signs": ("q1,d2,dx\n--1,2,3\n", ["table.csv:2: q1: found '--1', expected a number"]),
    "spreadsheet error": ("q1,d2,dx\n1,2,#REF!\n", ["table.csv:2: dx: found '#REF!', expected a number"]),
    "empty joint": ("q1,d2,dx\n1,2,3\n,2,3\n", ["table.csv:3: q1: found an empty cell, expected a number"]),
    "empty load": ("q1,d2,mx,dx\n1,2,,3\n", ["table.csv:2: mx: found an empty cell, expected a number"]),
    "uppermost of several": ("q1,d2,dx\n1,2,x\ny,2,3\n", ["table.csv:2: dx: found 'x'"]),
    "decimal comma undeclared": ("q1;d2;dx\n1,5;2;3\n", ["table.csv:2: q1: found '1,5'", "# decimal: comma"]),
    "point under decimal comma": (
        "# decimal: comma\nq1;d2;dx\n1,5;2.5;3\n",
        ["table.csv:3: d2: found '2.5', expected a decimal comma"],
    ),
    "thousands": ("# decimal: comma\nq1;d2;dx\n1.000,5;2;3\n", ["table.csv:3: q1: found '1.000,5'"]),
    "timestamp": ("q1,d2,dx,t\n1,2,3,2024-01-01 12:00\n", ["table.csv:2: t: found '2024-01-01 12:00'"]),
    "temperature below zero kelvin": ("q1,d2,dx,temperature\n1,2,3,-300\n", ["temperature", "absolute zero"]),
    # columns
    "missing joint": ("q1,dx\n1,2\n", ["table.csv:1: d2: this column is missing", "(q1, d2)"]),
    "unknown column": ("q1,d2,dxx\n1,2,3\n", ["table.csv:1: 'dxx': unknown column (did you mean 'dx'?)"]),
    "unknown synonym": ("q1,d2,dx,time\n1,2,3,4\n", ["'time': unknown column (did you mean 't'?)"]),
    "upper case": ("q1,d2,DX\n1,2,3\n", ["'DX': unknown column (did you mean 'dx'?)"]),
    "upper case positions": ("q1,d2,X\n1,2,3\n", ["'X': unknown column (did you mean 'x'?)"]),
    "unit in parentheses": ("q1,d2,dx (mm)\n1,2,3\n", ["did you mean 'dx'?", "square brackets"]),
    "unit in the name": ("q1,d2,dx_mm\n1,2,3\n", ["'dx_mm': unknown column (did you mean 'dx'?)"]),
    "coupled joint": (
        "q1,d2,q3,dx\n1,2,3,4\n",
        ["table.csv:1: q3:", "follows others (= -q1)", "leave the column out"],
    ),
    "doubled column": ("q1,d2,dx [mm],fx,dx [m]\n1,2,3,4,5\n", ["dx: found twice, in columns 3 and 5"]),
    "empty name": (
        "q1,d2,dx,\n1,2,3,\n",
        ["table.csv:1: column 4: found ''", "expected a name and its unit"],
    ),
    "only a unit": ("q1,d2,[mm]\n1,2,3\n", ["table.csv:1: column 3: found '[mm]'"]),
    "broken bracket": ("q1,d2,dx [mm\n1,2,3\n", ["table.csv:1: column 3: found 'dx [mm'"]),
    "wrong dimension": ("q1 [mm],d2,dx\n1,2,3\n", ["table.csv:1: q1: found the unit 'mm'", "angle"]),
    "degrees for a length": ("q1,d2 [deg],dx\n1,2,3\n", ["table.csv:1: d2: found the unit 'deg'", "length"]),
    "stiffness for a force": (
        "q1,d2,fx [N/m],dx\n1,2,3,4\n",
        ["fx: found the unit 'N/m'", "force such as N"],
    ),
    "unknown unit": ("q1,d2,dx [mmm]\n1,2,3\n", ["table.csv:1: dx:", "'mmm'"]),
    "empty unit": ("q1,d2,dx []\n1,2,3\n", ["table.csv:1: dx:", "found the unit ''"]),
    "unit of a pose": ("q1,d2,dx,pose [mm]\n1,2,3,4\n", ["pose: found the unit 'mm', expected none"]),
    # what was measured
    "nothing measured": ("q1,d2,dx\n1,2,\n1,2,\n", ["table.csv:2:", "no measured value"]),
    "no measured column": ("q1,d2,fx\n1,2,3\n", ["table.csv:1:", "no measured column", "dx dy dz rx ry rz"]),
    "both kinds": ("q1,d2,x,dx\n1,2,3,4\n", ["table.csv:1: x: found beside dx", "not both"]),
    "both kinds, rotation": ("q1,d2,x,y,z,rx\n1,2,3,4,5,6\n", ["found beside rx", "not both"]),
    "KUKA A B C": (
        "q1,d2,x,y,z,A,B,C\n1,2,3,4,5,6,7,8\n",
        ["table.csv:1: A:", "KUKA", "# orientation: KUKA ABC"],
    ),
    "Euler angles as a b c": (
        "q1,d2,x,a [deg],b [deg],c [deg]\n1,2,3,170,5,-120\n",
        ["table.csv:2: a b c: found a rotation vector of 208 deg", "# orientation: KUKA ABC"],
    ),
    "part of a rotation": ("q1,d2,x,a,b\n1,2,3,4,5\n", ["a: found only a, b, expected all of a b c"]),
    "part of a rotation in a row": ("q1,d2,x,a,b,c\n1,2,3,,0,0\n", ["table.csv:2: a b c:", "all or none"]),
    "orientation without columns": (
        "# orientation: KUKA ABC\nq1,d2,dx\n1,2,3\n",
        ["table.csv:1: orientation:", "A B C"],
    ),
    "sigma of Euler angles": (
        "# orientation: KUKA ABC\nq1,d2,A,B,C,sigma_a\n1,2,0,0,0,1\n",
        ["table.csv:1: orientation:", "sigma_rotation"],
    ),
    # metadata
    "sigma of zero": (
        "# sigma_position: 0 mm\nq1,d2,dx\n1,2,3\n",
        ["table.csv:1: sigma_position: found '0 mm'", "positive"],
    ),
    "sigma below anything": (
        "# sigma_position: 1e-300 mm\nq1,d2,dx\n1,2,3\n",
        ["table.csv:1: sigma_position: found '1e-300 mm'", "positive", "at least 1e-12"],
    ),
    "sigma below zero": (
        "# sigma_rotation: -1 deg\nq1,d2,rx\n1,2,3\n",
        ["sigma_rotation: found '-1 deg'", "positive"],
    ),
    "sigma of the wrong unit": (
        "\n# sigma_position: 1 deg\nq1,d2,dx\n1,2,3\n",
        ["table.csv:2: sigma_position:", "'deg'"],
    ),
    "sigma as text": (
        "# sigma_position: small\nq1,d2,dx\n1,2,3\n",
        ["table.csv:1: sigma_position:", "'small'"],
    ),
    "sigma nan": ("# sigma_position: nan\nq1,d2,dx\n1,2,3\n", ["table.csv:1: sigma_position:", "'nan'"]),
    "sigma twice": (
        "# sigma_position: 1 mm\n# sigma_position: 2 mm\nq1,d2,dx\n1,2,3\n",
        ["table.csv:2: sigma_position: found again", "line 1"],
    ),
    "sigma misspelled": (
        "# sigma_postion: 1 mm\nq1,d2,dx\n1,2,3\n",
        ["unknown key (did you mean 'sigma_position'?)"],
    ),
    "sigma in another case": ("# Sigma Rotation: 1\nq1,d2,dx\n1,2,3\n", ["(did you mean 'sigma_rotation'?)"]),
    "sigma after the header": (
        "q1,d2,dx\n# sigma_position: 1 mm\n1,2,3\n",
        ["table.csv:2: sigma_position:", "after the header"],
    ),
    "row sigma of zero": ("q1,d2,dx,sigma_dx\n1,2,3,0\n", ["table.csv:2: sigma_dx: found '0'", "positive"]),
    "row sigma without its value": (
        "q1,d2,dx,sigma_dy\n1,2,3,1\n",
        ["sigma_dy: found without the column dy"],
    ),
    "unknown reading": (
        "# unloaded_reading: common\nq1,d2,dx\n1,2,3\n",
        ["unloaded_reading: found 'common', expected independent or shared"],
    ),
    "shared absolute": (
        "# unloaded_reading: shared\nq1,d2,x\n1,2,3\n",
        ["table.csv:1: unloaded_reading:", "absolute"],
    ),
    "unknown history": ("# history: continous\nq1,d2,dx\n1,2,3\n", ["(did you mean 'continuous'?)"]),
    "decimal comma between commas": (
        "# decimal: comma\nq1,d2,dx\n1,2,3\n",
        ["table.csv:1: decimal:", "semicolons"],
    ),
    # labels
    "unknown node": (
        "q1,d2,dx,point\n1,2,3,tip\n1,2,3,tipp\n",
        ["table.csv:3: point: found 'tipp'", "did you mean 'tip'?"],
    ),
    "unknown load point": (
        "q1,d2,dx,load_point\n1,2,3,zzz\n",
        ["table.csv:2: load_point: found 'zzz'", "root, elbow, tip"],
    ),
    "empty pose": ("q1,d2,dx,pose\n1,2,3,\n", ["table.csv:2: pose: found ''", "label"]),
    "half a pose": (
        "q1,d2,dx,pose\n1,2,3,1.5\n",
        ["table.csv:2: pose: found '1.5', expected a whole number"],
    ),
    "nan pose": ("q1,d2,dx,pose\n1,2,3,nan\n", ["table.csv:2: pose: found 'nan', expected a whole number"]),
    "half a step": (
        "q1,d2,dx,step\n1,2,3,1\n1,2,3,0.5\n",
        ["table.csv:3: step: found '0.5', expected a whole number"],
    ),
    "one id for two configurations": (
        "q1 [deg],d2,dx,pose\n10,2,3,7\n10,2,3,8\n20,2,3,7\n",
        ["table.csv:4: pose:", "q1 = 0.349066 in pose 7", "0.174533 as in line 2"],
    ),
}


@pytest.mark.parametrize(("text", "parts"), BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("line_end", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_is_refused_by_name_of_file_line_and_column(
    text: str, parts: list[str], line_end: str, arm: Robot
) -> None:
    with pytest.raises(BeamstiffError) as caught:
        parse_measurements(text.replace("\n", line_end), arm, "table.csv")
    message = str(caught.value)
    assert message.startswith("table.csv:")
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_there_are_as_many_kinds_as_promised() -> None:
    assert len(BAD) >= 40


def test_passive_variables_are_refused_with_a_hint(four_bar: Robot) -> None:
    with pytest.raises(BeamstiffError, match=r"t.csv:1: th2: .*passive.*loop closure.*leave the column out"):
        parse_measurements("q1,th2,dx\n1,2,3\n", four_bar, "t.csv")


@pytest.mark.parametrize("name", ["x", "fx", "rz", "t", "step", "load_point", "sigma_dx", "c"])
def test_a_robot_whose_variable_is_called_like_a_column_is_refused(name: str) -> None:
    with pytest.raises(BeamstiffError, match=rf"variables\[0\].*'{name}' is a column of its own.*rename"):
        Robot(
            name="gantry",
            variables=[{"name": name, "type": "prismatic"}],
            nodes=[{"name": "root"}],
            fixed=["root"],
            tcp="root",
        )


def test_robots_know_all_columns_of_tables() -> None:
    assert set(RESERVED) == TABLE_COLUMNS


FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "binary": (b"q1,d2,dx\n1,2,\x00\x01\n", "binary"),
    "UTF-16": ("q1,d2,dx\n1,2,3\n".encode("utf-16"), "UTF-16"),
    "Latin-1": ("# Prüfer: Ö\nq1,d2,dx\n1,2,3\n".encode("latin-1"), "UTF-8"),
}


@pytest.mark.parametrize(("data", "part"), FILES.values(), ids=FILES.keys())
def test_files_that_are_no_text_are_refused(data: bytes, part: str, arm: Robot, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(data)
    with pytest.raises(BeamstiffError, match=f"table.csv.*{part}"):
        read_measurements(path, arm)


def test_a_spreadsheet_is_refused_with_a_hint(arm: Robot, tmp_path: Path) -> None:
    path = tmp_path / "table.xlsx"
    path.write_bytes(b"PK\x03\x04\x00")
    with pytest.raises(BeamstiffError, match=r"table.xlsx: found a spreadsheet, expected CSV"):
        read_measurements(path, arm)


def test_a_missing_file_and_a_folder_are_refused(arm: Robot, tmp_path: Path) -> None:
    with pytest.raises(BeamstiffError, match=r"nowhere.csv: no such file"):
        read_measurements(tmp_path / "nowhere.csv", arm)
    with pytest.raises(BeamstiffError, match="folder"):
        read_measurements(tmp_path, arm)


def test_a_file_without_permission_is_refused(arm: Robot, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("q1,d2,dx\n1,2,3\n", encoding="utf-8")
    path.chmod(0)
    try:
        path.read_bytes()
    except PermissionError:
        with pytest.raises(BeamstiffError, match=r"table.csv: cannot be read"):
            read_measurements(path, arm)
    else:
        pytest.skip("this user may read everything")
