"""Further effects of geometry, loads and readings against the library's kinematics and linear theory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.exam.campaign import Array
from beamstiff.exam.forms.author2.measurement import links
from beamstiff.exam.robots import with_payload
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
)
from tests.exam.test_truths_measurement import XYZ, more, serial, tcp_axes, tcp_places, vector

STILL = np.zeros((1, 6))


# --- geometry, payload


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
@pytest.mark.parametrize("form", ["eccentric", "crooked"])
def test_an_encoder_whose_error_changes_moves_the_tool_as_the_angle_does(name: str, form: str) -> None:
    robot = load_robot(name).model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    variable = robot.actuated[1]
    q = random_poses(robot, np.random.default_rng(22), 5)
    truth = drawn(robot, "geometry-error", variable.name, form)
    p, angle, moved = truth.parameters, q[:, 1], q.copy()
    if form == "eccentric":
        moved[:, 1] += p["error"] + p["runout"] * np.sin(angle + p["phase"])
        assert p["runout"] < abs(p["error"])  # an offset first of all
    else:
        moved[:, 1] += p["error"] + p["scale"] * (angle - np.mean(variable.limits))
    found = read(robot, campaign_of(robot, q, STILL, kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, tcp_places(robot, moved), atol=1e-9)


@pytest.mark.parametrize("form", ["eccentric", "crooked"])
def test_a_frames_error_comes_with_far_smaller_ones(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "f3.d", form)
    p = truth.parameters
    errors = {"d": p["error"]} | {name: p[name] for name in ("r", "alpha", "beta") if name in p}
    wrong = [
        f.model_copy(update={n: quantity(getattr(f, n), FRAME_PARAMETERS[n]) + e for n, e in errors.items()})
        if f.name == "f3"
        else f
        for f in robot.frames
    ]
    moved = q.copy()
    moved[:, 2] += p.get("runout", 0.0) * np.sin(q[:, 2] + p.get("phase", 0.0))
    expected = tcp_places(robot.model_copy(update={"frames": tuple(wrong)}), moved)
    found = read(robot, campaign_of(robot, q, STILL, kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    only = drawn(robot, "geometry-error", "f3.d", "single")
    alone = read(robot, campaign_of(robot, q, STILL, kind="absolute"), only)[:, :3]
    assert only.parameters["error"] == pytest.approx(p["error"])
    rest, named = np.abs(found - alone).max(), np.abs(alone - tcp_places(robot, q)).max()
    assert rest < 0.7 * named


def test_a_hose_weighs_as_much_as_the_tool_has_lifted_of_it() -> None:
    robot = load_robot("kr240-2")
    truth = drawn(robot, "payload-error", None, "hose")
    p = truth.parameters
    q = random_poses(robot, np.random.default_rng(23), 4)
    for pose, height in zip(q, tcp_places(robot, q)[:, 2], strict=True):
        campaign = campaign_of(robot, pose[None], STILL, kind="absolute")
        hung = with_payload(robot, max(p["per_metre"] * (height - p["low"]), 0.0), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(read(robot, campaign, truth), read(hung, campaign), atol=1e-12)


def test_a_loose_part_slides_down_its_axis_and_weighs_there() -> None:
    robot = with_payload(load_robot("kr240-2"), 50.0, (0.05, 0.0, 0.1))
    truth = changed(drawn(robot, "payload-error", None, "loose"), mass=10.0)
    p, axis = truth.parameters, vector(truth)
    q = random_poses(robot, np.random.default_rng(23), 4)
    down = tcp_axes(robot, q).transpose(0, 2, 1) @ np.array(robot.gravity) / 9.81
    for pose, way in zip(q, down, strict=True):
        campaign = campaign_of(robot, pose[None], STILL, kind="absolute")
        at = (p["away"] + p["slides"] * float(axis @ way)) * axis
        there = with_payload(robot, 10.0, tuple(at.tolist()))
        found, expected = (read(one, campaign, *t) for one, t in ((robot, (truth,)), (there, ())))
        added = np.abs(expected - read(robot, campaign)).max()
        np.testing.assert_allclose(found, expected, atol=2e-3 * added)


# --- loads


def linear(C: Array, wrench: Array) -> Array:
    return np.einsum("pij,psj->psi", C, wrench).reshape(-1, 6)


def beside(force: Array, moment: Array | None = None) -> Array:
    return np.concatenate([force, np.zeros_like(force) if moment is None else moment], axis=-1)


def test_a_shackles_eye_goes_where_the_load_pulls_it_furthest() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "shackle", size=0.6)
    loads = random_loads(np.random.default_rng(1), 6, [0.01])
    axes, force = tcp_axes(robot, q), loads[:, 0, :3]
    n = vector(truth)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u = u / np.linalg.norm(u)
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)[:, None]
    ring = truth.parameters["away"] * (np.cos(angles) * u + np.sin(angles) * np.cross(n, u))
    eye = np.array([(at := ring @ a.T)[np.argmax(at @ f)] for a, f in zip(axes, force, strict=True)])
    expected = linear(C, beside(np.zeros_like(force), np.cross(eye, force))[:, None])
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=2e-2 * np.abs(expected).max())


def test_a_strap_hangs_below_the_tool() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "strap", size=0.6)
    down = np.tile([0, 0, -20.0, 0, 0, 0], (6, 1, 1))
    np.testing.assert_allclose(more(robot, campaign_of(robot, q, down), truth), 0.0, atol=1e-12)
    aside = np.tile([15.0, 8.0, 0, 0, 0, 0], (6, 1, 1))
    moment = np.cross([0.0, 0.0, -truth.parameters["away"]], aside[..., :3])
    expected = linear(C, beside(np.zeros_like(moment), moment))
    found = more(robot, campaign_of(robot, q, aside), truth)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_a_hanger_adds_its_weight_however_much_hangs_on_it() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "load-error", None, "hanger", size=0.05)
    loads = beside(random_loads(np.random.default_rng(2), 6, [0.0, 0.3, 1.0], force=20.0)[..., :3])
    found = more(robot, campaign_of(robot, q, loads), truth).reshape(6, 3, 6)
    way = loads[:, 2] / np.linalg.norm(loads[:, 2, :3], axis=1, keepdims=True)
    expected = truth.parameters["tare"] * np.einsum("pij,pj->pi", C, way)
    np.testing.assert_allclose(found[:, 0], 0.0, atol=1e-12)
    for loaded in (1, 2):
        np.testing.assert_allclose(found[:, loaded], expected, atol=2e-3 * np.abs(expected).max())


def test_a_gain_that_differs_from_push_to_pull_is_even_in_the_load() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "load-error", None, "push-pull", size=0.05)
    loads = beside(random_loads(np.random.default_rng(2), 6, [1.0, -1.0], force=20.0)[..., :3])
    found = more(robot, campaign_of(robot, q, loads), truth).reshape(6, 2, 6)
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=2e-3 * np.abs(found).max())
    axes = tcp_axes(robot, q)
    far = np.stack([400.0 * axes @ np.ones(3)], axis=1)  # all of a cell's axes pulled well beyond its middle
    wrong = 400.0 * (axes @ vector(truth))
    expected = linear(C, beside(wrong)[:, None])
    pulled = more(robot, campaign_of(robot, q, beside(far)), truth)
    np.testing.assert_allclose(pulled, expected, atol=2e-2 * np.abs(expected).max())


def test_cross_talk_is_a_moment_that_no_load_beside_the_tool_makes() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "load-error", None, "crosstalk", size=0.3)
    mixed = np.array([[truth.parameters[a + b] for b in XYZ] for a in XYZ])
    np.testing.assert_allclose(mixed, mixed.T, atol=1e-15)  # a lever's would be odd
    assert np.trace(mixed) == pytest.approx(0.0, abs=1e-12)
    loads = random_loads(np.random.default_rng(2), 6, [0.5, 1.0], force=20.0)
    axes = tcp_axes(robot, q)
    own = np.swapaxes(axes, -1, -2)[:, None] @ loads[..., :3, None]
    moment = (axes[:, None] @ mixed @ own)[..., 0]
    expected = linear(C, beside(np.zeros_like(moment), moment))
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


# --- readings


def test_a_tracker_sees_the_right_distance_from_where_it_stands() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "frame-misalignment", None, "tracker")
    place = vector(truth, "uvw")
    campaign = campaign_of(robot, q, STILL, kind="absolute")
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    assert np.abs(found - was).max() > 1e-4
    apart = [np.linalg.norm(points - place, axis=1) for points in (was, found)]
    np.testing.assert_allclose(apart[0], apart[1], rtol=1e-12)
    campaign = campaign_of(robot, q, random_loads(np.random.default_rng(3), 6, [1.0]))
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    np.testing.assert_allclose(found, Rotation.from_rotvec(vector(truth)).apply(was), atol=1e-12)


def test_a_camera_misjudges_depth_only() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "frame-misalignment", None, "depth"), x=0.0, y=0.0, z=0.0)
    view = vector(truth, "uvw") / np.linalg.norm(vector(truth, "uvw"))
    campaign = campaign_of(robot, q, random_loads(np.random.default_rng(3), 6, [1.0]))
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    np.testing.assert_allclose(found @ view, (1.0 + truth.parameters["deeper"]) * was @ view, atol=1e-12)
    np.testing.assert_allclose(np.cross(found, view), np.cross(was, view), atol=1e-12)


def test_a_link_that_grows_pushes_the_tool_along_itself() -> None:
    robot, q, _ = serial()
    for link, (a, b) in enumerate(links(robot)):
        truth = changed(drawn(robot, "thermal-drift", None, "link"), link=float(link))
        campaign = campaign_of(robot, q, np.zeros((4, 6)), time=100.0 * np.arange(24))
        found = more(robot, campaign, truth)
        kinematics = compile_kinematics(robot)
        nodes = posture(kinematics, q).node_positions
        way = nodes[:, kinematics.node_index[b]] - nodes[:, kinematics.node_index[a]]
        way = np.repeat(way / np.linalg.norm(way, axis=1, keepdims=True), 4, axis=0)
        grown = np.sum(found[:, :3] * way, axis=1)
        np.testing.assert_allclose(found[:, :3], grown[:, None] * way, atol=1e-14)
        assert (np.diff(grown) > 0.0).all()
        assert (np.diff(grown, 2) < 0.0).all()  # ever more slowly
        assert grown[-1] < truth.parameters["drift"]


def test_the_halls_swing_comes_back_after_its_period() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "thermal-drift", None, "swing"), period=12 / 23)
    campaign = campaign_of(robot, q, np.zeros((4, 6)), time=100.0 * np.arange(24))
    found = more(robot, campaign, truth)[:, :3]
    np.testing.assert_allclose(found[:12], found[12:], atol=1e-15)
    along = found @ vector(truth)
    assert np.ptp(along) == pytest.approx(truth.parameters["drift"], rel=0.05)


def test_a_stand_that_tilts_turns_all_readings_about_it() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "thermal-drift", None, "stand")
    campaign = campaign_of(robot, q, np.zeros((4, 6)), time=100.0 * np.arange(24))
    found = more(robot, campaign, truth)
    arm = np.repeat(tcp_places(robot, q), 4, axis=0) - vector(truth, "uvw")
    np.testing.assert_allclose(found[:, :3], np.cross(found[:, 3:], arm), atol=1e-9)
    assert np.linalg.norm(found[-1, 3:]) == pytest.approx(truth.parameters["drift"] / 3.0, rel=1e-3)


@pytest.mark.parametrize("form", ["link", "swing", "stand"])
def test_a_shared_unloaded_reading_takes_off_the_drift_before_it(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "thermal-drift", None, form)
    time = 100.0 * np.arange(24)
    shared, whole = (
        more(robot, campaign_of(robot, q, np.zeros((4, 6)), time=time, shared_unloaded=how), truth)
        for how in (True, False)
    )
    first = np.repeat(whole[::4], 4, axis=0)
    np.testing.assert_allclose(shared, whole - first, atol=1e-9)
