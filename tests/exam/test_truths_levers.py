"""Levers, balancers and coupled drives of all authors against mechanics, on an arm and a six-axis robot."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.optimize import brentq

from beamstiff import Robot, load_robot
from beamstiff.exam.campaign import Array, Truth
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

Parameters = Mapping[str, float]
CLEAR = np.deg2rad(12.0)  # of a cylinder from its dead centres
STEP = 1e-4  # rad, of derivatives


def slope(way: Callable[[float], float], at: float) -> float:
    return (way(at + STEP) - way(at - STEP)) / (2.0 * STEP)


# --- levers: the stiffness about the axis at an angle of the crank, up to a factor


def rod_length(p: Parameters, angle: float) -> float:
    return float(abs(p["crank"] * np.exp(1j * angle) - p["frame"]))


def rod(p: Parameters, angle: float) -> float:
    """Return the square of a rod's distance from the axis: twice the triangle's area over its length."""
    return float((p["crank"] * p["frame"] * np.sin(angle) / rod_length(p, angle)) ** 2)


def screw(p: Parameters, angle: float) -> float:
    """Return the stiffness of a screw, which gives more the longer its shaft."""
    dead = 0.6 * (p["frame"] - p["crank"])
    shaft = (rod_length(p, angle) - dead) / (rod_length(p, p["start"]) - dead)
    return rod(p, angle) / (1.0 + p["shaft"] * shaft)


def four_bar(p: Parameters, lever: float) -> float:
    """Return the square of the crank's turn over the lever's, by the coupler's constant length."""
    base = np.array([p["base"], 0.0])

    def gap(angle: float, at: Array) -> float:
        pin = base + p["crank"] * np.array([np.cos(angle), np.sin(angle)])
        return float(np.linalg.norm(at - pin) - p["coupler"])

    def end(turn: float) -> Array:
        return np.array([np.cos(turn), np.sin(turn)])

    towards = np.arctan2(*(end(lever) - base)[::-1])
    crank = brentq(gap, towards, towards + np.pi, args=(end(lever),), xtol=1e-13)
    turn = slope(lambda x: brentq(gap, crank - 0.05, crank + 0.05, args=(end(x),), xtol=1e-14), lever)
    return float(turn**2)


def slider(p: Parameters, angle: float) -> float:
    """Return the square of a slide's way: the far end of a rod of length 1/`rod` from the crank's pin."""

    def at(turn: float) -> float:
        pin = np.array([np.cos(turn), np.sin(turn)])
        return float(brentq(lambda x: np.hypot(*(pin - [x, 0.0])) - 1.0 / p["rod"], pin[0] - 10.0, pin[0]))

    # the rod lies on the other side of the crank than the dead centre from which its angle counts
    return slope(at, np.pi - angle) ** 2


def cylinder(p: Parameters, angle: float) -> float:
    """Return the stiffness of oil columns, softest between the ends."""
    low, high = rod_length(p, CLEAR), rod_length(p, np.pi - CLEAR)
    out = rod_length(p, angle) - low
    volumes = np.array([out, high - low - out]) + p["dead"] * (high - low)
    lever = slope(lambda x: rod_length(p, x), angle)
    return float(lever**2 * np.sum(np.array([1.0, p["ring"]]) / volumes))


@pytest.mark.parametrize(
    ("form", "stiffness"),
    [
        ("rod", rod), ("geared", rod), ("screw", screw), ("four-bar", four_bar), ("slider-crank", slider),
        ("cylinder", cylinder),
    ],
)  # fmt: skip
@pytest.mark.parametrize("q", [-0.9, -0.3, 0.0, 0.5, 0.9])
def test_a_drive_is_as_stiff_as_its_lever_makes_it(
    form: str, stiffness: Callable[[Parameters, float], float], q: float
) -> None:
    truth = drawn(arm(), "actuator-lever", "q1", form)
    p = truth.parameters
    share = stiffness(p, p["start"] + p["way"] * p["gear"] * q) / stiffness(p, p["start"])
    found = turned_about_its_axis(arm(), 5.0, truth, q=q)[0]
    tolerance = {"screw": 1e-6, "cylinder": 1e-5}.get(form, 1e-4)
    assert found == pytest.approx(5.0 / (STIFF * share), rel=tolerance)


# --- balancers: how far the spring is drawn at a turn, m, and its force, N, there


def drawn_out(form: str, p: Parameters, turn: float) -> float:
    if form == "cam":
        angle = turn - p["top"]
        return float(p["crank"] * (2.0 * np.sin(angle / 2) ** 2 + 0.5 * p["pointed"] * np.sin(angle) ** 2))
    if form == "disc":
        wave = [np.sin(angle - p["phase"]) for angle in (turn, 0.0)]
        return float(p["side"] * p["crank"] * (turn + p["eccentric"] * (wave[0] - wave[1])))
    return rod_length(p, p["angle"] + turn) - rod_length(p, p["angle"])


def force(form: str, p: Parameters, way: float) -> tuple[float, float]:
    """Return the force of a balancer's spring and its rate over the first coil's."""
    if form == "chain":  # slack over part of the range
        z = way - p["slack"]
        return float(p["growth"] * (z + np.hypot(z, 0.02))), float(0.5 * (1.0 + z / np.hypot(z, 0.02)))
    second = p.get("second", 0.0)
    beyond = way - p.get("engages", 0.0)
    return p["pull"] + p["growth"] * (way + second * max(beyond, 0.0)), 1.0 + second * (beyond > 0.0)


@pytest.mark.parametrize(
    ("form", "size", "moved"),
    [("coil", 0.7, 0.0), ("gas", 0.7, 0.0)]
    + [(form, 0.7, moved) for form in ("nested", "disc") for moved in (-0.25, 0.0, 0.3)]
    + [(form, 0.3, moved) for form in ("cam", "chain") for moved in (-0.35, 0.0, 0.3)],
)
def test_a_balancers_torque_is_what_its_spring_stores(form: str, size: float, moved: float) -> None:
    robot = load_robot("kr240-2").model_copy(update={"masses": ()})
    truth = drawn(robot, "gravity-compensator", "q2", form, size=size)
    p, k = truth.parameters, robot.parameter(robot.identify[1])
    q = np.array([[np.mean(v.limits) for v in robot.actuated]])
    q[0, 1] += moved
    campaign = campaign_of(robot, q, np.zeros((1, 6)), kind="absolute")
    pulled = read(robot, campaign, truth)[0, :3] - read(robot, campaign)[0, :3]
    kinematics = compile_kinematics(robot)
    column = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0, :3, 1]
    turned = float(column @ pulled / (column @ column))
    np.testing.assert_allclose(pulled, turned * column, atol=0.02 * np.linalg.norm(pulled))

    low, here, high = (drawn_out(form, p, p["way"] * moved + way * STEP) for way in (-1, 0, 1))
    lever, curved = (high - low) / (2.0 * STEP), (high - 2.0 * here + low) / STEP**2
    pull, rate = force(form, p, here)
    stiffness = k + rate * p["share"] * k / p["crank"] ** 2 * lever**2 + pull * curved
    # the second coil engages over some centimetres, not all at once
    near = form == "nested" and abs(here - p["engages"]) < 0.06
    expected = -pull * lever / stiffness
    assert turned * p["way"] == pytest.approx(expected, rel=0.3 if near else 0.02 if size > 0.5 else 0.03)


# --- coupling


def coupled(truth: Truth, robot: Robot, q: Array, load: float) -> Array:
    """Return the compliance (2, 2) of a pair of axes by what loads do, 1 for small ones."""
    loads = load * np.concatenate([20.0 * np.eye(6)[:3], 5.0 * np.eye(6)[3:]])
    campaign = campaign_of(robot, q, loads)
    added = read(robot, campaign, truth) - read(robot, campaign)
    kinematics = compile_kinematics(robot)
    i, j = (int(name[1:]) - 1 for name in str(truth.component).split("+"))
    pair = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0][:, [i, j]]
    left = np.linalg.pinv(pair)
    more = left @ (added / (load * np.array([20.0] * 3 + [5.0] * 3))[:, None]).T @ left.T
    # the two axes explain all that is added, to first order
    tolerance = 1e-3 if truth.form in ("compliance", "gear") else 2e-3
    if load <= 1.0:
        np.testing.assert_allclose(
            pair @ more @ pair.T @ loads.T, added.T, atol=tolerance * np.abs(added).max()
        )
    k = np.array([robot.parameter(robot.identify[axis]) for axis in (i, j)])
    return np.asarray(more + np.diag(1.0 / k))


def linked(form: str, p: Parameters, k: Array, angles: Array, robot: Robot, second: int) -> Array:
    """Return the compliance (2, 2) of two drives and what links them."""
    sign = np.sign(p["share"])
    if form in ("compliance", "gear"):
        lever = -sign * p.get("ratio", 1.0) * np.sqrt(k[0] / k[1])
        if form == "compliance":
            cross = p["share"] / np.sqrt(k[0] * k[1])
            return np.array([[1.0 / k[0], cross], [cross, 1.0 / k[1]]])
        n = np.array([1.0, lever])
        made = [
            np.linalg.inv(np.diag(k) + s * np.outer(n, n)) for s in np.geomspace(1e-4, 1e4, 4001) * k.sum()
        ]
        return min(made, key=lambda C: abs(C[0, 1] / np.sqrt(C[0, 0] * C[1, 1]) - p["share"]))
    strong = abs(p["share"]) / (1.0 - abs(p["share"]))
    if form == "bracket":  # both hang on it: softer
        n = np.array([1.0, sign * p["ratio"] * np.sqrt(k[0] / k[1])])
        return np.asarray(np.diag(1.0 / k) + strong / k[0] * np.outer(n, n))
    if form == "eccentric":
        strong *= 1.0 + p["depth"] * np.sin(angles[0] + p["phase"])
    n = np.array([1.0, -sign * p["ratio"] * np.sqrt(k[1] / k[0])])
    if form == "linkage":
        low, high = robot.actuated[second].limits or (0.0, 0.0)
        geared = min(1.0, np.deg2rad(70.0) / (0.5 * (high - low)))
        n[1] *= np.cos(p["start"] + geared * (angles[1] - 0.5 * (low + high)))
    return np.asarray(np.linalg.inv(np.diag(k) + strong * k[0] * np.outer(n, n)))


@pytest.mark.parametrize("component", ["q2+q3", "q4+q6", "q5+q6"])
@pytest.mark.parametrize(
    ("form", "size", "changes"),
    [
        ("compliance", 0.7, {}), ("gear", 0.7, {}), ("belt", 0.7, {"ratio": 1.0}),
        ("eccentric", 0.7, {"ratio": 1.0}), ("bracket", 0.7, {"ratio": 1.0}), ("linkage", 0.4, {}),
        ("bevel", 0.4, {"preload": 1e-2}),
    ],
)  # fmt: skip
def test_torque_on_one_axis_turns_the_other(
    form: str, size: float, changes: dict[str, float], component: str
) -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = changed(drawn(robot, "joint-coupling", component, form, size=size), **changes)
    q = random_poses(robot, np.random.default_rng(3), 1)
    i, j = (int(name[1:]) - 1 for name in component.split("+"))
    k = np.array([robot.parameter(robot.identify[axis]) for axis in (i, j)])
    expected = linked(form, truth.parameters, k, q[0, [i, j]], robot, j)
    found = coupled(truth, robot, q, 1.0)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=5e-3)
    share, wanted = (C[0, 1] / np.sqrt(C[0, 0] * C[1, 1]) for C in (found, expected))
    assert share == pytest.approx(wanted, rel=2e-2)
    if form in ("compliance", "gear"):
        assert share == pytest.approx(truth.parameters["share"], rel=2e-2)
    if form in ("belt", "eccentric", "bracket"):
        assert share == pytest.approx(wanted, rel=5e-3)
        assert ((np.diag(found) * k > 1.0) == (form == "bracket")).all()


def test_bevel_teeth_couple_more_under_load() -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = changed(drawn(robot, "joint-coupling", "q5+q6", "bevel", size=0.4), preload=1e-5)
    q = random_poses(robot, np.random.default_rng(3), 1)
    light, heavy = (coupled(truth, robot, q, load) for load in (0.02, 20.0))
    shares = [abs(C[0, 1]) / np.sqrt(C[0, 0] * C[1, 1]) for C in (light, heavy)]
    assert shares[1] > 1.1 * shares[0]
