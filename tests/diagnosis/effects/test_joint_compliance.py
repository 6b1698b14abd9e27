from dataclasses import replace

import numpy as np
import pytest

from beamstiff import predict
from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import at_rows
from beamstiff.se3 import Array
from tests.added import added
from tests.diagnosis.machines import (
    at_random,
    by_compliance_of,
    close,
    elbow,
    kr240,
    nominal,
    rows_of,
    shape_of,
    unexplained,
)


def test_the_column_is_the_derivative_by_the_compliance_of_a_joint_held_rigid() -> None:
    robot = elbow(torsional="rigid")
    there = nominal(robot, at_random(robot, 8, seed=1))
    found = shape_of(there, "joint-compliance", "q2", "linear").columns[..., 0]
    close(found, by_compliance_of(robot, there.rows, "J2.torsional"), 1e-6)


def test_joints_with_springs_of_their_own_are_no_components() -> None:
    robot = elbow(torsional="rigid")
    assert EFFECTS["joint-compliance"].components(nominal(robot, at_random(robot, 3, seed=1))) == ["q2"]
    assert EFFECTS["joint-compliance"].components(nominal(kr240(), at_random(kr240(), 3, seed=1))) == []


def test_the_weight_of_absolute_positions_winds_it_up_too() -> None:
    robot = elbow(mass=50.0, gravity=(0.0, -9.81, 0.0), torsional="rigid")
    rows = at_random(robot, 3, seed=2)
    loaded = nominal(robot, rows)
    absolute = nominal(robot, rows_of(robot, rows.q, 0 * rows.wrench, position=[[1.0, 0, 0]] * 3))
    slip = shape_of(absolute, "joint-compliance", "q2", "linear").columns[:, 5, 0]
    arm = 0.8 * np.cos(rows.q.sum(axis=1))
    assert slip == pytest.approx(-50 * 9.81 * arm)
    assert shape_of(loaded, "joint-compliance", "q2", "linear").columns[:, 5, 0] != pytest.approx(slip)


def test_a_joint_that_stiffens_gives_way_less_by_what_it_lost() -> None:
    robot = elbow(torsional="rigid")
    rows = rows_of(robot, [0, 0], np.array([1000, -500, 100])[:, None] * np.eye(6)[1])
    found = shape_of(nominal(robot, rows), "joint-compliance", "q2", "stiffening").columns[:, 5]
    torque = 0.8 * np.array([1000, -500, 100])
    assert found[:, 0] == pytest.approx(torque)
    # compliance of half its loss at the largest torque, of all of it far beyond
    assert found[:, 1] == pytest.approx(-torque * np.abs(torque) / (800 + np.abs(torque)))


def test_a_joint_may_give_way_otherwise_at_another_angle() -> None:
    robot = elbow(torsional="rigid")
    there = nominal(robot, at_random(robot, 8, seed=1))
    even = shape_of(there, "joint-compliance", "q2", "linear").columns[..., 0]
    found = shape_of(there, "joint-compliance", "q2", "by its angle").columns @ [1.0, 0.2, -0.1, 0.05, 0.3]
    q = there.rows.q[:, 1]
    follows = 1 + 0.2 * np.cos(q) - 0.1 * np.sin(q) + 0.05 * np.cos(2 * q) + 0.3 * np.sin(2 * q)
    close(found, follows[:, None] * even)


@pytest.mark.parametrize(("travel", "follows"), [(50.0, False), (70.0, True)])
def test_over_a_short_travel_no_compliance_follows_the_angle(travel: float, follows: bool) -> None:
    """Two waves over 7 degrees, beside the zero of the joint, may be any size (a real q2 of 28 to 35 deg)."""
    robot, rng = elbow(torsional="rigid"), np.random.default_rng(3)
    q = np.deg2rad(np.column_stack([rng.uniform(-90, 90, 9), np.linspace(20.0, 20.0 + travel, 9)]))
    there = nominal(robot, rows_of(robot, q, rng.normal(size=(9, 6))))
    names = {shape.name for shape in EFFECTS["joint-compliance"].shapes(there, "q2")}
    assert ({"by its angle", "by sectors"} <= names) == follows
    assert {"linear", "stiffening", "any law"} <= names


def test_a_joint_may_be_worn_in_a_sector() -> None:
    robot = elbow(torsional="rigid")
    there = nominal(robot, at_random(robot, 60, seed=2))
    even = shape_of(there, "joint-compliance", "q2", "linear").columns[..., 0]
    shape = shape_of(there, "joint-compliance", "q2", "by sectors")
    assert [item.name for item in shape.parameters[:2]] == ["compliance", "compliance_near_-180_deg"]
    q = there.rows.q[:, 1]
    wide, places = np.deg2rad(20.0), np.deg2rad(range(-180, 180, 30))
    bumps = [np.exp(-2.0 * (np.sin((q - at) / 2.0) / wide) ** 2) for at in places]
    for at, bump in enumerate(bumps, 1):  # cos a - 1 = -2 sin(a / 2)^2
        close(shape.columns[..., at], bump[:, None] * even, least=1e-12)
    # any smooth course of the angle is nearly one of these
    worn = (1.0 + np.exp(-0.5 * ((q - 0.4) / 0.5) ** 2))[:, None] * even
    left = unexplained(worn, shape.columns) * np.linalg.norm(worn)
    assert left < 0.02 * np.linalg.norm(worn - even)


def test_all_rigid_drives_at_once_are_one_cause() -> None:
    robot = kr240().with_parameters(dict.fromkeys(("J2.torsional", "J3.torsional"), np.inf))
    robot = robot.model_copy(update={"identify": ()})
    rows = at_random(robot, 6, seed=3)
    assert EFFECTS["joint-compliance"].components(nominal(robot, rows)) == ["q2", "q3", None]  # displacements
    unread = rows_of(robot, rows.q, rows.wrench, position=np.ones((6, 3)).tolist())
    absolute = nominal(robot, replace(unread, position=predict(robot, unread).pose[:, :3]))
    assert EFFECTS["joint-compliance"].components(absolute) == ["q2", "q3", None]
    [every] = EFFECTS["joint-compliance"].shapes(absolute, None)
    assert [one.name for one in every.parameters] == ["compliance_q2", "compliance_q3"]
    assert all(one.positive for one in every.parameters)
    for at, name in enumerate(("q2", "q3")):
        alone = shape_of(absolute, "joint-compliance", name, "linear").columns[..., 0]
        close(every.columns[..., at], alone, 1e-12)


def test_what_was_found_to_follow_the_angle_holds_for_a_single_posture() -> None:
    """A robot file that has the effect has it wherever it goes; rows that are predicted need no travel."""
    robot = elbow(torsional="rigid")
    fit = nominal(robot, at_random(robot, 8, seed=1))
    one = at_random(robot, 1, seed=2)
    scales = EFFECTS["joint-compliance"].scales(fit, "q2")
    effect = added("joint-compliance:q2", "by its angle", scales, compliance_by_cosine_q=2e-6)
    moved = effects_displacement(robot.model_copy(update={"effects": (effect,)}), one)
    linear = shape_of(nominal(robot, one), "joint-compliance", "q2", "linear").columns[..., 0]
    close(moved, 2e-6 * np.cos(one.q[0, 1]) * linear)
    assert shape_of(at_rows(fit, one), "joint-compliance", "q2", "by its angle")


def test_a_small_arm_is_as_soft_for_its_size_as_a_large_one() -> None:
    # similar machines under similar loads move alike: a joint of 1/50 the stiffness, 1/50 of the force
    def usual(share: float) -> Array:
        drives = {name: share * kr240().parameter(name) for name in kr240().identify}
        robot = kr240().with_parameters(drives | {kr240().identify[3]: np.inf})
        rows = at_random(robot, 5, seed=1)
        there = nominal(robot, replace(rows, wrench=share * rows.wrench))
        (component,) = EFFECTS["joint-compliance"].components(there)
        shape = shape_of(there, "joint-compliance", component, "linear")
        return shape.columns[..., 0] * shape.parameters[0].size

    assert usual(0.02) == pytest.approx(usual(1.0), rel=1e-6, abs=1e-12)
