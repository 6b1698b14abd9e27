"""The IR-663 against its paper: lengths, four-bar in closed form, stiffness, displacements, share of beams.

Source: Marie, Courteille, Maurine, "Elasto-geometrical modeling and calibration of robot manipulators". Its
closed form is meant with the sign slip set right: the two signs before the root differ.
"""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from beamstiff import load_robot
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.se3 import Array
from beamstiff.units import quantity
from benchmarks.condition_numbers import condition_numbers
from tests.robot.machines import four_bar_th3
from tests.robots.machine import at, compliance, inside, nothing_gives_but, point, springs, values

ROBOT = load_robot("ir663")
TABLE_4 = np.radians([[q2, q8] for q2 in (-24.15, 1.37, 12.54, 36.83) for q8 in (33.04, 48.63, 62.90)])


def test_only_axes_2_and_8_are_driven() -> None:
    assert [variable.name for variable in ROBOT.actuated] == ["q2", "q8"]


def test_its_lengths_are_those_of_table_2(shared_path: Callable[[str], Path]) -> None:
    table = yaml.safe_load(shared_path("data/ir663_geometry.yaml").read_text(encoding="utf-8"))["lengths_mm"]
    frames, nodes = ({item.name: item for item in items} for items in (ROBOT.frames, ROBOT.nodes))
    ours = {
        "r1": frames["f1"].r,
        "d3": frames["f3"].d,
        "r4": nodes["n7"].at[1],
        "d9": frames["f9"].d,
        "d10": frames["f10"].d,
        "d11": frames["f11"].d,
    }
    assert {name: quantity(value, "length") for name, value in ours.items()} == pytest.approx(
        {name: 1e-3 * table[name] for name in ours}, rel=1e-15
    )


def test_its_stiffness_is_design_1_of_table_3(shared_path: Callable[[str], Path]) -> None:
    text = shared_path("data/ir663_identified.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    design = {row["parameter"]: (row["design_1"], row["unit"]) for row in rows}
    found = {name: value for name, value in springs(ROBOT).items() if value not in (FREE, RIGID)}
    assert len(found) == 7
    for name, value in found.items():
        kind = "rotational stiffness" if name.endswith("torsional") else "translational stiffness"
        number, unit = design[name]
        assert value == pytest.approx(quantity(f"{number} {unit}", kind), rel=1e-15)


def test_theta3_is_that_of_the_closed_form_and_never_changes_branch() -> None:
    q = inside(ROBOT, 5000)
    posed = at(ROBOT, q)
    expected = four_bar_th3(*q.T, branch=-1 if tool_in_front(-1, q) else 1)
    difference = values(posed, "th3") + np.pi / 2 - expected  # the lever lies along y of frame 3
    assert np.abs(np.angle(np.exp(1j * difference))).max() < 1e-12


def tool_in_front(branch: int, q: Array) -> bool:
    """Tell whether this branch of the closed form has the tool at x > 0, by the lever's direction alone."""
    lever = q[:, 0] - np.pi / 2 + four_bar_th3(*q.T, branch=branch)  # clockwise from x
    return bool((1.047 * np.sin(q[:, 0]) + 1.760 * np.cos(lever) > 0.0).all())


def test_one_branch_only_has_the_tool_in_front_of_the_robot() -> None:
    q = inside(ROBOT, 1000)
    assert tool_in_front(-1, q) != tool_in_front(1, q)
    assert (point(at(ROBOT, q), "n7")[:, 0] > 0.0).all()


def test_table_4_puts_the_tool_into_the_papers_workspace() -> None:
    tool = point(at(ROBOT, TABLE_4), "n7")
    assert tool[:, 0].min() == pytest.approx(1.1, abs=0.1)
    assert tool[:, 0].max() == pytest.approx(2.4, abs=0.1)
    assert tool[:, 2].min() == pytest.approx(0.5, abs=0.1)
    assert tool[:, 2].max() == pytest.approx(1.5, abs=0.1)
    assert np.abs(tool[:, 1]).max() < 1e-12


def test_900_newton_along_x_move_the_tool_as_far_as_three_notes_on_the_paper_say() -> None:
    q = np.radians([[1.37, 48.63], [12.54, 33.04], [36.83, 62.90]])
    moved = 1e3 * 900.0 * compliance(ROBOT, q)[:, 0, 0]
    assert [f"{value:.2f}" for value in moved] == ["0.96", "0.72", "1.56"]


def test_of_which_the_springs_alone_are_nearly_all() -> None:
    soft = {name: value for name, value in springs(ROBOT).items() if value not in (FREE, RIGID)}
    q = np.radians([[1.37, 48.63], [12.54, 33.04], [36.83, 62.90]])
    moved = 1e3 * 900.0 * compliance(nothing_gives_but(ROBOT, soft), q)[:, 0, 0]
    assert moved == pytest.approx([0.930, 0.705, 1.513], abs=6e-4)


def share_of_beams(direction: int) -> tuple[Array, dict[str, Array]]:
    """Return the share of the beams in the deflection along a force, on a grid over table 4's range."""
    grid = [
        axis.ravel() for axis in np.meshgrid(np.linspace(-24.15, 36.83, 15), np.linspace(33.04, 62.90, 10))
    ]
    structure, posture = at(ROBOT, np.radians(grid).T)
    force = np.zeros(6)
    force[direction] = 900.0
    shares = respond(structure, posture, nodal_loads(structure, 150, {"n7": force})).energy_shares()
    beams = {beam.name: shares[beam.name] for beam in ROBOT.beams}
    # under one force the energy is half of force times deflection: shares in the one are shares in the other
    return np.sum(list(beams.values()), axis=0), beams


def test_beams_are_up_to_a_tenth_of_the_deflection_and_more_of_a_vertical_one() -> None:
    # figure 11 says "about 10 %"; table 3's springs and 0.96, 0.72 and 1.56 mm together leave less on average
    vertical, _ = share_of_beams(2)
    horizontal, _ = share_of_beams(0)
    assert 0.06 < vertical.mean() < 0.10
    assert 0.10 < vertical.max() < 0.15
    assert 0.03 < horizontal.mean() < 0.10
    assert vertical.mean() > horizontal.mean(), "the paper: more important for a vertical load"


@pytest.mark.parametrize("direction", [0, 2])
def test_most_of_it_comes_from_the_arm(direction: int) -> None:
    _, beams = share_of_beams(direction)
    assert max(beams, key=lambda name: beams[name].mean()) == "arm"


def test_with_every_joint_direction_finite_or_free_the_stiffness_is_60_by_60() -> None:
    rigid = {name: 1e9 for name, value in springs(ROBOT).items() if value == RIGID}
    opened, found = condition_numbers(ROBOT.with_parameters(rigid), TABLE_4)
    assert opened == 60
    assert found.max() < 1e10
    shipped, _ = condition_numbers(ROBOT, TABLE_4)
    assert shipped == 60 - len(ROBOT.joints) * 3, "axial and both tilting directions of each joint are rigid"
