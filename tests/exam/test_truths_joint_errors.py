"""Errors that follow a joint's angle or its last motion, and reflectors that slip, against closed forms."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, load_robot
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.forms import EFFECTS, came_to_rest, components
from beamstiff.se3 import Array
from tests.exam.campaigns import LONG, arm, campaign_of, drawn, read

ANGLES = np.array([[0.3], [-0.2], [0.1], [0.1], [0.5], [0.4]])


def seen(*truths: Truth, kind: str = "absolute", q: Array = ANGLES) -> Array:
    robot = arm()
    return read(robot, campaign_of(robot, q, np.zeros((1, 6)), kind=kind), *truths)[:, :3]


def tip(angle: Array) -> Array:
    return LONG * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)


@pytest.mark.parametrize("form", ["order", "two-orders"])
def test_an_angle_curve_turns_the_arm_by_its_fourier_series(form: str) -> None:
    p = {"amplitude": 1e-3, "order": 2.0, "phase": 0.4, "second": 0.5 if form == "two-orders" else 0.0}
    q = ANGLES[:, 0]
    error = 1e-3 * (np.sin(2.0 * q + 0.4) + p["second"] * np.cos(3.0 * q + 0.8))
    np.testing.assert_allclose(seen(Truth("angle-curve", "q1", form, p)), tip(q + error), atol=1e-12)


def test_a_joint_stands_at_the_flank_by_which_it_came() -> None:
    p = {"half": 1e-3, "first": 1.0, "way": 1.0}
    # down, up, as it was, up, down: it lags behind its motion
    error = 1e-3 * np.array([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])
    for form in ("flank", "play"):
        found = seen(Truth("approach-direction", "q1", form, p))
        np.testing.assert_allclose(found, tip(ANGLES[:, 0] + error), atol=1e-12)


def test_in_play_a_small_motion_does_not_reach_the_other_flank() -> None:
    p = {"half": 1e-3, "first": 1.0, "way": 1.0}
    q = np.array([[0.0], [5e-4], [2.5e-3]])
    error = {"play": [1e-3, 5e-4, -1e-3], "flank": [1e-3, -1e-3, -1e-3]}
    for form, expected in error.items():
        found = seen(Truth("approach-direction", "q1", form, p), q=q)
        np.testing.assert_allclose(found, tip(q[:, 0] + expected), atol=1e-12)


def test_a_slip_is_constant_in_the_tool_and_lasts() -> None:
    p = {"when": 0.5, "again": 0.0, "x": 1e-3, "y": 2e-3, "z": 0.0}
    moved = seen(Truth("target-slip", None, "once", p)) - seen()
    q = ANGLES[:, 0]
    c, s = np.cos(q), np.sin(q)
    own = np.stack([1e-3 * c - 2e-3 * s, 1e-3 * s + 2e-3 * c, 0.0 * q], axis=-1)
    np.testing.assert_allclose(moved, own * (np.arange(6) >= 3)[:, None], atol=1e-12)
    twice = Truth("target-slip", None, "twice", {**p, "again": 0.5})
    late = seen(twice) - seen()
    np.testing.assert_allclose(late[-1], 1.5 * own[-1], atol=1e-12)
    rest = came_to_rest(twice, campaign_of(arm(), ANGLES, np.zeros((1, 6))))
    np.testing.assert_allclose(seen(rest) - seen(), 1.5 * own, atol=1e-12)


@pytest.mark.parametrize("form", EFFECTS["target-slip"].forms)
@pytest.mark.parametrize("seed", range(3))
def test_a_slip_that_came_to_rest_is_everywhere_what_it_was_at_the_last_row(form: str, seed: int) -> None:
    rng, robot = np.random.default_rng(seed), arm()
    slip = drawn(robot, "target-slip", None, form, seed)

    def campaign(rows: int) -> SimulatedCampaign:
        time = 60.0 * rng.permutation(rows)
        point = np.where((time == time.max()) | (rng.random(rows) < 0.7), robot.tcp, "b")
        q = rng.uniform(-0.5, 0.5, (rows, 1))
        return campaign_of(robot, q, np.zeros((1, 6)), kind="absolute", time=time, point=point)

    def moved(rows: SimulatedCampaign, truth: Truth) -> Array:
        """Return by how much the readings are off, in the tool's frame."""
        x, y, z = (read(robot, rows, truth) - read(robot, rows))[:, :3].T
        c, s = np.cos(rows.q[:, 0]), np.sin(rows.q[:, 0])
        return np.stack([c * x + s * y, c * y - s * x, z], axis=1)

    measured = campaign(12)
    found = moved(measured, slip)
    first, last = np.argmin(measured.time), np.argmax(measured.time)
    assert not found[first].any()
    assert np.linalg.norm(found[last]) > 1e-5
    rest = came_to_rest(slip, measured)
    for rows in (measured, campaign(5), campaign(40)):
        own = (rows.point == robot.tcp)[:, None]
        np.testing.assert_allclose(moved(rows, rest), own * found[last], atol=1e-12)
    np.testing.assert_allclose(moved(measured, came_to_rest(rest, measured))[last], found[last], atol=1e-12)


def test_what_is_no_slip_does_not_come_to_rest() -> None:
    curve = drawn(arm(), "angle-curve", "q1", "order")
    with pytest.raises(BeamstiffError, match="angle-curve"):
        came_to_rest(curve, campaign_of(arm(), ANGLES, np.zeros((1, 6))))


def test_displacements_do_not_show_them_nor_do_loops_have_them() -> None:
    robot = arm()
    for effect, form, at in (
        ("angle-curve", "order", "q1"),
        ("approach-direction", "play", "q1"),
        ("target-slip", "once", None),
    ):
        assert not seen(drawn(robot, effect, at, form), kind="displacement").any()
        assert components(load_robot("ir663"), effect) == ([None] if effect == "target-slip" else [])
