"""Errors of the kinematics against a robot that was built with them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import Baseline, nominal_pose
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array
from tests.diagnosis.machines import arm_at, at_random, close, kr240, nominal, rows_of, shape_of

SMALL = 1e-6


def placed(robot: Robot, count: int = 8, seed: int = 1) -> Baseline:
    rows = at_random(robot, count, seed)
    position = nominal_pose(robot, rows)[0]
    return nominal(robot, rows_of(robot, rows.q, 0 * rows.wrench, position=position))


def moved(q: Array, off: tuple[int, str, float]) -> Array:
    """Return how far the tool of a KR240-2 built with an error is from the nominal one's, per error."""
    (low, high) = (arm_at(q, (*off[:2], sign * SMALL)) for sign in (-1, 1))
    turn = Rotation.from_matrix(high.tool) * Rotation.from_matrix(low.tool).inv()
    return np.concatenate([high.tip - low.tip, turn.as_rotvec()], axis=1) / (2 * SMALL)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("parameter", ["alpha", "d", "r", "theta"])
def test_the_column_of_a_parameter_or_an_encoder_is_a_robot_built_with_it(joint: int, parameter: str) -> None:
    there = placed(kr240())
    name = f"q{joint + 1}" if parameter == "theta" else f"f{joint + 1}.{parameter}"
    found = shape_of(there, "geometry-error", name, "offset").columns[..., 0]
    close(found, moved(there.rows.q, (joint, parameter, 0.0)), 1e-6)


def test_discs_err_once_and_twice_a_turn() -> None:
    there = placed(kr240(), 40)
    shape = shape_of(there, "geometry-error", "q4", "offset, and once and twice a turn")
    q = there.rows.q[:, 3]
    oval = 0.3 + 0.1 * np.sin(q) - 0.2 * np.cos(2 * q)
    turned = moved(there.rows.q, (3, "theta", 0.0))
    size = {"offset": 0.3, "once_a_turn_sine": 0.1, "twice_a_turn_cosine": -0.2}
    found = shape.columns @ [size.get(item.name, 0.0) for item in shape.parameters]
    close(found, oval[:, None] * turned, 1e-6)
    # what is no encoder has no disc to be oval, but takes one along
    names = [one.name for one in EFFECTS["geometry-error"].shapes(there, "f4.d")]
    assert names == ["offset", "offset, and once a turn", "offset, and once a turn, of the encoder too"]


def test_an_axis_that_runs_out_of_true_takes_its_encoder_along() -> None:
    there = placed(kr240(), 40)
    shape = shape_of(there, "geometry-error", "f4.d", "offset, and once a turn, of the encoder too")
    q = there.rows.q[:, 3]
    size = {"offset": 0.3, "once_a_turn_sine": 0.1, "encoder_once_a_turn_cosine": -0.2}
    found = shape.columns @ [size.get(item.name, 0.0) for item in shape.parameters]
    longer, turned = moved(there.rows.q, (3, "d", 0.0)), moved(there.rows.q, (3, "theta", 0.0))
    close(found, (0.3 + 0.1 * np.sin(q))[:, None] * longer - 0.2 * np.cos(q)[:, None] * turned, 1e-6)


def test_a_loop_closes_anew_around_an_error() -> None:
    robot = load_robot("ir663")
    there = placed(robot, count=5)
    found = shape_of(there, "geometry-error", "f9.d", "offset").columns[..., 0]
    longer = [
        frame.model_copy(update={"d": 0.473 + 1e-5}) if frame.name == "f9" else frame
        for frame in robot.frames
    ]
    built = robot.model_copy(update={"frames": tuple(longer)})
    expected = (nominal_pose(built, there.rows)[0] - nominal_pose(robot, there.rows)[0]) / 1e-5
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-3 * np.abs(expected).max())


def test_displacements_depend_on_an_encoders_offset_as_on_the_angle_itself() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=2))
    off = replace(there.rows, q=there.rows.q + SMALL * np.eye(6)[2])
    expected = (predict_displacements(kr240(), off) - predict_displacements(kr240(), there.rows)) / SMALL
    close(shape_of(there, "geometry-error", "q3", "offset").columns[..., 0], expected, 1e-4)


def test_components_are_what_calibration_can_change() -> None:
    components = EFFECTS["geometry-error"].components
    found = components(placed(kr240()))
    assert {"q1", "q6", "f3.d", "f4.r", "f2.alpha"} <= set(found)
    assert "f2.theta" not in found  # that is the encoder's offset
    assert components(nominal(kr240(), at_random(kr240(), 3, seed=3))) == [f"q{k}" for k in range(1, 7)]
