"""A machine that stood elsewhere for each table: the base of each is fitted beside the causes."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, diagnose, predict
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.measure.table import Measurements
from beamstiff.robot.reader import parse_robot
from beamstiff.se3 import rotation_from_vector
from tests.diagnosis.machines import LIFT, at_random, bent, lift

NOISE = 5e-5
STANDS = ((0.0, 0.0, 0.3), (4.0, -2.0, 1.9), (-3.0, 5.0, -2.4))  # m, m, rad about the vertical


@pytest.fixture(scope="module")
def tables() -> list[Measurements]:
    """Return 40 positions at each of three stands, of a column that bends under its arm's weight."""
    robot = lift()
    real = bent(robot, "column", EI=4e5)
    rng = np.random.default_rng(8)
    found = []
    for number, (x, y, about) in enumerate(STANDS):
        rows = at_random(robot, 40, seed=number, position=np.zeros((40, 3)), sigma_position=NOISE)
        rows = replace(rows, wrench=np.zeros((40, 6)))
        pose = predict(real, rows).pose
        turn = rotation_from_vector(np.array([[0.0, 0.0, about]]))[0]
        seen = pose[:, :3] @ turn.T + [x, y, 0.7] + NOISE * rng.standard_normal((40, 3))
        found.append(replace(rows, position=seen, sources=(f"stand {number}",)))
    return found


def test_the_column_that_bends_is_found_from_all_stands_at_once(tables: list[Measurements]) -> None:
    found = diagnose(lift(), tables, stations=True)
    assert found.verdict.key == "link-bending:column"
    (cause,) = found.to_dict()["causes"]
    assert cause["closes"] > 0.9
    assert cause["parameters"]["bending_flexibility"]["value"] == pytest.approx(1 / 4e5, rel=0.02)


def test_tables_of_one_stand_are_not_taken_for_tables_of_several(tables: list[Measurements]) -> None:
    found = diagnose(lift(), tables)
    # a measuring frame that is not one frame: no cause of the machine is sure
    assert found.verdict.effect in ("unknown", "frame-misalignment")
    assert found.verdict.effect == "unknown" or found.verdict.probability < 0.6
    (note,) = (one for one in found.notes if "--stations" in one)
    assert note.startswith("the tables fit robot 'lift' one by one (within ")
    assert not any("--stations" in one for one in diagnose(lift(), tables, stations=True).notes)


def test_displacements_know_no_stand() -> None:
    moved = replace(at_random(lift(), 20, seed=1), displacement=np.full((20, 6), 1e-4))
    with pytest.raises(BeamstiffError, match="displacements know no base frame"):
        diagnose(lift(), moved, stations=True)


def test_few_readings_far_from_the_base_frame_have_the_base_fitted_alone(tables: list[Measurements]) -> None:
    found = diagnose(lift(), tables[1])
    assert found.to_dict()["gap"]["rms_mm"] < 10.0
    assert found.verdict.key == "link-bending:column"


def test_of_few_readings_an_error_of_the_geometry_is_a_cause() -> None:
    """Nine positions do not tell all lengths and angles: only the base is free, and one length is wrong."""
    robot = lift()
    rows = at_random(robot, 9, seed=4, position=np.zeros((9, 3)), sigma_position=NOISE)
    rows = replace(rows, wrench=np.zeros((9, 6)))
    longer = parse_robot(LIFT.replace("d: 0.8,", "d: 0.802,").replace("at: [0.8, 0, 0]", "at: [0.802, 0, 0]"))
    turn = rotation_from_vector(np.array([[0.0, 0.0, 1.9]]))[0]
    noise = NOISE * np.random.default_rng(4).standard_normal((9, 3))
    seen = nominal_pose(longer, rows)[0] @ turn.T + [4.0, -2.0, 0.7] + noise
    assert diagnose(robot, replace(rows, position=seen)).verdict.key == "geometry-error:fore.d"
