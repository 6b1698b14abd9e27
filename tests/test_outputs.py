"""Seals: every format is still itself, and any change shows."""

import json
import os
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

from beamstiff import load_robot, read_measurements
from beamstiff.errors import BeamstiffError
from beamstiff.maps.dataset import save_dataset
from beamstiff.outputs import LEDGER, check_distinct, check_replaceable, is_sealed, sealed, write_output
from beamstiff.report.figures import figure_bytes, new_figure
from beamstiff.robot.library import robot_path

ROBOT = robot_path("ir663").read_text(encoding="utf-8")
CSV = "# sigma_position: 0.01 mm\nq2 [deg],q8 [deg],fz,dz [mm]\n1,30,-900,-1\n"
FIGURES = {ending: figure_bytes(new_figure(1, 1), f"a.{ending}") for ending in ("png", "svg", "pdf")}
CONTENTS: dict[str, bytes] = {
    "a.json": b'{\n  "a": [1, 2]\n}\n',
    "empty.json": b"{}\n",
    "a.html": b"<!DOCTYPE html><html lang='en'><body>text</body></html>\n",
    "a.vtu": b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid"></VTKFile>\n',
    "a.yaml": f"# The head.\n{ROBOT}".encode(),
    "a.csv": CSV.encode(),
    **{f"a.{ending}": data for ending, data in FIGURES.items()},
}


@given(name=st.sampled_from(list(CONTENTS)), at=st.integers(0, 10**7), bit=st.integers(0, 7))
def test_any_change_of_a_single_bit_shows(
    tmp_path_factory: pytest.TempPathFactory, name: str, at: int, bit: int
) -> None:
    path = tmp_path_factory.mktemp("seal") / name
    data = bytearray(sealed(CONTENTS[name]))
    path.write_bytes(data)
    assert is_sealed(path)
    at %= len(data)
    data[at] ^= 1 << bit
    path.write_bytes(data)
    checksum = name == "a.png" and len(data) - 16 <= at < len(data) - 12  # a PNG's own: no reader passes it
    assert is_sealed(path) == checksum


@given(name=st.sampled_from(list(CONTENTS)), more=st.binary(min_size=1, max_size=5))
def test_nothing_can_be_added_or_cut_off(
    tmp_path_factory: pytest.TempPathFactory, name: str, more: bytes
) -> None:
    path = tmp_path_factory.mktemp("seal") / name
    data = sealed(CONTENTS[name])
    for other in (data + more, more + data, data[: -len(more)], CONTENTS[name], b""):
        path.write_bytes(other)
        assert not is_sealed(path)


def test_every_format_is_still_read(tmp_path: Path) -> None:
    for name, content in CONTENTS.items():
        write_output(tmp_path / name, content)
    told = json.loads((tmp_path / "a.json").read_text())
    assert told.pop("written_by").startswith("beamstiff-output sha256=")
    assert told == {"a": [1, 2]}
    assert list(json.loads((tmp_path / "empty.json").read_text())) == ["written_by"]
    for name in ("a.vtu", "a.svg"):
        assert ET.parse(tmp_path / name).getroot().tag.rpartition("}")[2] in ("VTKFile", "svg")
    assert load_robot(tmp_path / "a.yaml") == load_robot("ir663")
    assert (tmp_path / "a.yaml").read_text().startswith("# The head.\n")
    rows = read_measurements(tmp_path / "a.csv", load_robot("ir663"))
    assert (len(rows), rows.sigma_position, dict(rows.metadata)) == (1, 1e-5, {"sigma_position": "0.01 mm"})
    assert imread(tmp_path / "a.png").shape[:2] == (150, 150)
    assert (tmp_path / "a.pdf").read_bytes().rpartition(b"%%EOF\n")[2].startswith(b"%beamstiff-output")


def test_the_chunks_of_a_sealed_png_have_their_checksums() -> None:
    data, at, kinds = sealed(FIGURES["png"]), 8, []
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        body, check = data[at + 4 : at + 8 + length], data[at + 8 + length : at + 12 + length]
        assert zlib.crc32(body) == int.from_bytes(check, "big")
        kinds.append(body[:4])
        at += 12 + length
    assert kinds[-2:] == [b"tEXt", b"IEND"]


def test_what_shows_a_sealed_text_is_sealed_all_the_same(tmp_path: Path) -> None:
    shown = sealed(CSV).decode()
    write_output(tmp_path / "a.html", f"<html><pre>{shown}</pre></html>\n")
    write_output(tmp_path / "b.yaml", f"# head\nname: x\n{shown}")
    assert is_sealed(tmp_path / "a.html")
    assert is_sealed(tmp_path / "b.yaml")


def test_an_output_is_replaced_until_it_is_edited(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    write_output(path, CSV)
    write_output(path, CSV)
    path.write_text(path.read_text().replace("-1\n", "-1.2\n"))  # measured, and filled in
    with pytest.raises(BeamstiffError, match=r"plan.csv: exists, and is not as beamstiff wrote it"):
        write_output(path, CSV)
    assert path.read_text().endswith("-1.2\n")


@pytest.mark.parametrize("change", ["added", "edited", "removed"])
def test_a_folder_that_is_an_output_is_replaced_until_it_is_edited(tmp_path: Path, change: str) -> None:
    pytest.importorskip("zarr")
    xarray = pytest.importorskip("xarray")
    out, dataset = tmp_path / "map.zarr", xarray.Dataset({"a": ("x", [1.0, 2.0])})
    save_dataset(dataset, out)
    save_dataset(dataset, out)
    files = sorted(path for path in (out / "a").rglob("*") if path.is_file())
    if change == "added":
        (out / "mine.txt").write_text("mine")
    elif change == "edited":
        files[0].write_bytes(files[0].read_bytes() + b" ")
    else:
        files[-1].unlink()
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with pytest.raises(BeamstiffError, match="not as beamstiff wrote it"):
        save_dataset(dataset, out)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_an_empty_file_holds_nothing_to_lose(tmp_path: Path) -> None:
    path = tmp_path / "tmp.x1"
    path.touch()
    write_output(path, CSV)
    assert is_sealed(path)
    path.write_bytes(b"\n")
    with pytest.raises(BeamstiffError, match="not as beamstiff wrote it"):
        write_output(path, CSV)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_what_was_an_output_and_is_written_again_has_one_seal(end: str) -> None:
    once = sealed(f"# head{end}name: x{end}")
    again = sealed(b"# above" + end.encode() + once)
    assert again.count(b"beamstiff-output") == 1
    assert [line for line in again.decode().split(end) if "beamstiff-output" not in line] == [
        *("# above", "# head", "name: x", "")
    ]


def test_what_must_stay_byte_for_byte_is_known_by_the_ledger_beside_it(tmp_path: Path) -> None:
    path, program = tmp_path / "new.src", b"LIN {X 1,Y 2}\r\n"
    write_output(path, program, as_it_is=True)
    assert path.read_bytes() == program
    write_output(path, program.replace(b"1", b"3"), as_it_is=True)
    path.write_bytes(b"LIN {X 1.5,Y 2}\r\n")  # touched up at the robot
    with pytest.raises(BeamstiffError, match="not as beamstiff wrote it"):
        check_replaceable(path)
    path.unlink()
    (tmp_path / LEDGER).write_text("mine\n")
    with pytest.raises(BeamstiffError, match="beamstiff did not write it"):
        write_output(path, program, as_it_is=True)
    assert (tmp_path / LEDGER).read_text() == "mine\n"
    assert not path.exists()


def test_outputs_fall_neither_on_inputs_nor_on_each_other(tmp_path: Path) -> None:
    data = tmp_path / "data.csv"
    data.write_text("mine")
    (tmp_path / "soft").symlink_to(data)
    os.link(data, tmp_path / "hard")
    for other in ("data.csv", "soft", "hard", "./data.csv"):
        with pytest.raises(BeamstiffError, match=r"--out .*: would overwrite the input"):
            check_distinct([data], {"--out": tmp_path / other})
        with pytest.raises(BeamstiffError, match=r"--b .*: would overwrite the output --a"):
            check_distinct([], {"--a": data, "--b": tmp_path / other})
    with pytest.raises(BeamstiffError, match=r"--b .*: lies in the output --a"):
        check_distinct([], {"--a": tmp_path / "map.zarr", "--b": tmp_path / "map.zarr" / "a.json"})
    check_distinct([data], {"--a": "/dev/null", "--b": "/dev/null", "--c": tmp_path / "new"})
