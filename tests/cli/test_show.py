import json
import re
from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import robot_names
from beamstiff.robot.library import robot_path
from tests.cli.conftest import Run
from tests.robot.machines import four_bar_th3


@pytest.fixture
def facts(run: Run) -> Callable[..., dict[str, Any]]:
    """Return a function that shows a robot as JSON."""

    def show(*arguments: str) -> dict[str, Any]:
        result = run("show", *arguments, "--json", "-")
        assert (result.exit_code, result.stderr) == (0, "")
        return json.loads(result.stdout, parse_constant=pytest.fail)

    return show


def test_without_a_robot_the_bundled_ones_are_listed(run: Run, told: Run) -> None:
    assert run("show").stdout.split() == ["Bundled", "robots:", *robot_names()]
    assert told("show") == {"robots": robot_names()}


@pytest.mark.parametrize("name", robot_names())
def test_every_shipped_robot_is_shown(succeed: Run, facts: Callable[..., dict[str, Any]], name: str) -> None:
    succeed(f"show {name}")
    answer = facts(name)
    assert answer["name"] == name
    assert answer["reach"]["closing"] > 0
    assert 1 <= answer["condition"] < 1e10


def test_the_ir663_is_described_as_in_its_paper(facts: Callable[..., dict[str, Any]]) -> None:
    answer = facts("ir663")
    assert [len(answer[kind]) for kind in ("nodes", "beams", "joints", "loops", "frames")] == [11, 6, 5, 1, 7]
    assert [item["role"] for item in answer["variables"]] == ["actuated", "actuated", "passive", "passive"]
    # the four-bar is the one closed loop of the structure: all nodes but the foot and the tool
    assert [sorted(loop) for loop in answer["structural_loops"]] == [
        sorted(item["name"] for item in answer["nodes"] if item["name"] not in ("n0", "n7"))
    ]
    by_name = {item["name"]: item for item in answer["nodes"]}
    assert (by_name["n0"]["hangs_on"], by_name["n0"]["fixed"]) == (None, True)
    assert (by_name["n7"]["hangs_on"], by_name["n7"]["through"]) == ("n10b", ["arm"])
    stiffness = {item["name"]: item["stiffness"] for item in answer["joints"]}
    assert (stiffness["J33"]["torsional"], stiffness["J33"]["tilting"]) == ("free", "rigid")
    # six unknowns for each of the ten nodes that are not fixed; each joint's rigid directions have none, and
    # there are five joints with axial and both tilting rigid: 60 - 15
    assert answer["unknowns"] == 45


def test_assemblies_are_listed_and_the_one_taken_is_marked(run: Run, facts: Callable[..., Any]) -> None:
    """The four-bar of the IR-663 closes in two ways: circles about the ends of swing and crank that cut."""
    for arguments, taken in (((), "+"), (("--assembly", "-"), "-")):
        answer = facts("ir663", *arguments)
        assert [(item["name"], item["taken"]) for item in answer["assemblies"]] == [
            ("+", taken == "+"),
            ("-", taken == "-"),
        ]
        for item in answer["assemblies"]:
            th3 = four_bar_th3(
                *(np.array([item["q"][name]]) for name in ("q2", "q8")), 1 - 2 * (item["name"] == "-")
            )
            # the paper's x3 points along the lever, 90 deg from frame 3
            assert np.sin(0.5 * (item["passive"]["th3"] + pi / 2 - th3)) == pytest.approx(0.0, abs=1e-10)
        reference = {item["name"]: item["reference"] for item in answer["variables"]}
        near = next(item["passive"] for item in answer["assemblies"] if item["taken"])
        assert abs(reference["th3"] - near["th3"]) < 1.0
    assert re.search(r"^- +taken +-?[0-9.]+ ", run("show ir663 --assembly -").stdout, re.MULTILINE)
    assert facts("crane.yaml")["assemblies"] == []


def test_loops_that_close_far_from_their_guess_are_told(succeed: Run, folder: Path) -> None:
    """The same four-bar from guesses 3 and 60 degrees away from where it ever is, and a whole turn away."""
    text = robot_path("ir663").read_text(encoding="utf-8")
    for guess, notes in (("20 deg", 0), ("-60 deg", 1), ("382.8 deg", 0)):
        changed = text.replace('"22.8 deg"', f'"{guess}"')
        assert changed != text
        (folder / "four_bar.yaml").write_text(changed, encoding="utf-8")
        result = succeed("show four_bar.yaml")
        assert result.stderr.count("\n") == notes
        assert notes == ("name it (assembly: in the robot file, --assembly of a command)" in result.stderr)
        assert succeed("show four_bar.yaml --assembly +").stderr == ""


def test_mass_and_length_of_a_tube(facts: Callable[..., dict[str, Any]]) -> None:
    answer = facts("cantilever")
    assert answer["mass"] == pytest.approx(7850 * pi / 4 * (0.060**2 - 0.052**2), rel=1e-12)
    assert answer["beams"][0]["length"] == 1.0
    assert answer["unknowns"] == 6


def test_beams_that_weigh_nothing_are_named(run: Run, folder: Path) -> None:
    text = robot_path("cantilever").read_text(encoding="utf-8")
    light = text.replace(', density: "7850 kg/m^3"', "")
    assert light != text
    (folder / "light.yaml").write_text(light, encoding="utf-8")
    assert "0 kg; without density: tube" in run("show light.yaml").stdout
    assert "without density" not in run("show cantilever").stdout


def test_the_reach_of_an_arm_of_one_metre(facts: Callable[..., dict[str, Any]]) -> None:
    reach = facts("crane.yaml", "--samples", "20000", "--seed", "3")["reach"]
    # a circle of 1 m but for 10 deg either side of -x
    np.testing.assert_allclose(reach["lower"], [-np.cos(np.radians(10)), -1, 0], atol=1e-3)
    np.testing.assert_allclose(reach["upper"], [1, 1, 0], atol=1e-3)
    assert reach["farthest"] == pytest.approx(1.0, rel=1e-12)
    assert (reach["closing"], reach["seed"]) == (reach["samples"], 3)


def test_the_seed_makes_the_samples(facts: Callable[..., dict[str, Any]]) -> None:
    same, again, other = (facts("crane.yaml", "--seed", seed)["reach"] for seed in ("1", "1", "2"))
    assert same == again
    assert same["lower"] != other["lower"]


def test_a_robot_is_shown_to_people(run: Run) -> None:
    text = run("show crane.yaml").stdout
    for part in ("-170 to 170 deg", "hub by J1: 0.000 0.000 0.000", "tip by arm: 1000.000 0.000 0.000 [TCP]"):
        assert part in text
    for part in (
        "J1     q1         4e+06    2e+06       1e+06     8e+06",
        "J1.torsional",
        "3 nodes, 1 rigid, 1 joint",
    ):
        assert part in text


def test_a_large_robot_is_cut_for_people_alone(run: Run, facts: Callable[..., Any], folder: Path) -> None:
    count = 100
    nodes = "".join(f"  - {{name: n{at}, at: [{at}, 0, 0]}}\n" for at in range(count))
    beams = "".join(
        f"  - {{name: b{at}, nodes: [n{at}, n{at + 1}], section: rod, material: steel}}\n"
        for at in range(count - 1)
    )
    (folder / "long.yaml").write_text(
        "beamstiff: 1\nname: long\nmaterials: {steel: {E: 2.1e11, G: 8e10}}\n"
        "sections: {rod: {shape: circle, outer: 0.1}}\n"
        f"nodes:\n{nodes}beams:\n{beams}fixed: [n0]\ntcp: n{count - 1}\n"
    )
    text = run("show long.yaml").stdout
    assert "... 59 more" in text
    assert "... 60 more nodes" in text
    assert len(text.splitlines()) < 120
    assert [len(facts("long.yaml")[kind]) for kind in ("nodes", "beams")] == [count, count - 1]


def test_names_from_the_file_are_printed_as_they_are(run: Run, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text().replace("tip", '"[bold]:smile:"')
    (folder / "odd.yaml").write_text(text)
    assert "[bold]:smile: by arm" in run("show odd.yaml").stdout


def test_gravity_stands_in_the_summary(run: Run, folder: Path) -> None:
    assert re.search(r"gravity +0, 0, -9.81 m/s\^2", run("show crane.yaml").stdout)  # where none is said
    weightless = (folder / "crane.yaml").read_text() + "gravity: [0, 0, 0]\n"
    (folder / "moon.yaml").write_text(weightless)
    assert re.search(r"gravity +none", run("show moon.yaml").stdout)


def test_limits_without_a_unit_that_are_many_turns_are_noted(succeed: Run, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text().replace('"-170 deg", "170 deg"', "-170, 170")
    (folder / "crane.yaml").write_text(text)
    for command in (("show",), ("deflect", "crane.csv")):
        result = succeed(command[0], "crane.yaml", *command[1:])
        assert "limits of q1: -170 to 170 rad are 54 turns" in " ".join(result.stderr.split())


def test_every_size_of_an_effect_has_its_unit(succeed: Run, tmp_path: Path) -> None:
    size = "{bending_flexibility_root: 2e-5}"
    bending = f"{{effect: link-bending, component: link3, shape: tapered, parameters: {size}}}"
    base = "{effect: base-compliance, shape: tilt, parameters: {tilting_compliance: 2e-7 rad/(N*m)}}"
    file = tmp_path / "real.yaml"
    file.write_text(f"{robot_path('kr240-2').read_text()}\neffects:\n  - {bending}\n  - {base}\n")
    shown = succeed("show", str(file)).stdout
    assert "Effect link-bending:link3, tapered: bending_flexibility_root 2e-05 (SI)." in shown
    assert "Effect base-compliance, tilt: tilting_compliance 2e-7 rad/(N*m)." in shown
