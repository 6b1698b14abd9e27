"""Gross errors of reading are left out before causes are sought; what effects leave is none."""

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot, diagnose
from beamstiff.diagnosis.decomposition.decompose import OPEN
from beamstiff.diagnosis.decomposition.open_model import open_as_determined
from beamstiff.diagnosis.decomposition.outlier_influence import LISTED, Apart, places_apart, rows_apart
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.table import Measurements
from beamstiff.report.diagnosis_text import verdict
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import Rigid
from beamstiff.se3 import rotation_from_vector
from tests.diagnosis.decomposition.test_decompose import FRAME, table
from tests.diagnosis.planted import base_compliance, campaign, kr240, plan

CAUSES = ("approach", "gear", "slip")
PLACES = {"A": (0.03, 0.09, 0.05), "B": (-0.04, -0.08, 0.07)}  # m, of reflectors in the last frame


def with_wrong(*causes: str, wrong: dict[int, float] | None = None) -> tuple[Robot, Measurements]:
    """Return a robot and its positions, some of them wrong by so many m along x."""
    robot, rows = table(causes, 60)
    position = rows.position.copy()
    for row, by in (wrong or {}).items():
        position[row, 0] += by
    return robot, replace(rows, position=position)


def apart(robot: Robot, rows: Measurements) -> Apart:
    return rows_apart(open_as_determined(robot, rows, False, OPEN, False)[0], rows)


def places(rows: Measurements, numbers: Iterable[int]) -> tuple[str, ...]:
    return tuple(map(rows.place, sorted(numbers)))


@pytest.mark.parametrize("causes", [(), ("gear",), ("slip",), ("friction",), CAUSES])
def test_no_cause_makes_a_row_stand_apart(causes: tuple[str, ...]) -> None:
    assert apart(*with_wrong(*causes)) == Apart()


@pytest.mark.parametrize(
    "wrong", [{7: 0.05}, {7: 0.02}, {7: 0.05, 41: -0.03}, {7: 0.05, 41: -0.01}, {0: 0.5}]
)
def test_gross_errors_stand_apart_beside_causes(wrong: dict[int, float]) -> None:
    robot, rows = with_wrong(*CAUSES, wrong=wrong)
    assert apart(robot, rows).left_out == places(rows, wrong)


@pytest.mark.parametrize("count", [3, 5, 9])
def test_of_many_gross_errors_each_says_which_coordinate_is_wrong(count: int) -> None:
    robot, rows = with_wrong(*CAUSES)
    numbers = np.random.default_rng(count).choice(60, count, replace=False)
    position = rows.position.copy()
    for turn, row in enumerate(numbers.tolist()):
        position[row, turn % 3] += (-1) ** turn * 0.01 * (1 + turn % 2)
    found = apart(robot, replace(rows, position=position))
    assert found.left_out == places(rows, numbers)
    for row, said in zip(sorted(numbers.tolist()), found.said, strict=True):
        turn = numbers.tolist().index(row)
        said_mm, axis = re.fullmatch(r".*\((.*) mm off, along (.) alone\)", said).groups()
        assert float(said_mm) == pytest.approx(10 * (1 + turn % 2), abs=1.5)  # causes move rows by 0.6 mm RMS
        assert axis == "xyz"[turn % 3]
    assert not found.doubtful


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [(3, 17, 18, 40, 55), (3, 9, 17, 18, 27, 40, 51, 55)])
def test_gross_errors_in_any_direction_are_told_and_left_out_while_they_are_rare(
    wrong: tuple[int, ...],
) -> None:
    robot, rows = with_wrong(*CAUSES)
    position = rows.position.copy()
    for row in wrong:
        position[row] += 0.01 / np.sqrt(3.0)
    found, rare = apart(robot, replace(rows, position=position)), len(wrong) <= 6
    assert found.left_out == (tuple(rows.place(row) for row in wrong) if rare else ())
    assert found.doubtful.startswith(f"{len(wrong)} of 60 rows are ")
    named = found.doubtful.rpartition(": ")[2].split(" and ")[0].split(", ")
    assert {*named} <= {rows.place(row) for row in wrong}
    assert len(named) >= min(len(wrong), LISTED) - 1
    said = diagnose(robot, replace(rows, position=position))
    effects = {one.forms[0].effect for one in said.decomposition.causes}
    assert effects >= {"approach-direction", "angle-curve"} if rare else said.verdict.effect == "unknown"
    assert verdict(said).action.startswith(f"Check the table: {len(wrong)} of ")


@pytest.mark.parametrize("count", [1, 3, 8])
def test_rows_named_as_another_reflector_say_so(count: int) -> None:
    robot, rows = two_reflectors(count)
    found = apart(robot, rows)
    assert len(found.left_out) == count
    assert all(re.search(r": reads as (A, not B|B, not A)\)$", said) for said in found.said)


@pytest.mark.slow
def test_exchanged_coordinates_say_so() -> None:
    robot, rows = with_wrong(*CAUSES)
    position = rows.position.copy()
    for row in (3, 17, 40, 55):
        position[row] = position[row][[1, 0, 2]]
    found = diagnose(robot, replace(rows, position=position))
    assert found.outliers == places(rows, (3, 17, 40, 55))
    assert sum(note.count("x and y exchanged") for note in found.notes) == 4
    sound = diagnose(*with_wrong(*CAUSES)).decomposition
    assert {one.key for one in found.decomposition.causes} == {one.key for one in sound.causes}


def test_two_reflectors_under_one_name_are_told() -> None:
    robot, rows = two_reflectors(0)
    found = diagnose(robot, replace(rows, point=np.full(len(rows), "A")))
    said = "The 60 rows of A read two places of its link, "
    assert verdict(found).action.startswith(f"Check the table: {said}")
    assert apart(*two_reflectors(0)) == Apart()


def two_reflectors(wrong: int) -> tuple[Robot, Measurements]:
    """Return a robot with two reflectors and a table of 60 rows, some of them named as the other."""
    robot, rows = table(CAUSES, 60)
    tcp = next(node for node in robot.nodes if node.name == robot.tcp)
    nodes = [tcp.model_copy(update={"name": name, "at": at}) for name, at in PLACES.items()]
    held = [Rigid(name=f"to {name}", nodes=(robot.tcp, name)) for name in PLACES]
    robot = robot.model_copy(update={"nodes": (*robot.nodes, *nodes), "rigids": (*robot.rigids, *held)})
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, rows.q)
    turn = rotation_from_vector(FRAME)
    names = np.array(["A", "B"])[np.arange(60) % 2]
    own, tool = (pose_of(kinematics, where, name)[:, :3, 3] for name in ("A", robot.tcp))
    other = pose_of(kinematics, where, "B")[:, :3, 3]
    way = np.where((names == "A")[:, None], own, other) - tool
    named = names.copy()
    some = np.random.default_rng(wrong).choice(60, wrong, replace=False)
    named[some] = np.where(names[some] == "A", "B", "A")
    return robot, replace(rows, position=rows.position + way @ turn.T, point=named)


def test_a_diagnosis_with_a_gross_error_is_the_one_without_the_row() -> None:
    robot, rows = with_wrong(*CAUSES, wrong={7: 0.05})
    found = diagnose(robot, rows)
    place = rows.place(7)
    assert found.outliers == (place,)
    assert any(note.startswith(f"left out: {place} (49.9 mm off, along x alone).") for note in found.notes)
    named = [cause.key for cause in diagnose(*with_wrong(*CAUSES)).decomposition.causes]
    assert [cause.key for cause in found.decomposition.causes] == named
    assert found.to_dict()["outliers"] == [place]


def test_a_displacement_that_is_wrong_stands_apart_whatever_rows_share_its_unloaded_reading() -> None:
    rows = campaign(plan(10), base_compliance)
    wrong = rows.displacement.copy()
    wrong[12, 0] += 0.02
    assert places_apart(fit_baseline(kr240(), rows)) == Apart()
    found = places_apart(fit_baseline(kr240(), replace(rows, displacement=wrong)))
    assert found.left_out == (rows.place(12),)
    assert found.said == (f"{rows.place(12)} (20 mm off, along dx alone)",)


def test_a_row_that_is_left_out_is_said_with_how_far_it_is_off() -> None:
    rows = campaign(plan(), base_compliance)
    wrong = rows.displacement.copy()
    wrong[12, 2] -= 0.01
    rows = replace(rows, displacement=wrong)
    found = diagnose(kr240(), rows)
    told = next(note for note in found.notes if note.startswith("left out"))
    size = re.search(rf"{re.escape(rows.place(12))} \(dz off by (\S+) mm\)", told)
    assert size is not None
    assert float(size[1]) == pytest.approx(10.0, abs=0.3)
