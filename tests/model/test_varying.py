"""Springs that change from row to row: the same physics as one robot a row."""

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.model.varying import displaced, displaced_with_slopes, ports_at
from beamstiff.planning.candidates import candidate_poses
from beamstiff.robot.kinematics import compile_kinematics

# in series, and where the forces at the springs depend on their stiffness
CASES = {
    "kr240-2": None,
    "ir663": ("J12.torsional", "J18.torsional", "J1010.radial"),
    "ir663-screws": ("screw2", "screw8", "arm.E"),
    "tripod": None,
    "gantry": None,
}


def at_poses(
    name: str, poses: int = 4, loads: int = 2
) -> tuple[Robot, tuple[str, ...], np.ndarray, np.ndarray]:
    robot, random = load_robot(name), np.random.default_rng(3)
    q = candidate_poses(compile_kinematics(robot), poses, seed=1)
    wrench = random.normal(size=(poses * loads, 6)) * [900, 900, 900, 100, 100, 100]
    return robot, tuple(CASES[name] or robot.identify), np.repeat(q, loads, axis=0), wrench


@pytest.mark.parametrize("name", CASES)
def test_a_compliance_a_row_is_a_robot_a_row(name: str) -> None:
    robot, parameters, q, wrench = at_poses(name)
    random = np.random.default_rng(5)
    start = np.array([robot.parameter(parameter) for parameter in parameters])
    by_pose = start * np.exp(random.normal(size=(len(q) // 2, len(start))) * 0.7)
    stiffness = np.repeat(by_pose, 2, axis=0)
    predicted = displaced(ports_at(robot, parameters, q, wrench), 1.0 / stiffness)
    names = [variable.name for variable in robot.actuated]
    for row in range(len(q)):
        own = robot.with_parameters(dict(zip(parameters, stiffness[row].tolist(), strict=True)))
        alone = make_measurements(names, q[row : row + 1], tcp=robot.tcp, wrench=wrench[row : row + 1])
        expected = predict_displacements(own, alone)[0]
        # springs of 5e13 N/m: the reduction to ports alone rounds to 2e-9 on ir663-screws
        assert np.abs(predicted[row] - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("name", CASES)
def test_slopes_are_the_finite_differences_by_logarithms(name: str) -> None:
    robot, parameters, q, wrench = at_poses(name)
    model = ports_at(robot, parameters, q, wrench)
    compliance = np.tile([1.0 / robot.parameter(parameter) for parameter in parameters], (len(q), 1))
    predicted, slopes = displaced_with_slopes(model, compliance)
    assert np.allclose(predicted, displaced(model, compliance), rtol=1e-12, atol=1e-18)
    step = 1e-5
    for at in range(len(parameters)):
        there, back = compliance.copy(), compliance.copy()
        there[:, at] *= np.exp(step)
        back[:, at] *= np.exp(-step)
        difference = (displaced(model, there) - displaced(model, back)) / (2 * step)
        assert np.abs(difference - slopes[:, :, at]).max() < 1e-8 * np.abs(predicted).max()


def test_equal_compliances_everywhere_are_the_port_model() -> None:
    robot, parameters, q, wrench = at_poses("tripod")
    names = [variable.name for variable in robot.actuated]
    model = reduce_to_ports(robot, make_measurements(names, q, tcp=robot.tcp, wrench=wrench), parameters)
    stiffness = np.array([robot.parameter(parameter) for parameter in parameters])
    same = displaced(model, np.tile(1.0 / stiffness, (len(q), 1)))
    assert np.abs(same - model.predict(stiffness)).max() < 1e-12 * np.abs(same).max()
