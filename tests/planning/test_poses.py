"""Grids and random poses: the poses they say they are, within limits and with loops closed."""

import re
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.planning import poses
from beamstiff.planning.poses import closed_posture, joint_grid, joint_ranges, random_poses, spread
from beamstiff.robot.closure import close_loops, near_fold
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.parts import Variable
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.reader import load_robot

KR240, IR663 = load_robot("kr240-2"), load_robot("ir663")


def test_a_grid_holds_every_pair_of_values_and_the_held_ones() -> None:
    grid = joint_grid(KR240, {"q3": [-1.0, 0.5], "q2": [0.1, 0.2, 0.3]}, {"q5": 0.7})
    assert grid.names == ("q3", "q2")
    assert grid.shape == (2, 3)
    assert grid.q.reshape(2, 3, 6)[1, 2].tolist() == [0, 0.3, 0.5, 0, 0.7, 0]
    assert {tuple(row[[2, 1]]) for row in grid.q} == {(a, b) for a in (-1.0, 0.5) for b in (0.1, 0.2, 0.3)}
    assert grid.turns == (True, True)


@pytest.mark.parametrize(
    ("over", "held", "message"),
    [
        ({"q2": [0, 1]}, {}, "a map needs two joint variables, found q2"),
        ({}, {}, "a map needs two joint variables, found none"),
        ({"q2": [0, 1], "q3": [0, 1]}, {"q3": 1.0}, "q3 is on an axis of the map and held"),
        ({"q2": [0, 1], "q3": [1, 0]}, {}, "q3: expected at least two growing values"),
        ({"q2": [0], "q3": [0, 1]}, {}, "q2: expected at least two growing values"),
        ({"q2": [0, np.nan], "q3": [0, 1]}, {}, "q2: expected at least two growing values"),
        ({"q2": [0, 1], "q33": [0, 1]}, {}, r"unknown joint variable 'q33' \(did you mean 'q3'\?\)"),
        ({"q2": [0, 1], "q3": [0, 1]}, {"q4": np.inf}, "q4: found inf"),
    ],
)
def test_bad_grids_are_refused(over: dict[str, Any], held: dict[str, float], message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        joint_grid(KR240, over, held)


def test_random_poses_close_within_the_limits_and_come_again_with_the_seed() -> None:
    kinematics = compile_kinematics(IR663)
    found = random_poses(kinematics, 300, np.random.default_rng(4))
    lower, upper = joint_ranges(IR663)
    assert found.shape == (300, 2)
    assert ((found >= lower) & (found <= upper)).all()
    assert closed_posture(kinematics, found)[1].all()
    assert (found == random_poses(kinematics, 300, np.random.default_rng(4))).all()
    assert (found != random_poses(kinematics, 300, np.random.default_rng(5))).all()
    # all over the limits, not near one pose
    assert (np.ptp(found, axis=0) > 0.5 * (upper - lower)).all()


def test_poses_whose_loops_do_not_close_are_left_out_and_shown_as_missing() -> None:
    kinematics = compile_kinematics(IR663)
    # crank towards the elbow: P3 and P9 are 574 mm apart, lever and coupler span 812 mm at least
    q = np.radians([[1.37, 48.63], [0.0, -90.0], [12.54, 33.04]])
    posture, closed = closed_posture(kinematics, q)
    assert closed.tolist() == [True, False, True]
    assert len(posture.values) == 2
    assert np.isnan(spread(closed, posture.values)[1]).all()


def test_a_length_without_limits_has_no_range() -> None:
    slide = Variable(name="q1", type="prismatic")
    robot = KR240.model_copy(update={"variables": (slide, *KR240.variables[1:])})
    with pytest.raises(BeamstiffError, match="variable 'q1' of robot 'kr240-2' is a length without limits"):
        joint_ranges(robot)


def test_when_no_pose_closes_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(poses, "ROUNDS", 3)  # each takes a fifth of a second
    limits = {"q2": np.radians((0.0, 2.0)), "q8": np.radians((-92.0, -90.0))}
    variables = tuple(
        v.model_copy(update={"limits": tuple(limits[v.name])}) if v.actuated else v for v in IR663.variables
    )
    robot = IR663.model_copy(update={"variables": variables})
    with pytest.raises(BeamstiffError, match="only 0 of 5 poses found whose loops close within the limits"):
        random_poses(compile_kinematics(robot), 5, np.random.default_rng(0))


def test_no_pose_is_drawn_where_a_loop_folds_and_limits_that_hold_a_fold_are_told() -> None:
    palletizer = load_robot("palletizer")
    assert not [said for said in robot_doubts(palletizer) if "fold" in said]
    wide = [
        one.model_copy(update={"limits": (one.limits[0] - 0.9, one.limits[1] + 0.9)}) if one.limits else one
        for one in palletizer.variables
    ]
    robot = palletizer.model_copy(update={"variables": tuple(wide)})
    [said] = [said for said in robot_doubts(robot) if "fold" in said]
    assert re.search(r"its loops come near a fold, such as at q1 = \S+ deg, ", said)
    kinematics = compile_kinematics(robot)
    drawn = random_poses(kinematics, 400, np.random.default_rng(0))
    values, closed, _ = close_loops(kinematics, drawn, strict=False)
    assert closed.mean() > 0.99  # with other neighbours than when it was drawn
    assert not near_fold(kinematics, values[closed]).any()
    low, high = joint_ranges(robot)
    every, closed, _ = close_loops(
        kinematics, np.random.default_rng(1).uniform(low, high, (400, len(low))), False
    )
    assert near_fold(kinematics, every[closed]).any()
