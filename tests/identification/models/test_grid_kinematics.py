"""Kinematic parameters of their own in every cube: planted ones come back, in the geometry's own terms."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot
from beamstiff.calibration.corrected import corrected
from beamstiff.identification.models.grid import with_kinematics
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.cube_kinematics import CubeDeviations, deviating, kinematic_parameters
from beamstiff.model.grid import Cubes, GriddedStiffness, tcp_positions
from tests.identification.varying_machines import WORKSPACE, compliances, kr500, postures

SIGMA = 1e-5
HALVES = ({"f2.d": 3e-4, "q3": 4e-4, "f4.r": -2e-4}, {"f2.d": -1e-4, "q3": -3e-4, "f3.alpha": 5e-4})


def gridded(cubes: Cubes = WORKSPACE, interpolate: bool = False) -> GriddedStiffness:
    springs = np.tile(compliances(), (cubes.count, 1))
    rows = np.full(cubes.count, 1)
    return GriddedStiffness(kr500(), kr500().identify, cubes, springs, rows, interpolate, extrapolate=True)


def machines(q: np.ndarray) -> tuple[Robot, Robot]:
    """Return the robot as its halves of the workspace have it, by other means than the model."""
    first, second = (corrected(kr500(), half, q[:1]) for half in HALVES)
    return first, second


def read(q: np.ndarray, seed: int) -> Measurements:
    left = tcp_positions(kr500(), q)[:, 1:2] > 0
    right, other = (tcp_positions(robot, q) for robot in machines(q))
    seen = np.where(left, other, right) + SIGMA * np.random.default_rng(seed).standard_normal((len(q), 3))
    names = [variable.name for variable in kr500().actuated]
    return make_measurements(names, q, tcp=kr500().tcp, position=seen, sigma_position=SIGMA)


def test_there_are_24_of_six_joints() -> None:
    names = kinematic_parameters(kr500())
    assert len(names) == 24
    assert {"q1", "f1.alpha", "f6.r"} < set(names)


def test_deviations_move_the_tool_as_a_robot_with_other_numbers_does() -> None:
    q = postures(20)
    for half, other in zip(HALVES, machines(q), strict=True):
        rows = np.tile(np.array(list(half.values())), (len(q), 1))
        moved = deviating(kr500(), tuple(half)).offsets(q, rows)
        assert np.abs(moved[:, :3] - (tcp_positions(other, q) - tcp_positions(kr500(), q))).max() < 1e-12


@pytest.mark.parametrize("shrink", [True, False])
def test_planted_kinematics_of_each_half_come_back_on_fresh_poses(shrink: bool) -> None:
    model = with_kinematics(gridded(), read(postures(120), 1), shrink)
    fresh = postures(40, seed=9)
    left = read(fresh, 2).position - tcp_positions(kr500(), fresh) - model.offsets(fresh)[:, :3]
    assert np.sqrt((left**2).sum(axis=1).mean()) < 1.5 * np.sqrt(3) * SIGMA
    everywhere = replace(gridded(), cubes=Cubes(WORKSPACE.low, 1.2, (1, 1, 1)), rows=np.array([1]))
    everywhere = with_kinematics(
        replace(everywhere, compliance=everywhere.compliance[:1]), read(postures(120), 1)
    )
    one = read(fresh, 2).position - tcp_positions(kr500(), fresh) - everywhere.offsets(fresh)[:, :3]
    assert np.abs(one).max() > 10 * np.abs(left).max() > 0  # one set of parameters cannot be both halves


def test_without_deviations_nothing_moves() -> None:
    q = postures(5)
    assert not gridded().offsets(q).any()
    names = kinematic_parameters(kr500())
    model = replace(gridded(), deviations=CubeDeviations(names, np.zeros((2, 24))))
    assert np.abs(model.offsets(q)).max() < 1e-15


def test_what_cannot_carry_kinematics_is_refused() -> None:
    q = postures(40)
    names = [variable.name for variable in kr500().actuated]
    moved = make_measurements(names, q, tcp="n6b", displacement=np.zeros((40, 6)))
    with pytest.raises(BeamstiffError, match=r"holds displacements, expected absolute positions"):
        with_kinematics(gridded(), moved)
    one_side = q[tcp_positions(kr500(), q)[:, 1] > 0]
    with pytest.raises(BeamstiffError, match=r"cube 1.1.1 holds no measured position"):
        with_kinematics(gridded(), read(one_side, 1), shrink=False)
    with pytest.raises(BeamstiffError, match=r"unknown kinematic parameter 'f2.x'"):
        deviating(kr500(), ("f2.x",))
