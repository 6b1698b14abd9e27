"""Errors that follow a joint's angle, or a slide's position."""

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.effects.angle_curve import joint_error, longest_wave
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.reader import load_robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array
from tests.arms import on_rail

SIGMA = 2e-5
TRAVEL = 1.5


def rack_error(position: Array) -> Array:
    """A wrong pitch, 0.2 mm in a metre, and a wave of 0.7 m."""
    return 2e-4 * position + 1.5e-4 * np.sin(2 * np.pi * position / 0.7 + 0.4)


def railbot() -> Robot:
    robot = on_rail(load_robot("kr500"), TRAVEL)
    rigid = dict.fromkeys(stiffness_parameters(robot), np.inf)
    return robot.with_parameters(rigid).model_copy(update={"identify": (), "masses": ()})


def readings(robot: Robot, seed: int, error: bool = True, count: int = 50) -> Measurements:
    random = np.random.default_rng(seed)
    limits = np.array([variable.limits for variable in robot.actuated])
    q = random.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    real = q.copy()
    real[:, 0] += rack_error(q[:, 0]) if error else 0.0
    kinematics = compile_kinematics(robot)
    poses = pose_of(kinematics, posture(kinematics, real), robot.tcp)
    position = poses[:, :3, 3] + SIGMA * random.standard_normal((count, 3))
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=SIGMA)


@pytest.mark.parametrize("error", [True, False])
def test_the_error_of_a_rack_is_found_where_there_is_one(error: bool) -> None:
    robot = railbot()
    found = decompose(robot, readings(robot, 3, error))
    assert [cause.key for cause in found.causes] == ["angle-curve:e1"] * error
    if error:
        assert found.causes[0].closes > 0.95
        forms, sizes = found.causes[0].forms, found.causes[0].theta
        named = {
            item.name: float(value * size)
            for form, theta in zip(forms, sizes, strict=True)
            for item, value, size in zip(form.shape.parameters, theta, form.sizes, strict=True)
        }
        along = np.linspace(-0.9 * TRAVEL, 0.9 * TRAVEL, 61)
        off = joint_error(named, 2 * np.pi / (4 * TRAVEL) * along) - rack_error(along)
        assert np.std(off) < 0.1 * np.std(rack_error(along))  # its mean is the zero of the slide


def test_a_slides_first_wave_is_twice_its_travel_and_a_joints_is_a_turn() -> None:
    robot = railbot()
    baseline = fit_baseline(robot, readings(robot, 1, count=20), keep=())
    assert longest_wave(baseline, "e1") == 4 * TRAVEL
    assert longest_wave(baseline, "q1") is None
