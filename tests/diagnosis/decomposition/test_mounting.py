"""A robot on a wall whose file has it on the floor: plain statics moves it, and the direction is told."""

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.decomposition.decompose import OPEN
from beamstiff.diagnosis.decomposition.mounting import Mounting, other_mounting
from beamstiff.diagnosis.decomposition.open_model import open_as_determined
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.errors import UnusableError
from beamstiff.measure.table import Measurements, make_measurements
from tests.diagnosis.test_absolute import COMPLIANCE, NOISE, UR10, moved

DOWN = (0.0, 0.0, -9.81)


def measured(robot: Robot, gravity: tuple[float, ...], eccentric: float = 0.0) -> Measurements:
    """Return 80 positions of an arm whose first four joints give way under its weight, by plain statics.

    `eccentric`: rad, by which the first joint is off once a turn.
    """
    rng = np.random.default_rng(3)
    q = rng.uniform(-2.5, 2.5, (80, 6))
    names = [variable.name for variable in robot.actuated]
    off = q + eccentric * np.sin(q[:, :1]) * (np.arange(6) == 0)
    where = make_measurements(names, off, tcp=robot.tcp, position=np.zeros((80, 3)))
    position = nominal_pose(robot, where)[0]
    there = robot.model_copy(update={"gravity": gravity})
    position = position + COMPLIANCE * sum(moved(there, q, joint, position)[0] for joint in (1, 2, 3, 4))
    position = position + NOISE * rng.standard_normal(position.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=NOISE)


def found(rows: Measurements) -> Mounting | None:
    return other_mounting(open_as_determined(load_robot(UR10), rows, False, OPEN, False)[0])


@pytest.mark.parametrize(
    "gravity", [(9.81, 0.0, 0.0), (0.0, -9.81, 0.0), (0.0, 0.0, 9.81), (0.0, 6.94, -6.94)], ids=str
)
def test_gravity_of_a_wall_a_ceiling_or_a_slope_is_told(gravity: tuple[float, ...]) -> None:
    told = found(measured(load_robot(UR10), gravity))
    assert told is not None
    np.testing.assert_allclose(told.gravity, gravity, atol=0.3)
    assert told.left < 2.0 < 3.0 * told.left < told.stated


@pytest.mark.parametrize("eccentric", [0.0, 2e-3])
def test_nothing_is_told_of_a_robot_on_the_floor(eccentric: float) -> None:
    assert found(measured(load_robot(UR10), DOWN, eccentric)) is None


def test_the_diagnosis_of_a_robot_on_a_wall_is_refused_until_its_file_says_so() -> None:
    robot = load_robot(UR10)
    rows = measured(robot, (9.81, 0.0, 0.0))
    with pytest.raises(UnusableError, match=r"with gravity \[9.81, 0.0, 0.0\] m/s\^2"):
        diagnose(robot, rows)
    on_the_wall = diagnose(robot.model_copy(update={"gravity": (9.81, 0.0, 0.0)}), rows)
    assert on_the_wall.verdict.effect == "joint-compliance"
