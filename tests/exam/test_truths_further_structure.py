"""Further structural effects of the simulated machines against closed forms of first order, on an arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.forms.author2.tool import strutted
from beamstiff.robot.parts import Beam, Material
from beamstiff.robot.sections import Section
from tests.exam.campaigns import LONG, arm, campaign_of, changed, drawn, pushed, read
from tests.exam.test_truths_structure import LOADS, TIP, agree, crossed, drive, mohr

NAMES = ["fx", "fy", "fz", "mx", "my", "mz"]
Z = np.array([0.0, 0.0, 1.0])


def give(truth: Truth, axis: int, moment: float, step: float) -> float:
    """Return the compliance about an axis of the base under a moment at the tip."""
    low, high = (pushed(arm(), (moment + way * step) * np.eye(6)[axis], truth)[axis] for way in (-1.0, 1.0))
    return float((high - low) / (2.0 * step))


@pytest.mark.parametrize("wrench", LOADS[[2, 3, 4]], ids=["fz", "mx", "my"])
def test_three_feet_sink_as_the_lever_rule_says(wrench: Array) -> None:
    truth = drawn(arm(), "base-compliance", None, "three-feet")
    p = truth.parameters
    angles = p["first"] + 2.0 * np.pi / 3.0 * np.arange(3)
    x, y = p["radius"] * np.cos(angles), p["radius"] * np.sin(angles)
    shares = np.array([p[f"foot{i}"] for i in range(3)])
    moment = wrench[3:] + np.cross(TIP, wrench[:3])
    carried = np.linalg.solve(np.stack([np.ones(3), y, -x]), [wrench[2], moment[0], moment[1]])
    risen = carried / shares * p["tilt"] * np.sum(shares * y**2)
    up, about_x, about_y = np.linalg.solve(np.stack([np.ones(3), y, -x], axis=1), risen)
    turned = np.array([about_x, about_y, 0.0])
    moved = up * Z + np.cross(turned, TIP)
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate([moved, turned]))


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_column_bends_as_mohrs_integrals_say(wrench: Array) -> None:
    truth = changed(drawn(arm(), "base-compliance", None, "column"), flat=1.0)
    p = truth.parameters
    H = p["height"]
    EI = H / p["tilt"]
    EA = EI / 0.15**2

    def thickness(x: Array) -> Array:
        return np.asarray((1.0 + p["taper"] * (0.5 - x)) ** 0.75)

    moved, turned = mohr(-H * Z, np.zeros(3), TIP, wrench, EI, p["twist"] * EI, EA, thickness)
    x, w = np.polynomial.legendre.leggauss(40)
    sheared = 0.5 * H / (0.15 * EA) * float(w @ thickness(0.5 * (x + 1.0)) ** -2.0)
    moved = moved + sheared * np.array([wrench[0], wrench[1], 0.0])
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate([moved, turned]))


def test_mounts_stiffen_when_they_are_squeezed() -> None:
    truth = changed(drawn(arm(), "base-compliance", None, "mounts"), moment=10.0)
    p = truth.parameters
    for axis, share in ((3, 1.0), (4, p["about_y"])):
        assert give(truth, axis, 0.0, 0.01) == pytest.approx(share * p["tilt"], rel=1e-2)
        assert give(truth, axis, 1e4, 10.0) == pytest.approx(share * p["tilt"] / (1.0 + p["more"]), rel=1e-2)


def test_balls_on_a_ring_carry_the_power_three_halves_of_the_tilt() -> None:
    truth = changed(drawn(arm(), "bearing-tilt", "q1", "hertz"), turned=0.0, moment=1e-3)
    small, large = (pushed(arm(), moment * np.eye(6)[4], truth)[4] for moment in (10.0, 80.0))
    assert large / small == pytest.approx(4.0, rel=1e-3)
    light = changed(truth, moment=1e5)
    assert pushed(arm(), np.eye(6)[4], light)[4] == pytest.approx(truth.parameters["tilt"] / 0.8, rel=1e-3)


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_two_bearings_share_the_load_by_the_lever_rule(wrench: Array) -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", "pair")
    p = truth.parameters
    heights = p["shift"] + p["span"] * np.array([0.5, -0.5])
    k = 2.0 / (p["tilt"] * p["span"] ** 2) * np.array([1.0, p["uneven"]])
    moment = wrench[3:] + np.cross(TIP, wrench[:3])
    moved, turned = p["axial"] * wrench[2] * Z, np.zeros(3)
    for way, share in zip(crossed(truth), (1.0, p["other"]), strict=True):
        about = np.cross(Z, way)  # the rotation that moves the shaft this way above the joint
        carried = np.linalg.solve(np.stack([np.ones(2), heights]), [way @ wrench[:3], about @ moment])
        give_a, give_b = carried / (share * k)
        slope = (give_a - give_b) / p["span"]
        moved = moved + (give_a - slope * heights[0]) * way
        turned = turned + slope * about
    expected = np.concatenate([moved + np.cross(turned, TIP), turned])
    agree(pushed(arm(), wrench, truth), drive(wrench) + expected)


@pytest.mark.parametrize("form", ["hollow", "bolted"])
def test_a_links_section_turns_with_it(form: str) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", form), flat=0.4)
    angles = np.array([0.0, 0.5, 0.95])
    turns = Rotation.from_rotvec(angles[:, None] * Z)
    load = np.array([[5.0, 12.0, 20.0], [3.0, 4.0, -2.0]])
    loads = np.stack([turns.apply(part) for part in load], axis=1).reshape(3, 1, 6)
    found = read(arm(), campaign_of(arm(), angles[:, None], loads), truth)
    back = np.concatenate([turns.inv().apply(part) for part in np.split(found, 2, axis=1)], axis=1)
    agree(back, np.broadcast_to(back[:1], back.shape), 1e-6)


@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_hollow_link_bends_and_shears(wrench: Array) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "hollow"), flat=1.0)
    p = truth.parameters
    EI, EA = p["EI"], p["EI"] / 0.12**2

    def thickness(x: Array) -> Array:
        return np.asarray((1.0 - p["narrower"] * x) ** 0.75)

    moved, turned = mohr(np.zeros(3), TIP, TIP, wrench, EI, p["twist"] * EI, EA, thickness)
    x, w = np.polynomial.legendre.leggauss(40)
    sheared = 0.5 * LONG / (p["shear"] * EA) * float(w @ thickness(0.5 * (x + 1.0)) ** -2.0)
    moved = moved + sheared * np.array([0.0, wrench[1], wrench[2]])
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate([moved, turned]))


def test_a_skewed_link_bends_aside_unless_it_is_pushed_along_its_own_axes() -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "hollow"), flat=0.5)
    loads = 20.0 * np.eye(6)[1:3]
    for skew in (0.0, 0.6, 0.5 * np.pi):
        found = np.array([pushed(arm(), load, changed(truth, skew=skew)) for load in loads])
        found = found - np.array([drive(load) for load in loads])
        aside = found[0, 2] / found[0, 1]
        assert found[0, 2] == pytest.approx(found[1, 1], rel=1e-3, abs=1e-4 * found[0, 1])
        assert bool(abs(aside) > 0.05) is (skew == 0.6)


@pytest.mark.parametrize("end", [0.0, 1.0])
@pytest.mark.parametrize("wrench", LOADS, ids=NAMES)
def test_a_bolted_link_turns_at_its_bolts_and_bends_between(wrench: Array, end: float) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "bolted"), flat=1.0, opens=1.0, end=end)
    p = truth.parameters
    EI, EA, twist = p["EI"], p["EI"] / 0.12**2, p["twist"]
    bent = mohr(np.zeros(3), TIP, TIP, wrench, EI, twist * EI, EA, lambda x: np.full_like(x, 1.0))
    lever = (1.0 - end) * TIP
    M = wrench[3:] + np.cross(lever, wrench[:3])
    opened = p["joint"] * LONG * M / np.array([2.0 * twist * EI, EI, EI])
    whole = np.concatenate(bent) * (1.0 - p["joint"])
    expected = drive(wrench) + whole + np.concatenate([np.cross(opened, lever), opened])
    agree(pushed(arm(), wrench, truth), expected)


@pytest.mark.parametrize("form", ["hollow", "bolted"])
def test_a_beam_of_the_model_is_softer(form: str) -> None:
    robot = arm().model_copy(
        update={
            "rigids": (),
            "materials": {"steel": Material(E=2.1e11, G=8e10, density=0.0)},
            "sections": {"bar": Section(A=1e-3, Iy=1e-6, Iz=1e-6, J=2e-6)},
            "beams": (Beam(name="bar", nodes=["b", "tip"], section="bar", material="steel"),),
        }
    )
    truth = drawn(robot, "link-bending", "bar", form)
    truth = changed(truth, end=1.0, opens=1.0) if form == "bolted" else truth
    softer, GJ = truth.parameters["softer"], 8e10 * 2e-6
    twisted = pushed(robot, 5.0 * np.eye(6)[3], truth)[3]
    share = 0.5 if form == "bolted" else 1.0
    assert twisted == pytest.approx(5.0 * LONG / GJ * (1.0 + share * (softer - 1.0)), rel=1e-4)
    stretched = pushed(robot, 1e3 * np.eye(6)[0], truth)[0]
    share = 0.0 if form == "bolted" else 0.5
    assert stretched == pytest.approx(1e3 * LONG / 2.1e8 * (1.0 + share * (softer - 1.0)), rel=1e-4)


def test_six_equal_struts_are_alike_every_third_of_a_turn() -> None:
    truth = drawn(arm(), "tool-compliance", None, "struts")
    p = {**truth.parameters, **{f"strut{i}": 0.8 for i in range(6)}}
    K = strutted(p)
    third = np.kron(np.eye(2), Rotation.from_rotvec(2.0 * np.pi / 3.0 * Z).as_matrix())
    np.testing.assert_allclose(third @ K @ third.T, K, atol=1e-9 * np.abs(K).max())
    assert (np.linalg.eigvalsh(strutted(truth.parameters)) > 0.0).all()


@pytest.mark.parametrize("axis", [3, 4, 5])
def test_a_load_cell_on_struts_gives_way_about_its_place(axis: int) -> None:
    truth = drawn(arm(), "tool-compliance", None, "struts")
    C = np.linalg.inv(strutted(truth.parameters))
    moment = 5.0 * np.eye(6)[axis]
    lever = np.array([0.0, 0.0, truth.parameters["behind"]])
    moved, turned = np.split(C @ moment, 2)
    expected = np.concatenate([moved + np.cross(turned, lever), turned])
    agree(pushed(arm(), moment, truth), drive(moment) + expected, 1e-3)
    assert C[3, 3] == pytest.approx(truth.parameters["tilt"])


def test_a_flange_gives_more_once_it_opens() -> None:
    truth = drawn(arm(), "tool-compliance", None, "opening")
    p = truth.parameters
    for axis, share, opens in ((3, 1.0, p["opens"]), (4, p["other"], p["later"] * p["opens"])):
        closed, open_ = (give(truth, axis, load * opens, 1e-2 * opens) for load in (0.0, 8.0))
        assert closed == pytest.approx(share * p["tilt"], rel=1e-3)
        assert open_ == pytest.approx(share * p["tilt"] / p["loose"], rel=1e-2)
