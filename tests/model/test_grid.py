"""Cubes of the workspace, where they are sampled, and springs that change from cube to cube."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.model.grid import Cubes, GriddedStiffness, tcp_positions
from beamstiff.model.grid_sampling import TOLERANCE, point_in_each, sample, sampling_points
from beamstiff.model.protocol import StructuralModel
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import vector_from_rotation

DOWN = np.diag([-1.0, 1.0, -1.0])
HOME = np.deg2rad([0.0, -60.0, 100.0, 0.0, 40.0, 0.0])
WORKSPACE = Cubes(np.array([1.7, -0.6, 0.8]), 0.6, (1, 2, 1))


def kr500() -> Robot:
    return load_robot("kr500")


def gridded(factor: float = 2.0) -> GriddedStiffness:
    """Return two cubes, the second softer by a factor."""
    robot = kr500()
    compliance = np.array([1.0 / robot.parameter(name) for name in robot.identify])
    both = np.stack([compliance, factor * compliance])
    return GriddedStiffness(robot, robot.identify, WORKSPACE, both, np.array([27, 27]))


def at(*positions: tuple[float, float, float]) -> np.ndarray:
    found = sample(compile_kinematics(kr500()), np.array(positions), DOWN, [0.0], HOME)
    assert found.reached.all()
    return found.q


def push(rows: int) -> np.ndarray:
    return np.tile([100.0, 200.0, -490.0, 0, 0, 30.0], (rows, 1))


@pytest.mark.parametrize(("counts", "points"), [((1, 2, 1), 14), ((2, 4, 2), 61), ((4, 8, 4), 353)])
def test_cubes_are_sampled_at_their_corners_and_centres_each_once(
    counts: tuple[int, int, int], points: int
) -> None:
    cubes = Cubes(np.zeros(3), 0.3, counts)
    found = sampling_points(cubes)
    assert len(found) == points == len(np.unique(found.round(9), axis=0))
    assert (cubes.inside(found).sum(axis=0) == 9).all()


def test_sampling_turns_the_tool_about_its_y_axis() -> None:
    kinematics = compile_kinematics(kr500())
    points = sampling_points(WORKSPACE)
    found = sample(kinematics, points, DOWN, start=HOME)
    assert found.reached.all()
    assert len(found.q) == 3 * len(points)
    there = pose_of(kinematics, posture(kinematics, found.q), "n6b")
    assert np.abs(there[:, :3, 3] - np.repeat(points, 3, axis=0)).max() <= 2 * TOLERANCE
    turned = np.rad2deg(vector_from_rotation(DOWN.T @ there[:, :3, :3]))
    assert np.abs(turned - np.tile([[0, -10, 0], [0, 0, 0], [0, 10, 0]], (len(points), 1))).max() < 1e-4


def test_what_is_out_of_reach_is_said_to_be() -> None:
    found = sample(compile_kinematics(kr500()), [[2.0, 0, 1.0], [9.0, 0, 1.0]], DOWN, [0.0], HOME)
    assert found.reached.tolist() == [True, False]


@given(st.integers(0, 1000))
def test_a_random_point_lies_in_its_cube(seed: int) -> None:
    cubes = Cubes(np.array([0.1, -2.0, 0.5]), 0.15, (4, 8, 4))
    inside = cubes.inside(point_in_each(cubes, np.random.default_rng(seed)))
    assert inside[np.arange(cubes.count), np.arange(cubes.count)].all()


@given(st.integers(0, 1000), st.booleans())
def test_shares_sum_to_one_inside_and_to_nothing_outside(seed: int, smooth: bool) -> None:
    cubes = Cubes(np.array([0.0, 1.0, -1.0]), 0.5, (2, 3, 2))
    points = np.random.default_rng(seed).uniform([-1, 0, -2], [2, 3.5, 1], (40, 3))
    weights = cubes.weights(points, smooth)
    assert (weights >= 0).all()
    assert np.abs(weights.sum(axis=1) - cubes.inside(points).any(axis=1)).max() < 1e-12


def test_interpolation_between_cubes_is_linear_in_the_logarithm() -> None:
    model = replace(gridded(4.0), interpolate=True)
    ratios = model.compliances(at((2.0, -0.3, 1.1), (2.0, -0.15, 1.1), (2.0, 0.0, 1.1), (2.0, 0.5, 1.1)))
    first = model.compliance[0]
    assert np.allclose(ratios / first, np.array([1.0, 2**0.5, 2.0, 4.0])[:, None], rtol=1e-5)


def test_within_a_cube_the_grid_is_the_robot_with_its_stiffness() -> None:
    robot, model = kr500(), gridded(2.0)
    q = at((2.0, -0.3, 1.1), (2.2, 0.4, 0.9))
    softer = robot.with_parameters({name: robot.parameter(name) / 2 for name in robot.identify})
    expected = [StructuralModel(own).predict(q, push(2)) for own in (robot, softer)]
    predicted = model.predict(q, push(2))
    for row in range(2):
        assert np.abs(predicted[row] - expected[row][row]).max() < 1e-12


def test_beyond_the_grid_is_refused_or_flagged() -> None:
    q, model = at((2.0, -0.3, 1.1), (2.0, 0.7, 1.1)), gridded()
    with pytest.raises(
        BeamstiffError, match=r"row 1: found the TCP at x = 2.000, y = 0.700, z = 1.100 m, bey"
    ):
        model.predict(q, push(2))
    assert model.outside(q).tolist() == [False, True]
    assert np.allclose(model.extrapolating().compliances(q)[1], model.compliance[1], rtol=1e-12)


def test_a_cube_without_data_is_refused_or_flagged() -> None:
    q, model = at((2.0, -0.3, 1.1), (2.0, 0.3, 1.1)), replace(gridded(), rows=np.array([27, 0]))
    with pytest.raises(BeamstiffError, match=r"row 1: found the TCP at .* in cube 1.2.1 that has no data"):
        model.predict(q, push(2))
    assert model.outside(q).tolist() == [False, True]


def test_joint_readings_that_miss_a_corner_by_little_still_count_for_their_cubes() -> None:
    corner = WORKSPACE.low + np.array([0.0, 0.6, 0.0])
    away = np.array([[-1e-3, 1e-3, -1e-3]])
    assert WORKSPACE.inside(corner + away).tolist() == [[True, True]]


def test_positions_are_those_of_the_nominal_tcp() -> None:
    assert np.abs(tcp_positions(kr500(), at((2.0, 0.3, 1.1))) - [[2.0, 0.3, 1.1]]).max() < 2 * TOLERANCE
