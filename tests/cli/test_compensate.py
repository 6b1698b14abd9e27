"""`beamstiff compensate`: paths in, corrected paths out, whole or not at all."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff import load_robot
from beamstiff.cli.main import app
from beamstiff.robot.writer import robot_to_yaml
from tests.arms import on_rail
from tests.cli.conftest import FAR, PROGRAM, TAUGHT, Refused, Run

ROBOTS = Path(__file__).parents[2] / "robots"
RESULT = re.compile(r"RMS (\S+) mm, at most .* commands: (?:RMS |under )(\S+) mm")


def test_a_program_is_corrected_and_nothing_else_of_it_changes(cell: Path, succeed: Run) -> None:
    result = succeed("compensate kr500 cell.src --wrench fz=-900N,fx=300 --out new.src")
    old, new = PROGRAM.encode("latin-1").split(b"\r\n"), (cell / "new.src").read_bytes().split(b"\r\n")
    assert [a == b for a, b in zip(old, new, strict=True)] == [*[True] * 3, *[False] * 3, True, True]
    number = rb"[-+0-9.E]+"
    for a, b in zip(old[3:6], new[3:6], strict=True):
        assert re.sub(rb" *" + number, b"#", a) == re.sub(rb" *" + number, b"#", b)
    assert b"Z 9.00" in new[5]
    assert b"E+02" in new[5]
    before, after = map(float, RESULT.search(result.stdout).groups())
    assert before > 0.3
    assert "under 0.001 mm and 0.001 deg everywhere" in result.stdout
    assert after == 0.001
    assert "the path begins at q1 = " in result.stderr
    assert "axis values are left as they are: line 3" in result.stderr


def test_targets_beyond_what_the_real_robot_was_fitted_at_are_doubtful(cell: Path, succeed: Run) -> None:
    fitted = load_robot("kr500").with_fitted_rows([], {"q1": (0.5, 0.9)}, 2e-4)
    (cell / "real.yaml").write_text(robot_to_yaml(fitted), encoding="utf-8")
    said = " ".join(succeed("compensate kr500 cell.src --actual real.yaml --wrench fz=-900N").stdout.split())
    assert "expected after correction 0.20 mm, as the real robot's file left on held-out postures" in said
    assert "Doubtful: 3 of 3 targets are beyond the joint values that robot 'kr500' was fitted at (q1" in said
    assert "Next: Measure postures of this path" in said


@pytest.mark.usefixtures("cell")
def test_json_tells_every_target(told: Run) -> None:
    facts = told("compensate kr500 cell.src --wrench fz=-900N")
    assert facts["format"] == "beamstiff-compensation/1"
    assert facts["unreachable"] == []
    assert [target["line"] for target in facts["targets"]] == [4, 5, 6]
    assert facts["improvement"] > 0.99
    error = np.array([target["before"] for target in facts["targets"]])
    assert facts["before"]["max_mm"] == pytest.approx(1e3 * np.linalg.norm(error[:, :3], axis=1).max())
    assert facts["targets"][0]["wrench"] == [0, 0, -900, 0, 0, 0]


def test_a_target_out_of_reach_leaves_nothing_written(cell: Path, run: Run) -> None:
    figure = ("--figure", "p.png", "--html", "p.html")
    result = run("compensate kr500 far.src --out new.src --json r.json", *figure)
    assert result.exit_code == 2
    assert result.stderr.count("error:") == 1
    assert "far.src: 1 of 3 targets cannot be corrected: line 5, LIN 5 (out of reach by" in result.stderr
    assert not (cell / "new.src").exists()
    assert not (cell / "p.png").exists()
    assert not (cell / "p.html").exists()
    [lost] = json.loads((cell / "r.json").read_text())["unreachable"]
    assert (lost["line"], lost["name"]) == (5, "LIN 5")
    assert lost["reason"].startswith("out of reach by")


def test_targets_out_of_reach_can_be_left_as_they_are(cell: Path, succeed: Run) -> None:
    arguments = ("--wrench", "fz=-900N", "--unreachable", "keep", "--out", "new.src")
    result = succeed("compensate kr500 far.src", *arguments)
    old, new = FAR.encode("latin-1").split(b"\r\n"), (cell / "new.src").read_bytes().split(b"\r\n")
    assert [a == b for a, b in zip(old, new, strict=True)] == [*[True] * 3, False, True, False, True, True]
    assert "out of reach by" in result.stdout


def test_a_process_file_and_a_path_table(folder: Path, told: Run) -> None:
    (folder / "p.yaml").write_text("kind: cutting-table\nvariable: depth\nvalues: [0, 5 mm]\nfz: [0, -800]\n")
    (folder / "p.csv").write_text(
        "# orientation: KUKA ABC\nx [mm],y [mm],z [mm],a [deg],b [deg],c [deg],depth [mm],fx\n"
        "1500,0,900,0,110,0,1,50\n1500,100,900,0,110,0,5,50\n"
    )
    loads = [target["wrench"][:3] for target in told("compensate kr500 p.csv --process p.yaml")["targets"]]
    np.testing.assert_allclose(loads, [[50, 0, -160], [50, 0, -800]])


def test_a_resampled_path_is_a_table(cell: Path, succeed: Run, refused: Refused) -> None:
    load = ("--wrench", "fz=-900N")
    succeed("compensate kr500 cell.src", *load, "--resample", "step=50mm", "--out", "dense.csv")
    lines = (cell / "dense.csv").read_text().splitlines()
    assert lines[3].startswith("name,x [mm],y [mm],z [mm],a [deg]")
    assert len(lines) == 4 + 9
    # the corrected table holds commands: to run it again without load goes there
    refused(
        ["compensate", "kr500", "cell.src", *load, "--resample", "step=50mm", "--out", "dense.src"],
        "a resampled path is written as a table",
    )


def test_only_some_targets(cell: Path, succeed: Run, refused: Refused) -> None:
    point = "{X 1500,Y 0,Z 900,A 0,B 110,C 0}"
    text = f"DECL E6POS XP1={point}\nDECL E6POS XQ1={point}\n"
    (cell / "cell.dat").write_text(text)
    load = ("--wrench", "fz=-900N", "--quiet")
    succeed("compensate kr500 cell.dat", *load, "--only", "XP*", "--out", "n.dat")
    old, new = text.splitlines(), (cell / "n.dat").read_text().splitlines()
    assert [a == b for a, b in zip(old, new, strict=True)] == [False, True]
    refused("compensate kr500 cell.dat --only XR*", "found no target 'XR*'")


def test_a_path_without_load_and_weight_stays_as_it_is(cell: Path, succeed: Run) -> None:
    succeed("compensate kr500 cell.src --out new.src")
    assert (cell / "new.src").read_bytes() == PROGRAM.encode("latin-1")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.src"], "none.src: no such file"),
        (["cell.txt.gz"], "found the ending '.gz', expected one of"),
        (["cell.src", "--base", "x=1 N"], "--base: x: found the unit 'N', expected a unit of length"),
        (["cell.src", "--base", "u=1"], "--base: found 'u=1', expected parts such as x=1200mm"),
        (["cell.src", "--tool", "x=1,x=2"], "--tool: x is given twice"),
        (["cell.src", "--tool", "qw=2"], "--tool: found a quaternion of length 2"),
        (["cell.src", "--tool", "qw=1,a=2"], "--tool: found angles and a quaternion"),
        (["cell.src", "--wrench", "fz"], "--wrench: found 'fz', expected name=value"),
        (["cell.src", "--process", "no.yaml"], "no.yaml: no such file"),
        (["cell.src", "--resample", "5mm"], "--resample: found '5mm', expected step=5mm"),
        (["cell.src", "--resample", "step=0"], "--resample: step: found '0', expected more than 0"),
        (["cell.src", "--resample", "step=1mm,step=2mm"], "--resample: step is given twice"),
        (["cell.src", "--unreachable", "drop"], "--unreachable: found 'drop', expected refuse, keep"),
        (["cell.src", "--out", "cell.src"], "--out cell.src: would overwrite the input cell.src"),
        (["cell.src", "--out", "o.csv"], "--out o.csv: found the ending .csv, expected .src as of cell.src"),
        (["cell.src", "--figure", "p.gif"], "p.gif: found the ending 'gif', expected a figure"),
        (["cell.src", "--q", "q9=1"], "--q: unknown joint variable 'q9'"),
        (["cell.src", "--q", "q1=200deg"], "--q: q1: found 200 deg, expected one within -185 deg to 185 deg"),
        (["cell.src", "--q", "q1=9000deg"], "--q: q1: found 9000 deg, expected one within -185 deg to"),
        (["cell.src", "--stream", "--q", "q1=-3.3"], "--q: q1: found -189.076 deg, expected one within"),
        (["broken.src"], "broken.src:2: LIN: Y: found 'abc', expected a number"),
        (["cell.src", "--base-taught", "x=0"], "--base-taught: found 1 point, expected three: the origin, a"),
        (["cell.src", "--base-taught", "a=0"], "--base-taught: found 'a=0', expected coordinates such as"),
        (["cell.src", "--base-taught", "x=1deg"], "--base-taught: x: found the unit 'deg', expected a unit"),
        (["cell.src", *TAUGHT, "--base-taught", "z=1"], "--base-taught: found 4 points, expected three"),
        (["cell.src", *TAUGHT, "--taught"], "--base-taught: found together with taught, expected one of"),
        (["cell.src", *TAUGHT, "--stream"], "--stream: answers lines, and goes with no --out, page,"),
        (
            ["cell.src", *TAUGHT[:4], "--base-taught", "x=9,y=-0.2,z=0.9"],
            "--base-taught: found three points on one line",
        ),
    ],
)
def test_bad_input_is_one_line(cell: Path, refused: Refused, arguments: list[str], message: str) -> None:
    (cell / "broken.src").write_text("DEF a()\nLIN {X 1,Y abc,Z 3,A 0,B 0,C 0}\n")
    (cell / "cell.txt.gz").write_text("x")
    refused(["compensate", "kr500", *arguments], message)


TABLE = """\
x [mm],y [mm],z [mm],a [deg],b [deg],c [deg],fz [N]
1500,-200,900,0,110,0,-900
1500,200,900,0,110,0,-900
"""
PLAY = (
    "masses: [{node: n6b, mass: 200 kg}]\n"
    "effects: [{effect: backlash, component: q3, shape: 'flank within 0.03, asymmetric', "
    "parameters: {width_up: 1.5e-4, width_down: 1e-4}, scales: {torque: 2000}}]\n"
)


def test_what_displacements_cannot_fix_is_not_promised(cell: Path, run: Run) -> None:
    """An effect that moves the unloaded tool too was found from differences, in which that drops out."""
    (cell / "play.yaml").write_text(robot_to_yaml(load_robot("kr500")) + PLAY)
    (cell / "path.csv").write_text("# orientation: KUKA ABC\n" + TABLE)
    result = run("compensate kr500 path.csv --actual play.yaml")
    told = re.search(
        r"note: part of the correction assumes that backlash:q3 moves the unloaded tool too "
        r"\(width_up (\S+) mm\): its file does not say from which readings it was found; "
        "displacements, loaded minus unloaded, cannot confirm",
        result.stderr,
    )
    assert told is not None, result.stderr  # the torque is far from zero: none of the other side
    (cell / "twice.yaml").write_text(robot_to_yaml(load_robot("kr500")) + PLAY.replace("1.5e-4", "3e-4"))
    twice = run("compensate kr500 path.csv --actual twice.yaml").stderr
    again = re.search(r"\(width_up (\S+) mm\)", twice)
    assert again is not None, twice
    assert float(again[1]) == pytest.approx(2 * float(told[1]), rel=0.06)  # two digits each
    assert "% less, if the real robot is as assumed)" in " ".join(result.stdout.split())
    assert "unloaded tool" not in run("compensate kr500 path.csv --actual play.yaml --taught").stderr
    assert "unloaded tool" not in run("compensate kr500 path.csv").stderr


def test_what_goes_with_the_load_is_fixed_by_displacements(cell: Path, succeed: Run) -> None:
    """A pedestal that tilts under the weight is seen tilting under the load."""
    tilting = PLAY[: PLAY.index("effects")] + (
        "effects: [{effect: base-compliance, shape: tilt, parameters: {tilting_compliance: 8e-8}}]\n"
    )
    (cell / "soft.yaml").write_text(robot_to_yaml(load_robot("kr500")) + tilting)
    (cell / "path.csv").write_text("# orientation: KUKA ABC\n" + TABLE)
    result = succeed("compensate kr500 path.csv --actual soft.yaml")
    assert "the robot's effects are included: base-compliance" in result.stderr
    misread = tilting.replace(
        "}}]",
        "}}, {effect: load-error, shape: 'gain, and a share that does not grow', parameters: {gain: -0.3}, "
        "std: {gain: 0.08}, scales: {force: 900}}]",
    )
    (cell / "misread.yaml").write_text(robot_to_yaml(load_robot("kr500")) + misread)
    said = succeed("compensate kr500 cell.src --actual misread.yaml").stderr
    assert "state the load that really acts: 0.7 ± 0.08 N for each N in the measured table" in said
    (cell / "misread.yaml").write_text(
        robot_to_yaml(load_robot("kr500"))
        + misread.replace("gain: -0.3", "gain: -0.3, tare_along_the_load: 73")
    )
    said = succeed("compensate kr500 cell.src --actual misread.yaml").stderr
    assert "the load that really acts: 0.7 N for each N in the measured table, and +73 N" in said
    assert "unloaded tool" not in result.stderr


def test_a_rigid_robot_is_said_to_be_one_and_rounding_is_nothing(folder: Path, succeed: Run) -> None:
    text = (folder / "crane.yaml").read_text().replace("identify: [J1.torsional]\n", "")
    (folder / "rigid.yaml").write_text(re.sub('"[0-9]e6 N.*?"', "rigid", text))
    (folder / "path.csv").write_text("x,y,z\n1,0,0\n0.8,0.6,0\n")
    result = succeed("compensate rigid.yaml path.csv")
    assert "note: robot 'crane' is rigid: weight and load move nothing" in result.stderr
    assert "RMS 0 mm, at most 0 mm" in result.stdout
    assert "e-1" not in result.stdout


def test_degrees_without_a_declaration_are_refused_and_radians_are_a_rotation_vector(
    cell: Path, run: Run, refused: Refused
) -> None:
    (cell / "path.csv").write_text(TABLE)
    refused("compensate kr500 path.csv", ["path.csv:1: a, b, c in degrees", "# orientation: KUKA ABC"])
    for head in ("# orientation: rotation vector\n", "# orientation: KUKA ABC\n"):
        (cell / "path.csv").write_text(head + TABLE)
        assert "rotation vectors" not in run("compensate kr500 path.csv").stderr
    (cell / "path.csv").write_text("x,y,z,a,b,c\n1.8,0,1.7,0.1,1.9,0.1\n")
    assert "note: path.csv: a, b, c are read as rotation vectors" in run("compensate kr500 path.csv").stderr


def test_how_far_a_command_turns_is_told_beside_how_far_it_moves(cell: Path, run: Run) -> None:
    """At B = 90 deg the angles of a command jump though it turns by a tenth of a degree."""
    (cell / "steep.src").write_text(PROGRAM.replace("B 110", "B 90"))
    result = run("compensate kr500 steep.src --wrench fz=-900N --json said.json")
    facts = json.loads((cell / "said.json").read_text())
    heads = [
        line.split() for line in result.stdout.splitlines() if line.split()[-1:] in (["turned,"], ["deg"])
    ]
    assert [(*line[:1], *line[-2:]) for line in heads] == [
        ("force,", "moved,", "turned,"),
        ("target", "mm", "deg"),
    ]
    assert 0 < facts["before"]["max_deg"] < 0.5
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith("LIN")]
    assert [float(row[-1]) for row in rows] == pytest.approx([float(row[5]) for row in rows], abs=0.01)


MEAN_OF_SHAPES = """
effects:
  - {effect: bearing-tilt, component: q2, shape: tilt, parameters: {tilting_compliance: 1.2e-7 rad/(N*m)}}
  - {effect: bearing-tilt, component: q2, shape: tilt and radial,
     parameters: {tilting_compliance: 2e-8 rad/(N*m), radial_compliance: -1e-12 m/N}}
"""


def test_a_real_robot_whose_effect_is_a_mean_of_shapes_is_taken(succeed: Run, cell: Path) -> None:
    """Of several shapes of one effect only the sum has a sign: noise may leave a part slightly negative."""
    (cell / "real.yaml").write_text((ROBOTS / "kr500.yaml").read_text() + MEAN_OF_SHAPES)
    arguments = ("--wrench", "fz=-900N", "--actual", "real.yaml")
    result = succeed("compensate kr500 cell.src", *arguments, "--out", "new.src")
    before, after = map(float, RESULT.search(result.stdout).groups())
    assert after < 0.01 * before


def test_status_and_turn_choose_between_the_arms_of_one_target(folder: Path, succeed: Run, told: Run) -> None:
    sags = {}
    for status, turn in ((0, 37), (2, 11), (6, 59)):
        text = f"PTP {{X 2500,Y 100,Z 1700,A 0,B 90,C 10,S {status},T {turn}}}\n"
        (folder / "a.src").write_text(text)
        [found] = told("compensate kr500 a.src --wrench fz=-900N")["targets"]
        q = [found["q"][f"q{axis}"] for axis in range(1, 7)]
        assert [q[2] > 0, q[4] < 0] == [bool(status & 2), bool(status & 4)]
        assert [q[axis] < 0 for axis in (0, 3, 5)] == [bool(turn >> axis & 1) for axis in (0, 3, 5)]
        sags[status] = 1e3 * np.linalg.norm(found["before"][:3])
    assert abs(sags[0] - sags[2]) > 0.02  # elbow up or down
    assert abs(sags[2] - sags[6]) < 1e-6  # a wrist turned over has its axes where they were
    other = succeed("compensate kr500 a.src --q q2=12deg,q3=-80deg,q5=60deg")
    assert "q chooses the posture: S 6, T 59 and the like in the program are not followed" in other.stderr


def test_a_frame_that_the_program_does_not_hold_is_asked_for(cell: Path, refused: Refused) -> None:
    text = PROGRAM.replace("{FRAME: X 0,Y 0,Z 0,A 0,B 0,C 0}", "BASE_DATA[2]")
    (cell / "cell.src").write_bytes(text.encode("latin-1"))
    refused(
        "compensate kr500 cell.src --out new.src",
        "--base: is needed: cell.src:2 has $BASE = BASE_DATA[2], whose place",
    )
    assert not (cell / "new.src").exists()


def test_a_stream_of_forces_is_answered_line_by_line(folder: Path) -> None:
    (folder / "a.src").write_text("PTP {X 2500,Y 100,Z 1700,A 0,B 90,C 10,S 2}\n")
    lines = "target PTP 1 0 0 -900 0 0 0\ntarget PTP 1 0 0 0 0 0 0\nquit\n"
    result = CliRunner().invoke(app, ["compensate", "kr500", str(folder / "a.src"), "--stream"], input=lines)
    assert result.exit_code == 0
    ready, loaded, free = result.stdout.splitlines()
    assert ready == "ready beamstiff-stream/1 1 6"
    up = [float(line.split()[3]) for line in (loaded, free)]
    assert 5e-4 < up[0] - up[1] < 2e-3
    assert loaded.endswith("warm corrected")


def test_standard_deviations_come_from_identify(folder: Path, refused: Refused, told: Run) -> None:
    (folder / "a.src").write_text("PTP {X 2500,Y 100,Z 1700,A 0,B 90,C 10,S 2}\n")
    facts = {"parameters": {"J2.torsional": {"value": 1e6, "std": 2e6}, "J3.torsional": {"std": None}}}
    (folder / "i.json").write_text(json.dumps(facts))
    load = ("--wrench", "fz=-900N", "--std", "i.json")
    [found] = told("compensate kr500 a.src", *load, "--leave-doubtful")["targets"]
    assert found["std"][2] > 0
    # where nothing states one there is none: 0 would be certainty
    [silent] = told("compensate kr500 a.src --wrench fz=-900N --leave-doubtful")["targets"]
    assert silent["std"] is None
    (folder / "i.json").write_text("[]")
    refused(["compensate", "kr500", "a.src", *load], "--std: i.json: found no parameters with a std")


def test_what_comes_from_start_values_is_said(folder: Path, succeed: Run) -> None:
    """No load of the table tilts the crane: its tilting stiffness is a start value, until one does."""
    (folder / "path.csv").write_text("x,y,z,fz\n1,0,0,1000\n0.8,0.6,0,400\n")
    fit = ("--parameters", "J1.torsional,J1.tilting")
    succeed("identify crane.yaml crane.csv", *fit, "--out", "found.yaml")
    assert "unmeasured: [J1.tilting]" in (folder / "found.yaml").read_text()
    result = succeed("compensate crane.yaml path.csv --actual found.yaml")
    # an arm of 1 m under 1000 N: F L^2 / k = 1000 N * 1 m^2 / 8e6 N m/rad
    expected = "note: up to 0.12 mm of the predicted error (at row 1) comes from start values"
    assert expected in result.stderr
    assert "no measurement determined J1.tilting of robot 'crane'" in result.stderr
    again = succeed("compensate crane.yaml path.csv --actual found.yaml --taught")
    assert expected in again.stderr  # all of it is the load's: the crane has no weight
    lift = "# sigma_position: 0.01 mm\nq1 [deg],fz,dz [mm]\n0,1000,0.3\n90,500,0.15\n"
    (folder / "lift.csv").write_text(lift)
    succeed("identify found.yaml lift.csv --parameters J1.tilting --out lifted.yaml")
    assert "start values" not in succeed("compensate crane.yaml path.csv --actual lifted.yaml").stderr


def test_a_measured_run_teaches_the_process(cell: Path, succeed: Run, refused: Refused) -> None:
    table = "kind: cutting-table\nvariable: way\nvalues: [0, 1]\nfx: [400, 300]\nfz: [-900, -900]\n"
    (cell / "p.yaml").write_text(table)
    before = json.loads(succeed("compensate kr500 cell.src --process p.yaml --json -").stdout)
    # the run went half as far again as the process says
    targets = np.array([[1.5, y, 0.9] for y in (-0.2, 0.0, 0.2)])
    weight = json.loads(succeed("compensate kr500 cell.src --json -").stdout)
    sag, loaded = (np.array([one["before"][:3] for one in facts["targets"]]) for facts in (weight, before))
    seen = targets + sag + 1.5 * (loaded - sag)
    rows = "".join(f"{x:.9f},{y:.9f},{z:.9f}\n" for x, y, z in seen)
    (cell / "run.csv").write_text("# sigma_position: 1e-6\nx,y,z\n" + rows)
    learned = ("--process", "p.yaml", "--measured", "run.csv", "--out", "new.src", "--learned", "q.yaml")
    result = succeed("compensate kr500 cell.src", *learned, "--json", "l.json")
    facts = json.loads((cell / "l.json").read_text())
    size = facts["learned"]["parameters"]["process stiffness"]
    assert abs(size["value"] - 1.5) < 0.01
    assert size["identifiable"]
    assert facts["before"]["rms_mm"] == pytest.approx(
        1e3 * np.sqrt(((seen - targets) ** 2).sum(1).mean()), rel=0.01
    )
    assert "Process, from the measured runs" in result.stdout
    # the process of the file is the one that was learned: with it the same program comes out
    succeed("compensate kr500 cell.src --process q.yaml --out by_file.src")
    programs = [(cell / name).read_bytes().decode("latin-1") for name in ("by_file.src", "new.src")]
    texts = [re.sub(r"-?\d+\.\d+", "", text) for text in programs]
    numbers = [np.array(re.findall(r"-?\d+\.\d+", text), dtype=float) for text in programs]
    assert texts[0] == texts[1]
    np.testing.assert_allclose(*numbers, atol=2e-3)  # mm and deg: the file rounds to its standard deviation
    assert re.search(r"# process stiffness: 1\.(49|5)", (cell / "q.yaml").read_text())
    refused("compensate kr500 cell.src --learned q.yaml", "--learned: found no measured run")
    refused(
        "compensate kr500 cell.src --ran cell.src",
        "--ran: found programs that ran, expected what was measured of them",
    )


def test_a_program_is_written_with_its_dat(folder: Path, run: Run, succeed: Run, refused: Refused) -> None:
    points = PROGRAM.replace("  LIN {X 1500,Y    0.0,Z 900,A 0,B 110,C 0} C_DIS\r\n", "  LIN XP1\r\n")
    data = "DEFDAT CELL\nDECL E6POS XP1={X 1500,Y 0.0,Z 900,A 0,B 110,C 0,S 6,T 27}\nENDDAT\n"
    (folder / "cell.src").write_bytes(points.encode("latin-1"))
    (folder / "cell.dat").write_text(data)
    result = succeed("compensate kr500 cell.src --wrench fz=-900N --out new.src")
    assert "Predicted error of the tool at 3 targets" in result.stdout
    assert "cell.dat:2" in result.stdout
    new = (folder / "new.dat").read_text()
    assert new != data
    assert re.sub(r"[0-9.]+(?=,|})", "#", new) == re.sub(r"[0-9.]+(?=,|})", "#", data)
    succeed("compensate kr500 cell.src --wrench fz=-900N --out new.src")  # its own files
    (folder / "new.dat").write_text(new + ";mine\n")
    refused("compensate kr500 cell.src --out new.src", "new.dat")
    assert run("compensate kr500 cell.src --out cell.SRC").exit_code == 2
    assert (folder / "cell.dat").read_text() == data


def test_external_axes_of_a_program_hold_the_joints_of_these_names(cell: Path, succeed: Run) -> None:
    rail = PROGRAM.replace("C 0} C_DIS", "C 0,E1 250.0,E2 0.0} C_DIS").replace(
        "C 0}\r\nEND", "C 0,E1 250.0}\r\nEND"
    )
    (cell / "rail.src").write_bytes(rail.encode("latin-1"))
    (cell / "rail.yaml").write_text(robot_to_yaml(on_rail(load_robot("kr500"))), encoding="utf-8")
    still = succeed("compensate kr500 rail.src --wrench fz=-900N")
    assert "note: external axes are not followed: E1, first in line 4" in still.stderr
    moved = succeed("compensate rail.yaml rail.src --wrench fz=-900N --out new.src --json new.json")
    assert "note: e1: external axis, held where the path says" in moved.stderr
    assert "not followed" not in moved.stderr
    assert (cell / "new.src").read_bytes().count(b",E1 250.0") == 3
    targets = json.loads((cell / "new.json").read_text())["targets"]
    assert [target["q"]["e1"] for target in targets] == [0.25] * 3
