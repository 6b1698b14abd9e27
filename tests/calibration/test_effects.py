"""A robot with effects is calibrated beside them: the geometry is that of the same robot without any."""

import numpy as np
import pytest

import beamstiff
from beamstiff import load_robot
from beamstiff.diagnosis.residual.baseline import nominal_pose, predict
from beamstiff.measure.table import make_measurements
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import rotation_from_vector

SAG = AddedEffect(effect="base-compliance", shape="tilt", parameters={"tilting_compliance": 3e-8})
OFFSET = 8e-4  # rad


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_effects_are_counted_in_whatever_frame_measures(turn: float) -> None:
    robot = load_robot("kr240-2").model_copy(update={"effects": (SAG,)})
    random = np.random.default_rng(0)
    ends = np.array([one.limits for one in robot.actuated])
    q = random.uniform(*(0.4 * ends.T), (40, 6))
    wrench = np.zeros((40, 6))
    wrench[:, 2] = random.choice([0.0, -1500.0], 40)
    wrong = q + np.array([0, 0, OFFSET, 0, 0, 0])
    names = [one.name for one in robot.actuated]
    real = make_measurements(names, wrong, tcp=robot.tcp, wrench=wrench, position=np.zeros((40, 3)))
    at = nominal_pose(robot, real)[0] + predict(robot, real)[:, :3]
    seen = at @ rotation_from_vector(np.array([[0.1, 0.2, turn]]))[0].T + [1.0, -2.0, 0.3]
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, position=seen, sigma_position=1e-6)
    found = beamstiff.calibrate(robot, rows, ["base", "q3"], folds=0)
    assert found["q3"].change == pytest.approx(OFFSET, rel=1e-3)
    assert found.robot.effects == robot.effects
    bare = beamstiff.calibrate(load_robot("kr240-2"), rows, ["base", "q3"], folds=0)
    assert abs(bare["q3"].change - OFFSET) > 10 * abs(found["q3"].change - OFFSET)
