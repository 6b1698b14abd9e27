"""Bad input of every kind ends with 2, one line on stderr, nothing on stdout, and no file."""

from pathlib import Path

import pytest

from tests.cli.conftest import Refused, Run
from tests.malformed import BROKEN_ROBOTS, BROKEN_TABLES

IDENTIFY = ("identify", "crane.yaml", "crane.csv")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["stifness", "crane.yaml"], ["stifness", "stiffness", "--help"]),
        (["stiffness"], ["ROBOT", "beamstiff stiffness --help"]),
        (["deflect", "crane.yaml"], ["DATA"]),
        (["stiffness", "crane.yaml", "more.yaml"], ["more.yaml"]),
        (["stiffness", "crane.yaml", "--jsn", "a.json"], ["--jsn", "--json"]),
        (["stiffness", "crane.yaml", "--json"], ["--json"]),
        (["show", "crane.yaml", "--samples", "many"], ["--samples", "integer"]),
        (["show", "crane.yaml", "--samples", "0"], ["--samples: found 0", "1 to 100000"]),
        (["show", "crane.yaml", "--seed", "-1"], ["--seed: found -1", "0 or more"]),
        (["stiffness", "crane.yaml", "--q", "q1"], ["--q", "'q1'", "name=value"]),
        (["stiffness", "crane.yaml", "--q", ""], ["--q", "name=value"]),
        (["stiffness", "crane.yaml", "--q", "q1=1,"], ["--q", "name=value"]),
        (["stiffness", "crane.yaml", "--q", "q1=0,3"], ["--q", "'3'", "name=value"]),
        (["stiffness", "crane.yaml", "--q", "q1=10 deg,q1=0"], ["--q", "q1 is given twice"]),
        (["stiffness", "crane.yaml", "--q", "q2=0"], ["--q", "unknown joint variable 'q2'", "expected q1"]),
        (["stiffness", "kr240-2", "--q", "q11=0"], ["--q", "'q11'", "did you mean 'q1'"]),
        (["stiffness", "crane.yaml", "--q", "q1=10mm"], ["--q: q1", "'mm'", "angle"]),
        (["stiffness", "crane.yaml", "--q", "q1=ten"], ["--q: q1", "'ten'"]),
        (["stiffness", "crane.yaml", "--q", "q1=1e300"], ["--q: q1", "'1e300'", "an angle"]),
        (["stiffness", "crane.yaml", "--q", "q1=nan"], ["--q: q1", "nan"]),
        (["stiffness", "crane.yaml", "--q", "q1=1e999"], ["--q: q1", "1e999"]),
        (["stiffness", "ir663", "--q", "th3=0.3"], ["--q", "'th3'", "solved by loop closure"]),
        (["stiffness", "ir663", "--q", "q2=90deg"], ["four_bar", "cannot close"]),
        (["stiffness", "kr240-2", "--json", "-"], ["kr240-2", "singular compliance", "--q q1=...,q2=..."]),
        (
            ["stiffness", "kr240-2", "--preload", "--json", "-"],
            ["kr240-2", "singular compliance", "--q q1=...,q2=..."],
        ),
        (["stiffness", "ir663-screws", "--q", "r2=0"], ["slider_crank2", "cannot close"]),
        (["stiffness", "crane.yaml", "--wrench", "fz=1"], ["--wrench", "--preload"]),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "fz"], ["--wrench", "'fz'", "fz=-900N"]),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "f=1"], ["--wrench", "'f'", "fx, fy, fz, mx"]),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "mx=1N"], ["--wrench: mx", "'N'", "moment"]),
        (
            ["stiffness", "crane.yaml", "--preload", "--wrench", "fz=1,fz=2"],
            ["--wrench", "fz is given twice"],
        ),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "fx=nan"], ["--wrench: fx", "nan"]),
        (
            ["stiffness", "crane.yaml", "--preload", "--wrench", "fx=-9MN"],
            ["'crane' buckles", "J1.torsional"],
        ),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "fx=-1e300"], ["'crane' buckles"]),
        (["stiffness", "crane.yaml", "--preload", "--wrench", "fx=1e300"], ["out of range"]),
        (["stiffness", "ir666"], ["ir666", "did you mean 'ir663'"]),
        (["stiffness", "no.yaml"], ["no.yaml", "no such file"]),
        (["deflect", "crane.yaml", "no.csv"], ["no.csv", "no such file"]),
        (["stiffness", "."], [".", "folder"]),
        (["deflect", "crane.yaml", "."], [".", "folder"]),
        (["stiffness", "crane.csv"], ["crane.csv"]),
        (["deflect", "crane.yaml", "crane.yaml"], ["crane.yaml"]),
        (["stiffness", "a\0b.yaml"], ["b.yaml"]),
        ([*IDENTIFY, "--parameters", "J1.tosional"], ["'J1.tosional'", "did you mean 'J1.torsional'"]),
        ([*IDENTIFY, "--parameters", "J1.torsional,"], ["--parameters", "J1.torsional"]),
        ([*IDENTIFY, "--parameters", "J1.torsional,J1.torsional"], ["'J1.torsional'", "twice"]),
        ([*IDENTIFY, "--figure", "fit.jpeg"], ["fit.jpeg", "png, svg, pdf"]),
        ([*IDENTIFY, "--figure", "fit"], ["fit", "png, svg, pdf"]),
    ],
    ids=lambda value: " ".join(value).replace("\0", "NUL") if isinstance(value, list) else None,
)
def test_what_was_typed_is_refused(refused: Refused, arguments: list[str], says: list[str]) -> None:
    refused(arguments, says)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--json", "missing/out.json"], ["missing/out.json", "no folder"]),
        (["--json", "."], [".", "folder"]),
        (["--json", ""], ["folder"]),
        (["--json", "crane.csv/out.json"], ["crane.csv/out.json", "no folder"]),
        (["--json", "crane.yaml"], ["--json", "would overwrite the input"]),
        (["--json", "./sub/../crane.csv"], ["crane.csv"]),
        (["--json", "a" * 300], ["cannot be written"]),
        (["--json", "a\0b"], ["cannot be written"]),
        (["--out", "crane.yaml"], ["--out crane.yaml", "would overwrite the input"]),
        (["--out", "-"], ["--out", "expected the name of a file"]),
        (["--json", "same.txt", "--out", "same.txt"], ["same.txt", "would overwrite the output --json"]),
        (["--json", "good.json", "--out", "missing/out.yaml"], ["missing/out.yaml"]),
        (["--json", "good.json", "--figure", "missing/fit.png"], ["missing/fit.png"]),
        (["--html", "missing/out.html"], ["there is no folder"]),
        (["--html", "-"], ["--html: found -"]),
    ],
    ids=lambda value: " ".join(value).replace("\0", "NUL")[:40] if isinstance(value, list) else None,
)
def test_impossible_outputs_are_refused(refused: Refused, options: list[str], says: list[str]) -> None:
    refused([*IDENTIFY, *options], says)


@pytest.mark.parametrize(("old", "new", "says"), BROKEN_ROBOTS)
def test_a_broken_robot_is_refused(
    refused: Refused, folder: Path, old: str | None, new: str | bytes, says: list[str]
) -> None:
    text = (folder / "crane.yaml").read_text(encoding="utf-8")
    content = new if isinstance(new, bytes) else text.replace(str(old), new).encode()
    assert content != text.encode()
    (folder / "broken.yaml").write_bytes(content)
    for command in ("stiffness", "show"):
        refused(f"{command} broken.yaml --json a.json", says)


def test_beams_of_no_length_and_of_negative_sections_are_refused(refused: Refused, folder: Path) -> None:
    beam = (
        "beamstiff: 1\nname: beam\nmaterials: {steel: {E: 2.1e11, G: 8e10}}\n"
        "sections: {rod: {A: 1e-4, Iy: 1e-9, Iz: 1e-9, J: 2e-9}}\n"
        "nodes: [{name: a}, {name: b, at: [1, 0, 0]}]\n"
        "beams: [{name: rod1, nodes: [a, b], section: rod, material: steel}]\nfixed: [a]\ntcp: b\n"
    )
    for old, new, says in (
        ("[1, 0, 0]", "[0, 0, 0]", ["rod1", "length"]),
        ("Iy: 1e-9", "Iy: -1e-9", ["Iy", "-1e-09"]),
        ("A: 1e-4", "A: .nan", ["A", "nan"]),
        ("E: 2.1e11", "E: 0", ["E"]),
    ):
        (folder / "broken.yaml").write_text(beam.replace(old, new))
        refused("stiffness broken.yaml", ["broken.yaml" if new != "[0, 0, 0]" else "", *says])


@pytest.mark.parametrize(("content", "says"), BROKEN_TABLES)
def test_broken_tables_are_refused(refused: Refused, folder: Path, content: bytes, says: list[str]) -> None:
    (folder / "broken.csv").write_bytes(content)
    refused("identify crane.yaml broken.csv --json a.json --out a.yaml", says)


@pytest.mark.parametrize("command", ["identify", "diagnose", "deflect"])
def test_a_displacement_too_large_to_square_is_refused(refused: Refused, folder: Path, command: str) -> None:
    text = (folder / "crane.csv").read_text().replace("0,0,1000,0,1.5", "0,0,1000,-1e308,1.5")
    (folder / "broken.csv").write_text(text)
    says = "broken.csv:3: dx: found '-1e308', expected at most 1e+100 in SI"
    refused(f"{command} crane.yaml broken.csv", says)


@pytest.mark.parametrize("load", ["0", "1e-300"])
def test_loads_whose_square_is_0_are_none(refused: Refused, folder: Path, load: str, succeed: Run) -> None:
    (folder / "rows.csv").write_text(f"q1,fy,dy [mm]\n0,{load},1\n1,{load},1\n")
    assert "no row carries a load" in succeed("diagnose crane.yaml rows.csv").stderr
    refused("identify crane.yaml rows.csv", "without load")


def test_a_mechanism_is_refused_and_its_motion_named(refused: Refused, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text().replace('torsional: "1e6 N*m/rad"', "torsional: free")
    (folder / "loose.yaml").write_text(text.replace("identify: [J1.torsional]", ""))
    (folder / "loads.csv").write_text("q1,fy\n0,1000\n")
    for command in (["stiffness"], ["show"], ["deflect", "loads.csv"]):
        arguments = [command[0], "loose.yaml", *command[1:]]
        refused(arguments, ["'crane' is a mechanism", "(0.00, 1.00, 0.00)", "J1.torsional"])


def test_fewer_values_than_parameters_are_refused(refused: Refused, folder: Path) -> None:
    (folder / "short.csv").write_text("q1,fy,dy [mm]\n0,1000,1.5\n")
    arguments = ["identify", "crane.yaml", "short.csv", "--parameters", "J1.torsional,J1.radial"]
    refused(arguments, ["short.csv", "J1.radial"])


def test_as_many_values_as_parameters_need_a_stated_noise(run: Run, refused: Refused, folder: Path) -> None:
    table = "q1,fy,dy [mm]\n0,1000,1.5\n"
    (folder / "short.csv").write_text(table)
    counted = "1 measured component in 1 row for 1 parameter (J1.torsional) and the noise, which"
    refused("identify crane.yaml short.csv", [counted, "state the noise (# sigma_position: 0.03 mm)"])
    (folder / "short.csv").write_text("# sigma_position: 0.03 mm\n" + table)
    assert run("identify crane.yaml short.csv").exit_code == 0


def test_a_robot_without_a_drive_to_identify_is_refused_with_a_hint(refused: Refused, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text().replace("identify: [J1.torsional]", "")
    (folder / "plain.yaml").write_text(text.replace('torsional: "1e6 N*m/rad"', "torsional: rigid"))
    refused("identify plain.yaml crane.csv", ["identify", "such as J1.axial"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            "calibrate crane.yaml crane.csv --compliances --out x.yaml",
            "--compliances: expected NAME,..., found",
        ),
        ("identify crane.yaml crane.csv --out --json", "--out: expected FILE, found the option --json"),
        ("compare-runs crane.yaml crane.csv crane.csv --level --json -", "--level: expected P, found"),
        ("schema --json --quiet", "--json: expected FILE, found the option --quiet"),
    ],
)
def test_no_option_takes_the_next_one_for_its_value(refused: Refused, arguments: str, says: str) -> None:
    refused(arguments, says)


def test_values_may_be_negative(succeed: Run, refused: Refused) -> None:
    assert succeed("stiffness crane.yaml --q q1=-10deg --json -").stdout
    refused(
        "compare-runs crane.yaml crane.csv crane.csv --level -1", "--level: found -1.0, expected a number"
    )


@pytest.mark.parametrize("command", ["stiffness", "show"])
@pytest.mark.parametrize("length", ["1e160", "1e300"])
def test_numbers_that_overflow_are_refused(refused: Refused, folder: Path, command: str, length: str) -> None:
    (folder / "huge.yaml").write_text((folder / "crane.yaml").read_text().replace('"1 m"', length))
    refused(f"{command} huge.yaml --json a.json", "numbers out of range")


@pytest.mark.parametrize("command", ["deflect", "identify"])
def test_loads_and_displacements_too_large_are_refused(refused: Refused, folder: Path, command: str) -> None:
    (folder / "huge.csv").write_text("q1,fy,dy\n0,1e308,1e300\n0,1,1e300\n1,1e3,1\n")
    refused(f"{command} crane.yaml huge.csv --json a.json", "numbers out of range")
