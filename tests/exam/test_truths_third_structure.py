"""The third author's structural effects against closed forms of first order, on an arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.forms.author3.structure import carriage, girder
from beamstiff.robot.parts import Beam, Material
from beamstiff.robot.sections import Section
from tests.exam.campaigns import LONG, arm, campaign_of, changed
from tests.exam.test_truths_structure import LOADS, TIP, agree, drive, mohr
from tests.exam.third import drawn, pushed, read

NAMES = ["fx", "fy", "fz", "mx", "my", "mz"]
Z = np.array([0.0, 0.0, 1.0])
EVEN = np.ones_like


def give(truth: Truth, axis: int, moment: float, step: float) -> float:
    """Return the compliance about an axis of the base under a moment at the tip."""
    low, high = (pushed((moment + way * step) * np.eye(6)[axis], truth)[axis] for way in (-1.0, 1.0))
    return float((high - low) / (2.0 * step))


def seen_at(tip: Array, compliance: Array, wrench: Array) -> Array:
    """Return what the tip does where a foot gives way at the origin."""
    at_foot = np.concatenate([wrench[:3], wrench[3:] + np.cross(tip, wrench[:3])])
    moved, turned = np.split(compliance @ at_foot, 2)
    return np.concatenate([moved + np.cross(turned, tip), turned])


# --- base


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_carriage_rests_on_its_blocks_as_the_lever_rule_says(wrench: Array) -> None:
    truth = drawn(arm(), "base-compliance", None, "carriage")
    p = truth.parameters
    k = 1.0 / (4.0 * p["tilt"] * p["wide"] ** 2)
    # in the rails' axes, about the middle of the blocks: all six directions are decoupled there
    soft = np.array(
        [
            1.0 / (p["rack"] * k),
            1.0 / (4.0 * p["across"] * k),
            1.0 / (4.0 * k),
            p["tilt"],
            1.0 / (4.0 * k * p["long"] ** 2),
            1.0 / (4.0 * p["across"] * k * p["long"] ** 2),
        ]
    )
    rails = Rotation.from_rotvec(p["turned"] * Z)
    tip = rails.inv().apply(TIP + p["low"] * Z)
    own = np.concatenate([rails.inv().apply(part) for part in np.split(wrench, 2)])
    expected = seen_at(tip, np.diag(soft), own)
    expected = np.concatenate([rails.apply(part) for part in np.split(expected, 2)])
    agree(pushed(wrench, truth), drive(wrench) + expected)


def test_bases_tilt_by_their_parameter_and_hold_every_way() -> None:
    for form, made in (("carriage", carriage), ("girder", girder)):
        p = dict(drawn(arm(), "base-compliance", None, form).parameters)
        K = made(p)
        np.testing.assert_allclose(K, K.T, atol=1e-9 * np.abs(K).max())
        assert (np.linalg.eigvalsh(K) > 0.0).all()
        assert np.linalg.inv(K)[3, 3] == pytest.approx(p["tilt"], rel=1e-6)


def test_a_girders_middle_sinks_as_textbooks_say() -> None:
    p = dict(drawn(arm(), "base-compliance", None, "girder").parameters)
    p |= {"place": 0.5, "beside": 0.0, "above": 0.0}
    C = np.linalg.inv(girder(p))
    # clamped at both ends: twist L/(4 GJ), sinking L^3/(192 EI), slope L/(16 EI)
    EI = p["span"] / (4.0 * p["twist"] * p["tilt"])
    assert C[2, 2] == pytest.approx(p["span"] ** 3 / (192.0 * EI), rel=1e-6)
    assert C[4, 4] == pytest.approx(p["span"] / (16.0 * EI), rel=1e-6)
    assert C[5, 5] == pytest.approx(p["span"] / (16.0 * p["flat"] * EI), rel=1e-6)
    # beside its axis, what sinks also tilts
    beside = np.linalg.inv(girder(p | {"beside": 0.2}))
    assert abs(beside[2, 3]) == pytest.approx(0.2 * beside[3, 3], rel=1e-6)


# --- bearings


@pytest.mark.parametrize("q", [-0.8, 0.0, 0.6])
def test_a_housing_stays_soft_the_same_way_while_the_joint_turns(q: float) -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", "housing")
    p = truth.parameters
    axes = np.stack([pushed(5.0 * np.eye(6)[axis], truth, q=q)[3:5] for axis in (3, 4)]) / 5.0
    softness = np.linalg.eigvalsh(axes)
    np.testing.assert_allclose(softness, [p["other"] * p["tilt"], p["tilt"]], rtol=1e-3)
    still = np.stack([pushed(5.0 * np.eye(6)[axis], truth)[3:5] for axis in (3, 4)]) / 5.0
    np.testing.assert_allclose(axes, still, atol=1e-3 * p["tilt"])


def test_a_housing_lets_the_joint_sink_and_shift() -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", "housing")
    p = truth.parameters
    lifted = pushed([0.0, 0.0, 20.0, 0.0, LONG * 20.0, 0.0], truth)  # no moment at the joint
    assert lifted[2] == pytest.approx(20.0 * p["axial"], rel=1e-3)
    aside = np.array([[20.0, 0, 0, 0, 0, 0], [0, 20.0, 0, 0, 0, -20.0 * LONG]])
    shifted = np.stack([pushed(load, truth)[:2] for load in aside]) / 20.0
    softness = np.linalg.eigvalsh(shifted)
    np.testing.assert_allclose(softness, [p["other"] * p["radial"], p["radial"]], rtol=1e-3)


def test_a_row_that_is_unloaded_leaves_the_other_one() -> None:
    truth = changed(drawn(arm(), "bearing-tilt", "q1", "unloading"), turned=0.0)
    p = truth.parameters
    gives: list[float] = []
    for axis in (3, 4):
        moment = p["strain"] / p["tilt"]
        near, far = (give(truth, axis, load * moment, 1e-2 * moment) for load in (0.0, 40.0))
        gives.append(near / p["tilt"])
        assert far / near == pytest.approx(1.0 / p["loose"], rel=2e-2)
    np.testing.assert_allclose(sorted(gives), [p["other"], 1.0], rtol=2e-3)


# --- links


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_channel_bends_and_twists_about_its_own_line(wrench: Array) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "channel"), flat=1.0, side=0.0)
    p = truth.parameters
    EI = p["EI"]
    shape = EI, p["twist"] * EI, EI / 0.12**2
    away = beside_of(p["beside"])
    expected = np.concatenate(mohr(away, TIP + away, TIP, wrench, *shape, EVEN))
    agree(pushed(wrench, truth), drive(wrench) + expected)


def beside_of(beside: float) -> Array:
    """Return a way across the arm, which lies along x, that far for each metre of it."""
    across = np.cross([1.0, 0.0, 0.0], np.eye(3)[1])
    return np.asarray(beside * LONG * across)


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_two_legs_of_a_fork_share_the_load_by_their_stiffness(wrench: Array) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "fork"), flat=1.0, side=0.0)
    p = truth.parameters
    K = np.zeros((6, 6))
    for way, share in ((1.0, 1.0), (-1.0, p["uneven"])):
        EI = p["EI"] * share / (1.0 + p["uneven"])
        away = beside_of(way * p["beside"])
        columns = [
            np.concatenate(mohr(away, TIP + away, TIP, load, EI, p["twist"] * EI, EI / 0.12**2, EVEN))
            for load in np.eye(6)
        ]
        K += np.linalg.inv(np.stack(columns, axis=1))
    agree(pushed(wrench, truth), drive(wrench) + np.linalg.solve(K, wrench))


@pytest.mark.parametrize("form", ["channel", "fork"])
def test_a_links_section_turns_with_it(form: str) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", form), flat=0.4)
    angles = np.array([0.0, 0.5, 0.95])
    turns = Rotation.from_rotvec(angles[:, None] * Z)
    load = np.array([[5.0, 12.0, 20.0], [3.0, 4.0, -2.0]])
    loads = np.stack([turns.apply(part) for part in load], axis=1).reshape(3, 1, 6)
    found = read(arm(), campaign_of(arm(), angles[:, None], loads), truth)
    back = np.concatenate([turns.inv().apply(part) for part in np.split(found, 2, axis=1)], axis=1)
    agree(back, np.broadcast_to(back[:1], back.shape), 1e-6)


@pytest.mark.parametrize("form", ["channel", "fork"])
def test_a_beam_of_the_model_stretches_as_much_more_as_it_is_softer(form: str) -> None:
    robot = arm().model_copy(
        update={
            "rigids": (),
            "materials": {"steel": Material(E=2.1e11, G=8e10, density=0.0)},
            "sections": {"bar": Section(A=1e-3, Iy=1e-6, Iz=1e-6, J=2e-6)},
            "beams": (Beam(name="bar", nodes=["b", "tip"], section="bar", material="steel"),),
        }
    )
    truth = changed(drawn(robot, "link-bending", "bar", form), beside=1e-6)
    stretched = pushed(1e3 * np.eye(6)[0], truth, robot=robot)[0]
    assert stretched == pytest.approx(truth.parameters["softer"] * 1e3 * LONG / 2.1e8, rel=1e-3)
    twisted = pushed(5.0 * np.eye(6)[3], truth, robot=robot)[3]
    assert twisted == pytest.approx(truth.parameters["softer"] * 5.0 * LONG / (8e10 * 2e-6), rel=1e-3)


# --- tool


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_remote_centre_turns_the_tool_about_a_place_ahead(wrench: Array) -> None:
    truth = drawn(arm(), "tool-compliance", None, "remote-centre")
    p = truth.parameters
    about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    across = about[:2] * p["reach"] ** 2
    soft = np.concatenate([across, [across[0] / 20.0], about])
    expected = seen_at(-p["ahead"] * Z, np.diag(soft), wrench)
    agree(pushed(wrench, truth), drive(wrench) + expected, 1e-3)


def test_a_force_at_a_remote_centre_does_not_tilt_the_tool() -> None:
    truth = changed(drawn(arm(), "tool-compliance", None, "remote-centre"), ahead=0.0)
    found = pushed(20.0 * np.eye(6)[0], truth)
    np.testing.assert_allclose(found[3:], 0.0, atol=1e-9)
    assert found[0] > 1e-7


@pytest.mark.parametrize("axis", [2, 3, 4])
def test_three_balls_give_way_as_the_lever_rule_says(axis: int) -> None:
    truth = changed(drawn(arm(), "tool-compliance", None, "balls"), clamped=1e9)
    p = truth.parameters
    angles = p["first"] + 2.0 * np.pi / 3.0 * np.arange(3)
    x, y = p["radius"] * np.cos(angles), p["radius"] * np.sin(angles)
    shares = np.array([p[f"ball{i}"] for i in range(3)])
    k = shares / (p["tilt"] * np.sum(shares * y**2))
    wrench = np.eye(6)[axis] * np.array([20.0] * 3 + [5.0] * 3)
    plane = np.stack([np.ones(3), y, -x])
    up, about_x, about_y = np.linalg.solve(plane.T, np.linalg.solve(plane, wrench[2:5]) / k)
    turned = np.array([about_x, about_y, 0.0])
    expected = np.concatenate([up * Z + np.cross(turned, p["behind"] * Z), turned])
    agree(pushed(wrench, truth), drive(wrench) + expected, 1e-3)


def test_balls_give_less_when_they_are_pressed_and_more_when_they_are_lifted() -> None:
    truth = changed(drawn(arm(), "tool-compliance", None, "balls"), ball0=1.0, ball1=1.0, ball2=1.0)
    clamped = truth.parameters["clamped"]
    pressed, light, lifted = (
        float(np.diff([pushed(load * np.eye(6)[2], truth)[2] for load in (at - 1.0, at + 1.0)])[0] / 2.0)
        for at in (-3.0 * 6.75 * clamped, 0.0, 3.0 * 0.99 * clamped)
    )
    # root 2 of 1 + approach / (1.5 P / k): 0.45 P from the clamp, 0.9 (2^3 - 1) P from the contact
    assert light / pressed == pytest.approx(0.1 + 0.9 * 2.0, rel=1e-2)
    assert lifted > 1.5 * light
