"""Closing many poses at once: the postures that Newton's method finds, and no claim about any other."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.loops import LoopSystem, loop_equations, loop_system, recorded
from beamstiff.robot.newton import CLOSED, close_at_once, closing_program, newton

ROBOTS = ["ir663", "tripod"]


def near_the_assembly(name: str, poses: int, reach: float, seed: int = 0) -> tuple[LoopSystem, np.ndarray]:
    """Return a robot's loops, and starts off by up to `reach` from a closed posture, few far, many near."""
    system = recorded(loop_system(compile_kinematics(load_robot(name))))
    assembly = system.kinematics.assembly
    rng = np.random.default_rng(seed)
    shifts = rng.uniform(-1.0, 1.0, (poses, len(assembly.free))) * reach ** rng.uniform(1.0, 4.0, (poses, 1))
    return system, assembly.free + shifts * system.scale


@pytest.mark.parametrize("name", ROBOTS)
def test_it_closes_what_newton_closes(name: str) -> None:
    system, start = near_the_assembly(name, 300, 0.02)
    free, sure = close_at_once(system, system.kinematics.assembly, start)
    assert sure.mean() > 0.95
    expected, _, _, closed = newton(system, start)
    assert closed[sure].all()
    assert np.abs(free - expected)[sure].max() <= 1e-12
    assert np.linalg.norm(loop_equations(system, free)[0], axis=1)[sure].max() <= 2 * CLOSED
    assert (free[:, : system.actuated] == start[:, : system.actuated]).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_what_it_claims_is_closed_in_the_branch_wherever_it_starts(name: str) -> None:
    system, start = near_the_assembly(name, 2000, 0.5)
    assembly = system.kinematics.assembly
    free, sure = close_at_once(system, assembly, start)
    assert 0 < sure.sum() < len(sure)
    gaps, jacobian = loop_equations(system, free[sure])
    assert np.linalg.norm(gaps, axis=1).max() <= 2 * CLOSED
    assert assembly.same_branch(jacobian[:, :, system.actuated :]).all()


def test_a_posture_closed_in_another_branch_is_not_claimed() -> None:
    system, _ = near_the_assembly("ir663", 1, 0.0)
    assembly = system.kinematics.assembly
    around = np.repeat(assembly.free[None], 200, axis=0)
    around[:, system.actuated :] += np.random.default_rng(1).uniform(-np.pi, np.pi, (200, 2))
    found, _, jacobian, closed = newton(system, around)
    flipped = closed & ~assembly.same_branch(jacobian)
    assert flipped.any()
    assert not close_at_once(system, assembly, found[flipped])[1].any()


def test_what_is_no_number_is_not_claimed() -> None:
    system, start = near_the_assembly("ir663", 3, 0.01)
    start[1, 0], start[2, 1] = np.nan, np.inf
    assert close_at_once(system, system.kinematics.assembly, start)[1].tolist() == [True, False, False]


def test_equations_that_are_not_written_down_are_left_to_newton() -> None:
    system = loop_system(compile_kinematics(load_robot("ir663")))
    assembly = system.kinematics.assembly
    assert closing_program(system, assembly) is None
    start = assembly.free[None]
    free, sure = close_at_once(system, assembly, start)
    assert (free == start).all()
    assert not sure.any()
