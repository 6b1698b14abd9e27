"""Planar loops closed in their planes: which they are, and that a tilted axis is found and kept."""

import numpy as np
import pytest

from beamstiff import calibrate, load_robot, predict, tcp_stiffness
from beamstiff.calibration.corrected import corrected
from beamstiff.errors import BeamstiffError
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import posture
from beamstiff.robot.planar_loops import closed_in_plane
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from tests.calibration.machines import within

TILT = np.radians(0.05)


@pytest.mark.parametrize(
    ("name", "planar"),
    [
        ("ir663", {"four_bar"}),
        ("ir663-screws", {"four_bar", "slider_crank2", "slider_crank8"}),
        ("palletizer", {"arm", "level_arm", "level_forearm"}),
        ("five-bar", {"five_bar"}),
        ("delta", set()),  # its rods leave their planes
        ("stewart", set()),
        ("kr240-2", set()),  # no loop
    ],
)
def test_loops_are_planar_where_no_variable_leads_out_of_the_plane(name: str, planar: set[str]) -> None:
    robot = load_robot(name)
    found, names = closed_in_plane(robot, within(robot, 12, 0))
    assert set(names) == planar
    assert {loop.name for loop in found.loops if loop.constrain == "plane"} == planar


def tilted(robot: Robot, q: np.ndarray, **changes: float) -> Robot:
    """The robot with axes that are not parallel, closed in its plane."""
    plane, _ = closed_in_plane(robot, q)
    return corrected(plane, {name.replace("_", "."): by for name, by in changes.items()}, q)


def test_a_tilted_loop_of_rigid_bearings_is_as_compliant_as_one_of_parallel_axes() -> None:
    robot = load_robot("ir663")
    q = within(robot, 5, 1)
    leaning = tilted(robot, q, f3_alpha=TILT)
    there, nominal = ([tcp_stiffness(one, one_q) for one_q in q] for one in (leaning, robot))
    np.testing.assert_allclose(there, nominal, rtol=0, atol=5e-3 * np.abs(nominal).max())
    off = leaning.model_copy(update={"loops": robot.loops})
    with pytest.raises(BeamstiffError, match="four_bar"):
        tcp_stiffness(off, q[0])


def test_bearings_turn_about_the_normal_of_their_loop_and_others_about_their_own_axes() -> None:
    robot = load_robot("palletizer")
    q = within(robot, 4, 3)
    tilts = {"f2_alpha": TILT, "f3_alpha": TILT, "triangle_alpha": -TILT, "f4_alpha": TILT}
    structure = compile_structure(tilted(robot, q, **tilts))
    where = posture(structure.kinematics, q)
    axes = place(structure, where).joint_rotation[:, :, :, 0]
    own = where.transforms[:, structure.joint_frame][:, :, :3, 2]
    at = {joint.name: number for number, joint in enumerate(robot.joints)}
    alone = [at["J1"], at["J4"]]
    np.testing.assert_allclose(axes[:, alone], own[:, alone], atol=1e-15)
    bearings = [at[name] for name in ("J2", "J3", "elbow", "triangle", "wrist")]
    np.testing.assert_allclose(np.cross(axes[:, bearings], axes[:, [bearings[0]]]), 0.0, atol=1e-14)
    turned = np.linalg.norm(axes - own, axis=-1).max(axis=0)[bearings]
    assert 0.5 * TILT < turned.max() < 3 * TILT


def readings(robot: Robot, q: np.ndarray) -> Measurements:
    names = [variable.name for variable in robot.actuated]
    nothing = np.zeros((len(q), 3))
    there = predict(robot, make_measurements(names, q, tcp=robot.tcp, position=nothing)).pose
    assert there is not None
    scatter = np.random.default_rng(3).normal(0.0, 1e-5, (len(q), 3))
    return make_measurements(names, q, tcp=robot.tcp, position=there[:, :3] + scatter)


def test_a_tilted_axis_of_a_loop_is_calibrated_and_written_with_its_plane() -> None:
    robot = load_robot("palletizer")
    q = within(robot, 60, 2)
    machine = tilted(robot, q, f2_alpha=TILT, f3_alpha=-2 * TILT)
    found = calibrate(robot, readings(machine, q[:40]), folds=0)
    assert {loop.constrain for loop in found.robot.loops} == {"plane"}
    assert any("constrain: plane" in note for note in found.notes)
    fresh = readings(machine, q[40:])
    error = calibrate(robot, readings(machine, q[:40]), folds=0, test=[fresh]).tests
    assert next(iter(error.values())).position_rms < 3e-5


def test_a_loop_whose_axes_are_parallel_stays_closed_as_described() -> None:
    robot = load_robot("palletizer")
    q = within(robot, 30, 4)
    rows = readings(tilted(robot, q, f3_d=5e-4), q)
    found = calibrate(robot, rows, parameters=["f3.d", "base"], folds=0)
    assert {loop.constrain for loop in found.robot.loops} == {"position"}
    assert not any("constrain: plane" in note for note in found.notes)
    assert parse_robot(robot_to_yaml(found.robot)).loops == robot.loops
