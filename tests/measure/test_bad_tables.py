"""Tables that cannot be used, each refused in one line that says where, what was found and what is right."""

from pathlib import Path

import pytest
import yaml

from beamstiff.errors import BeamstiffError
from beamstiff.measure.columns import RESERVED
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.robot.checks import TABLE_COLUMNS
from beamstiff.robot.description import Robot

# name: text of table.csv and what the message must hold
BAD: dict[str, list[str]] = yaml.safe_load(Path(__file__).with_name("bad_tables.yaml").read_text("utf-8"))


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("line_end", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_is_refused_by_name_of_file_line_and_column(case: str, line_end: str, arm: Robot) -> None:
    text, *parts = BAD[case]
    with pytest.raises(BeamstiffError) as caught:
        parse_measurements(text.replace("\n", line_end), arm, "table.csv")
    message = str(caught.value)
    assert message.startswith("table.csv:")
    assert "\n" not in message
    for part in parts:
        assert part in message


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
