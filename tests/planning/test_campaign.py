"""Campaigns: candidates within reach, what they tell, and the table that is filled in."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.reader import read_measurements
from beamstiff.planning.campaign import Plan, by_pose, plan_csv, plan_of
from beamstiff.planning.candidates import (
    Noise,
    candidate_poses,
    candidate_tests,
    force_loads,
    identifiable,
    information,
)
from beamstiff.planning.designs import choose_tests
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array

KR240, IR663 = load_robot("kr240-2"), load_robot("ir663")
LOADS = [[0, 0, -2000, 200, 200, 0], [0, 1500, 0, 0, 0, 150], [1500, 0, 0, 0, -200, 0]]
NOISE = Noise(3e-5, 5e-5)


def plan_campaign(
    robot: Robot,
    count: int,
    loads: Any,
    noise: Noise,
    *,
    parameters: Any = None,
    criterion: Any = "D",
    poses: Any = None,
    candidates: int = 1000,
    region: Any = None,
    whole_poses: bool = False,
    seed: int = 0,
) -> Plan:
    """Return the best tests, or whole poses, among random poses."""
    if poses is None:
        poses = candidate_poses(compile_kinematics(robot), candidates, seed, region)
    tests = candidate_tests(robot, poses, loads)
    names, tells = information(robot, tests, noise, parameters)
    design = choose_tests(by_pose(tests, tells) if whole_poses else tells, count, names, criterion)
    return plan_of(tests, design, noise, whole_poses)


def displacement(robot: Robot, q: Array, wrench: Array) -> Array:
    structure = compile_structure(robot)
    compliance = tcp_compliance(structure, posture(structure.kinematics, q))
    return (compliance @ wrench[..., None])[..., 0]


@pytest.mark.parametrize(("robot", "loads"), [(KR240, LOADS), (IR663, force_loads(900.0, ("x", "z")))])
@pytest.mark.parametrize("noise", [NOISE, Noise(3e-5, 5e-5, force=20.0, moment=5.0)])
def test_information_is_that_of_differences_of_the_displacement(
    robot: Robot, loads: Any, noise: Noise
) -> None:
    poses = candidate_poses(compile_kinematics(robot), 12, seed=1)
    tests = candidate_tests(robot, poses, loads)
    names, found = information(robot, tests, noise)
    assert names == robot.identify
    structure = compile_structure(robot)
    compliance = tcp_compliance(structure, posture(structure.kinematics, tests.q))
    columns = []
    for name in names:
        sides = [
            displacement(
                robot.with_parameters({name: robot.parameter(name) * np.exp(step)}), tests.q, tests.wrench
            )
            for step in (1e-4, -1e-4)
        ]
        columns.append((sides[0] - sides[1]) / 2e-4)
    sensitivity = np.stack(columns, axis=-1)
    used = 3 if noise.rotation is None else 6
    read = np.diag([noise.position**2] * 3 + [(noise.rotation or 1.0) ** 2] * 3)
    load = np.diag([noise.force**2] * 3 + [noise.moment**2] * 3)
    for row, got in enumerate(found):
        covariance = (read + compliance[row] @ load @ compliance[row].T)[:used, :used]
        expected = sensitivity[row, :used].T @ np.linalg.solve(covariance, sensitivity[row, :used])
        assert got == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_noise_of_the_load_makes_tests_tell_less() -> None:
    tests = candidate_tests(KR240, candidate_poses(compile_kinematics(KR240), 30, seed=2), LOADS)
    plain = information(KR240, tests, NOISE)[1]
    noisy = information(KR240, tests, replace(NOISE, force=50.0))[1]
    assert (np.linalg.eigvalsh(plain - noisy) > -1e-9 * np.abs(plain).max(axis=(1, 2))[:, None]).all()
    assert np.trace(noisy.sum(axis=0)) < 0.9 * np.trace(plain.sum(axis=0))


def test_the_noise_model_changes_the_choice() -> None:
    poses = candidate_poses(compile_kinematics(KR240), 200, seed=3)
    chosen = [
        plan_campaign(KR240, 10, LOADS, noise, poses=poses).tests.q
        for noise in (Noise(3e-5, 5e-4), Noise(3e-5, 5e-6))
    ]
    assert {tuple(q) for q in chosen[0]} != {tuple(q) for q in chosen[1]}


def test_expected_standard_errors_are_those_of_simulated_campaigns() -> None:
    """Least squares in the logarithms: one Gauss-Newton step from the truth, against what is expected."""
    campaign = plan_campaign(KR240, 15, LOADS, NOISE, candidates=150, seed=4)
    tests, names = campaign.tests, campaign.design.names
    rng = np.random.default_rng(0)
    columns = [
        displacement(KR240.with_parameters({name: KR240.parameter(name) * 1.0001}), tests.q, tests.wrench)
        for name in names
    ]
    base = displacement(KR240, tests.q, tests.wrench)
    sigma = np.array([3e-5] * 3 + [5e-5] * 3)
    sensitivity = ((np.stack(columns, axis=-1) - base[..., None]) / np.log(1.0001) / sigma[:, None]).reshape(
        -1, 6
    )
    found = np.linalg.lstsq(sensitivity, rng.normal(size=(len(sensitivity), 4000)))[0]
    spread = found.std(axis=1)
    assert spread == pytest.approx(list(campaign.design.standard_errors.values()), rel=0.06)


def test_candidates_are_all_loads_at_all_poses() -> None:
    poses = np.zeros((2, 6))
    poses[1] = 0.5
    tests = candidate_tests(KR240, poses, LOADS)
    assert len(tests) == 6
    assert tests.q[:3].tolist() == [[0.0] * 6] * 3
    assert tests.wrench.tolist() == [[float(f) for f in load] for load in LOADS] * 2
    assert tests.pose.tolist() == [0, 0, 0, 1, 1, 1]
    assert np.isnan(tests.displacement).all()


def test_poses_lie_in_the_region_and_within_the_limits() -> None:
    kinematics = compile_kinematics(KR240)
    region = [(1.0, 2.5), (-1.0, 1.0), (0.3, 2.0)]
    poses = candidate_poses(kinematics, 200, seed=5, region=region)
    at = posture(kinematics, poses).node_positions[:, kinematics.node_index[KR240.tcp]]
    assert poses.shape == (200, 6)
    assert all(
        ((at[:, axis] >= low) & (at[:, axis] <= high)).all() for axis, (low, high) in enumerate(region)
    )
    limits = np.array([v.limits for v in KR240.actuated])
    assert ((poses >= limits[:, 0]) & (poses <= limits[:, 1])).all()
    with pytest.raises(BeamstiffError, match="only 0 of 5 random poses have their TCP in the region"):
        candidate_poses(kinematics, 5, seed=5, region=[(9, 10), (0, 1), (0, 1)])


def test_the_plan_is_a_table_that_is_read_back_when_filled_in(tmp_path: Path) -> None:
    campaign = plan_campaign(KR240, 12, LOADS, Noise(3e-5, 5e-5), candidates=100, seed=6)
    path = tmp_path / "plan.csv"
    path.write_text(plan_csv(campaign, KR240))
    lines = path.read_text().splitlines()
    header = next(line for line in lines if not line.startswith("#"))
    for cell in ("q1 [deg]", "fz [N]", "dx [mm]", "rz [rad]", "pose", "step"):
        assert cell in header.split(",")
    assert any(line.startswith("# sigma_rotation: 5e-05 rad") for line in lines)
    assert any(line.startswith("# plan: 12 tests, D-efficient to at least 9") for line in lines)
    with pytest.raises(BeamstiffError, match="no measured value"):
        read_measurements(path, KR240)
    # someone fills in what they measured
    expected = displacement(KR240, campaign.tests.q, campaign.tests.wrench)
    names = header.split(",")
    filled, row = [], 0
    for line in lines:
        if line.startswith("#") or line == header:
            filled.append(line)
            continue
        cells = line.split(",")
        for at, name in enumerate(("dx [mm]", "dy [mm]", "dz [mm]", "rx [rad]", "ry [rad]", "rz [rad]")):
            assert cells[names.index(name)] == ""
            cells[names.index(name)] = repr(float(expected[row, at]) * (1e3 if at < 3 else 1.0))
        filled.append(",".join(cells))
        row += 1
    path.write_text("\n".join(filled) + "\n")
    back = read_measurements(path, KR240)
    # to the digits of a pendant, a tenth of a degree
    np.testing.assert_allclose(back.q, campaign.tests.q, rtol=0, atol=np.radians(0.05) + 1e-12)
    np.testing.assert_allclose(np.degrees(back.q), np.degrees(back.q).round(1), rtol=0, atol=1e-12)
    assert back.wrench.tolist() == campaign.tests.wrench.tolist()
    assert back.displacement == pytest.approx(expected, rel=1e-12)
    assert back.pose.tolist() == campaign.tests.pose.tolist()
    assert back.sigma_rotation == 5e-5


def test_whole_poses_take_all_their_loads() -> None:
    loads = force_loads(900.0, ["x", "z"])
    campaign = plan_campaign(IR663, 5, loads, Noise(3.5e-5), candidates=60, whole_poses=True, seed=7)
    assert len(campaign.tests) == 10
    assert np.bincount(campaign.tests.pose).tolist() == [2] * 5
    assert len(np.unique(campaign.tests.q, axis=0)) == 5
    names, found = information(IR663, campaign.tests, Noise(3.5e-5))
    assert names == campaign.design.names
    assert np.linalg.inv(found.sum(axis=0)) == pytest.approx(campaign.design.covariance, rel=1e-6)


def test_rows_of_a_pose_stand_together_and_poses_near_each_other() -> None:
    campaign = plan_campaign(KR240, 30, LOADS, NOISE, candidates=40, seed=8)
    pose = campaign.tests.pose
    assert (np.diff(pose) >= 0).all()
    assert set(np.diff(pose)) <= {0, 1}
    assert all(len(np.unique(campaign.tests.q[pose == p], axis=0)) == 1 for p in np.unique(pose))
    first = campaign.tests.q[np.unique(pose, return_index=True)[1]]
    way = np.abs(np.diff(first, axis=0)).max(axis=1).sum()
    shuffled = np.random.default_rng(0).permutation(first)
    assert way < np.abs(np.diff(shuffled, axis=0)).max(axis=1).sum()


def test_the_same_seed_plans_the_same() -> None:
    plans = [plan_campaign(KR240, 8, LOADS, NOISE, candidates=60, seed=seed).tests.q for seed in (1, 1, 2)]
    assert (plans[0] == plans[1]).all()
    assert plans[0].shape != plans[2].shape or (plans[0] != plans[2]).any()


def test_under_the_papers_wrench_joint_1_is_never_loaded() -> None:
    """[0, 0, -2000 N, 200, 200, 0 N m] (seed 000, 3.2) has no moment about axis 1, which is vertical."""
    with pytest.raises(BeamstiffError, match=r"J1\.torsional is never loaded by these tests"):
        plan_campaign(KR240, 10, [[0, 0, -2000, 200, 200, 0]], NOISE, candidates=50)
    others = KR240.identify[1:]
    campaign = plan_campaign(KR240, 10, [[0, 0, -2000, 200, 200, 0]], NOISE, candidates=50, parameters=others)
    assert campaign.design.names == others


def test_without_rotations_the_last_axis_is_not_seen() -> None:
    """The TCP of the KR240-2 lies on axis 6: turning about it moves no point that is measured."""
    message = r"J6\.torsional moves next to nothing that these tests measure: measure rotations"
    with pytest.raises(BeamstiffError, match=message):
        plan_campaign(KR240, 10, LOADS, Noise(3e-5), candidates=50)
    campaign = plan_campaign(KR240, 10, LOADS, Noise(3e-5), candidates=50, parameters=KR240.identify[:5])
    assert 0 < campaign.design.worst < 1


def test_springs_that_act_only_together_are_named() -> None:
    """Bearings in series of the IR-663 under loads in its plane (seed 003, 5)."""
    parameters = ["J12.torsional", "J12.radial", "J33.radial"]
    robot = IR663.with_parameters({"J12.radial": 2e8, "J33.radial": 3e8})
    with pytest.raises(BeamstiffError, match=r"the parameters J12\.radial, J33\.radial act only together"):
        plan_campaign(
            robot, 10, force_loads(900.0, ["x", "z"]), Noise(3e-5), candidates=50, parameters=parameters
        )


def test_what_cannot_be_told_is_left_out_with_the_reason_and_the_rest_is_as_alone() -> None:
    tests = candidate_tests(KR240, candidate_poses(compile_kinematics(KR240), 20, seed=3), LOADS)
    names, found, left_out = identifiable(KR240, tests, Noise(3e-5))
    assert (names, list(left_out)) == (KR240.identify[:5], ["J6.torsional"])
    assert found == pytest.approx(information(KR240, tests, Noise(3e-5), KR240.identify[:5])[1], rel=1e-9)
    robot = IR663.with_parameters({"J12.radial": 2e8, "J33.radial": 3e8})
    tests = candidate_tests(
        robot, candidate_poses(compile_kinematics(robot), 20, seed=3), force_loads(900.0, ["x", "z"])
    )
    parameters = ["J12.torsional", "J12.radial", "J33.radial"]
    names, _, left_out = identifiable(robot, tests, Noise(3e-5), parameters)
    assert names == ("J12.torsional", "J12.radial")
    assert left_out == {"J33.radial": "acts only together with J12.radial"}
    with pytest.raises(BeamstiffError, match=r"J1\.torsional is never loaded"):
        identifiable(
            KR240, candidate_tests(KR240, np.ones((1, 6)), [[0, 0, 1, 0, 0, 0]]), NOISE, ["J1.torsional"]
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"loads": np.zeros((1, 6))}, "found a load of zero"),
        ({"loads": np.zeros((0, 6))}, "found 100 poses and 0 loads"),
        (
            {"parameters": ["J1.axial"]},
            "J1.axial is rigid in robot 'kr240-2': a plan to find it needs a value",
        ),
        ({"parameters": ["J7.torsional"]}, "has no stiffness parameter 'J7.torsional'"),
        ({"poses": np.zeros((3, 5))}, r"found joint values of shape \(3, 5\)"),
        ({"count": 301}, "300 candidates for 301 tests"),
    ],
)
def test_plans_that_cannot_be_are_refused(arguments: dict[str, Any], message: str) -> None:
    known: dict[str, Any] = {"count": 10, "loads": LOADS, "noise": NOISE, "candidates": 100}
    with pytest.raises(BeamstiffError, match=message):
        plan_campaign(KR240, **(known | arguments))


def test_loads_are_limited() -> None:
    with pytest.raises(BeamstiffError, match="found a force of 2000, more than the 1500 allowed"):
        candidate_tests(KR240, np.zeros((1, 6)), LOADS, largest_force=1500)
    with pytest.raises(BeamstiffError, match=r"found a moment of 282\.843, more than the 250 allowed"):
        candidate_tests(KR240, np.zeros((1, 6)), LOADS, largest_moment=250)
    with pytest.raises(BeamstiffError, match="direction of a load: found 'u', expected x, y or z"):
        force_loads(1.0, ["u"])


@pytest.mark.parametrize(
    "values",
    [
        {"position": 0.0},
        {"position": np.nan},
        {"position": 1.0, "rotation": 0.0},
        {"position": 1.0, "force": -1},
    ],
)
def test_noise_that_is_none_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(BeamstiffError, match="noise: found"):
        Noise(**values)


def test_a_measured_campaign_is_no_plan() -> None:
    campaign = plan_campaign(KR240, 8, LOADS, NOISE, candidates=60)
    measured = replace(campaign, tests=replace(campaign.tests, displacement=np.zeros((8, 6))))
    with pytest.raises(BeamstiffError, match="measured already, expected a plan"):
        plan_csv(measured, KR240)
