"""Wrong measuring frames, drift and bad rows, of all authors: against their laws."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.forms.author2.measurement import links
from beamstiff.exam.forms.author3.measurement import heated
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.exam.campaigns import campaign_of, changed, drawn, random_loads, read
from tests.exam.kr240 import STILL, XYZ, more, serial, tcp_places, vector


def both(truth: Truth, factors: list[float], seed: int = 3) -> tuple[Array, Array]:
    """Return displacements as they are and as they are read, (N, 3) each."""
    robot, q, _ = serial()
    campaign = campaign_of(robot, q, random_loads(np.random.default_rng(seed), 6, factors))
    was, found = read(robot, campaign), read(robot, campaign, truth)
    return was[:, :3], found[:, :3]


# --- measuring frame


@pytest.mark.parametrize("form", ["turned", "scaled", "sheared"])
def test_a_wrong_measuring_frame_maps_displacements_linearly(form: str) -> None:
    truth = drawn(serial()[0], "frame-misalignment", None, form, size=0.1)
    was, found = both(truth, [0.5, 1.0])
    matrix, *_ = np.linalg.lstsq(was, found, rcond=None)
    np.testing.assert_allclose(was @ matrix, found, atol=1e-12)
    error = matrix.T - np.eye(3)
    odd, even = 0.5 * (error - error.T), 0.5 * (error + error.T)
    turned = np.array([odd[2, 1], odd[0, 2], odd[1, 0]])
    p = truth.parameters
    shear = np.array([p.get("yz", 0.0), -p.get("xz", 0.0), p.get("xy", 0.0)])  # odd part of a shear
    np.testing.assert_allclose(turned, vector(truth) - 0.5 * shear, atol=1e-4)
    np.testing.assert_allclose(np.diag(even), np.full(3, p.get("scale", 0.0)), atol=1e-4)


def test_a_tracker_sees_the_right_distance_from_where_it_stands() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "frame-misalignment", None, "tracker")
    place = vector(truth, "uvw")
    campaign = campaign_of(robot, q, STILL, kind="absolute")
    was, found = read(robot, campaign)[:, :3], read(robot, campaign, truth)[:, :3]
    assert np.abs(found - was).max() > 1e-4
    apart = [np.linalg.norm(points - place, axis=1) for points in (was, found)]
    np.testing.assert_allclose(apart[0], apart[1], rtol=1e-12)
    was, found = both(truth, [1.0])
    np.testing.assert_allclose(found, Rotation.from_rotvec(vector(truth)).apply(was), atol=1e-12)


def test_a_camera_misjudges_depth_only() -> None:
    truth = changed(drawn(serial()[0], "frame-misalignment", None, "depth"), x=0.0, y=0.0, z=0.0)
    view = vector(truth, "uvw") / np.linalg.norm(vector(truth, "uvw"))
    was, found = both(truth, [1.0])
    np.testing.assert_allclose(found @ view, (1.0 + truth.parameters["deeper"]) * was @ view, atol=1e-12)
    np.testing.assert_allclose(np.cross(found, view), np.cross(was, view), atol=1e-12)


def test_two_stations_turn_the_poses_that_each_has_seen() -> None:
    truth = changed(drawn(serial()[0], "frame-misalignment", None, "stations"), after=0.5)
    was, found = both(truth, [1.0])
    for rows, names in ((slice(0, 3), XYZ), (slice(3, 6), "uvw")):
        turned = Rotation.from_rotvec(vector(truth, names)).apply(was[rows])
        np.testing.assert_allclose(found[rows], turned, atol=1e-12)


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
    was, found = both(truth, [0.01])
    rounds = np.cross(view, out)
    first = np.sum(found * rounds, axis=1)
    np.testing.assert_allclose(first, (1.0 + barrel * wide) * np.sum(was * rounds, axis=1), rtol=1e-2)
    away = np.sum(found * out, axis=1)
    expected = (1.0 + 3.0 * barrel * wide) * np.sum(was * out, axis=1)
    expected -= 2.0 * barrel * wide * radius / depth * (was @ view)
    np.testing.assert_allclose(away, expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found @ view, was @ view, atol=1e-12)


# --- drift


def still(form: str, **other: Any) -> tuple[Truth, SimulatedCampaign, Array]:
    """Return a drift, a campaign of 6 poses with 4 unloaded rows each, and what it adds to them, (24, 6)."""
    robot, q, _ = serial()
    changes = {name: other.pop(name) for name in ("period", "link") if name in other}
    truth = changed(drawn(robot, "thermal-drift", None, form), **changes, turn=0.0)
    campaign = campaign_of(robot, q, np.zeros((4, 6)), **({"time": 100.0 * np.arange(24)} | other))
    return truth, campaign, more(robot, campaign, truth)


@pytest.mark.parametrize("form", ["lagged-time", "link", "swing", "stand", "thermostat", "sun"])
def test_a_shared_unloaded_reading_takes_off_the_drift_before_it(form: str) -> None:
    _, _, shared = still(form, shared_unloaded=True)
    _, _, whole = still(form)
    assert np.abs(whole).max() > 0.0
    tolerance = 1e-15 if form == "lagged-time" else 1e-9
    np.testing.assert_allclose(shared, whole - np.repeat(whole[::4], 4, axis=0), atol=tolerance)


def test_drift_in_time_nears_its_end_with_its_lag() -> None:
    truth, campaign, found = still("lagged-time")
    p, share = truth.parameters, campaign.time / campaign.time.max()
    course = -np.expm1(-share / p["lag"]) / -np.expm1(-1.0 / p["lag"])
    np.testing.assert_allclose(found[:, :3], p["drift"] * course[:, None] * vector(truth), atol=1e-15)
    assert np.linalg.norm(found[-1, :3]) == pytest.approx(p["drift"])


def test_drift_follows_the_temperature_with_a_lag() -> None:
    temperature = 20.0 + np.where(np.arange(24) < 8, 0.0, 5.0)
    truth, _, found = still("lagged-temperature", temperature=temperature)
    course = found[:, :3] @ vector(truth) / truth.parameters["drift"]
    np.testing.assert_allclose(course[:8], 0.0, atol=1e-12)
    assert (np.diff(course[8:]) > 0.0).all()
    assert course.max() == pytest.approx(1.0)
    # what is still to come fades evenly by ratio: an exponential
    step = 100.0 / (0.3 * truth.parameters["lag"] * 2300.0)
    felt = -np.expm1(-step * np.arange(17))
    np.testing.assert_allclose(course[7:], felt / felt[-1], atol=1e-9)


def test_a_growing_machine_drifts_away_from_its_base() -> None:
    robot, q, _ = serial()
    _, campaign, found = still("growth")
    ways = np.repeat(tcp_places(robot, q), 4, axis=0)
    rows = campaign.time > 0
    angle = np.linalg.norm(np.cross(found[rows, :3], ways[rows]), axis=1)
    np.testing.assert_allclose(angle, 0.0, atol=1e-12)
    assert (np.einsum("pi,pi->p", found[rows, :3], ways[rows]) > 0.0).all()


def test_a_link_that_grows_pushes_the_tool_along_itself() -> None:
    robot, q, _ = serial()
    for link, (a, b) in enumerate(links(robot)):
        truth, _, found = still("link", link=float(link))
        kinematics = compile_kinematics(robot)
        nodes = posture(kinematics, q).node_positions
        way = nodes[:, kinematics.node_index[b]] - nodes[:, kinematics.node_index[a]]
        way = np.repeat(way / np.linalg.norm(way, axis=1, keepdims=True), 4, axis=0)
        grown = np.sum(found[:, :3] * way, axis=1)
        np.testing.assert_allclose(found[:, :3], grown[:, None] * way, atol=1e-14)
        assert (np.diff(grown) > 0.0).all()
        assert (np.diff(grown, 2) < 0.0).all()  # ever more slowly
        assert grown[-1] < truth.parameters["drift"]


@pytest.mark.parametrize(
    ("form", "period", "size"),  # over half the campaign, and in s; the least span of the drift over its size
    [("swing", 12 / 23, 0.95), ("thermostat", 1200.0, 0.6)],
)
def test_the_hall_comes_back_after_its_period(form: str, period: float, size: float) -> None:
    truth, _, found = still(form, period=period)
    np.testing.assert_allclose(found[:12], found[12:], atol=1e-12 if form == "thermostat" else 1e-15)
    np.testing.assert_allclose(np.cross(found[:, :3], vector(truth)), 0.0, atol=1e-15)
    span = np.ptp(found[:, :3] @ vector(truth)) / truth.parameters["drift"]
    assert size < span <= (1.05 if form == "swing" else 1.0 + 1e-9)


def test_a_stand_that_tilts_turns_all_readings_about_it() -> None:
    robot, q, _ = serial()
    truth, _, found = still("stand")
    arm = np.repeat(tcp_places(robot, q), 4, axis=0) - vector(truth, "uvw")
    np.testing.assert_allclose(found[:, :3], np.cross(found[:, 3:], arm), atol=1e-9)
    assert np.linalg.norm(found[-1, 3:]) == pytest.approx(truth.parameters["drift"] / 3.0, rel=1e-3)


def test_a_column_leans_into_the_shade_and_its_top_goes_round_with_the_sun() -> None:
    robot, q, _ = serial()
    truth, _, found = still("sun")
    p = truth.parameters
    places = np.repeat(tcp_places(robot, q), 4, axis=0)
    np.testing.assert_allclose(found[:, :3], np.cross(found[:, 3:], places), atol=1e-9)
    np.testing.assert_allclose(found[:, 5], 0.0, atol=1e-15)  # it does not twist
    top = 1.5 * np.cross(found[:, 3:], [0.0, 0.0, 1.0])[:, :2]
    assert np.linalg.norm(top[-1]) == pytest.approx(p["drift"], rel=1e-9)
    # an arc of a circle through where it began
    centre = -p["drift"] / (2.0 * np.sin(0.5 * abs(p["sweep"])))
    centre = centre * np.array([np.cos(p["from"]), np.sin(p["from"])])
    np.testing.assert_allclose(np.linalg.norm(top - centre, axis=1), np.linalg.norm(centre), rtol=1e-9)


def test_warmth_follows_a_thermostat_as_its_equation_says() -> None:
    on, lag = 0.4, 0.3
    times = np.linspace(0.0, 40.0, 4001)
    solved = solve_ivp(
        lambda t, u: (float(t % 1.0 < on) - u) / lag, (0.0, 40.0), [0.0], t_eval=times, max_step=0.01
    )
    settled = solved.y[0][-201:]
    expected = (settled - settled.min()) / np.ptp(settled)
    np.testing.assert_allclose(heated(times[-201:], on, lag), expected, atol=2e-2)


# --- bad rows, gauges, stands


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
    head = -np.array([p[f"soft_{n}"] for n in XYZ]) * loads.reshape(-1, 6)[:, :3]
    lean = np.stack([-head[:, 1], head[:, 0], np.zeros(12)], axis=1) / p["tall"]
    seen = np.repeat(tcp_places(robot, q), 2, axis=0) - np.array([p["u"], p["v"], p["tall"]])
    np.testing.assert_allclose(found[:, :3], -head - np.cross(lean, seen), atol=1e-12)
    np.testing.assert_allclose(found[:, 3:], -lean, atol=1e-2 * np.abs(lean).max())
    np.testing.assert_allclose(found[1::2, :3], 2.0 * found[::2, :3], atol=1e-12)
