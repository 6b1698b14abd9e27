"""Postures that are proposed keep clear of boxes: checked by points along every part."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.functions.plan import plan
from beamstiff.planning.candidates import candidate_poses
from beamstiff.planning.obstacles import clear
from beamstiff.planning.poses import closed_posture, random_poses
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Kinematics, compile_kinematics
from beamstiff.robot.parts import Obstacle
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array

BOXES = (
    Obstacle(name="fence", low=(0.8, -3.0, 0.0), high=(1.0, 3.0, 1.5)),
    Obstacle(name="floor", low=(-5.0, -5.0, -1.0), high=(5.0, 5.0, 0.0)),
)
ALONG = np.linspace(0.0, 1.0, 2001)[:, None]


def boxed(name: str, obstacles: tuple[Obstacle, ...] = BOXES) -> Kinematics:
    return compile_kinematics(load_robot(name).model_copy(update={"obstacles": obstacles}))


def hit(robot: Robot, kinematics: Kinematics, positions: Array) -> bool:
    """Return whether some of 2001 points along some part lies in a box."""
    for item in (*robot.beams, *robot.rigids, *robot.joints, *robot.struts):
        if not set(item.nodes) <= set(robot.fixed):
            start, end = (positions[kinematics.node_index[node]] for node in item.nodes)
            points = start + ALONG * (end - start)
            for box in robot.obstacles:
                if ((points > box.low) & (points < box.high)).all(axis=1).any():
                    return True
    return False


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
def test_lines_through_boxes_are_found_as_by_points_along_them(name: str) -> None:
    kinematics = boxed(name)
    q = random_poses(kinematics, 200, np.random.default_rng(3))
    positions = closed_posture(kinematics, q)[0].node_positions
    expected = [not hit(kinematics.robot, kinematics, at) for at in positions]
    assert 0 < sum(expected) < len(expected)
    # a corner may be cut by less than the distance of two points
    assert np.mean(clear(kinematics, positions) == expected) > 0.99


def test_lines_along_a_side_and_points_within_a_box() -> None:
    kinematics = boxed("kr240-2", (Obstacle(name="box", low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)),))
    count = len(kinematics.robot.nodes)
    for place, free in (((0.5, 0.5, 0.5), False), ((0.5, 0.5, 1.0), True), ((0.5, 2.0, 0.5), True)):
        assert clear(kinematics, np.tile(np.array(place), (1, count, 1))).tolist() == [free]


def test_plans_keep_clear_and_the_robot_file_keeps_the_boxes() -> None:
    robot = load_robot("kr240-2").model_copy(update={"obstacles": BOXES})
    assert parse_robot(robot_to_yaml(robot), "<text>").obstacles == BOXES
    kinematics = compile_kinematics(robot)
    q = plan(robot, tests=6, force="500N").campaign.tests.q
    assert clear(kinematics, closed_posture(kinematics, q)[0].node_positions).all()


def test_a_machine_walled_in_is_refused(tmp_path: Path) -> None:
    everywhere = (Obstacle(name="hall", low=(-9.0, -9.0, -9.0), high=(9.0, 9.0, 9.0)),)
    with pytest.raises(BeamstiffError, match=r"0 of 5 random poses keep clear of its obstacles"):
        candidate_poses(boxed("kr240-2", everywhere), 5, seed=0)
    with pytest.raises(BeamstiffError, match=r"z: found 0 m, expected more than 1 m of low"):
        Obstacle(name="flat", low=(0.0, 0.0, 1.0), high=(1.0, 1.0, 0.0))
