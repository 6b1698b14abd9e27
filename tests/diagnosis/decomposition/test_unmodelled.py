"""What no effect of the library is, is told as a part of the remainder, and no cause stands in for it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from beamstiff import Robot, load_robot, tcp_compliance
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.elastic import elastic_displacement
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposition.open_model import open_geometry
from beamstiff.diagnosis.decomposition.unmodelled import LOSES_ZERO, UNMODELLED, unmodelled_forms
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.inference.component_subspaces import HINGES, OPENING, TETHERED
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.verify import verify
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.diagnosis_text import remainder_text
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array
from tests.diagnosis.decomposition import test_decompose as ur10

NOISE = 2e-5  # m
LOAD = np.array([0.0, 0.0, -1500.0])  # N
PLAY = 3e-4  # rad, to either side: a bearing lies against one race or the other
LIFTED = 4e-7  # rad/(N m), of a foot on the side to which it opens
OFF = {"q2": 1e-3, "q3": -2e-3, "q5": 2e-3, "f2.d": 5e-4, "f3.d": -8e-4, "f4.alpha": 1e-3, "f5.r": 6e-4}
POSES = 120


def plan(robot: Robot, position: Array, q: Array) -> Measurements:
    names = [variable.name for variable in robot.actuated]
    wrench = np.tile([*LOAD, 0.0, 0.0, 0.0], (len(q), 1))
    return make_measurements(names, q, tcp=robot.tcp, wrench=wrench, position=position, sigma_position=NOISE)


@cache
def loose() -> tuple[Robot, Measurements, Diagnosis]:
    """A KR240-2 whose third bearing tips over to the side to which a payload pulls it."""
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.0, 1.0, (POSES, 6)) + np.array([0.0, -1.2, 1.2, 0.0, 0.0, 0.0])
    made = corrected(robot, OFF, np.zeros((1, 6)))
    sag = elastic_displacement(made, plan(robot, np.zeros((POSES, 3)), q))[:, :3]
    kinematics = compile_kinematics(made)
    at = posture(kinematics, q)
    tool, joint = (pose_of(kinematics, at, node) for node in (robot.tcp, robot.joints[2].nodes[1]))
    across = joint[:, :3, 0]  # of the frame whose z is the joint's axis
    lever = tool[:, :3, 3] - joint[:, :3, 3]
    side = np.sign(np.einsum("ni,ni->n", across, np.cross(lever, LOAD)))
    moved = PLAY * side[:, None] * np.cross(across, lever)
    read = tool[:, :3, 3] + sag + moved + NOISE * rng.standard_normal((POSES, 3))
    rows = plan(robot, read, q)
    return robot, rows, diagnose(robot, rows)


def opened() -> Diagnosis:
    """A KR240-2 whose foot lifts off on one side, about a line 0.4 rad from the base's x axis."""
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(7)
    q = rng.uniform(-1.0, 1.0, (POSES, 6)) * [2.5, 1, 1, 1, 1, 1] + np.array([0.0, -1.2, 1.2, 0.0, 0.0, 0.0])
    made = corrected(robot, OFF, np.zeros((1, 6)))
    sag = elastic_displacement(made, plan(robot, np.zeros((POSES, 3)), q))[:, :3]
    kinematics = compile_kinematics(made)
    tool = pose_of(kinematics, posture(kinematics, q), robot.tcp)[:, :3, 3]
    hinge, at = (
        np.array([np.cos(0.4), np.sin(0.4), 0.0]),
        np.array([-0.2 * np.sin(0.4), 0.2 * np.cos(0.4), 0.0]),
    )
    moment = np.einsum("j,nj->n", hinge, np.cross(tool - at, LOAD))
    turn = LIFTED * np.maximum(moment, 0.0)
    moved = np.cross(turn[:, None] * hinge, tool - at)
    read = tool + sag + moved + NOISE * rng.standard_normal((POSES, 3))
    return diagnose(robot, plan(robot, read, q))


@pytest.mark.slow
def test_a_base_that_opens_to_one_side_is_no_compliance_of_the_base() -> None:
    diagnosis = opened()
    found = diagnosis.decomposition
    assert diagnosis.verdict.effect == "unknown"
    assert not found.causes
    assert found.law.key == f"{UNMODELLED}:base {OPENING}"
    assert found.law.closes > 0.5
    # what turns about a line to the right lifts on its left
    assert found.law.lifted_side == pytest.approx(0.4 + np.pi / 2, abs=np.pi / HINGES / 4)
    (told,) = diagnosis.to_dict()["remainder"]["outside_library"]
    assert told["lifts_at"] == found.law.lifted_side
    assert "lifts most at 11" in remainder_text(found)
    assert extended(diagnosis).unexplained == found.law.looks_like == f"the base {OPENING}"


def loaded_in_turn(robot: Robot) -> tuple[Measurements, Array]:
    """Postures of a KR240-2 under forces in every direction, and the points as the model has them."""
    rng = np.random.default_rng(11)
    q = rng.uniform(-1.0, 1.0, (POSES, 6)) * [2.5, 1, 1, 1, 1, 1] + np.array([0.0, -1.2, 1.2, 0.0, 0.0, 0.0])
    names = [variable.name for variable in robot.actuated]
    wrench = np.concatenate([rng.uniform(-1500.0, 1500.0, (POSES, 3)), np.zeros((POSES, 3))], axis=1)
    nothing = np.zeros((POSES, 3))
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, position=nothing, sigma_position=NOISE)
    made = corrected(robot, OFF, np.zeros((1, 6)))
    kinematics = compile_kinematics(made)
    tool = pose_of(kinematics, posture(kinematics, q), robot.tcp)[:, :3, 3]
    return rows, tool + elastic_displacement(made, rows)[:, :3]


@pytest.mark.slow
def test_a_stand_that_takes_the_reaction_is_no_compliance_of_the_base() -> None:
    robot = load_robot("kr240-2")
    rows, point = loaded_in_turn(robot)
    stands, force = np.array([3.0, -2.0, 0.0]), rows.wrench[:, :3]
    # it tilts away from a push, and stands on springs: as seen from it, all moves the other way
    tilt = 1e-7 * np.stack([force[:, 1], -force[:, 0], np.zeros(POSES)], axis=1)
    seen = point + np.cross(tilt, point - stands) + 1e-7 * force * [0.0, 0.0, 1.0]
    noise = NOISE * np.random.default_rng(12).standard_normal((POSES, 3))
    diagnosis = diagnose(robot, replace(rows, position=seen + noise))
    found = diagnosis.decomposition
    assert diagnosis.verdict.effect == "unknown"
    assert not found.causes
    assert found.law.key == "instrument-motion:null"
    assert found.law.closes > 0.9
    assert found.scatter == pytest.approx(1.0, abs=0.1)
    assert "the stand of the instrument moves with the applied force" in remainder_text(found)
    (told,) = diagnosis.to_dict()["remainder"]["outside_library"]
    sizes = {name: one["value"] for name, one in told["parameters"].items()}
    assert sizes["tilt_about_x_per_fy"] == pytest.approx(1e-7, rel=0.05)
    assert sizes["tilt_about_y_per_fx"] == pytest.approx(-1e-7, rel=0.05)
    # tilts about the stand lift the base: r x (-s), of a stand 3 m ahead of it and 2 m to its right
    assert sizes["rise_per_fx"] == pytest.approx(-3e-7, rel=0.05)
    assert sizes["rise_per_fy"] == pytest.approx(2e-7, rel=0.1)


def test_the_robot_is_calibrated_beside_the_motion_of_the_instrument() -> None:
    robot = load_robot("kr240-2")
    rows, point = loaded_in_turn(robot)
    tilt = 3e-7 * np.stack([rows.wrench[:, 1], -rows.wrench[:, 0], np.zeros(POSES)], axis=1)
    seen = point + np.cross(tilt, point - [3.0, -2.0, 0.0])
    noise = NOISE * np.random.default_rng(12).standard_normal((POSES, 3))
    some = np.arange(POSES) % 4 > 0
    read = replace(rows, position=seen + noise)
    diagnosis = diagnose(robot, subset(read, some))
    real = extended(diagnosis)
    assert [one.effect for one in real.effects] == ["instrument-motion"]
    assert not real.unexplained
    for name in robot.identify[:3]:
        assert real.parameter(name) == pytest.approx(robot.parameter(name), rel=0.03)
    found = verify(real, subset(read, ~some), refit_frame=True)
    assert found.before > 5.0 * found.after
    assert found.after == pytest.approx(np.sqrt(3.0) * NOISE, rel=0.2)
    assert diagnosis.left == pytest.approx(found.after, rel=0.2)


def test_a_hose_from_the_tool_to_the_floor_is_no_compliance_of_the_base() -> None:
    robot = load_robot("kr240-2")
    rows, point = loaded_in_turn(robot)
    made = corrected(robot, OFF, np.zeros((1, 6)))
    spring = 1e6 * np.outer([0.6, 0.0, 0.8], [0.6, 0.0, 0.8])
    compliance = tcp_compliance(made, rows.q)[:, :3, :3]
    free = np.einsum("nij,nj->ni", compliance, rows.wrench[:, :3])
    held = np.linalg.solve(np.eye(3) + compliance @ spring, free[:, :, None])[:, :, 0]
    noise = NOISE * np.random.default_rng(12).standard_normal((POSES, 3))
    diagnosis = diagnose(robot, replace(rows, position=point + held - free + noise))
    found = diagnosis.decomposition
    assert diagnosis.verdict.effect == "unknown"
    assert not found.causes
    assert found.law.key == f"{UNMODELLED}:tool {TETHERED}"
    assert found.law.closes > 0.9


def test_a_bearing_with_play_is_no_effect_of_the_library() -> None:
    _, _, diagnosis = loose()
    found = diagnosis.decomposition
    assert diagnosis.verdict.effect == "unknown"
    largest = max(found.unmodelled, key=lambda cause: cause.closes)
    assert largest.key == f"{UNMODELLED}:q3 has play"
    assert largest.closes > 0.5
    assert "q3 has play" in remainder_text(found)
    assert largest.lifted_side is None
    assert diagnosis.to_dict()["remainder"]["outside_library"][0]["what"] == largest.forms[0].component


def test_the_robot_is_written_without_it() -> None:
    _, _, diagnosis = loose()
    assert all(one.effect != UNMODELLED for one in extended(diagnosis).effects)


def test_modes_move_the_readings_a_metre_each_and_are_few() -> None:
    robot, rows, _ = loose()
    model = open_geometry(robot.model_copy(update={"identify": ()}), rows, parameters=("base",))
    for form in unmodelled_forms(model):
        if str(form.component).endswith(LOSES_ZERO):
            continue
        most = 4 * HINGES if form.shape.name == OPENING else 7  # turns and lifts, to either side
        assert 1 <= form.shape.columns.shape[-1] <= most
        rms = np.sqrt((form.shape.columns[:, :3] ** 2).sum(axis=1).mean(axis=0))
        np.testing.assert_allclose(rms, 1.0)
        assert form.columns == pytest.approx(model.weighed(form.shape.columns * form.sizes))


@pytest.mark.slow
def test_displacements_tell_the_motion_of_the_instrument_too() -> None:
    robot = load_robot("kr240-2")
    rows, point = loaded_in_turn(robot)
    tilt = 3e-7 * np.stack([rows.wrench[:, 1], -rows.wrench[:, 0], np.zeros(POSES)], axis=1)
    noise = NOISE * np.random.default_rng(13).standard_normal((POSES, 3))
    moved = predict_displacements(robot, rows)[:, :3] + np.cross(tilt, point - [3.0, -2.0, 0.0]) + noise
    nothing = np.full((POSES, 3), np.nan)
    read = replace(rows, kind="displacement", position=nothing, displacement=np.hstack([moved, nothing]))
    diagnosis = diagnose(robot, read)
    assert diagnosis.verdict.effect == "unknown"
    assert diagnosis.law is not None
    assert diagnosis.law.key == "instrument-motion:null"
    assert diagnosis.law.closes > 0.9


LOST, LOST_AT = 6e-4, 45  # rad, and the row from which the second joint stands elsewhere than it says


def test_a_joint_that_loses_its_zero_is_told_with_the_row_and_calibrated_as_it_is_in_the_end() -> None:
    robot, rows = ur10.table(())
    said = rows.q.copy()
    said[:LOST_AT, 1] -= LOST  # what the controller showed before: the joint went farther
    result = diagnose(robot, replace(rows, q=said))
    assert result.verdict.effect == "unknown"
    (law,) = result.to_dict()["remainder"]["outside_library"]
    assert law["what"] == "q2 loses its zero"
    assert law["closes"] > 0.9
    row = int(law["when"].rpartition(":")[2])
    line = int(rows.place(LOST_AT - 1).rpartition(":")[2])
    assert abs(row - line) <= 1
    assert "q2 loses its zero after" in remainder_text(result.decomposition)
    later = ur10.read(robot, ur10.table((), 60)[1].q, (), np.random.default_rng(8))
    check = verify(extended(result), later, refit_frame=True)
    assert check.after < 1.5 * np.sqrt(3) * ur10.NOISE
