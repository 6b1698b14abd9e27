from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Joint, JointStiffness, Node, Robot, load_robot
from beamstiff.diagnosis.effects.bearing_tilt import _seat
from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.diagnosis.residual.baseline import fit_baseline, own_direction
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.diagnosis.machines import (
    arm_at,
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


@pytest.mark.parametrize(
    ("shape", "at", "kind"), [("tilt", 0, "tilting"), ("all", 3, "radial"), ("all", 4, "axial")]
)
def test_columns_are_derivatives_by_the_bearings_compliance(shape: str, at: int, kind: str) -> None:
    robot = elbow(tilting=1e6, radial=1e8, axial=2e8)
    there = nominal(robot, at_random(robot, 8, seed=1))
    found = shape_of(there, "bearing-tilt", "q2", shape).columns[..., at]
    close(found, by_compliance_of(robot, there.rows, f"J2.{kind}"), 1e-6)


def test_in_a_closed_loop_too() -> None:
    robot = load_robot("ir663")
    rows = at_random(robot, 8, seed=2, reach=0.4)
    rows = rows_of(robot, rows.q, rows.wrench * [1, 0, 1, 0, 1, 0])
    found = shape_of(nominal(robot, rows), "bearing-tilt", "J1010", "tilt and radial").columns[..., 1]
    close(found, by_compliance_of(robot, rows, "J1010.radial"), 1e-5)


@pytest.mark.parametrize("joint", range(6))
def test_a_rigid_bearing_tilts_by_the_moment_across_its_axis(joint: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=3))
    arm = arm_at(there.rows.q)
    moment, axis = arm.moment(there.rows.wrench)[:, joint], arm.axis[:, joint]
    across = moment - axis * (axis * moment).sum(axis=1, keepdims=True)
    found = shape_of(there, "bearing-tilt", f"q{joint + 1}", "tilt").columns[..., 0]
    close(found, arm.turned(across, joint))
    by_axis = shape_of(there, "bearing-tilt", f"q{joint + 1}", "tilt by axis").columns
    np.testing.assert_allclose(by_axis[..., :2].sum(axis=-1), found, atol=1e-9)


def test_a_bearing_that_stiffens_tilts_by_the_power_two_thirds_of_the_moment() -> None:
    rows = rows_of(elbow(), [0, 0], np.array([1000, -500, 125])[:, None] * np.eye(6)[2])
    found = shape_of(nominal(elbow(), rows), "bearing-tilt", "q2", "tilt that stiffens").columns
    # moment about -y of the straight arm along x, relative to the largest
    share = np.array([1.0, -0.5, 0.125])
    assert found[:, 4, 1] == pytest.approx(-np.sign(share) * np.abs(share) ** (2 / 3))
    assert found[:, 4, 0] == pytest.approx(-0.8 * 1000 * share)
    assert found[:, 2, 1] == pytest.approx(0.8 * np.sign(share) * np.abs(share) ** (2 / 3))


def test_a_preloaded_bearing_gives_evenly_at_first_and_then_stiffens() -> None:
    share = np.array([1.0, 0.01, -0.02, -1.0])
    rows = rows_of(elbow(), [0, 0], 500 * share[:, None] * np.eye(6)[2])
    there = nominal(elbow(), rows)
    shape = shape_of(there, "bearing-tilt", "q2", "all, stiffening by axis, with preload")
    names = [item.name for item in shape.parameters]
    about_y = [k for k, name in enumerate(names) if name.startswith("tilt_at_usual_moment")]
    found = shape.columns[:, 4, about_y]
    across = found[:, np.abs(found).max(axis=0).argmax()]
    assert across[0] == pytest.approx(-1.0)  # the parameter is the tilt under the usual moment
    assert across[3] == pytest.approx(1.0)
    assert across[2] / across[1] == pytest.approx(-2.0, rel=1e-3)
    assert across[1] / across[0] == pytest.approx(0.01 * (1.25 / 0.25) ** (1 / 6), rel=1e-3)
    freely = shape_of(there, "bearing-tilt", "q2", "all, stiffening by axis").columns[:, 4, about_y]
    assert np.abs(freely).max(axis=1) == pytest.approx(np.abs(share) ** (2 / 3))


@pytest.mark.parametrize("knee", [0.1, 0.2, 0.35, 0.6])
def test_a_bearing_that_loses_its_preload_gives_more_beyond_and_evenly(knee: float) -> None:
    share = np.array([1.0, 0.05, -0.5 * (1 + knee), -1.0])
    rows = rows_of(elbow(), [0, 0], 500 * share[:, None] * np.eye(6)[2])
    shape = shape_of(
        nominal(elbow(), rows),
        "bearing-tilt",
        "q2",
        f"all, softening by axis as its preload is lost at {knee:g}",
    )
    besides = [k for k, item in enumerate(shape.parameters) if item.name.startswith("tilt_at_usual_moment")]
    found = shape.columns[:, 4, besides]
    across = found[:, np.abs(found).max(axis=0).argmax()]
    assert across == pytest.approx([-1.0, 0.0, 0.5, 1.0])  # half way from the knee to the usual moment
    assert all(shape.parameters[k].positive for k in besides)


@pytest.mark.parametrize("joint", range(6))
def test_a_bearing_that_tilts_about_a_point_off_its_frame_gives_way_to_forces_too(joint: int) -> None:
    compliance, off = 3e-7, 0.12  # rad/(N m), m along the axis
    rows = at_random(kr240(), 8, seed=3)
    there, arm = nominal(kr240(), rows), arm_at(rows.q)
    axis, centre = arm.axis[:, joint], arm.point[:, joint] + off * arm.axis[:, joint]
    moment = rows.wrench[:, 3:] + np.cross(arm.tip - centre, rows.wrench[:, :3])
    tilt = compliance * (moment - axis * (axis * moment).sum(axis=1, keepdims=True))
    moved = np.concatenate([np.cross(tilt, arm.tip - centre), tilt], axis=1)
    found = shape_of(there, "bearing-tilt", f"q{joint + 1}", "tilt off its centre")
    theta = compliance * np.array([1.0, off**2, -off])
    close(found.columns @ theta, moved)
    by_axis = shape_of(there, "bearing-tilt", f"q{joint + 1}", "all, off its centre").columns
    close(by_axis @ (compliance * np.array([1, 1, 0, off**2, off**2, 0, -off, off])), moved)


@pytest.mark.parametrize("joint", [0, 4])
def test_a_bearing_gives_by_any_symmetric_compliance_but_about_its_own_axis(joint: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 12, seed=8))
    place = there.places.joints[f"J{joint + 1}"]
    half = np.random.default_rng(2).standard_normal((6, 6))
    half[3] = 0.0  # the drive's
    slip = place.load @ (half @ half.T)
    columns = shape_of(there, "bearing-tilt", f"q{joint + 1}", "any").columns
    assert columns.shape[2] == 15
    assert unexplained(np.einsum("nab,nb->na", place.shift, slip), columns) < 1e-9


@pytest.mark.parametrize("robot", ["kr240-2", "kr500", "ir663", "tripod"])
def test_a_seat_stays_with_the_part_that_carries_it(robot: str) -> None:
    machine = load_robot(robot)
    there = fit_baseline(machine, at_random(machine, 6, seed=9), keep=())
    kinematics = compile_kinematics(machine)
    where = posture(kinematics, there.rows.q).transforms
    frames = {node.name: at for node, at in zip(machine.nodes, kinematics.node_frame, strict=True)}
    tried = 0
    for joint in machine.joints:
        if joint.variable is None or joint.name not in there.places.joints:
            continue
        if own_direction(machine, joint.name) != "torsional":
            continue
        tried += 1
        place, seat = there.places.joints[joint.name], _seat(there, joint)
        # the same wrenches and twists in other axes, with the joint's own first
        moved = [np.einsum("nab,nb->na", one.shift, one.load) for one in (seat, place)]
        np.testing.assert_allclose(*moved, rtol=1e-7, atol=1e-12 * np.abs(moved[1]).max())
        np.testing.assert_allclose(seat.turn[:, :, 0], place.turn[:, :, 0], atol=1e-9)
        # that are at rest in the part at one of the joint's ends, and not both
        parts = [where[:, frames[node], :3, :3].swapaxes(-1, -2) @ seat.turn for node in joint.nodes]
        still = [bool(np.allclose(part, part[0], atol=1e-9)) for part in parts]
        assert any(still)
        assert not all(still) or np.ptp(there.joint_values[joint.variable]) == 0
    assert tried


@pytest.mark.parametrize("robot", ["tripod", "gantry"])
def test_what_a_slide_gives_along_its_way_is_the_drives_and_not_the_bearings(robot: str) -> None:
    machine = load_robot(robot)
    there = fit_baseline(machine, at_random(machine, 6, seed=9), keep=())
    slides = [joint for joint in machine.joints if own_direction(machine, joint.name) == "axial"]
    shape = shape_of(there, "bearing-tilt", component_of(machine, slides[0]), "any")
    names = [item.name for item in shape.parameters]
    assert "compliance_rx_rx" in names
    assert not any(name.startswith("compliance_x_") for name in names)


SOUND = {"axial": 1e9, "radial": 1e9, "torsional": 1e8, "tilting": 1e8}


def on_springs() -> Robot:
    """Return the elbow arm on a joint between floor and foot, about the vertical."""
    robot = elbow()
    springs = JointStiffness(**SOUND)
    floor = Joint(name="J0", nodes=["floor", "foot"], frame="base", axis="z", stiffness=springs)
    more = {"nodes": (Node(name="floor"), *robot.nodes), "joints": (floor, *robot.joints)}
    return robot.model_copy(update=more | {"fixed": ("floor",)})


@pytest.mark.parametrize(
    ("shape", "columns", "kind"),
    [
        ("tilt", [0], "tilting"),
        ("rotation", [0, 1], "tilting"),
        ("rotation", [2], "torsional"),
        ("soil", [3, 4], "radial"),
        ("soil", [5], "axial"),
    ],
)
def test_columns_are_derivatives_by_springs_under_the_foot(shape: str, columns: list[int], kind: str) -> None:
    rows = at_random(elbow(), 8, seed=1)
    found = shape_of(nominal(elbow(), rows), "base-compliance", None, shape).columns[..., columns]
    close(found.sum(axis=-1), by_compliance_of(on_springs(), rows, f"J0.{kind}"), 1e-6)


def test_all_of_it_is_any_symmetric_6x6_compliance_of_the_floor() -> None:
    there = nominal(kr240(), at_random(kr240(), 12, seed=2))
    arm, wrench = arm_at(there.rows.q), there.rows.wrench
    factor = np.random.default_rng(3).standard_normal((6, 6))
    passed = np.concatenate([wrench[:, :3], wrench[:, 3:] + np.cross(arm.tip, wrench[:, :3])], axis=1)
    d, r = np.split(passed @ (factor @ factor.T), 2, axis=1)
    moved = np.concatenate([d + np.cross(r, arm.tip), r], axis=1)
    every = shape_of(there, "base-compliance", None, "all").columns
    assert every.shape[2] == 21
    assert unexplained(moved, every) < 1e-9


@pytest.mark.parametrize("at", range(6))
def test_under_eight_times_the_load_contacts_give_four_times_as_much(at: int) -> None:
    rows = at_random(elbow(), 8, seed=4)
    eight = rows_of(elbow(), rows.q, 8 * rows.wrench)
    stated = {"force": 1e3, "moment": 1e3}
    once, more = (
        shape_of(replace(nominal(elbow(), some), stated=stated), "base-compliance", None, "all, stiffening")
        for some in (rows, eight)
    )
    names = [item.name for item in once.parameters]
    column = names.index(f"{('rotation', 'translation')[at // 3]}_at_contacts_{'xyz'[at % 3]}")
    close(more.columns[..., column], 4 * once.columns[..., column])
    # under the load that is stated they give what the parameter says
    load = rows_of(elbow(), [0, 0], 1e3 * np.eye(6)[(at + 3) % 6])
    alone = shape_of(
        replace(nominal(elbow(), load), stated=stated), "base-compliance", None, "all, stiffening"
    ).columns[0, :, column]
    assert alone[(at + 3) % 6] == pytest.approx(1.0)
