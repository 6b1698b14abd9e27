"""Drive effects of the simulated machines against their laws, on an arm and on a six-axis robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.exam.campaigns import (
    STIFF,
    arm,
    campaign_of,
    changed,
    drawn,
    random_poses,
    read,
    turned_about_its_axis,
    without_weight,
)

EXACT = 1e-7  # the arm turns about its axis only: rotations add


def wound(truth: Truth, torque: Any, robot: Robot | None = None, **other: Any) -> Array:
    return turned_about_its_axis(robot or arm(), torque, truth, **other)


# --- backlash


@pytest.mark.parametrize("form", ["sharp", "smooth", "stages"])
def test_play_adds_its_half_width_beyond_the_flanks(form: str) -> None:
    truth = drawn(arm(), "backlash", "q1", form)
    truth = changed(truth, rest=0.0) if form == "sharp" else truth
    h, left = truth.parameters["half"], truth.parameters["left"]
    torque = np.array([-1.0, 1.0]) * 40.0 * STIFF * h
    found = wound(truth, torque)
    if form == "sharp":  # what is left of the drive in the play stays: k e - (1 - left) k h = T
        expected = torque / STIFF + np.sign(torque) * (1.0 - left) * h
    else:
        expected = torque / STIFF + np.sign(torque) * h
    np.testing.assert_allclose(found, expected, atol=1e-3 * h)


def test_within_the_play_little_stiffness_is_left() -> None:
    truth = changed(drawn(arm(), "backlash", "q1", "sharp"), rest=0.0)
    h, left = truth.parameters["half"], truth.parameters["left"]
    found = wound(truth, 0.3 * left * STIFF * h)
    assert found[0] == pytest.approx(0.3 * h, rel=0.05)


def test_a_drive_that_rests_beside_the_middle_of_its_play_is_not_odd_in_the_torque() -> None:
    truth = changed(drawn(arm(), "backlash", "q1", "sharp"), rest=0.5)
    h, left = truth.parameters["half"], truth.parameters["left"]
    torque = np.array([-1.0, 1.0]) * 20.0 * STIFF * h
    back, there = wound(truth, torque)
    # from rest at +h/2 the near flank is h/2 away, the far one 3h/2
    assert there + back == pytest.approx(-2.0 * 0.5 * h * (1.0 - left) - 2.0 * 0.5 * h * left, rel=0.05)
    assert there - back == pytest.approx(2.0 * (20.0 * h + (1.0 - left) * h), rel=1e-3)


def test_smooth_play_is_crossed_as_its_curve_says() -> None:
    truth = drawn(arm(), "backlash", "q1", "smooth")
    h, left = truth.parameters["half"], truth.parameters["left"]
    torque = STIFF * h * np.array([0.01, 0.05, 0.3, 2.0])
    crossing = 2.0 * left * STIFF * h
    expected = torque / STIFF + h * torque / np.sqrt(torque**2 + crossing**2)
    np.testing.assert_allclose(wound(truth, torque), expected, rtol=EXACT)


# --- joint compliance, hardening


def test_a_stiff_joint_gives_way_as_a_spring() -> None:
    robot = arm(RIGID)
    truth = drawn(robot, "joint-compliance", "q1", "plain")
    torque = np.array([-500.0, 100.0, 2000.0])
    np.testing.assert_allclose(
        wound(truth, torque, robot), torque / truth.parameters["stiffness"], rtol=EXACT
    )
    np.testing.assert_allclose(turned_about_its_axis(robot, torque), 0.0, atol=1e-12)


def test_a_second_spring_helps_once_the_joint_is_wound_up() -> None:
    robot = arm(RIGID)
    truth = drawn(robot, "joint-compliance", "q1", "helped")
    k, more, start = (truth.parameters[name] for name in ("stiffness", "more", "from"))
    torque = k * start * np.array([1e-3, 1.0, 50.0])
    e = wound(truth, torque, robot)
    share = (e / start) ** 2 / (1.0 + (e / start) ** 2)
    np.testing.assert_allclose(k * e * (1.0 + more * share), torque, rtol=EXACT)
    assert e[2] == pytest.approx(torque[2] / (k * (1.0 + more)), rel=1e-3)


@pytest.mark.parametrize("form", ["exponential", "piecewise", "sinh"])
def test_a_drive_hardens_from_its_soft_to_its_hard_stiffness(form: str) -> None:
    truth = drawn(arm(), "hardening", "q1", form)
    soft, hard = STIFF * truth.parameters["soft"], STIFF * truth.parameters["hard"]
    T = STIFF * truth.parameters["bend"]

    def stiffness(at: float) -> float:
        step = 1e-3 * T
        low, high = wound(truth, [at - step, at + step])
        return float(2.0 * step / (high - low))

    assert stiffness(0.0) == pytest.approx(soft, rel=2e-3)
    rising = [stiffness(share * T) for share in (0.01, 0.55, 0.9)]
    assert (np.diff(rising) > -1e-6 * soft).all()
    assert rising[-1] > 1.05 * rising[0]
    if form == "sinh":
        assert stiffness(T) == pytest.approx(soft * np.sqrt(1.0 + 2.0 * np.log(hard / soft)), rel=1e-4)
    else:
        assert stiffness(20.0 * T) == pytest.approx(hard, rel=1e-3)
    there, back = wound(truth, [2.0 * T, -2.0 * T])
    assert there == pytest.approx(-back, rel=1e-9)


def test_piecewise_hardening_turns_at_its_two_corners() -> None:
    truth = drawn(arm(), "hardening", "q1", "piecewise")
    p = truth.parameters
    soft, hard, T = STIFF * p["soft"], STIFF * p["hard"], STIFF * p["bend"]
    middle = soft + p["middle"] * (hard - soft)
    one = p["first"] * T
    expected = one / soft + (T - one) / middle + 3.0 * T / hard
    assert wound(truth, 4.0 * T)[0] == pytest.approx(expected, rel=EXACT)


# --- hysteresis

CYCLE = np.array([0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0, 0.5, 1.0])


@pytest.mark.parametrize("form", ["iwan", "bouc-wen"])
@pytest.mark.parametrize("largest", [2.0, 6.0])
def test_a_load_cycle_closes_and_takes_work(form: str, largest: float) -> None:
    truth = drawn(arm(), "hysteresis", "q1", form)
    truth = changed(truth, arrived=0.0) if form == "bouc-wen" else truth
    peak = largest * STIFF * truth.parameters["friction"]
    back, there = np.linspace(1, -1, 121)[1:], np.linspace(-1, 1, 121)[1:]
    way = np.concatenate([np.linspace(0, 1, 61), *3 * [back, there]])
    torque = peak * way
    e = wound(truth, torque)
    assert e[-1] == pytest.approx(e[-241], rel=1e-3)  # the same place a cycle later
    last = slice(-241, None)
    lost = float(np.sum(0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(e[last])))
    assert lost > 0.05 * truth.parameters["friction"] * peak


def test_sliders_follow_masings_rule() -> None:
    truth = drawn(arm(), "hysteresis", "q1", "iwan")
    peak = 3.0 * STIFF * truth.parameters["friction"]
    loading = wound(truth, peak * np.array([0.25, 0.5, 1.0]))
    back = wound(truth, peak * np.array([0.25, 0.5, 1.0, 0.5, 0.0, -1.0]))
    # the way back is the first loading, stretched by two
    np.testing.assert_allclose(back[3:], loading[-1] - 2.0 * loading, rtol=1e-6)


def test_sliding_friction_holds_its_torque() -> None:
    for form in ("iwan", "bouc-wen"):
        truth = drawn(arm(), "hysteresis", "q1", form)
        lost = truth.parameters["friction"]
        rising = np.linspace(0.0, 30.0, 61) * STIFF * lost
        e = wound(truth, rising)
        before = truth.parameters.get("arrived", 0.0)
        # all sliders slip: the spring carries all but the friction torque, less what was held at the start
        assert e[-1] == pytest.approx(rising[-1] / STIFF - lost * (1.0 - before), rel=0.02)


def test_the_answer_of_friction_depends_on_the_history_and_of_play_it_does_not() -> None:
    direct, by_the_peak = [0.5], [1.0, 0.5]
    for effect, form, remembers in (("hysteresis", "iwan", True), ("backlash", "smooth", False)):
        truth = drawn(arm(), effect, "q1", form)
        peak = 2.0 * STIFF * drawn(arm(), "hysteresis", "q1", "iwan").parameters["friction"]
        a, b = (wound(truth, peak * np.array(way))[-1] for way in (direct, by_the_peak))
        assert bool(abs(a - b) > 1e-2 * abs(a)) is remembers


# --- lever, compensator


def lever_of(p: Mapping[str, float], angle: float) -> float:
    """Return a rod's distance from the axis: twice the triangle's area over the rod's length."""
    a, b = p["crank"], p["frame"]
    return float(a * b * np.sin(angle) / np.sqrt(a**2 + b**2 - 2.0 * a * b * np.cos(angle)))


@pytest.mark.parametrize("form", ["rod", "geared"])
@pytest.mark.parametrize("q", [-0.9, -0.3, 0.0, 0.4, 0.9])
def test_stiffness_follows_the_square_of_the_lever(form: str, q: float) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", form)
    p = truth.parameters
    angle = p["start"] + p["way"] * p["gear"] * q
    ratio = lever_of(p, angle) / lever_of(p, p["start"])
    expected = 5.0 / (STIFF * ratio**2)
    assert wound(truth, 5.0, q=q)[0] == pytest.approx(expected, rel=1e-4)


def compensated() -> Robot:
    """Return a robot whose second axis is level, without weight that moves it."""
    robot = load_robot("kr240-2")
    return robot.model_copy(update={"masses": ()})


@pytest.mark.parametrize("form", ["coil", "gas"])
def test_a_balancer_pulls_on_its_axis_with_its_lever(form: str) -> None:
    robot = compensated()
    truth = drawn(robot, "gravity-compensator", "q2", form)
    p = truth.parameters
    k, lever = robot.parameter(robot.identify[1]), lever_of(p, p["angle"])
    middle = np.array([[np.mean(v.limits) for v in robot.actuated]])
    still, pulled = (
        read(robot, campaign_of(robot, middle, np.zeros((1, 6)), kind="absolute"), *truths)[0, :3]
        for truths in ((), (truth,))
    )
    column = twist_jacobian(compile_kinematics(robot), posture(compile_kinematics(robot), middle), robot.tcp)[
        0, :3, 1
    ]
    turned = float(column @ (pulled - still) / (column @ column))
    stiffness = k + p["share"] * k / p["crank"] ** 2 * lever**2
    assert abs(turned) == pytest.approx(abs(p["pull"] * lever / stiffness), rel=0.02)
    np.testing.assert_allclose(pulled - still, turned * column, atol=0.02 * np.linalg.norm(pulled - still))


# --- coupling, on a six-axis robot


@pytest.mark.parametrize("component", ["q2+q3", "q4+q6", "q5+q6"])
@pytest.mark.parametrize("form", ["compliance", "gear"])
def test_torque_on_one_axis_turns_the_other(form: str, component: str) -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = drawn(robot, "joint-coupling", component, form)
    q = random_poses(robot, np.random.default_rng(3), 4)
    wrench = np.random.default_rng(4).standard_normal((4, 1, 6)) * np.repeat([20.0, 5.0], 3)
    campaign = campaign_of(robot, q, wrench)
    more = read(robot, campaign, truth) - read(robot, campaign)
    kinematics = compile_kinematics(robot)
    J = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)
    torque = np.einsum("pij,pi->pj", J, wrench[:, 0])
    i, j = (int(name[1:]) - 1 for name in component.split("+"))
    pair = J[:, :, [i, j]]
    # the two columns explain all that is added, by one symmetric matrix of compliance
    unknown = np.stack(
        [
            pair[..., 0] * torque[:, [i]],
            pair[..., 1] * torque[:, [j]],
            pair[..., 0] * torque[:, [j]] + pair[..., 1] * torque[:, [i]],
        ],
        axis=-1,
    ).reshape(-1, 3)
    scale = np.tile(np.repeat([1.0, 2.0], 3), 4)
    found, *_ = np.linalg.lstsq(scale[:, None] * unknown, scale * more.reshape(-1), rcond=None)
    np.testing.assert_allclose(unknown @ found, more.reshape(-1), atol=1e-3 * np.abs(more).max())
    k = [robot.parameter(robot.identify[axis]) for axis in (i, j)]
    own = np.array([1.0 / k[0], 1.0 / k[1]]) + found[:2]
    share = found[2] / np.sqrt(own[0] * own[1])
    assert share == pytest.approx(truth.parameters["share"], rel=0.02)
    if form == "compliance":
        np.testing.assert_allclose(found[:2] * np.array(k), 0.0, atol=5e-3)


# --- outside the table


def test_ripple_makes_stiffness_wave_with_the_angle() -> None:
    truth = drawn(arm(), "stiffness-ripple", "q1", "sine")
    p = truth.parameters
    for q in (-0.7, 0.0, 0.2, 0.9):
        k = STIFF * np.exp(p["depth"] * np.sin(p["waves"] * q + p["phase"]))
        assert wound(truth, 10.0, q=q)[0] == pytest.approx(10.0 / k, rel=EXACT)


def test_a_toothed_gear_waves_with_its_wind_up() -> None:
    truth = drawn(arm(), "transmission-error", "q1", "toothed")
    p = truth.parameters
    torque = 1e3 * np.arange(1.0, 6.0)
    e = wound(truth, torque, q=0.1)
    phase = p["teeth"] * 0.1 + p["phase"]
    wave = p["depth"] / p["teeth"] * (np.sin(phase + p["teeth"] * e) - np.sin(phase))
    np.testing.assert_allclose(STIFF * (e + wave), torque, rtol=EXACT)


@pytest.mark.parametrize("form", ["lagged", "slow"])
def test_a_drive_warms_up_with_time(form: str) -> None:
    truth = drawn(arm(), "warm-up", "q1", form)
    p, time = truth.parameters, np.array([0.0, 600.0, 6000.0])
    warm = 1.0 - np.exp(-time / p["lag"]) if form == "lagged" else time / (time + p["lag"])
    found = wound(truth, np.full(3, 50.0), time=time)
    np.testing.assert_allclose(found, 50.0 / STIFF * (1.0 + p["softer"] * warm), rtol=EXACT)


def test_creep_under_a_constant_load_is_kelvins() -> None:
    truth = drawn(arm(), "creep", "q1", "kelvin-voigt")
    p, time = truth.parameters, 2.0 * np.arange(400)
    found = wound(truth, np.full(400, 50.0), time=time)
    since = time + 30.0  # the first state lasted as long as a pause
    expected = 50.0 / STIFF * (1.0 + p["creep"] * -np.expm1(-since / p["time"]))
    np.testing.assert_allclose(found, expected, rtol=EXACT)
