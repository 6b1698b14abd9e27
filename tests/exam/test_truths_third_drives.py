"""The third author's drive effects against mechanics, on an arm and on a six-axis robot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from beamstiff import load_robot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.exam.campaigns import LONG, STIFF, arm, campaign_of, changed, random_poses, without_weight
from tests.exam.third import drawn, pushed, read, wound

HALF_STROKE = 1.0  # rad, of the arm


def give(truth: Truth, torque: float, step: float, q: float = 0.0, robot: Robot | None = None) -> float:
    """Return the compliance about a torque."""
    low, high = wound(truth, [torque - step, torque + step], q, robot)
    return float((high - low) / (2.0 * step))


# --- play, hardening, joint compliance


@pytest.mark.parametrize("q", [-0.8, 0.0, 0.7])
def test_play_is_as_wide_as_the_gears_eccentricity_makes_it_there(q: float) -> None:
    truth = drawn(arm(), "backlash", "q1", "runout")
    p = truth.parameters
    half = p["half"] * (1.0 + p["depth"] * np.cos(q + p["phase"]))
    torque = 60.0 * STIFF * p["half"]
    there, back = wound(truth, [torque, -torque], q)
    # beyond the flank the whole stiffness holds, within only what is left of it
    assert there - torque / STIFF == pytest.approx((1.0 - p["left"]) * half, rel=2e-2, abs=1e-8)
    assert back == pytest.approx(-there, rel=1e-9)


def test_a_split_gear_is_crossed_one_way_past_its_preload() -> None:
    truth = changed(drawn(arm(), "backlash", "q1", "scissors"), way=1.0, preload=5e-5, growth=0.1)
    h = truth.parameters["half"]
    far = np.array([-1.0, 1.0]) * 200.0 * STIFF * h
    back, there = wound(truth, far)
    assert there - far[1] / STIFF == pytest.approx(2.0 * h, rel=1e-2)
    assert back - far[0] / STIFF == pytest.approx(0.0, abs=1e-2 * h)
    at_preload = 5e-5 * STIFF
    lost = wound(truth, at_preload)[0] - at_preload / STIFF
    assert lost == pytest.approx(h, rel=1e-2)
    other = wound(changed(truth, way=-1.0), -far)
    np.testing.assert_allclose(other, [-back, -there], rtol=1e-9)


def test_pins_of_a_cycloid_disc_come_into_contact_one_after_another() -> None:
    truth = drawn(arm(), "hardening", "q1", "lobes")
    p = truth.parameters
    angle = np.pi * (np.arange(18) + 0.5) / 18
    # distance of a pin's normal from the pitch point, over the eccentric's arm of longest lever
    pin = np.stack([np.cos(angle), np.sin(angle)], axis=-1) - [p["shortened"], 0.0]
    lever = np.sin(angle) / np.linalg.norm(pin, axis=-1)
    share = 1.0 / np.sum(lever**2)
    for e in p["bend"] * np.array([0.3, 1.0, 4.0]):
        closed = e * lever - p["bend"] * (1.0 - lever)
        carried = np.sum(lever[closed > 0] * closed[closed > 0]) * share
        torque = STIFF * (p["soft"] * e + (p["hard"] - p["soft"]) * carried)
        np.testing.assert_allclose(wound(truth, [torque, -torque]), [e, -e], rtol=1e-6)
    stiff = [1.0 / give(truth, load * STIFF * p["bend"], 1e-4 * STIFF * p["bend"]) for load in (1e-3, 300.0)]
    np.testing.assert_allclose(stiff, STIFF * np.array([p["soft"], p["hard"]]), rtol=1e-3)


def test_uneven_flanks_harden_from_torques_of_their_own() -> None:
    truth = drawn(arm(), "hardening", "q1", "hypoid")
    p = truth.parameters
    soft, hard = STIFF * p["soft"], STIFF * p["hard"]
    knee = 0.5 * STIFF * p["bend"]
    for way, at in ((1.0, knee), (-1.0, p["coast"] * knee)):
        # sqrt(1 + x^2) = 2 at x = sqrt(3)
        found = give(truth, way * np.sqrt(3.0) * at, 1e-3 * at) - 1.0 / hard
        assert found == pytest.approx(0.5 * (1.0 / soft - 1.0 / hard), rel=1e-3)
        assert give(truth, way * 1e4 * at, at) == pytest.approx(1.0 / hard, rel=1e-2)
    assert give(truth, 0.0, 1e-3 * knee) == pytest.approx(1.0 / soft, rel=1e-4)


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.4])
def test_two_strands_hold_as_their_lengths_say(q: float) -> None:
    robot = arm(RIGID)
    truth = drawn(robot, "joint-compliance", "q1", "strands")
    p = truth.parameters
    lengths = 1.0 + p["reach"] * q / HALF_STROKE * np.array([1.0, -1.0])
    expected = 0.5 * p["stiffness"] * np.sum(1.0 / lengths)
    assert 30.0 / wound(truth, 30.0, q, robot)[0] == pytest.approx(expected, rel=1e-6)


def test_a_wheel_gives_the_same_from_spoke_to_spoke() -> None:
    robot = arm(RIGID)
    truth = changed(drawn(robot, "joint-compliance", "q1", "spokes"), spokes=6.0)
    p = truth.parameters
    found = np.array([wound(truth, 30.0, q, robot)[0] for q in -0.9 + np.pi / 12.0 * np.arange(5)])
    assert found[0] == pytest.approx(found[4], rel=1e-9)
    # the mean over a whole wave is the plain one's
    assert found[:4].mean() == pytest.approx(30.0 / p["stiffness"], rel=1e-9)
    assert np.ptp(found[:4]) > 1e-2 * found.mean()


# --- friction


def test_friction_of_teeth_is_a_share_of_what_passes_them() -> None:
    truth = changed(drawn(arm(), "hysteresis", "q1", "teeth"), seals=0.0, arrived=0.0)
    rubbing = truth.parameters["rubbing"]
    slip = truth.parameters["slip"]
    peak = 400.0 * STIFF * slip
    torque = peak * np.concatenate([np.linspace(0.0, 1.0, 401), np.linspace(1.0, 0.0, 401)[1:]])
    e = wound(truth, torque)
    assert e[400] == pytest.approx(peak / STIFF / (1.0 + rubbing), rel=1e-3)
    # on the way back it holds the spring wound up
    assert e[720] == pytest.approx(0.2 * peak / STIFF / (1.0 - rubbing), rel=2e-2)
    lost = float(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(e)))
    assert lost > 0.2 * rubbing * peak**2 / STIFF


def test_a_hub_slips_past_its_clamp_and_stays_where_it_went() -> None:
    truth = changed(drawn(arm(), "hysteresis", "q1", "clamped"), arrived=0.0)
    p = truth.parameters
    breaks, key = STIFF * p["breaks"], STIFF / p["softer"]
    loads = breaks * np.array([0.5, 1.0, 3.0, 2.0, 1.5, 0.0])
    slipped = breaks / key * np.array([0.0, 0.0, 2.0, 2.0, 2.0, 1.0])
    np.testing.assert_allclose(wound(truth, loads), loads / STIFF + slipped, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("form", ["teeth", "clamped"])
def test_a_load_cycle_closes_and_takes_work(form: str) -> None:
    truth = drawn(arm(), "hysteresis", "q1", form)
    peak = 1.5e-3 * STIFF
    back, there = np.linspace(1, -1, 121)[1:], np.linspace(-1, 1, 121)[1:]
    torque = peak * np.concatenate([np.linspace(0, 1, 61), *3 * [back, there]])
    e = wound(truth, torque)
    assert e[-1] == pytest.approx(e[-241], rel=1e-3)
    last = slice(-241, None)
    lost = float(np.sum(0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(e[last])))
    assert lost > 1e-2 * peak**2 / STIFF


# --- lever, compensator


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.5])
def test_a_slider_crank_is_stiff_as_the_square_of_its_slides_way(q: float) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", "slider-crank")
    p = truth.parameters

    def slide(angle: float) -> float:
        """Return where the slide is: the far end of a rod of length 1/`rod` from the crank's pin."""
        pin = np.array([np.cos(angle), np.sin(angle)])
        return float(brentq(lambda x: np.hypot(*(pin - [x, 0.0])) - 1.0 / p["rod"], pin[0] - 10.0, pin[0]))

    def way(angle: float) -> float:
        step = 1e-4
        return (slide(angle + step) - slide(angle - step)) / (2.0 * step)

    # the rod lies on the other side of the crank than the dead centre from which its angle counts
    angle = np.pi - (p["start"] + p["way"] * p["gear"] * q)
    ratio = way(angle) / way(np.pi - p["start"])
    assert wound(truth, 5.0, q)[0] == pytest.approx(5.0 / (STIFF * ratio**2), rel=1e-4)


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.5])
def test_a_cylinders_oil_is_softest_between_its_ends(q: float) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", "cylinder")
    p = truth.parameters
    a, b, clear = p["crank"], p["frame"], np.deg2rad(12.0)

    def length(angle: float) -> float:
        return float(abs(a * np.exp(1j * angle) - b))

    def stiff(angle: float) -> float:
        step = 1e-5
        lever = (length(angle + step) - length(angle - step)) / (2.0 * step)
        stroke = length(np.pi - clear) - length(clear)
        out = length(angle) - length(clear)
        volumes = np.array([out, stroke - out]) + p["dead"] * stroke
        return float(lever**2 * np.sum(np.array([1.0, p["ring"]]) / volumes))

    ratio = stiff(p["start"] + p["way"] * p["gear"] * q) / stiff(p["start"])
    assert wound(truth, 5.0, q)[0] == pytest.approx(5.0 / (STIFF * ratio), rel=1e-5)


@pytest.mark.parametrize("form", ["cam", "chain"])
@pytest.mark.parametrize("moved", [-0.35, 0.0, 0.3])
def test_a_balancers_torque_is_what_its_spring_stores(form: str, moved: float) -> None:
    robot = load_robot("kr240-2").model_copy(update={"masses": ()})
    truth = drawn(robot, "gravity-compensator", "q2", form, size=0.3)
    p, k = truth.parameters, robot.parameter(robot.identify[1])
    q = np.array([[np.mean(v.limits) for v in robot.actuated]])
    q[0, 1] += moved
    campaign = campaign_of(robot, q, np.zeros((1, 6)), kind="absolute")
    still, pulled = (read(robot, campaign, *truths)[0, :3] for truths in ((), (truth,)))
    kinematics = compile_kinematics(robot)
    column = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0, :3, 1]
    turned = float(column @ (pulled - still) / (column @ column))

    def pressed(turn: float) -> float:
        if form == "cam":
            angle = turn - p["top"]
            return float(
                p["crank"] * (2.0 * np.sin(angle / 2) ** 2 + 0.5 * p["pointed"] * np.sin(angle) ** 2)
            )
        ends = [abs(p["crank"] * np.exp(1j * (p["angle"] + t)) - p["frame"]) for t in (turn, 0.0)]
        return float(ends[0] - ends[1])

    def force(way: float) -> float:
        if form == "cam":
            return float(p["pull"] + p["growth"] * way)
        z = way - p["slack"]
        return float(p["growth"] * (z + np.hypot(z, 0.02)))

    at, step = p["way"] * moved, 1e-4
    low, here, high = (pressed(at + way * step) for way in (-1, 0, 1))
    lever, curved = (high - low) / (2.0 * step), (high - 2.0 * here + low) / step**2
    rate = p["share"] * k / p["crank"] ** 2
    if form == "chain":
        z = here - p["slack"]
        rate *= 0.5 * (1.0 + z / np.hypot(z, 0.02))
    stiffness = k + rate * lever**2 + force(here) * curved
    assert turned * p["way"] == pytest.approx(-force(here) * lever / stiffness, rel=0.03)


# --- coupling


def coupled(truth: Truth, robot: Robot, q: Array, load: float) -> Array:
    """Return the compliance (2, 2) of a pair of axes by what small loads do."""
    loads = load * np.concatenate([20.0 * np.eye(6)[:3], 5.0 * np.eye(6)[3:]])
    campaign = campaign_of(robot, q, loads)
    added = read(robot, campaign, truth) - read(robot, campaign)
    kinematics = compile_kinematics(robot)
    i, j = (int(name[1:]) - 1 for name in str(truth.component).split("+"))
    pair = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0][:, [i, j]]
    left = np.linalg.pinv(pair)
    more = left @ (added / (load * np.array([20.0] * 3 + [5.0] * 3))[:, None]).T @ left.T
    k = np.array([robot.parameter(robot.identify[axis]) for axis in (i, j)])
    return np.asarray(more + np.diag(1.0 / k))


@pytest.mark.parametrize("component", ["q2+q3", "q4+q6", "q5+q6"])
@pytest.mark.parametrize("form", ["linkage", "bevel"])
def test_torque_on_one_axis_turns_the_other(form: str, component: str) -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = changed(drawn(robot, "joint-coupling", component, form, size=0.4), preload=1e-2)
    p = truth.parameters
    q = random_poses(robot, np.random.default_rng(3), 1)
    i, j = (int(name[1:]) - 1 for name in component.split("+"))
    k = np.array([robot.parameter(robot.identify[axis]) for axis in (i, j)])
    lever = -np.sign(p["share"]) * p["ratio"] * np.sqrt(k[1] / k[0])
    if form == "linkage":
        low, high = robot.actuated[j].limits or (0.0, 0.0)
        geared = min(1.0, np.deg2rad(70.0) / (0.5 * (high - low)))
        lever *= np.cos(p["start"] + geared * (q[0, j] - 0.5 * (low + high)))
    arm_of = np.array([1.0, lever])
    spring = abs(p["share"]) / (1.0 - abs(p["share"])) * k[0]
    expected = np.linalg.inv(np.diag(k) + spring * np.outer(arm_of, arm_of))
    found = coupled(truth, robot, q, 1.0)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=5e-3)
    assert np.sign(found[0, 1]) == np.sign(p["share"])


def test_bevel_teeth_couple_more_under_load() -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = changed(drawn(robot, "joint-coupling", "q5+q6", "bevel", size=0.4), preload=1e-5)
    q = random_poses(robot, np.random.default_rng(3), 1)
    light, heavy = (coupled(truth, robot, q, load) for load in (0.02, 20.0))
    shares = [abs(C[0, 1]) / np.sqrt(C[0, 0] * C[1, 1]) for C in (light, heavy)]
    assert shares[1] > 1.1 * shares[0]


# --- outside the table


def test_a_flange_slips_sideways_and_stays() -> None:
    truth: Any = changed(drawn(arm(), "slipping-flange", None, "clearance"), arrived=0.0)
    p = truth.parameters
    bolts, grip = 1.0 / p["give"], p["grip"]
    loads = np.zeros((4, 6))
    loads[:, 0] = [1e-3 * grip, 40.0 * grip, 20.0 * grip, 0.0]
    found = pushed(loads, truth)[:, 0]
    assert found[0] == pytest.approx(loads[0, 0] / (bolts * 5.0), rel=1e-2)
    assert found[1] == pytest.approx((loads[1, 0] - grip) / bolts, rel=1e-3)
    assert found[2] == pytest.approx((loads[2, 0] + grip) / bolts, rel=1e-3)
    assert found[3] == pytest.approx(grip / bolts, rel=1e-3)
    upright = pushed(50.0 * np.eye(6)[2], truth)
    np.testing.assert_allclose(upright, pushed(50.0 * np.eye(6)[2]), atol=1e-9)
    aside = pushed([0.0, 50.0 * grip, 0, 0, 0, 0], truth)[1]
    assert aside == pytest.approx(49.0 * grip / bolts + 50.0 * grip * LONG**2 / STIFF, rel=2e-2)
