"""The influence of K_C on displacements: seed 000, section 3.2."""

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.fem.structure import compile_structure
from beamstiff.planning.influence import choose_wrist, influence_map, load_influence
from beamstiff.planning.poses import joint_grid
from beamstiff.robot.kinematics import posture, twist_jacobian
from beamstiff.robot.reader import load_robot
from tests.fem.complementary_stiffness import complementary_stiffness

KR240 = load_robot("kr240-2")
STRUCTURE = compile_structure(KR240)
STIFFNESS = np.diag([joint.stiffness.torsional for joint in KR240.joints])
WRENCH = np.array([0, 0, -2000.0, 200, 200, 0])  # seed 000, section 3.2
WRIST = {"q4": np.pi / 4, "q5": np.pi / 4, "q6": np.pi / 4}
ANGLES = np.radians(np.arange(-180, 180, 5))


def test_nu_is_equations_14_and_15_with_equation_10() -> None:
    q = np.random.default_rng(0).uniform(-3, 3, (30, 6))
    pose = posture(STRUCTURE.kinematics, q)
    jacobian = twist_jacobian(STRUCTURE.kinematics, pose, KR240.tcp)
    k_c = complementary_stiffness(STRUCTURE, pose, WRENCH)
    with_k_c = np.array(
        [j @ np.linalg.solve(STIFFNESS - k, j.T @ WRENCH) for j, k in zip(jacobian, k_c, strict=True)]
    )
    without = np.array([j @ np.linalg.solve(STIFFNESS, j.T @ WRENCH) for j in jacobian])
    one, other = np.linalg.norm(with_k_c[:, :3], axis=1), np.linalg.norm(without[:, :3], axis=1)
    found = load_influence(STRUCTURE, pose, WRENCH)
    assert found.nu_p == pytest.approx(np.abs(one - other) / np.maximum(one, other), rel=1e-6, abs=1e-12)
    assert found.nu_r == pytest.approx(np.abs(with_k_c - without)[:, 3:].max(axis=1), rel=1e-6)
    assert found.displacement == pytest.approx(with_k_c, rel=1e-9)


def test_the_papers_bounds_hold_over_the_joint_space() -> None:
    """nu_p <= 0.016 and nu_r <= 0.025 deg everywhere; with Table 2's stiffness far less, nu_p < 0.002."""
    found = influence_map(STRUCTURE, joint_grid(KR240, {"q2": ANGLES, "q3": ANGLES}, WRIST), WRENCH)
    assert found.nu_p.max() < 0.002 < 0.016
    assert np.degrees(found.nu_r.max()) < 0.025
    assert found.nu_p.max() > 1e-4  # it is an influence, not rounding


def test_nu_grows_with_the_load() -> None:
    pose = posture(STRUCTURE.kinematics, np.random.default_rng(1).uniform(-3, 3, (20, 6)))
    one, ten = (load_influence(STRUCTURE, pose, factor * WRENCH) for factor in (1e-3, 1e-2))
    assert ten.nu_p == pytest.approx(10 * one.nu_p, rel=1e-2, abs=1e-10)
    assert ten.nu_r == pytest.approx(100 * one.nu_r, rel=1e-2)  # rotation and K_C both grow


def test_zones_of_small_influence() -> None:
    grid = joint_grid(KR240, {"q2": ANGLES, "q3": ANGLES}, WRIST)
    found = influence_map(STRUCTURE, grid, WRENCH)
    inside = found.within(nu_p=3e-4, nu_r=5e-7)
    assert inside.shape == grid.shape
    assert (inside == ((found.nu_p <= 3e-4) & (found.nu_r <= 5e-7))).all()
    assert 0 < inside.mean() < 1


def test_a_closed_loop_machine_has_its_influence_too() -> None:
    robot = load_robot("ir663")
    structure = compile_structure(robot)
    over = {"q2": np.radians(np.arange(-160, 161, 40)), "q8": np.radians(np.arange(-160, 161, 40))}
    found = influence_map(structure, joint_grid(robot, over), [0, 0, -900, 0, 0, 0])
    reached = ~np.isnan(found.nu_p)
    assert 0 < reached.mean() < 1
    assert 1e-5 < np.median(found.nu_p[reached]) < 1e-2
    assert not found.within(1.0, 1.0)[~reached].any()


def test_the_wrist_is_chosen_where_the_influence_is_least() -> None:
    poses = np.radians([[0, 50, -200, 0, 0, 45], [0, 10, 10, 0, 0, 45], [0, 120, 20, 0, 0, 45]])
    over = {"q4": np.radians(np.arange(-90, 91, 30)), "q5": np.radians(np.arange(-120, 121, 30))}
    chosen = choose_wrist(STRUCTURE, poses, WRENCH, over, 0.682, least=0.3)
    i, j = (
        int(np.argmin(np.abs(axis - chosen.best[name])))
        for axis, name in ((chosen.grid.first, "q4"), (chosen.grid.second, "q5"))
    )
    # what the map says of the chosen values is what the poses have there
    q = poses.copy()
    q[:, 3], q[:, 4] = chosen.best["q4"], chosen.best["q5"]
    there = load_influence(STRUCTURE, posture(STRUCTURE.kinematics, q), WRENCH)
    assert chosen.nu_p[i, j] == pytest.approx(there.nu_p.max())
    assert chosen.nu_r[i, j] == pytest.approx(there.nu_r.max())
    assert chosen.inverse_condition[i, j] >= 0.3
    # nothing else allowed is better in both
    allowed = chosen.inverse_condition >= 0.3
    better = allowed & (chosen.nu_p < chosen.nu_p[i, j]) & (chosen.nu_r < chosen.nu_r[i, j])
    assert not better.any()
    # straight wrists are singular: never allowed
    assert not allowed[:, np.abs(chosen.grid.second) < 1e-9].any()


def test_what_cannot_be_chosen_is_refused() -> None:
    poses = np.radians([[0, 50, -200, 0, 0, 45]])
    over = {"q4": [0.0, 0.5], "q5": [-0.01, 0.01]}
    with pytest.raises(BeamstiffError, match=r"no values of q4 and q5 keep 1/kappa_F at 0\.3 in all 1 poses"):
        choose_wrist(STRUCTURE, poses, WRENCH, over, 0.682, least=0.3)


@pytest.mark.parametrize(
    ("wrench", "message"),
    [
        ([0, 0, -2000], "wrench: found .*, expected six numbers fx fy fz mx my mz"),
        ([0, 0, np.nan, 0, 0, 0], "wrench: found .*, expected six numbers"),
        ([0] * 6, "wrench: found zeros only, expected a load"),
    ],
)
def test_a_wrench_that_is_none_is_refused(wrench: list[float], message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        load_influence(STRUCTURE, posture(STRUCTURE.kinematics, np.zeros((1, 6))), wrench)
