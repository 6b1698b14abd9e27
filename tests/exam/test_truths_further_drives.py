"""Further drive effects of the simulated machines against mechanics, on an arm and on a six-axis robot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from beamstiff import load_robot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.forms import INSIDE, draw_truth
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.exam.campaigns import (
    LONG,
    STIFF,
    arm,
    campaign_of,
    changed,
    drawn,
    pushed,
    random_poses,
    read,
    turned_about_its_axis,
    without_weight,
)


def wound(truth: Truth, torque: Any, robot: Robot | None = None, **other: Any) -> Array:
    return turned_about_its_axis(robot or arm(), torque, truth, **other)


def give(truth: Truth, torque: float, step: float, robot: Robot | None = None) -> float:
    """Return the compliance about a torque."""
    low, high = wound(truth, [torque - step, torque + step], robot)
    return float((high - low) / (2.0 * step))


def test_further_forms_are_drawn_as_often_as_the_first() -> None:
    robot, rng = arm(), np.random.default_rng(1)
    effect = next(effect for effect in INSIDE if effect.name == "backlash")
    found = [draw_truth(rng, robot, "backlash", 0.5).form for _ in range(400)]
    assert set(found) == set(effect.forms)
    assert 90 < sum(effect.author_of(form) == 2 for form in found) < 240


# --- play, hardening, joint compliance


def test_planets_take_up_their_play_one_after_another() -> None:
    truth = drawn(arm(), "backlash", "q1", "planets")
    h, left, spread = (truth.parameters[name] for name in ("half", "left", "spread"))
    torque = 50.0 * STIFF * h
    there, back = wound(truth, [torque, -torque])
    mean = h * (1.0 - spread * 1.4 / 3.0)
    assert there == pytest.approx(torque / STIFF + (1.0 - left) * mean, rel=1e-4)
    assert back == pytest.approx(-there, rel=1e-9)
    at_flanks = np.array([0.5, 1.0 - 0.7 * spread, 1.0 - 0.2 * spread, 2.0])
    at_flanks[0] = 0.5 * (1.0 - spread)
    # between the flanks of the planets none, one, two and three of them carry
    shares = (1.0 - left) / 3.0 * np.arange(4) + left
    flanks = np.array([1.0 - spread, 1.0 - 0.4 * spread, 1.0])
    for e, share in zip(at_flanks, shares, strict=True):
        torque = STIFF * h * (left * e + (1.0 - left) / 3.0 * np.maximum(e - flanks, 0.0).sum())
        assert 1.0 / give(truth, torque, 1e-3 * torque) == pytest.approx(share * STIFF, rel=0.05)


def test_arctan_play_is_half_crossed_at_its_crossing_torque_and_crossed_far_on() -> None:
    truth = drawn(arm(), "backlash", "q1", "arctan")
    h, left = truth.parameters["half"], truth.parameters["left"]
    crossing = 2.0 * left * STIFF * h
    lost = wound(truth, [crossing, 2e3 * crossing]) - np.array([crossing, 2e3 * crossing]) / STIFF
    np.testing.assert_allclose(lost, [0.5 * h, h], rtol=2e-3)


def test_contacts_give_less_by_the_cube_root_of_their_load() -> None:
    truth = drawn(arm(), "hardening", "q1", "hertz")
    soft, hard = STIFF * truth.parameters["soft"], STIFF * truth.parameters["hard"]
    preload = 0.3 * STIFF * truth.parameters["bend"]
    more = [give(truth, preload * load, 1e-3 * preload) - 1.0 / hard for load in (0.0, 7.0, 26.0)]
    np.testing.assert_allclose(more, (1.0 / soft - 1.0 / hard) * np.array([1.0, 1 / 2, 1 / 3]), rtol=2e-3)


def test_a_cubic_drive_ends_at_its_hard_stiffness() -> None:
    truth = drawn(arm(), "hardening", "q1", "cubic")
    soft, hard = STIFF * truth.parameters["soft"], STIFF * truth.parameters["hard"]
    end = 2.0 * truth.parameters["bend"]
    torque = end * (2.0 * soft + hard) / 3.0  # a parabola's mean height
    there, back = wound(truth, [torque, -torque])
    assert there == pytest.approx(end, rel=1e-6)
    assert back == pytest.approx(-end, rel=1e-6)
    assert 1.0 / give(truth, 0.0, 1e-3 * torque) == pytest.approx(soft, rel=1e-4)
    assert 1.0 / give(truth, 3.0 * torque, 1e-3 * torque) == pytest.approx(hard, rel=1e-6)


def test_a_joint_that_the_model_holds_stiff_gives_less_or_more_under_load() -> None:
    robot = arm(RIGID)
    truth = drawn(robot, "joint-compliance", "q1", "hertz")
    k, more, start = (truth.parameters[name] for name in ("stiffness", "more", "from"))
    found = [k * give(truth, k * start * load, 1e-3 * k * start, robot) for load in (0.0, 7.0, 26.0)]
    np.testing.assert_allclose(found, 1.0 + more * np.array([1.0, 1 / 2, 1 / 3]), rtol=2e-3)
    truth = changed(drawn(robot, "joint-compliance", "q1", "preloaded"), **{"from": 1e-4})
    k, loose = truth.parameters["stiffness"], truth.parameters["loose"]
    assert give(truth, 0.0, 1e-6 * k, robot) == pytest.approx(1.0 / k, rel=1e-6)
    assert give(truth, 2e-3 * k, 1e-5 * k, robot) == pytest.approx(1.0 / (loose * k), rel=1e-3)
    lost = (1.0 - loose) * k * 1e-4  # what the pair held when one of it went slack
    assert wound(truth, 2e-3 * k, robot)[0] == pytest.approx((2e-3 * k - lost) / (loose * k), rel=1e-3)


# --- friction


@pytest.mark.parametrize("form", ["dahl", "maxwell-slip"])
def test_friction_sticks_at_first_and_slides_at_last(form: str) -> None:
    truth = changed(drawn(arm(), "hysteresis", "q1", form), arrived=0.0)
    lost, sliding = truth.parameters["friction"], truth.parameters["sliding"]
    first = 1e-5 * STIFF * lost
    assert wound(truth, first)[0] == pytest.approx(first * (1.0 - sliding) / STIFF, rel=1e-3)
    rising = np.linspace(0.0, 60.0, 121) * STIFF * lost
    assert wound(truth, rising)[-1] == pytest.approx(rising[-1] / STIFF - lost, abs=0.06 * lost)


@pytest.mark.parametrize("form", ["dahl", "maxwell-slip"])
def test_a_load_cycle_closes_and_takes_work(form: str) -> None:
    truth = drawn(arm(), "hysteresis", "q1", form)
    peak = 4.0 * STIFF * truth.parameters["friction"]
    back, there = np.linspace(1, -1, 121)[1:], np.linspace(-1, 1, 121)[1:]
    torque = peak * np.concatenate([np.linspace(0, 1, 61), *3 * [back, there]])
    e = wound(truth, torque)
    assert e[-1] == pytest.approx(e[-241], rel=1e-3)
    last = slice(-241, None)
    lost = float(np.sum(0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(e[last])))
    assert lost > 0.05 * truth.parameters["friction"] * peak


def test_uneven_sliders_follow_masings_rule() -> None:
    truth = changed(drawn(arm(), "hysteresis", "q1", "maxwell-slip"), arrived=0.0)
    peak = 3.0 * STIFF * truth.parameters["friction"]
    loading = wound(truth, peak * np.array([0.25, 0.5, 1.0]))
    back = wound(truth, peak * np.array([0.25, 0.5, 1.0, 0.5, 0.0, -1.0]))
    np.testing.assert_allclose(back[3:], loading[-1] - 2.0 * loading, rtol=1e-6)


# --- lever, compensator


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.5])
def test_a_four_bar_drive_is_stiff_as_the_square_of_the_cranks_turn(q: float) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", "four-bar")
    p = truth.parameters

    def crank_turn(lever: float) -> float:
        """Return how far the crank turns with the lever, from the coupler's constant length."""
        end = np.array([np.cos(lever), np.sin(lever)])
        base = np.array([p["base"], 0.0])

        def gap(angle: float, at: Array) -> float:
            pin = base + p["crank"] * np.array([np.cos(angle), np.sin(angle)])
            return float(np.linalg.norm(at - pin) - p["coupler"])

        towards = np.arctan2(*(end - base)[::-1])
        angle = brentq(gap, towards, towards + np.pi, args=(end,), xtol=1e-13)
        step = 1e-4
        ends = [np.array([np.cos(lever + s), np.sin(lever + s)]) for s in (step, -step)]
        there, back = (brentq(gap, angle - 0.05, angle + 0.05, args=(at,), xtol=1e-14) for at in ends)
        return float((there - back) / (2.0 * step))

    ratio = crank_turn(p["start"] + p["way"] * p["gear"] * q) / crank_turn(p["start"])
    assert wound(truth, 5.0, q=q)[0] == pytest.approx(5.0 / (STIFF * ratio**2), rel=1e-4)


def triangle(p: Any, angle: float) -> tuple[float, float]:
    """Return a rod's distance from the axis and its length."""
    length = float(np.sqrt(p["crank"] ** 2 + p["frame"] ** 2 - 2.0 * p["crank"] * p["frame"] * np.cos(angle)))
    return float(p["crank"] * p["frame"] * np.sin(angle) / length), length


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.5])
def test_a_screw_gives_more_the_longer_its_shaft(q: float) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", "screw")
    p = truth.parameters
    (lever, length), (lever0, length0) = (
        triangle(p, p["start"] + way * p["way"] * p["gear"] * q) for way in (1.0, 0.0)
    )
    dead = 0.6 * (p["frame"] - p["crank"])
    gives = (1.0 + p["shaft"] * (length - dead) / (length0 - dead)) / (1.0 + p["shaft"])
    expected = 5.0 / STIFF * gives * (lever0 / lever) ** 2
    assert wound(truth, 5.0, q=q)[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("form", ["nested", "disc"])
@pytest.mark.parametrize("moved", [-0.25, 0.0, 0.3])
def test_a_balancers_torque_is_what_its_spring_stores(form: str, moved: float) -> None:
    robot = load_robot("kr240-2").model_copy(update={"masses": ()})
    truth = drawn(robot, "gravity-compensator", "q2", form)
    p, k = truth.parameters, robot.parameter(robot.identify[1])
    q = np.array([[np.mean(v.limits) for v in robot.actuated]])
    q[0, 1] += moved
    campaign = campaign_of(robot, q, np.zeros((1, 6)), kind="absolute")
    still, pulled = (read(robot, campaign, *truths)[0, :3] for truths in ((), (truth,)))
    kinematics = compile_kinematics(robot)
    column = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0, :3, 1]
    turned = float(column @ (pulled - still) / (column @ column))

    def longer(turn: float) -> float:
        if form == "nested":
            return triangle(p, p["angle"] + turn)[1] - triangle(p, p["angle"])[1]
        wave = [np.sin(angle - p["phase"]) for angle in (turn, 0.0)]
        return float(p["side"] * p["crank"] * (turn + p["eccentric"] * (wave[0] - wave[1])))

    def pull(stretch: float) -> float:
        more = p.get("second", 0.0) * max(stretch - p.get("engages", 0.0), 0.0)
        return float(p["pull"] + p["growth"] * (stretch + more))

    at, step = p["way"] * moved, 1e-4
    low, here, high = (longer(at + way * step) for way in (-1, 0, 1))
    lever, curved = (high - low) / (2.0 * step), (high - 2.0 * here + low) / step**2
    rate = p["share"] * k / p["crank"] ** 2
    rate *= 1.0 + (p.get("second", 0.0) if here > p.get("engages", 0.0) else 0.0)
    stiffness = k + rate * lever**2 + pull(here) * curved
    # the second coil engages over some centimetres, not all at once
    near = abs(here - p.get("engages", 1.0)) < 0.06
    assert turned * p["way"] == pytest.approx(-pull(here) * lever / stiffness, rel=0.3 if near else 0.03)


# --- coupling


@pytest.mark.parametrize("component", ["q2+q3", "q4+q6", "q5+q6"])
@pytest.mark.parametrize("form", ["belt", "eccentric", "bracket"])
def test_torque_on_one_axis_turns_the_other(form: str, component: str) -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = changed(drawn(robot, "joint-coupling", component, form), ratio=1.0)
    p = truth.parameters
    q = random_poses(robot, np.random.default_rng(3), 1)
    loads = np.concatenate([20.0 * np.eye(6)[:3], 5.0 * np.eye(6)[3:]])
    campaign = campaign_of(robot, q, loads)
    more = read(robot, campaign, truth) - read(robot, campaign)
    kinematics = compile_kinematics(robot)
    i, j = (int(name[1:]) - 1 for name in component.split("+"))
    pair = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0][:, [i, j]]
    left = np.linalg.pinv(pair)
    added = left @ (more / np.array([20.0] * 3 + [5.0] * 3)[:, None]).T @ left.T
    np.testing.assert_allclose(pair @ added @ pair.T @ loads.T, more.T, atol=2e-3 * np.abs(more).max())
    k = np.array([robot.parameter(robot.identify[axis]) for axis in (i, j)])
    whole = added + np.diag(1.0 / k)
    share = whole[0, 1] / np.sqrt(whole[0, 0] * whole[1, 1])
    strong = abs(p["share"]) / (1.0 - abs(p["share"]))
    if form == "eccentric":
        strong *= 1.0 + p["depth"] * np.sin(q[0, i] + p["phase"])
    # two equal drives and a spring between: u / (1 + u)
    assert share == pytest.approx(np.sign(p["share"]) * strong / (1.0 + strong), rel=5e-3)
    softer = np.diag(whole) * k > 1.0
    assert (softer == (form == "bracket")).all()


# --- outside the table


def test_an_uneven_drive_is_stiffer_one_way() -> None:
    truth = drawn(arm(), "uneven-drive", "q1", "two-way")
    u = truth.parameters["uneven"]
    for way in (1.0, -1.0):
        torque = way * 5e-3 * STIFF
        assert give(truth, torque, 1e-6 * STIFF) == pytest.approx(1.0 / (STIFF * (1.0 + way * u)), rel=1e-3)


def test_a_softening_drive_ends_at_what_is_left() -> None:
    truth = drawn(arm(), "softening-drive", "q1", "slackening")
    loose, start = truth.parameters["loose"], truth.parameters["from"]
    near, far = (give(truth, load * STIFF * start, 1e-3 * STIFF * start) for load in (0.01, 30.0))
    assert near == pytest.approx(1.0 / STIFF, rel=1e-4)
    assert far == pytest.approx(1.0 / (loose * STIFF), rel=1e-3)


def test_a_tether_holds_the_tool_along_its_line_only() -> None:
    truth = changed(drawn(arm(), "tether", None, "straight"), x=0.0, y=1.0, z=0.0)
    s = truth.parameters["stiffness"]
    held = pushed(arm(), [0, 50.0, 0, 0, 0, 0], truth)[1]
    assert held == pytest.approx(50.0 / (STIFF / LONG**2 + s), rel=1e-4)
    aside = changed(truth, x=1.0, y=0.0)
    free = pushed(arm(), [0, 50.0, 0, 0, 0, 0], aside)[1]
    assert free == pytest.approx(50.0 * LONG**2 / STIFF, rel=1e-3)
