"""`--assembly`: every command that takes a robot takes the assembly of its loops, by name."""

import inspect
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.cli.main import app
from beamstiff.cli.options import Assembly
from beamstiff.robot.library import robot_path
from tests.cli.conftest import Refused, Run
from tests.robot.machines import four_bar_th3


def test_commands_with_a_robot_take_its_assembly() -> None:
    commands = {
        item.callback.__name__: inspect.signature(item.callback).parameters
        for item in app.registered_commands
        if item.callback
    }
    with_robot = {name for name, known in commands.items() if "robot" in known}
    assert len(with_robot) == 13
    taking = {name for name in with_robot if "assembly" in commands[name]}
    assert with_robot - taking == {"exam"}  # which draws machines of a robot
    assert all(commands[name]["assembly"].annotation == Assembly for name in taking)


def test_stiffness_is_that_of_the_named_assembly(told: Run) -> None:
    q2, q8 = np.radians([10.0]), np.radians([45.0])
    for name, branch in (("+", 1), ("-", -1)):
        for option in (("--assembly", name), (f"--assembly={name}",)):
            th3 = told("stiffness ir663 --q q2=10deg,q8=45deg", *option)["variables"]["th3"]
            assert np.sin(0.5 * (th3 + np.pi / 2 - four_bar_th3(q2, q8, branch)[0])) == pytest.approx(
                0, abs=1e-12
            )


def test_a_name_that_no_assembly_has_is_refused(refused: Refused) -> None:
    refused("stiffness ir663 --assembly ++", "found assembly '++', expected one of +, -")
    refused("show crane.yaml --assembly +", "--assembly: found '+', but robot 'crane' has no closed loops")


def test_the_assembly_is_written_with_the_robot_its_comments_kept(succeed: Run, folder: Path) -> None:
    table = "q2 [deg],q8 [deg],fx,fz,dx [mm],dz [mm]\n" + "".join(
        f"{q2},{q8},{fx},{-900 - fx},0.1,-0.2\n"
        for q2, q8 in ((0, 40), (10, 45), (20, 60))
        for fx in (0, -900)
    )
    (folder / "data.csv").write_text(table, encoding="utf-8")
    succeed("identify ir663 data.csv --parameters J12.torsional --assembly - --out found.yaml")
    assert load_robot(folder / "found.yaml").assembly == "-"
    text = (folder / "found.yaml").read_text(encoding="utf-8")
    comments = [
        line for line in robot_path("ir663").read_text(encoding="utf-8").splitlines() if line.startswith("#")
    ]
    assert all(line in text for line in comments)
