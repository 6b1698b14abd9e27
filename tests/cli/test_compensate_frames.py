"""`beamstiff compensate`: where the numbers of a program count from, and in which posture it is run."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import beamstiff.compensation.formats.krl as krl
from beamstiff import load_robot
from beamstiff.robot.library import robot_path
from beamstiff.robot.writer import robot_to_yaml
from tests.cli.conftest import PROGRAM, TAUGHT, Refused, Run


def test_the_real_robot_may_be_another(cell: Path, succeed: Run, refused: Refused) -> None:
    text = robot_path("kr500").read_text(encoding="utf-8")
    (cell / "real.yaml").write_text(text.replace("theta: q2}", 'theta: "q2 + 0.05 deg"}'), encoding="utf-8")
    succeed("compensate kr500 cell.src --actual real.yaml --out new.src --quiet")
    # joint 2 turns the arm down: the command goes up by some 1.1 m times the angle
    z = float(re.search(rb"Z *([0-9.]+)", (cell / "new.src").read_bytes().split(b"\r\n")[4])[1])
    assert 0.5 < z - 900 < 2.0
    refused("compensate kr500 cell.src --actual ir663", "expected those of 'kr500'")


def test_frames_say_what_the_numbers_count_from(cell: Path, succeed: Run) -> None:
    here = krl.read(PROGRAM, "cell.src").path.poses[:, :3, 3]
    moved = PROGRAM.replace("X 1500.000", "X 1000.000").replace("X 1500", "X 1000")
    (cell / "moved.src").write_bytes(moved.encode("latin-1"))
    load = ("--wrench", "fz=-900N", "--quiet")
    succeed("compensate kr500 cell.src", *load, "--out", "a.src")
    succeed("compensate kr500 moved.src", *load, "--base", "x=500mm", "--out", "b.src")
    a, b = (
        krl.read((cell / name).read_bytes().decode("latin-1"), name).path.poses[:, :3, 3]
        for name in ("a.src", "b.src")
    )
    np.testing.assert_allclose(b + np.array([0.5, 0, 0]), a, atol=2e-6)
    assert np.abs(a - here).max() > 1e-4


SAGGING = "masses: [{node: n6b, mass: 500 kg}]\n"


def test_the_robot_itself_may_have_taught_the_base(cell: Path, succeed: Run, told: Run) -> None:
    """What its weight does everywhere alike is in the base too; what a base cannot take up remains."""
    real = robot_to_yaml(load_robot("kr500")) + SAGGING
    (cell / "real.yaml").write_text(real)
    arguments = "compensate kr500 cell.src --actual real.yaml"
    shown = " ".join(succeed(arguments).stdout.split())
    headline = re.search(
        r"Predicted error along the path: (\S+) mm against a measured base, (\S+) mm or more if the robot "
        r"itself touched off the workpiece; after correction",
        shown,
    )
    assert headline is not None, shown
    whole, differing = map(float, headline.groups())
    facts = told(arguments)
    error = 1e3 * np.array([target["before"][:3] for target in facts["targets"]])
    assert whole == pytest.approx(facts["before"]["rms_mm"], rel=0.05)  # two digits
    assert (
        "Next: If the robot itself touched off the workpiece (taught its base), give the three points with"
        in shown
    )
    assert differing == pytest.approx(np.sqrt(((error - error.mean(0)) ** 2).sum(1).mean()), rel=0.05)
    assert facts["before"]["rms_mm"] > 1
    taught = succeed(arguments, *TAUGHT, "--json", "r.json", "--out", "new.src")
    assert "measured base" not in taught.stdout
    assert "Errors count from the base as the real robot taught it, which is" in " ".join(
        taught.stdout.split()
    )
    less = json.loads((cell / "r.json").read_text())
    assert 1e-3 < less["before"]["rms_mm"] < 0.3 * facts["before"]["rms_mm"]
    assert less["after"]["max_mm"] < 1e-3
    assert len(less["base_taught"]) == 6
    assert "measured base" not in succeed(arguments, "--taught").stdout


@pytest.mark.parametrize(("read", "said"), [("n6", True), ("n6b", False), ("target", False)])
def test_a_tool_that_no_calibration_read_is_doubted(cell: Path, succeed: Run, read: str, said: bool) -> None:
    names = ", ".join(f"{{name: {name}.x, std: 1e-5}}" for name in ("base", read))
    (cell / "real.yaml").write_text(robot_to_yaml(load_robot("kr500")) + f"calibrated: [{names}]\n")
    notes = succeed("compensate kr500 cell.src --actual real.yaml --wrench fz=-900N").stderr
    assert ("'n6b' was not measured, only n6: its place on its link" in notes) == said


@pytest.mark.parametrize(("second", "told"), [(0.5, True), (0.2, False)])
def test_reflectors_that_stand_elsewhere_alike_tell_that_the_tool_may_too(
    cell: Path, succeed: Run, second: float, told: bool
) -> None:
    robot = load_robot("kr500")
    shifts = {"drawn": (0.0, 0.0), "real": (0.5, second)}
    for name, shift in shifts.items():
        nodes = [
            {"name": f"r{at}", "frame": "f6", "at": [f"{by} mm", f"{50 * at} mm", "10 mm"]}
            for at, by in enumerate(shift, 1)
        ]
        told_of = yaml.safe_load(robot_to_yaml(robot))
        told_of["nodes"] += nodes
        told_of["rigids"] = [
            *told_of.get("rigids", []),
            *({"name": f"mount{at}", "nodes": ["n6b", f"r{at}"]} for at in (1, 2)),
        ]
        if name == "real":
            told_of["calibrated"] = [{"name": f"{one}.x", "std": 1e-5} for one in ("base", "r1", "r2")]
            told_of["fitted_ranges"] = [
                {"variable": one.name, "low": -0.5, "high": 0.5} for one in robot.actuated
            ]
        (cell / f"{name}.yaml").write_text(yaml.safe_dump(told_of))
    run = succeed("compensate drawn.yaml cell.src --actual real.yaml --wrench fz=-900N")
    assert "only r1, r2" in run.stderr
    assert ("(these stand 0.5 mm elsewhere, alike: the tool may too)" in run.stderr) == told


def test_a_measured_base_is_mentioned_only_where_most_of_the_error_is_alike(cell: Path, succeed: Run) -> None:
    (cell / "one.src").write_text(PROGRAM.replace("  LIN {X 1500,", "  ;LIN {X 1500,"))
    assert "measured base" not in succeed("compensate kr500 one.src --wrench fz=-900N").stdout
    load = ("--process", "p.yaml")
    (cell / "p.yaml").write_text("kind: cutting-table\nvariable: y\nvalues: [-1, 1]\nfz: [-9000, 9000]\n")
    assert "measured base" not in succeed("compensate kr500 cell.src", *load).stdout


def test_points_of_a_program_in_the_robots_own_base_frame_are_places_of_the_workpiece(
    cell: Path, succeed: Run, refused: Refused
) -> None:
    (cell / "real.yaml").write_text(robot_to_yaml(load_robot("kr500")) + SAGGING)
    arguments = ("compensate", "kr500", "cell.src", "--actual", "real.yaml")
    foot = ("--base-taught", "x=0", "--base-taught", "x=300mm", "--base-taught", "y=300mm")
    refused(
        [*arguments, *foot],
        "The program counts from the robot's own base frame. In it, give three points at which the robot "
        "touched the workpiece",
    )
    said = succeed(" ".join(arguments), *TAUGHT, "--json", "r.json").stderr
    note = re.search(
        r"at the points of --base-taught the tool touched the workpiece, which stands (\S+) mm "
        r"\(at the first point\)",
        said,
    )
    assert note is not None, said
    # the first point is the first target, under the same weight: its own error against a measured base
    measured = json.loads(succeed(" ".join(arguments), "--json", "-").stdout)["targets"][0]["before"]
    assert float(note[1]) == pytest.approx(1e3 * np.linalg.norm(measured[:3]), rel=0.05)  # two digits
    elsewhere = PROGRAM.replace("{FRAME: X 0,", "{FRAME: X 100,")
    (cell / "cell.src").write_bytes(elsewhere.encode("latin-1"))
    refused([*arguments, *foot], "In the frame of the path, give three points at which the robot touched")
    assert "own base frame" not in succeed(" ".join(arguments), *TAUGHT).stderr


RAPID = "MODULE m\n{}ENDMODULE\n"
MOVE = "MoveL [[{},{},1700],[0.7071068,0,0.7071068,0],[{},0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\n"


def test_a_target_that_is_reachable_in_another_configuration_says_in_which(cell: Path, run: Run) -> None:
    """ABB turns axis 1 counterclockwise: at y < 0 it is in the quarter -1, whatever robconf says."""
    wrong, right = MOVE.format(2300, -400, "0,0,0"), MOVE.format(2300, 400, "0,-2,1")
    (cell / "a.mod").write_text(RAPID.format(wrong + right))
    result = run("compensate kr500 a.mod --wrench fz=-900N --out new.mod")
    assert result.exit_code == 2
    told = " ".join(result.stdout.split())
    found = re.search(
        r"is configuration \[0,0,0,0\]; reachable as \[-1,(\S+),(\S+),0\], q1 = (\S+) deg", told
    )
    assert found is not None, told
    assert float(found[3]) == pytest.approx(np.degrees(np.arctan2(400, 2300 - 290)), rel=0.005)
    assert "a.mod: 1 of 2 targets cannot be corrected: line 2, MoveL (no posture within" in result.stderr
    assert "Next: Correct the configuration of these targets in the program, or choose" in told
    assert "Move these targets" not in told + result.stderr
    # of the refused target no posture is told as that of the path
    assert "note: the first target that is reached, a.mod:3: MoveL, is at q1 = -11.2" in result.stderr
    # as told, it is reached
    (cell / "a.mod").write_text(RAPID.format(MOVE.format(2300, -400, f"-1,{found[1]},{found[2]}") + right))
    assert run("compensate kr500 a.mod --wrench fz=-900N --out new.mod").exit_code == 0


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("a.mod", RAPID.format(MOVE.format(9300, 0, "0,0,0")), "a.mod: 1 of 1 {}: line 2, MoveL (out of"),
        (
            "a.script",
            "def p():\n  movel(p[9,0,1,0,2,0])\n  movej(get_inverse_kin(p[9,1,1,0,2,0]))\nend\n",
            "a.script: 2 of 2 {}: line 2, movel (out of",
        ),
        ("a.mod", RAPID.format(MOVE.format("b", 0, "0,0,0")), "a.mod:2: MoveL: found 'b', expected a number"),
        (
            "a.script",
            "movel(p[0.4,9000.1,0.3,0,3.14,0])\n",
            "a.script:1: movel: found a position 9e+03 m away",
        ),
    ],
)
def test_errors_name_line_and_motion_in_the_language_of_the_program(
    cell: Path, run: Run, name: str, text: str, told: str
) -> None:
    (cell / name).write_text(text)
    result = run("compensate", "kr500", name)
    assert result.exit_code == 2
    assert told.format("targets cannot be corrected") in result.stderr


def test_targets_of_one_name_are_told_with_their_lines(cell: Path, run: Run) -> None:
    moves = "".join(MOVE.format(2300, y, "-1,0,0") for y in (-400, -300))
    (cell / "a.mod").write_text(RAPID.format(moves))
    # nothing moves the tool, which any standard deviation doubts
    result = run("compensate kr500 a.mod --q q2=-30deg,q3=60deg,q5=40deg --leave-doubtful --load-std fz=20N")
    assert "twice its standard deviation: line 2, MoveL, line 3, MoveL" in result.stderr
