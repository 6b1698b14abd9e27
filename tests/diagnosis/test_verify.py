"""A verification counts a cause once, with all its shapes."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.residual.baseline import nominal_pose, predict
from beamstiff.diagnosis.verify import verify
from beamstiff.measure.rows import row_digests, subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import rotation_from_vector

PLAY = {"effect": "backlash", "component": "q2", "scales": {"torque": 700.0}}


def played() -> Robot:
    """Return an arm with play in two shapes, one of which rounding made negative."""
    robot = load_robot("kr500")
    shapes = [("flank within 0.03", 2e-4), ("flank within 0.1", -6.7e-19)]
    play = [AddedEffect(**PLAY, shape=shape, parameters={"half_width": value}) for shape, value in shapes]
    return robot.model_copy(update={"effects": tuple(play)})


def fresh(robot: Robot) -> Measurements:
    rng = np.random.default_rng(0)
    q, wrench = rng.uniform(-0.5, 0.5, (8, len(robot.actuated))), np.zeros((8, 6))
    wrench[:, :3] = rng.uniform(-1000.0, 1000.0, (8, 3))
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=np.zeros((8, 6)))
    return replace(rows, displacement=predict(robot, rows))


def test_a_cause_is_counted_with_all_its_shapes() -> None:
    robot = played()
    found = verify(robot, fresh(robot))
    ((name, after, closes),) = found.causes
    assert name == "backlash:q2"
    assert found.before > 1e-5
    assert after == found.after == pytest.approx(0.0, abs=1e-12)
    assert closes == found.true == pytest.approx(1.0)


def test_rows_that_were_fitted_are_counted() -> None:
    robot = played()
    rows = fresh(robot)
    assert verify(robot, rows).fitted == 0
    seen = robot.with_fitted_rows(row_digests(subset(rows, np.arange(5))))
    assert verify(seen, rows).fitted == 5
    read_again = replace(rows, displacement=rows.displacement + 1e-6)  # the same states, other readings
    assert verify(seen, read_again).fitted == 0
    rounded = replace(rows, displacement=rows.displacement + 1e-16)  # written and read in other units
    assert verify(seen, rounded).fitted == 5


def test_rows_before_a_joint_moved_do_not_count_but_where_there_are_no_others() -> None:
    robot = load_robot("kr240-2")
    effect = AddedEffect(
        effect="approach-direction",
        component="q2",
        shape="direction of the last motion",
        parameters={"half_lost_motion": 1e-3},
    )
    q = np.array([0.0, -1.0, 1.5, 0.0, 0.5, 0.0]) + np.random.default_rng(4).uniform(-0.5, 0.5, (12, 6))
    names = [one.name for one in robot.actuated]
    plan = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((12, 3)))
    real = robot.model_copy(update={"effects": (effect,)})
    rows = replace(plan, position=nominal_pose(robot, plan)[0] + predict(real, plan)[:, :3])
    rows.position[0] += 2e-3
    found = verify(real, rows)
    assert (found.rows, found.notes) == (
        11,
        (f"left out: {rows.place(0)}: from which side the joints came is unknown",),
    )
    assert found.after < 1e-9
    alone = verify(real, subset(rows, np.arange(1)))
    assert (alone.rows, alone.notes) == (1, ())
    assert alone.after == pytest.approx(2e-3 * np.sqrt(3.0), rel=1e-6)


def test_an_axis_that_was_not_read_leaves_the_others_of_its_row() -> None:
    """The tracker stands elsewhere; the robot is as described, and its readings are exact but for that."""
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(2)
    q = np.array([0.0, -1.0, 1.5, 0.0, 0.5, 0.0]) + rng.uniform(-0.5, 0.5, (12, 6))
    names = [one.name for one in robot.actuated]
    plan = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((12, 3)))
    there = (nominal_pose(robot, plan)[0] + predict(robot, plan)[:, :3]) @ rotation_from_vector(
        np.array([0.1, -0.2, 0.7])
    ) + [1.0, 2.0, 3.0]
    there[2, 1] = np.nan
    found = verify(robot, replace(plan, position=there), refit_frame=True)
    assert found.after < 1e-9
    assert found.rows == 12
    there[2, 0] += 1e-3
    off = verify(robot, replace(plan, position=there), refit_frame=True)
    assert off.after == pytest.approx(1e-3 / np.sqrt(12.0), rel=1e-6)
