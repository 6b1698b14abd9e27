"""Absolute positions of a rigid model: what the dead weight shows is found, what is hidden is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot, predict
from beamstiff.calibration.calibrate import calibrate
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.recalibration import recalibration_of
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.verify import verify
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Node, Rigid
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation
from tests.calibration.machines import within

UR10 = Path(__file__).resolve().parents[2] / "examples" / "data" / "ur10.yaml"
COMPLIANCE = 8e-6  # rad/(N m)
NOISE, TURN = 3e-5, 1e-5  # m, rad


def measured(robot: Robot, joint: int | None, seed: int = 5) -> Measurements:
    """Return 80 positions of the tool; a joint gives way under the weight behind it, by plain statics."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.5, 2.5, (80, 6))
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((80, 3)))
    position = nominal_pose(robot, rows)[0]
    if joint is not None:
        position = position + COMPLIANCE * moved(robot, q, joint, position)[0]
    position = position + NOISE * rng.standard_normal(position.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=NOISE)


def far_away(robot: Robot, scatter: float, sag: float, seed: int = 1) -> Measurements:
    """Return 80 positions that a tracker reads in its own frame, the second joint `sag` times as soft."""
    rng = np.random.default_rng(seed)
    q = np.array([0.0, -1.0, 1.0, 0.3, 0.5, 0.0]) + rng.uniform(-0.7, 0.7, (80, 6))
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((80, 3)))
    position = nominal_pose(robot, rows)[0]
    position = position + 10.0 * sag * COMPLIANCE * moved(robot, q, 2, position)[0]
    position = position + scatter * rng.standard_normal(position.shape)
    there = position @ rotation_from_vector(np.array([0.0, 0.0, 0.3])).T + [0.5, 0.2, 0.1]
    return make_measurements(names, q, tcp=robot.tcp, position=there, sigma_position=NOISE)


def poses(robot: Robot, joint: int, seed: int) -> Measurements:
    """Return the same with how the tool is turned, read finely."""
    rows = measured(robot, joint, seed)
    tool, turn = nominal_pose(robot, rows)
    sag = rotation_from_vector(COMPLIANCE * moved(robot, rows.q, joint, tool)[1])
    noise = rotation_from_vector(TURN * np.random.default_rng(seed).standard_normal(tool.shape))
    sigma = np.tile([NOISE] * 3 + [TURN] * 3, (len(rows), 1))
    return replace(rows, rotation=vector_from_rotation(noise @ sag @ turn), sigma=sigma, sigma_rotation=TURN)


def moved(robot: Robot, q: Array, joint: int, tool: Array) -> tuple[Array, Array]:
    """Return what the tool moves and turns by per unit compliance about a joint's axis, (N, 3) each."""
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, q)
    frames = where.transforms[:, [kinematics.frame_index[f"f{k}"] for k in range(1, 7)]]
    axis, origin = frames[:, joint - 1, :3, 2], frames[:, joint - 1, :3, 3]
    torque = np.zeros(len(q))
    for mass in robot.masses:
        node = next(item for item in robot.nodes if item.name == mass.node)
        at = frames[:, int(node.frame[1]) - 1]
        if int(node.frame[1]) >= joint:
            centre = at[:, :3, 3] + at[:, :3, :3] @ (np.array(node.at) + np.array(mass.at))
            weight = mass.mass * np.array(robot.gravity)
            torque += np.einsum("ni,ni->n", axis, np.cross(centre - origin, weight))
    return torque[:, None] * np.cross(axis, tool - origin), torque[:, None] * axis


@pytest.fixture(scope="module")
def told() -> dict[int | None, Diagnosis]:
    robot = load_robot(UR10)
    return {joint: diagnose(robot, measured(robot, joint)) for joint in (None, 2, 3)}


def test_a_rigid_robot_that_does_not_give_way_is_in_order(told: dict[int | None, Diagnosis]) -> None:
    assert told[None].verdict.effect == "none"


@pytest.mark.parametrize("joint", [2, 3])
def test_a_joint_that_gives_way_under_weight_is_named(told: dict[int | None, Diagnosis], joint: int) -> None:
    found = told[joint]
    assert found.verdict.key == f"joint-compliance:q{joint}"
    [compliance] = found.verdict.estimates
    assert compliance.value == pytest.approx(COMPLIANCE, rel=0.05)
    assert found.verdict.shrink.shrink > 0.95


@pytest.mark.parametrize("scatter", [3e-4, 1e-3])
def test_what_a_tracker_reads_in_its_own_frame_is_calibrated(scatter: float) -> None:
    """However the machine scatters; that the frame is another one is no cause."""
    robot = load_robot(UR10)
    off = {"q2": 2e-3, "q3": -3e-3, "q5": 2e-3, "f2.d": 5e-4, "f3.d": -8e-4, "f4.alpha": 1e-3}
    rows = far_away(corrected(robot, off, np.zeros((1, 6))), scatter, sag=0.0)
    fitted, fresh = subset(rows, np.arange(56)), subset(rows, np.arange(56, 80))
    found = diagnose(robot, fitted)
    assert found.verdict.effect in ("none", "unknown")
    alone = calibrate(robot.model_copy(update={"identify": ()}), fitted, folds=0).robot
    left, by_itself = (verify(one, fresh, refit_frame=True).after for one in (extended(found), alone))
    assert left == pytest.approx(by_itself, rel=0.02)


def test_a_robot_found_from_poses_is_the_one_that_was_measured() -> None:
    robot = load_robot(UR10)
    rows = poses(robot, 2, seed=5)
    off = {"f3.d": 1e-3, "f2.alpha": 1e-3, "q3": 1e-3, "q4": 2e-3}
    found = diagnose(corrected(robot, off, rows.q[:1]), rows)
    assert found.decomposition is not None
    told = recalibration_of(found.decomposition, found.applied)
    by = {one.parameter.name: one.by for one in told.changes}
    assert by["q4"] == pytest.approx(-off["q4"], abs=5e-5)
    assert by["q3"] == pytest.approx(-off["q3"], abs=5e-5)
    [compliance] = found.verdict.estimates
    assert 1e-4 < compliance.realistic[1] < 1e-2  # drives of light arms have 1e4 N m/rad, none has 1e2
    checked = verify(extended(found), measured(robot, 2, seed=6), refit_frame=True)
    assert checked.before > 5.0 * checked.noise
    assert checked.after < 1.1 * checked.noise


def test_what_rigid_joints_without_loads_cannot_show_is_said(told: dict[int | None, Diagnosis]) -> None:
    hidden = {one.effect: one.why for one in told[2].untestable}
    for effect in ("actuator-lever", "gravity-compensator"):
        assert hidden[effect] == "all joints are rigid about their axes: add a stiffness to the robot file"
    for effect in ("backlash", "hardening", "hysteresis"):
        assert hidden[effect] == "these loads and postures do not excite it: choose others (beamstiff plan)"
    assert hidden["load-error"] == "no row carries a load: measure with one"
    assert "no row carries a load: only compliance under the machine's own weight can show" in told[2].notes


def test_a_robot_without_masses_is_told_that_its_sag_looks_like_something_else() -> None:
    robot = load_robot(UR10)
    found = diagnose(robot.model_copy(update={"masses": (), "payload": None}), measured(robot, 2))
    assert found.verdict.effect != "joint-compliance"
    assert sum("give it `masses`" in note for note in found.notes) == 1
    assert "Give the robot file `masses`, estimates are enough, and diagnose again" in str(found)


def test_a_reflector_that_was_put_on_elsewhere_is_no_error_of_the_geometry() -> None:
    """Of a four-bar, an angle of the arm between its bearings moves a reflector on the arm alike."""
    nominal = load_robot("ir663")
    tool = next(node for node in nominal.nodes if node.name == nominal.tcp)
    stalk = Rigid(name="stalk", nodes=(nominal.tcp, "ball"))

    def with_ball(x: float) -> Robot:
        ball = Node(name="ball", frame=tool.frame, at=(tool.at[0] + x, *tool.at[1:]))
        parts = {"nodes": (*nominal.nodes, ball), "rigids": (*nominal.rigids, stalk)}
        return nominal.model_copy(update=parts)

    def table(position: Array) -> Measurements:
        read = {"position": position, "sigma_position": NOISE, "point": ["ball"] * len(q)}
        return make_measurements([one.name for one in nominal.actuated], q, tcp=nominal.tcp, **read)

    q = within(nominal, 40, 0)
    there = predict(with_ball(7e-3), table(np.zeros((40, 3)))).pose
    assert there is not None
    rows = table(there[:, :3] + np.random.default_rng(0).normal(0.0, NOISE, (40, 3)))
    assert diagnose(with_ball(0.0), rows).verdict.effect == "none"
