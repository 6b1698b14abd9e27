import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.maps.grid import boxes, make_grid
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from tests.maps.robots import planar_arm


@given(st.lists(st.integers(1, 9), min_size=1, max_size=4).map(tuple), st.integers(1, 60))
def test_boxes_hold_every_pose_once_and_in_order(shape: tuple[int, ...], most: int) -> None:
    number = np.arange(np.prod(shape)).reshape(shape)
    found = [number[box].reshape(-1) for box in boxes(shape, most)]
    np.testing.assert_array_equal(np.concatenate(found), number.reshape(-1))
    assert max(map(len, found)) <= most


@given(st.integers(1, 3), st.integers(20, 60), st.integers(20, 60))
def test_boxes_are_of_about_one_size(a: int, b: int, c: int) -> None:
    sizes = [np.prod([part.stop - part.start for part in box]) for box in boxes((a, b, c), 19 * c)]
    assert min(sizes) >= 0.5 * max(sizes)


def test_points_of_a_box_run_with_the_last_axis() -> None:
    grid = make_grid(compile_kinematics(planar_arm()), {"q2": [1.0, 2.0, 3.0], "q1": [0.1, 0.2]})
    points = grid.points((slice(1, 3), slice(0, 2)))
    assert points.tolist() == [[2.0, 0.1], [2.0, 0.2], [3.0, 0.1], [3.0, 0.2]]
    assert grid.joint_values(points, planar_arm()).tolist() == [
        [0.1, 2.0],
        [0.2, 2.0],
        [0.1, 3.0],
        [0.2, 3.0],
    ]


def test_what_is_on_no_axis_stays_as_in_the_posture_held() -> None:
    kinematics = compile_kinematics(load_robot("kr240-2"))
    held = {"q2": 1.0, "q3": -1.5, "q5": 0.7}
    stand = pose_of(kinematics, posture(kinematics, held), kinematics.robot.tcp)[0]
    grid = make_grid(kinematics, {"z": [1.0, 1.1]}, held)
    assert grid.turned
    expected = np.repeat(stand[None], 2, axis=0)
    expected[:, 2, 3] = [1.0, 1.1]
    np.testing.assert_array_equal(grid.targets(grid.points((slice(2),))), expected)
    free = make_grid(kinematics, {"z": [1.0, 1.1]}, held, "free")
    np.testing.assert_array_equal(free.targets(free.points((slice(2),))), expected[:, :3, 3])


def test_a_robot_of_few_joints_follows_positions() -> None:
    assert not make_grid(compile_kinematics(planar_arm()), {"x": [0.5, 0.6]}, {"q2": 1.0}).turned


@pytest.mark.parametrize(
    ("over", "told"),
    [
        ({}, "needs axes"),
        ({"q1": [1.0]}, "at least two growing values"),
        ({"q1": [1.0, 1.0]}, "growing"),
        ({"q1": [1.0, np.nan]}, "growing"),
        ({"q1": [[1.0, 2.0]]}, "growing"),
        ({"q1": ["a", "b"]}, "expected numbers"),
        ({name: np.linspace(0, 1, 2_000_000) for name in ("q1", "q2")}, "expected at most"),
    ],
)
def test_grids_that_make_no_sense_are_refused(over: dict, told: str) -> None:
    with pytest.raises(BeamstiffError, match=told):
        make_grid(compile_kinematics(planar_arm()), over)


@pytest.mark.parametrize("turn", [np.zeros((3, 3)), -np.eye(3), np.eye(2)])
def test_an_orientation_is_a_rotation(turn: np.ndarray) -> None:
    kinematics = compile_kinematics(load_robot("kr240-2"))
    with pytest.raises(BeamstiffError, match="expected a right-handed rotation matrix"):
        make_grid(kinematics, {"x": [1.0, 2.0]}, {"q5": 0.7}, turn)
