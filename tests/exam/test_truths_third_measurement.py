"""The third author's effects of geometry, loads and readings against kinematics and linear theory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.exam.campaign import Array
from beamstiff.exam.forms.author3.measurement import heated
from beamstiff.exam.forms.author3.tool import eyes
from beamstiff.exam.robots import with_payload
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.units import quantity
from tests.exam.campaigns import campaign_of, changed, random_loads, random_poses
from tests.exam.test_truths_measurement import XYZ, serial, tcp_axes, tcp_places, vector
from tests.exam.third import drawn, more, read

STILL = np.zeros((1, 6))


def linear(C: Array, wrench: Array) -> Array:
    return np.einsum("pij,psj->psi", C, wrench).reshape(-1, 6)


# --- geometry, payload


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
def test_an_oval_encoder_errs_twice_a_turn(name: str) -> None:
    robot = load_robot(name).model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    q = random_poses(robot, np.random.default_rng(22), 5)
    truth = drawn(robot, "geometry-error", robot.actuated[1].name, "oval")
    p, moved = truth.parameters, q.copy()
    moved[:, 1] += p["error"] + p["oval"] * np.sin(2.0 * q[:, 1] + p["phase"])
    assert p["oval"] < abs(p["error"])  # an offset first of all
    found = read(robot, campaign_of(robot, q, STILL, kind="absolute"), truth)[:, :3]
    np.testing.assert_allclose(found, tcp_places(robot, moved), atol=1e-9)


def test_one_error_stands_out_among_tolerances() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "f3.d", "tolerances")
    p = dict(truth.parameters)
    errors = {"f3.d": p.pop("error")} | p
    wrong = []
    for frame in robot.frames:
        update = {
            n: quantity(getattr(frame, n), kind) + errors[f"{frame.name}.{n}"]
            for n, kind in FRAME_PARAMETERS.items()
            if f"{frame.name}.{n}" in errors
        }
        wrong.append(frame.model_copy(update=update))
    moved = q + np.array([errors.get(v.name, 0.0) for v in robot.actuated])
    expected = tcp_places(robot.model_copy(update={"frames": tuple(wrong)}), moved)
    campaign = campaign_of(robot, q, STILL, kind="absolute")
    np.testing.assert_allclose(read(robot, campaign, truth)[:, :3], expected, atol=1e-9)
    alone = changed(truth, **dict.fromkeys(p, 0.0))
    named = np.abs(read(robot, campaign, alone)[:, :3] - tcp_places(robot, q)).max()
    assert np.abs(expected - read(robot, campaign, alone)[:, :3]).max() < 0.8 * named


@pytest.mark.parametrize("form", ["rolling", "liquid"])
def test_what_is_loose_runs_to_the_low_side_and_weighs_there(form: str) -> None:
    robot = with_payload(load_robot("kr240-2"), 50.0, (0.05, 0.0, 0.1))
    truth = changed(drawn(robot, "payload-error", None, form), mass=10.0)
    p, axis = truth.parameters, vector(truth)
    q = random_poses(robot, np.random.default_rng(23), 4)
    down = tcp_axes(robot, q).transpose(0, 2, 1) @ np.array(robot.gravity) / 9.81
    for pose, way in zip(q, down, strict=True):
        along = float(axis @ way)
        if form == "rolling":
            moved = p["half"] * along / np.hypot(along, p["tilt"]) * axis
        else:  # each of the two ways across by itself
            across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
            across = across / np.linalg.norm(across)
            moved = np.zeros(3)
            for side in (across, np.cross(axis, across)):
                moved = moved + p["half"] * (side @ way) / np.hypot(side @ way, p["tilt"]) * side
        there = with_payload(robot, 10.0, tuple((p["along"] * axis + moved).tolist()))
        campaign = campaign_of(robot, pose[None], STILL, kind="absolute")
        found, expected = (read(one, campaign, *t) for one, t in ((robot, (truth,)), (there, ())))
        added = np.abs(expected - read(robot, campaign)).max()
        np.testing.assert_allclose(found, expected, atol=3e-3 * added)


# --- loads


def test_a_load_is_hooked_into_the_eye_that_faces_it() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "eyes", size=0.6)
    loads = random_loads(np.random.default_rng(1), 6, [0.01, -0.01])
    places = eyes(dict(truth.parameters))
    assert np.linalg.norm(places, axis=1)[:4] == pytest.approx(truth.parameters["away"])
    moments = np.zeros_like(loads)
    for pose, axes in enumerate(tcp_axes(robot, q)):
        for step in range(2):
            force = loads[pose, step, :3]
            cosines = [(axes @ at) @ force / np.linalg.norm(at) for at in places]
            eye = places[int(np.argmax(cosines))]
            moments[pose, step, 3:] = np.cross(axes @ eye, force)
    expected = linear(C, moments)
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=2e-2 * np.abs(expected).max())


def test_a_sling_lies_elsewhere_in_every_pose_but_there_for_all_of_its_loads() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "rehung", size=0.6)
    p = truth.parameters
    loads = np.tile(20.0 * np.eye(3, 6), (6, 1, 1))
    found = more(robot, campaign_of(robot, q, loads), truth).reshape(6, 3, 6)
    places = []
    for pose in range(6):  # the moment of each force, found by the rotation that it adds
        made = np.linalg.solve(C[pose], found[pose].T).T[:, 3:] / 20.0
        np.testing.assert_allclose(made, -made.T, atol=2e-2 * np.abs(made).max())  # that of one arm
        arm = np.array([made[1, 2], made[2, 0], made[0, 1]])
        places.append(tcp_axes(robot, q)[pose].T @ arm)
    mean = np.mean(places, axis=0)
    assert np.linalg.norm(mean - p["away"] * vector(truth)) < 3.0 * p["scatter"] * p["away"]
    assert 0.2 * p["scatter"] * p["away"] < np.std(places, axis=0).max() < 3.0 * p["scatter"] * p["away"]
    some = campaign_of(robot, q[3:], loads[3:], pose=np.repeat(np.arange(3, 6), 3))
    np.testing.assert_allclose(more(robot, some, truth), found[3:].reshape(-1, 6), atol=1e-12)


def test_a_rope_pulls_towards_its_pulley_from_wherever_the_tool_is() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "load-error", None, "rope")
    loads = random_loads(np.random.default_rng(2), 6, [1.0], force=20.0)
    loads[..., 3:] = 0.0
    limits = np.array([v.limits for v in robot.actuated])
    middle = tcp_places(robot, limits.mean(axis=1)[None])[0]
    reach = np.linalg.norm(middle)
    way = loads[:, 0, :3] / np.linalg.norm(loads[:, 0, :3], axis=1, keepdims=True)
    set_out = middle + reach * vector(truth)
    pulley = set_out + reach / truth.parameters["angle"] * way
    rope = pulley - tcp_places(robot, q)
    size = np.linalg.norm(loads[:, 0, :3], axis=1, keepdims=True)
    true = size * rope / np.linalg.norm(rope, axis=1, keepdims=True)
    wrong = np.zeros_like(loads)
    wrong[:, 0, :3] = true - loads[:, 0, :3]
    expected = linear(C, wrong)
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_discs_add_up_each_with_its_own_error() -> None:
    robot, q, C = serial()
    truth = changed(drawn(robot, "load-error", None, "discs"), **{f"disc{i}": 0.0 for i in range(6)})
    truth = changed(truth, disc2=0.12)
    loads = random_loads(np.random.default_rng(2), 1, np.arange(7) / 6.0, force=20.0)
    loads = np.tile(120.0 / np.linalg.norm(loads[:, -1:, :3], axis=-1, keepdims=True) * loads, (6, 1, 1))
    way = loads[:, -1:] / 120.0
    wrong = way * (0.12 * 20.0 * (np.arange(7) >= 3))[:, None]  # the third disc, of 20 N, and all above it
    expected = linear(C, wrong)
    found = more(robot, campaign_of(robot, q, loads), truth)
    np.testing.assert_allclose(found, expected, atol=5e-3 * np.abs(expected).max())


# --- readings


def test_a_lens_stretches_the_picture_towards_its_rim() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "frame-misalignment", None, "lens"), x=0.0, y=0.0, z=0.0)
    camera, barrel = vector(truth, "uvw"), truth.parameters["barrel"]
    view = -camera / np.linalg.norm(camera)
    at = tcp_places(robot, q) - camera
    depth = at @ view
    across = at - depth[:, None] * view
    radius = np.linalg.norm(across, axis=1)
    out = across / radius[:, None]
    wide = (radius / depth) ** 2
    # a small way out is stretched three times as much as one round the picture's middle
    campaign = campaign_of(robot, q, random_loads(np.random.default_rng(3), 6, [0.01]))
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    rounds = np.cross(view, out)
    first = np.sum(found * rounds, axis=1)
    np.testing.assert_allclose(first, (1.0 + barrel * wide) * np.sum(was * rounds, axis=1), rtol=1e-2)
    away = np.sum(found * out, axis=1)
    expected = (1.0 + 3.0 * barrel * wide) * np.sum(was * out, axis=1)
    expected -= 2.0 * barrel * wide * radius / depth * (was @ view)
    np.testing.assert_allclose(away, expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found @ view, was @ view, atol=1e-12)


def test_two_stations_turn_the_poses_that_each_has_seen() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "frame-misalignment", None, "stations"), after=0.5)
    campaign = campaign_of(robot, q, random_loads(np.random.default_rng(3), 6, [1.0]))
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    for rows, names in ((slice(0, 3), XYZ), (slice(3, 6), "uvw")):
        turned = Rotation.from_rotvec(vector(truth, names)).apply(was[rows])
        np.testing.assert_allclose(found[rows], turned, atol=1e-12)


def test_warmth_follows_a_thermostat_as_its_equation_says() -> None:
    on, lag = 0.4, 0.3
    times = np.linspace(0.0, 40.0, 4001)
    solved = solve_ivp(
        lambda t, u: (float(t % 1.0 < on) - u) / lag, (0.0, 40.0), [0.0], t_eval=times, max_step=0.01
    )
    settled = solved.y[0][-201:]
    expected = (settled - settled.min()) / np.ptp(settled)
    np.testing.assert_allclose(heated(times[-201:], on, lag), expected, atol=2e-2)


def test_a_hall_that_is_heated_comes_back_after_each_period() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "thermal-drift", None, "thermostat"), period=1200.0)
    found = more(robot, campaign_of(robot, q, np.zeros((4, 6)), time=100.0 * np.arange(24)), truth)
    np.testing.assert_allclose(found[:12], found[12:], atol=1e-12)
    np.testing.assert_allclose(np.cross(found[:, :3], vector(truth)), 0.0, atol=1e-15)
    along = found[:, :3] @ vector(truth)
    assert 0.6 * truth.parameters["drift"] < np.ptp(along) <= truth.parameters["drift"] * (1.0 + 1e-9)


def test_a_column_leans_into_the_shade_and_its_top_goes_round_with_the_sun() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "thermal-drift", None, "sun")
    p = truth.parameters
    campaign = campaign_of(robot, q, np.zeros((4, 6)), time=100.0 * np.arange(24))
    found = more(robot, campaign, truth)
    places = np.repeat(tcp_places(robot, q), 4, axis=0)
    np.testing.assert_allclose(found[:, :3], np.cross(found[:, 3:], places), atol=1e-9)
    np.testing.assert_allclose(found[:, 5], 0.0, atol=1e-15)  # it does not twist
    top = 1.5 * np.cross(found[:, 3:], [0.0, 0.0, 1.0])[:, :2]
    assert np.linalg.norm(top[-1]) == pytest.approx(p["drift"], rel=1e-9)
    # an arc of a circle through where it began
    centre = -p["drift"] / (2.0 * np.sin(0.5 * abs(p["sweep"])))
    centre = centre * np.array([np.cos(p["from"]), np.sin(p["from"])])
    np.testing.assert_allclose(np.linalg.norm(top - centre, axis=1), np.linalg.norm(centre), rtol=1e-9)


@pytest.mark.parametrize("form", ["thermostat", "sun"])
def test_a_shared_unloaded_reading_takes_off_the_drift_before_it(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "thermal-drift", None, form)
    time = 100.0 * np.arange(24)
    shared, whole = (
        more(robot, campaign_of(robot, q, np.zeros((4, 6)), time=time, shared_unloaded=how), truth)
        for how in (True, False)
    )
    np.testing.assert_allclose(shared, whole - np.repeat(whole[::4], 4, axis=0), atol=1e-9)


def test_a_run_of_rows_is_off_by_the_same_and_the_others_untouched() -> None:
    robot, q, _ = serial()
    truth = changed(drawn(robot, "outliers", None, "run"), length=4.0, share=0.01)
    found = more(robot, campaign_of(robot, q, np.zeros((10, 6))), truth)
    bad = np.flatnonzero(np.abs(found).max(axis=1))
    np.testing.assert_array_equal(np.diff(bad), 1)
    assert len(bad) == 4
    np.testing.assert_allclose(found[bad], np.tile(found[bad[:1]], (4, 1)), atol=1e-15)
    size = np.linalg.norm(found[bad[0], :3]) / truth.parameters["size"]
    assert 0.5 <= size <= 1.5


# --- outside the table


def test_a_gauge_lags_by_its_reversal_error() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "sticking-gauge", None, "reversal")
    half = vector(truth)
    rising = np.linspace(0.0, 1.0, 30)
    shares = np.concatenate([rising, rising[::-1][1:], -rising[1:], -rising[::-1][1:]])
    loads = random_loads(np.random.default_rng(3), 6, shares, force=6000.0)
    campaign = campaign_of(robot, q, loads)
    was, found = (read(robot, campaign, *t)[:, :3].reshape(6, -1, 3) for t in ((), (truth,)))
    lag = found - was
    assert (np.abs(lag) <= half * (1.0 + 1e-9)).all()
    far = np.abs(was).max(axis=1) > 3.0 * half  # where the point goes far enough
    assert far.any()
    for at, way in ((29, 1.0), (87, -1.0)):
        expected = -way * np.sign(was[:, 29]) * half
        np.testing.assert_allclose(lag[:, at][far], expected[far], rtol=1e-9)
    still = np.abs(was).max(axis=1) < half  # too short a way to be seen at all
    np.testing.assert_array_equal(found.transpose(0, 2, 1)[still], 0.0)


def test_a_stand_goes_with_the_reaction_of_the_load_whatever_the_pose() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "moving-stand", None, "reaction")
    p = truth.parameters
    loads = random_loads(np.random.default_rng(3), 6, [1.0, 2.0])
    found = more(robot, campaign_of(robot, q, loads), truth)
    force = loads.reshape(-1, 6)[:, :3]
    head = -np.array([p[f"soft_{n}"] for n in XYZ]) * force
    lean = np.stack([-head[:, 1], head[:, 0], np.zeros(12)], axis=1) / p["tall"]
    tracker = np.array([p["u"], p["v"], p["tall"]])
    seen = np.repeat(tcp_places(robot, q), 2, axis=0) - tracker
    np.testing.assert_allclose(found[:, :3], -head - np.cross(lean, seen), atol=1e-12)
    np.testing.assert_allclose(found[:, 3:], -lean, atol=1e-2 * np.abs(lean).max())
    np.testing.assert_allclose(found[1::2, :3], 2.0 * found[::2, :3], atol=1e-12)
