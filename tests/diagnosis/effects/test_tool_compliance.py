from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.measure.table import make_measurements
from beamstiff.robot.parts import JointStiffness
from beamstiff.robot.urdf.reader import parse_urdf
from tests.diagnosis.machines import arm_at, at_random, close, kr240, nominal, rows_of, shape_of, unexplained


def test_an_even_flange_turns_by_the_moment_and_slides_by_the_force_at_the_tool() -> None:
    there = nominal(kr240(), at_random(kr240(), 6, seed=1))
    wrench = there.rows.wrench
    columns = shape_of(there, "tool-compliance", None, "rotation and translation").columns
    close(columns[..., 0], np.concatenate([0 * wrench[:, :3], wrench[:, 3:]], axis=1))
    close(columns[..., 1], np.concatenate([wrench[:, :3], 0 * wrench[:, 3:]], axis=1))


def test_an_uneven_one_is_any_6x6_compliance_that_turns_with_the_tool() -> None:
    there = nominal(kr240(), at_random(kr240(), 12, seed=2))
    turn, wrench = arm_at(there.rows.q).tool, there.rows.wrench
    rng = np.random.default_rng(3)
    compliance = np.diag([*rng.uniform(1, 2, 3), 0, 0, 0])  # translations apart from one another
    compliance[3:, 3:] = (half := rng.standard_normal((3, 3))) @ half.T
    compliance[:3, 3:] = rng.standard_normal((3, 3))
    compliance[3:, :3] = compliance[:3, 3:].T
    both = np.zeros((12, 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = turn
    moved = np.einsum("nab,bc,ndc,nd->na", both, compliance, both, wrench)
    assert unexplained(moved, shape_of(there, "tool-compliance", None, "all").columns) < 1e-9


@pytest.mark.parametrize("distance", [0.05, 0.1, 0.2])
def test_a_tool_that_tilts_about_a_centre_behind_the_tcp(distance: float) -> None:
    there = nominal(kr240(), at_random(kr240(), 6, seed=5))
    tool, wrench = arm_at(there.rows.q).tool, there.rows.wrench
    arm = distance * tool[:, :, 2]  # from the centre to the TCP
    moment = wrench[:, 3:] + np.cross(arm, wrench[:, :3])
    about = np.einsum("na,na->n", moment, tool[:, :, 2])[:, None] * tool[:, :, 2]
    turned = moment - about
    found = shape_of(there, "tool-compliance", None, f"about a centre {distance:g} m behind").columns
    close(found[..., 0], np.concatenate([np.cross(turned, arm), turned], axis=1))
    close(found[..., 1], np.concatenate([0 * about, about], axis=1))


def test_a_tool_that_tilts_about_the_last_joint_wherever_the_tcp_is() -> None:
    text = (
        '<robot name="mill"><link name="l0"/><link name="l1"/><link name="l2"/><link name="tip"/>'
        '<joint name="a1" type="revolute"><parent link="l0"/><child link="l1"/><origin xyz="0.1 0 0.4"/>'
        '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>'
        '<joint name="a2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.5 0 0.2"/>'
        '<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>'
        '<joint name="m" type="fixed"><parent link="l2"/><child link="tip"/><origin xyz="0.3 0.1 -0.05"/>'
        "</joint></robot>"
    )
    robot = parse_urdf(text)
    joint = robot.joints[0].model_copy(update={"stiffness": JointStiffness(torsional="1e6 N*m/rad")})
    robot = robot.model_copy(update={"joints": (joint, *robot.joints[1:])})
    rng = np.random.default_rng(4)
    q, wrench = rng.uniform(-1.0, 1.0, (5, 2)), rng.standard_normal((5, 6))
    rows = make_measurements(["a1", "a2"], q, tcp=robot.tcp, wrench=wrench, displacement=np.ones((5, 6)))
    found = shape_of(nominal(robot, rows), "tool-compliance", None, "about the last joint, by axis").columns
    axes = Rotation.from_euler("ZY", q).as_matrix()
    arm = axes @ [0.3, 0.1, -0.05]  # from the joint to the TCP
    moment = wrench[:, 3:] + np.cross(arm, wrench[:, :3])
    for at in range(3):
        about = np.einsum("na,na->n", moment, axes[:, :, at])[:, None] * axes[:, :, at]
        close(found[..., at], np.concatenate([np.cross(about, arm), about], axis=1))


def test_a_round_tool_gives_the_same_whichever_way_it_is_turned_about_its_axis() -> None:
    still = at_random(kr240(), 8, seed=6)
    q = still.q.copy()
    q[:, 5] += np.random.default_rng(1).uniform(-2, 2, 8)
    turned = rows_of(kr240(), q, still.wrench)
    for shape, alike in (("round", True), ("by axis", False)):
        both = (nominal(kr240(), rows) for rows in (still, turned))
        one, other = (shape_of(there, "tool-compliance", None, shape).columns for there in both)
        assert np.allclose(one, other, atol=1e-9 * np.abs(one).max()) == alike
    # a tilt about a centre on the axis is one of them
    there = nominal(kr240(), still)
    columns = shape_of(there, "tool-compliance", None, "round").columns
    behind = shape_of(there, "tool-compliance", None, "about a centre 0.1 m behind").columns
    assert (columns.shape[2], behind.shape[2]) == (5, 2)
    assert max(unexplained(behind[..., at], columns) for at in (0, 1)) < 1e-9


def test_what_is_seen_before_the_flange_does_not_move() -> None:
    rows = rows_of(kr240(), np.full(6, 0.3), np.ones((2, 6)), point=["n5b", "n6b"])
    columns = shape_of(nominal(kr240(), rows), "tool-compliance", None, "rotation").columns
    assert not columns[0].any()
    assert columns[1].any()


# the largest load that was fitted, N and N m: beyond it the law goes on along its tangent, 3 x - 2 for x^3
@pytest.mark.parametrize(("largest", "times"), [(1e4, 8.0), (1e-4, 2.0)])
def test_under_twice_the_load_a_seam_gives_eight_times_as_much(largest: float, times: float) -> None:
    rows = at_random(kr240(), 6, seed=4)
    stated = {"force": largest, "moment": largest}
    once, more = (
        shape_of(
            replace(nominal(kr240(), some), stated=stated),
            "tool-compliance",
            None,
            "by axis, softening as a seam that opens",
        ).columns[..., 6:]
        for some in (rows, rows_of(kr240(), rows.q, 2 * rows.wrench))
    )
    close(more, times * once, 1e-6)
