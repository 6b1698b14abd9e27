from __future__ import annotations

import numpy as np

from beamstiff.gap.effects import EFFECTS
from tests.gap.machines import arm_at, at_random, close, kr240, nominal, shape_of


def test_torque_on_either_joint_turns_the_other() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    arm = arm_at(there.rows.q)
    torque = arm.torque(there.rows.wrench)
    one, other = arm.slipped(torque[:, 5], 4), arm.slipped(torque[:, 4], 5)
    close(shape_of(there, "joint-coupling", "q5+q6", "reciprocal").columns[..., 0], one + other)
    each = shape_of(there, "joint-coupling", "q5+q6", "one way each").columns
    close(each[..., 0], one)
    close(each[..., 1], other)


def test_it_is_the_off_diagonal_entry_of_the_compliance_of_all_joints() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=2))
    arm = arm_at(there.rows.q)
    compliance = np.zeros((6, 6))
    compliance[1, 3] = compliance[3, 1] = 1.0
    slip = arm.torque(there.rows.wrench) @ compliance
    moved = sum(arm.slipped(slip[:, joint], joint) for joint in range(6))
    close(shape_of(there, "joint-coupling", "q2+q4", "reciprocal").columns[..., 0], np.asarray(moved))


def test_components_are_pairs_in_the_order_of_the_variables() -> None:
    found = EFFECTS["joint-coupling"].components(nominal(kr240(), at_random(kr240(), 2, seed=3)))
    assert len(found) == 15
    assert found[:2] == ["q1+q2", "q1+q3"]
    assert "q5+q6" in found


def test_a_lever_between_them_that_follows_the_angles_couples_by_them() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    shape = shape_of(there, "joint-coupling", "q5+q6", "by the angles")
    even = shape_of(there, "joint-coupling", "q5+q6", "reciprocal").columns[..., 0]
    q5, q6 = there.rows.q[:, 4], there.rows.q[:, 5]
    courses = (1 + 0 * q5, np.cos(q5), np.sin(q5), np.cos(q6), np.sin(q6))
    for column, course in enumerate(courses):
        close(shape.columns[..., column], course[:, None] * even)
