"""Effects of geometry, loads and readings: against the library's kinematics, linear theory, their laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.robots import with_payload
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.units import quantity
from tests.exam.campaigns import (
    campaign_of,
    changed,
    drawn,
    random_loads,
    random_poses,
    read,
    without_weight,
)

XYZ = ("x", "y", "z")


def vector(truth: Truth, names: Any = XYZ) -> Array:
    return np.array([truth.parameters[name] for name in names])


def serial() -> tuple[Robot, Array, Array]:
    """Return a robot, poses (6, 6) and its compliance there by the library's linear theory (6, 6, 6)."""
    robot = without_weight(load_robot("kr240-2"))
    q = random_poses(robot, np.random.default_rng(21), 6)
    return robot, q, tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))


def tcp_places(robot: Robot, q: Array) -> Array:
    kinematics = compile_kinematics(robot)
    return posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]


def tcp_axes(robot: Robot, q: Array) -> Array:
    kinematics = compile_kinematics(robot)
    frame = next(node.frame for node in robot.nodes if node.name == robot.tcp)
    return posture(kinematics, q).transforms[:, kinematics.frame_index[frame], :3, :3]


def more(robot: Robot, campaign: SimulatedCampaign, truth: Truth) -> Array:
    """Return what an effect adds to the readings."""
    return read(robot, campaign, truth) - read(robot, campaign)


# --- geometry


@pytest.mark.parametrize("component", ["f3.d", "f2.alpha", "f4.r"])
def test_an_error_of_a_frame_moves_the_tool_as_the_library_moves_it(component: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", component, "single")
    frame, parameter = component.split(".")
    kind = FRAME_PARAMETERS[parameter]
    wrong = [
        f.model_copy(update={parameter: quantity(getattr(f, parameter), kind) + truth.parameters["error"]})
        if f.name == frame
        else f
        for f in robot.frames
    ]
    changed_robot = robot.model_copy(update={"frames": tuple(wrong)})
    found = read(robot, campaign_of(robot, q, np.zeros((1, 6)), kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, tcp_places(changed_robot, q), atol=1e-10)
    assert np.abs(found - tcp_places(robot, q)).max() > 1e-4


def test_an_encoder_offset_moves_the_tool_as_the_angle_does() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "q2", "single")
    moved = q + np.eye(6)[1] * truth.parameters["error"]
    found = read(robot, campaign_of(robot, q, np.zeros((1, 6)), kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, tcp_places(robot, moved), atol=1e-10)


def test_an_encoder_of_a_closed_loop_moves_the_tool_as_the_angle_does() -> None:
    robot = without_weight(load_robot("ir663"))
    name = robot.actuated[1].name
    q = random_poses(robot, np.random.default_rng(22), 4)
    truth = drawn(robot, "geometry-error", name, "single")
    moved = q + np.eye(q.shape[1])[1] * truth.parameters["error"]
    found = read(robot, campaign_of(robot, q, np.zeros((1, 6)), kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, tcp_places(robot, moved), atol=1e-10)


def test_geometry_hardly_shows_in_displacement() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "f3.d", "single")
    loads = random_loads(np.random.default_rng(0), 6, [1.0])
    seen = np.abs(more(robot, campaign_of(robot, q, loads), truth)[:, :3]).max()
    absolute = np.abs(more(robot, campaign_of(robot, q, loads, kind="absolute"), truth)[:, :3]).max()
    assert seen < 1e-2 * absolute


# --- tool


def test_a_wrench_beside_the_tool_adds_its_moment() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "wrench", size=0.6)
    loads = random_loads(np.random.default_rng(1), 6, [0.01])
    away = tcp_axes(robot, q) @ vector(truth)
    moment = np.concatenate([np.zeros((6, 3)), np.cross(away, loads[:, 0, :3])], axis=1)
    found = more(robot, campaign_of(robot, q, loads), truth)
    expected = np.einsum("pij,pj->pi", C, moment)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_a_reflector_beside_the_tool_swings_with_it() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "target", size=0.6)
    loads = random_loads(np.random.default_rng(1), 6, [0.01])
    away = tcp_axes(robot, q) @ vector(truth, "uvw")
    turned = np.einsum("pij,pj->pi", C, loads[:, 0])[:, 3:]
    found = more(robot, campaign_of(robot, q, loads), truth)
    expected = np.cross(turned, away)
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found[:, 3:], 0.0, atol=1e-14)


# --- loads


def acting(truth: Truth, loads: Array, axes: Array) -> Array:
    """Return by how much the loads that act differ from those read, (P, S, 6)."""
    p = truth.parameters
    force, moment = loads[..., :3], loads[..., 3:]
    if truth.form == "direction":
        turned = Rotation.from_rotvec(vector(truth)).as_matrix()
        return np.concatenate([force @ turned.T, moment @ turned.T], axis=-1) - loads
    if truth.form == "sensor":
        gain = np.array([[p[a + b] for b in XYZ] for a in XYZ])
        wrong = axes @ gain @ np.swapaxes(axes, -1, -2)
        return np.concatenate([np.einsum("pij,psj->psi", wrong, part) for part in (force, moment)], axis=-1)
    size = np.linalg.norm(force, axis=-1, keepdims=True)
    if truth.form == "quadratic":
        return np.asarray(p["gain"] * size / p["reference"] * loads)
    # pulley: less than read while the load grows, more while it shrinks
    before = np.concatenate([np.zeros_like(size[:, :1]), size[:, :-1]], axis=1)
    return np.asarray(-p["gain"] * np.sign(size - before) * loads)


@pytest.mark.parametrize("form", ["direction", "sensor", "quadratic", "pulley"])
def test_misread_loads_move_the_machine_by_the_difference(form: str) -> None:
    robot, q, C = serial()
    truth = drawn(robot, "load-error", None, form, size=0.05)
    factors = [0.3, 1.0, 0.6]
    loads = random_loads(np.random.default_rng(2), 6, factors, force=20.0)
    expected = np.einsum("pij,psj->psi", C, acting(truth, loads, tcp_axes(robot, q))).reshape(-1, 6)
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_a_sensors_error_holds_no_equal_gain_which_would_be_a_softer_machine() -> None:
    truth = drawn(load_robot("kr240-2"), "load-error", None, "sensor")
    assert sum(truth.parameters[a + a] for a in XYZ) == pytest.approx(0.0, abs=1e-15)


# --- measuring frame


@pytest.mark.parametrize("form", ["turned", "scaled", "sheared"])
def test_a_wrong_measuring_frame_maps_displacements_linearly(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "frame-misalignment", None, form, size=0.1)
    loads = random_loads(np.random.default_rng(3), 6, [0.5, 1.0])
    campaign = campaign_of(robot, q, loads)
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    matrix, *_ = np.linalg.lstsq(was, found, rcond=None)
    np.testing.assert_allclose(was @ matrix, found, atol=1e-12)
    error = matrix.T - np.eye(3)
    odd, even = 0.5 * (error - error.T), 0.5 * (error + error.T)
    turned = np.array([odd[2, 1], odd[0, 2], odd[1, 0]])
    p = truth.parameters
    shear = np.array([p.get("yz", 0.0), -p.get("xz", 0.0), p.get("xy", 0.0)])  # odd part of a shear
    np.testing.assert_allclose(turned, vector(truth) - 0.5 * shear, atol=1e-4)
    diagonal = np.full(3, p.get("scale", 0.0))
    np.testing.assert_allclose(np.diag(even), diagonal, atol=1e-4)


# --- payload


@pytest.mark.parametrize("form", ["mass", "centre", "both"])
def test_a_wrong_payload_is_another_payload(form: str) -> None:
    robot = with_payload(load_robot("kr240-2"), 100.0, (0.05, 0.0, 0.1))
    truth = drawn(robot, "payload-error", None, form)
    mass, away = truth.parameters["mass"], vector(truth)
    carried = next(m for m in robot.masses if m.node == robot.tcp)
    other = carried.model_copy(
        update={"mass": carried.mass + mass, "at": tuple((np.array(carried.at) + away).tolist())}
    )
    masses = (*(m for m in robot.masses if m.node != robot.tcp), other)
    q = random_poses(robot, np.random.default_rng(23), 4)
    campaign = campaign_of(robot, q, np.zeros((1, 6)), kind="absolute")
    expected = read(robot.model_copy(update={"masses": masses}), campaign)
    np.testing.assert_allclose(read(robot, campaign, truth), expected, atol=1e-12)
    # and by linear theory: the weight's difference on the unloaded machine's compliance
    C = tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))
    axes, g = tcp_axes(robot, q), np.array(robot.gravity)
    moment = [m.mass * np.cross(axes @ np.array(m.at), g) for m in (other, carried)]
    wrench = np.concatenate([np.tile(mass * g, (4, 1)), moment[0] - moment[1]], axis=1)
    linear = np.einsum("pij,pj->pi", C, wrench)[:, :3]
    found = more(robot, campaign, truth)[:, :3]
    np.testing.assert_allclose(found, linear, atol=0.03 * np.abs(linear).max())


# --- readings


def still(form: str, **other: Any) -> tuple[Truth, SimulatedCampaign, Array]:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "thermal-drift", None, form), turn=0.0)
    time = 100.0 * np.arange(24)
    campaign = campaign_of(robot, q, np.zeros((4, 6)), time=time, **other)
    return truth, campaign, more(robot, campaign, truth)[:, :3]


def test_drift_in_time_nears_its_end_with_its_lag() -> None:
    truth, campaign, found = still("lagged-time")
    p, share = truth.parameters, campaign.time / campaign.time.max()
    course = -np.expm1(-share / p["lag"]) / -np.expm1(-1.0 / p["lag"])
    np.testing.assert_allclose(found, p["drift"] * course[:, None] * vector(truth), atol=1e-15)
    assert np.linalg.norm(found[-1]) == pytest.approx(p["drift"])


def test_drift_follows_the_temperature_with_a_lag() -> None:
    temperature = 20.0 + np.where(np.arange(24) < 8, 0.0, 5.0)
    truth, _, found = still("lagged-temperature", temperature=temperature)
    course = found @ vector(truth) / truth.parameters["drift"]
    np.testing.assert_allclose(course[:8], 0.0, atol=1e-12)
    assert (np.diff(course[8:]) > 0.0).all()
    assert course.max() == pytest.approx(1.0)
    # what is still to come fades evenly by ratio: an exponential
    step = 100.0 / (0.3 * truth.parameters["lag"] * 2300.0)
    felt = -np.expm1(-step * np.arange(17))
    np.testing.assert_allclose(course[7:], felt / felt[-1], atol=1e-9)


def test_a_shared_unloaded_reading_takes_off_the_drift_before_it() -> None:
    truth, campaign, found = still("lagged-time", shared_unloaded=True)
    _, _, whole = still("lagged-time")
    first = np.repeat(whole[campaign.step == 0], 4, axis=0)
    np.testing.assert_allclose(found, whole - first, atol=1e-15)
    assert truth.parameters["drift"] > 0


def test_a_growing_machine_drifts_away_from_its_base() -> None:
    robot, q, _ = serial()
    truth, campaign, found = still("growth")
    ways = np.repeat(tcp_places(robot, q), 4, axis=0)
    rows = campaign.time > 0
    angle = np.linalg.norm(np.cross(found[rows], ways[rows]), axis=1)
    np.testing.assert_allclose(angle, 0.0, atol=1e-12)
    assert (np.einsum("pi,pi->p", found[rows], ways[rows]) > 0.0).all()
    assert truth.form == "growth"


@pytest.mark.parametrize("form", ["spikes", "jumps"])
def test_a_few_rows_are_bad_and_the_others_untouched(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "outliers", None, form)
    loads = random_loads(np.random.default_rng(5), 6, np.linspace(0.1, 1.0, 20))
    found = more(robot, campaign_of(robot, q, loads), truth)
    bad = np.abs(found).max(axis=1) > 0
    assert bad.sum() == max(1, round(truth.parameters["share"] * 120))
    if form == "spikes":
        np.testing.assert_allclose(np.abs(found[bad]).max(axis=1), truth.parameters["size"], rtol=1e-9)
        assert (np.count_nonzero(np.abs(found[bad]) > 1e-15, axis=1) == 1).all()
