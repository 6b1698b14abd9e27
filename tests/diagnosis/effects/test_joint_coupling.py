import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.torque_laws import axis_at
from beamstiff.diagnosis.residual.baseline import fit_baseline
from tests.diagnosis.machines import arm_at, at_random, close, kr240, nominal, shape_of, unexplained


@pytest.mark.parametrize(("pair", "a", "b"), [("q5+q6", 4, 5), ("q2+q4", 1, 3)])
def test_torque_on_either_joint_turns_the_other(pair: str, a: int, b: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    arm = arm_at(there.rows.q)
    torque = arm.torque(there.rows.wrench)
    one, other = arm.slipped(torque[:, b], a), arm.slipped(torque[:, a], b)
    close(shape_of(there, "joint-coupling", pair, "reciprocal").columns[..., 0], one + other)
    each = shape_of(there, "joint-coupling", pair, "one way each").columns
    close(each[..., 0], one)
    close(each[..., 1], other)


def test_components_are_pairs_in_the_order_of_the_variables() -> None:
    found = EFFECTS["joint-coupling"].components(nominal(kr240(), at_random(kr240(), 2, seed=3)))
    assert len(found) == 15
    assert found[:2] == ["q1+q2", "q1+q3"]
    assert "q5+q6" in found


def test_joints_that_share_a_variable_have_their_own_names_and_are_not_coupled_by_torque() -> None:
    machine = load_robot("gantry")  # two carriages on one variable
    there = fit_baseline(machine, at_random(machine, 3, seed=3), keep=())
    assert EFFECTS["backlash"].components(there) == ["X_left", "X_right", "qz"]
    assert EFFECTS["bearing-tilt"].components(there) == ["X_left", "X_right", "qy", "qz"]
    assert EFFECTS["joint-coupling"].components(there) == ["X_left+qz", "X_right+qz"]
    left, right = (axis_at(there, name).joint.name for name in ("X_left", "X_right"))
    assert (left, right) == ("X_left", "X_right")


def test_a_lever_between_them_that_follows_the_angles_couples_by_them() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    shape = shape_of(there, "joint-coupling", "q5+q6", "by the angles")
    even = shape_of(there, "joint-coupling", "q5+q6", "reciprocal").columns[..., 0]
    q5, q6 = there.rows.q[:, 4], there.rows.q[:, 5]
    courses = (1 + 0 * q5, np.cos(q5), np.sin(q5), np.cos(q6), np.sin(q6))
    for column, course in enumerate(courses):
        close(shape.columns[..., column], course[:, None] * even)


def test_a_spring_on_a_cable_that_winds_up_with_an_angle_is_three_compliances_that_grow_with_it() -> None:
    """Pulled is the cable by both joints: ``l = (a + b q6) s5 + (c + d q6) s6`` of their slips s."""
    there = nominal(kr240(), at_random(kr240(), 30, seed=1))
    arm = arm_at(there.rows.q)
    torque, q6 = arm.torque(there.rows.wrench), there.rows.q[:, 5]
    first, second = 0.3 + 0.05 * q6, -0.2 + 0.1 * q6
    pull = first * torque[:, 4] + second * torque[:, 5]
    moved = arm.slipped(first * pull, 4) + arm.slipped(second * pull, 5)
    own = shape_of(there, "joint-coupling", "q5+q6", "reciprocal").columns
    drives = np.stack([arm.slipped(torque[:, joint], joint) for joint in (4, 5)], -1)  # fitted anyway
    wound = shape_of(there, "joint-coupling", "q5+q6", "a cable across both, wound up by angle 2").columns
    assert unexplained(moved, drives, own) > 0.05
    assert unexplained(moved, drives, wound) < 1e-9
