"""Rotations that are read worse than stated, and causes that show in rotations alone."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.exam.cases import Exam, draw_case
from beamstiff.exam.simulate import simulate
from beamstiff.measure.table import make_measurements
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import rotation_from_vector, vector_from_rotation
from tests.diagnosis.decomposition.test_decompose import FRAME, GEAR, NOISE, UR10, machine, read

STATED = 5e-5  # rad
TURNED = np.array([0.3, -0.5, 0.2])  # rad, of the target on the tool


@pytest.mark.parametrize("scatter", [STATED, 20 * STATED])
@pytest.mark.parametrize("causes", [(), ("gear",)])
def test_a_cause_is_found_however_badly_rotations_are_read(causes: tuple[str, ...], scatter: float) -> None:
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(5)
    q = rng.uniform(-2.5, 2.5, (60, 6))
    rows = read(robot, q, causes, rng)
    true, kinematics = q.copy(), compile_kinematics(machine(robot))
    true[:, 2] += GEAR * np.cos(2 * q[:, 2]) * ("gear" in causes)
    tool = pose_of(kinematics, posture(kinematics, true), robot.tcp)[:, :3, :3]
    noise = rotation_from_vector(scatter * rng.standard_normal((60, 3)))
    rotation = vector_from_rotation(noise @ rotation_from_vector(FRAME) @ tool @ rotation_from_vector(TURNED))
    sigma = {"sigma_position": NOISE, "sigma_rotation": STATED}
    rows = make_measurements(
        rows.variables, q, tcp=robot.tcp, position=rows.position, rotation=rotation, **sigma
    )
    assert diagnose(robot, rows).verdict.key == ("angle-curve:q3" if causes else "none:null")


@pytest.mark.slow
def test_what_shows_in_rotations_alone_is_no_scatter_of_these() -> None:
    """A wrist's last drive gives way under moments: positions on its axis hardly move."""
    case = draw_case(Exam(seed=20270211), 270)
    rows = simulate(case.machine, case.truths, case.campaign, np.random.default_rng([20270211, 270, 1]))
    assert diagnose(case.robot, rows).verdict.key == case.label.truths[0] == "joint-compliance:q6"
