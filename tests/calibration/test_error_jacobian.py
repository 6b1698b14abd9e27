"""Columns of the error Jacobian against central differences of the nonlinear geometry, loops closed anew."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.calibration.error_jacobian import Geometry, build_geometry
from beamstiff.calibration.parameters import known_parameters
from beamstiff.calibration.statement import opening_parameters, refuse_opening
from beamstiff.measure.rows import concatenate
from beamstiff.se3 import Array, vector_from_rotation
from tests.calibration.machines import four_bar, four_bar_poses, machine, measured, serial, within

STEP = 1e-6


def geometry_of(robot: Robot, q: Array, points: tuple[str, ...]) -> Geometry:
    tables = [measured(robot, q, turned=True, point=point) for point in points]
    rows = concatenate(tables)
    geometry = build_geometry(robot, rows, known_parameters(robot, points, True))
    opening = opening_parameters(geometry)
    return replace(geometry, parameters=tuple(x for x in geometry.parameters if x.name not in opening))


def by_differences(geometry: Geometry, theta: Array) -> Array:
    """Return the Jacobian (N, 6, t) by central differences."""
    columns = []
    for at in range(len(theta)):
        low, high = (geometry.placed(theta + sign * STEP * np.eye(len(theta))[at]) for sign in (-1, 1))
        turned = vector_from_rotation(high.rotation @ low.rotation.swapaxes(-1, -2))
        columns.append(np.concatenate([high.position - low.position, turned], axis=1) / (2 * STEP))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("size", [0.0, 5e-3])
def test_columns_of_a_serial_robot_with_two_reflectors(size: float) -> None:
    geometry = geometry_of(serial(), within(serial(), 6, seed=1), ("ball", "other"))
    theta = size * np.random.default_rng(2).standard_normal(len(geometry.parameters))
    _, jacobian = geometry.jacobian(theta)
    expected = by_differences(geometry, theta)
    assert np.abs(jacobian - expected).max() < 1e-8
    assert {item.group for item in geometry.parameters} == {"base", "target", "offset", "frame"}


@pytest.mark.parametrize("size", [0.0, 1e-3])
def test_columns_of_a_four_bar_with_ball_screws_carry_the_loops(size: float) -> None:
    geometry = geometry_of(four_bar(), four_bar_poses()[::14], ("tool",))
    theta = size * np.random.default_rng(3).standard_normal(len(geometry.parameters))
    _, jacobian = geometry.jacobian(theta)
    expected = by_differences(geometry, theta)
    for at, item in enumerate(geometry.parameters):  # the loops close to 1e-12 of the machine's size
        assert np.abs(jacobian[:, :, at] - expected[:, :, at]).max() < 2e-5, item.name
    names = [item.name for item in geometry.parameters]
    loops = ["f9.d", "f10.d", "f11.d", "f3.d", "lug2.gamma", "pivot2.gamma", "lug2.d", "pivot2.d", "screw8"]
    alone = np.abs(jacobian[:, :, [names.index(name) for name in loops]]).max(axis=(0, 1))
    assert (alone > 0.1).all()


def test_columns_of_two_stations_move_their_own_rows() -> None:
    tables = [measured(serial(), within(serial(), 4, seed=seed), turned=True) for seed in (1, 2)]
    known = known_parameters(serial(), ["ball"], True, 2)
    assert [item.name for item in known][:12:6] == ["base1.x", "base2.x"]
    geometry = build_geometry(serial(), concatenate(tables), known, 2)
    theta = 0.2 * np.random.default_rng(3).standard_normal(len(known)) * [x.group == "base" for x in known]
    _, jacobian = geometry.jacobian(theta)
    assert np.abs(jacobian - by_differences(geometry, theta)).max() < 1e-8
    second = [number for number, item in enumerate(known) if item.name.startswith("base2")]
    assert not jacobian[:4, :, second].any()
    assert np.abs(jacobian[4:, :, second]).max(axis=(0, 1)).all()


def test_elastic_displacement_is_carried_along_by_the_base() -> None:
    robot = serial()
    rows = measured(robot, within(robot, 4, seed=3), turned=True)
    base = tuple(x for x in known_parameters(robot, ["ball"], True) if x.group == "base")
    geometry = build_geometry(robot, rows, base)
    moved = 1e-2 * np.random.default_rng(0).standard_normal((4, 6))
    theta = np.array([0.1, 0.2, -0.3, 0.4, -0.5, 1.2])
    _, jacobian = geometry.jacobian(theta, moved)
    low, high = (geometry.placed(theta + sign * STEP * np.eye(6)[4], moved) for sign in (-1, 1))
    assert (high.position - low.position) / (2 * STEP) == pytest.approx(jacobian[:, :3, 4], abs=1e-8)


def test_a_corrected_robot_is_where_the_parameters_put_it() -> None:
    for robot, q in ((serial(), within(serial(), 20, seed=5)), (four_bar(), four_bar_poses())):
        geometry = geometry_of(robot, q, (robot.tcp,))
        rng = np.random.default_rng(6)
        theta = np.array(
            [
                0.0 if x.group == "base" or "target" in x.name else 2e-3 * rng.standard_normal()
                for x in geometry.parameters
            ]
        )
        errors = {x.name: value for x, value in zip(geometry.parameters, theta, strict=True)}
        built = build_geometry(machine(robot, errors), geometry.rows, ())
        expected, placed = built.placed(np.zeros(0)), geometry.placed(theta)
        assert placed.position == pytest.approx(expected.position, abs=1e-11)
        assert placed.rotation == pytest.approx(expected.rotation, abs=1e-11)


def test_parameters_that_would_open_a_planar_loop_are_named_with_it() -> None:
    robot = load_robot("ir663")
    rows = measured(robot, within(robot, 4, seed=1))
    geometry = build_geometry(robot, rows, known_parameters(robot, ["n7"], False))
    opening = opening_parameters(geometry)
    assert set(opening.values()) == {"four_bar"}
    assert {"f9.r", "f9.alpha", "f3.alpha", "f8.alpha"} <= set(opening)
    assert not {"f9.d", "f3.d", "f10.d", "f11.d", "q2", "f1.r", "f1.alpha"} & set(opening)
    with pytest.raises(BeamstiffError, match=r"^f9.r: loop 'four_bar' closes with the present value only"):
        refuse_opening(opening, ["f9.d", "f9.r"])
    assert opening_parameters(build_geometry(serial(), measured(serial(), within(serial(), 2, 0)), ())) == {}


def test_a_pose_that_cannot_close_is_named_by_its_row() -> None:
    q = four_bar_poses()[:5].copy()
    rows = replace(measured(four_bar(), q), q=np.vstack([q[:3], [[0, 0.1, 0.8, 0, 0, 0]], q[4:]]))
    geometry = build_geometry(four_bar(), rows, ())
    with pytest.raises(
        BeamstiffError, match=r"^<arrays>:4: loop 'slider_crank2' cannot close at .*screw2 = 0.1 m"
    ):
        geometry.placed(np.zeros(0))
