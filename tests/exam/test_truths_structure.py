"""Structural effects of the simulated machines against closed forms of first order, on an arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.exam.campaign import Array, Truth
from beamstiff.robot.parts import Beam, Material
from beamstiff.robot.sections import Section
from tests.exam.campaigns import LONG, STIFF, arm, campaign_of, changed, drawn, pushed, read

FIRST_ORDER = 2e-4  # what rotations of 1e-4 rad add to the linear answer
TIP = np.array([LONG, 0.0, 0.0])
LOADS = np.concatenate([20.0 * np.eye(3, 6), 5.0 * np.eye(6)[3:]])

Size = Callable[[Array], Array]


def mohr(
    a: Array, b: Array, tip: Array, wrench: Array, EI: float, GJ: float, EA: float, size: Size
) -> tuple[Array, Array]:
    """Return displacement and rotation of the tip from a beam a to b, stiff beyond: Mohr's integrals."""
    x, w = np.polynomial.legendre.leggauss(60)
    x, length = 0.5 * (x + 1.0), float(np.linalg.norm(b - a))
    t, moved, turned = (b - a) / length, np.zeros(3), np.zeros(3)
    for station, weight, scale in zip(x, 0.5 * w * length, size(x), strict=True):
        lever = tip - (a + station * (b - a))
        M, F = wrench[3:] + np.cross(lever, wrench[:3]), wrench[:3]
        bent = (M - (t @ M) * t) / (EI * scale**4) + (t @ M) * t / (GJ * scale**4)
        turned = turned + weight * bent
        moved = moved + weight * (np.cross(bent, lever) + (t @ F) * t / (EA * scale**2))
    return moved, turned


def drive(wrench: Array) -> Array:
    """Return what the arm's drive alone does."""
    torque = wrench[5] + LONG * wrench[1]
    turned = np.array([0.0, 0.0, torque / STIFF])
    return np.concatenate([np.cross(turned, TIP), turned])


def agree(found: Array, expected: Array, tolerance: float = FIRST_ORDER) -> None:
    """Ask for agreement within a share of the largest translation, and of the largest rotation."""
    for part in (slice(0, 3), slice(3, 6)):
        scale = np.abs(expected[..., part]).max() + 1e-15
        np.testing.assert_allclose(found[..., part], expected[..., part], atol=tolerance * scale)


@pytest.mark.parametrize("form", ["tapered", "elbow", "hinged"])
def test_a_links_section_turns_with_it(form: str) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", form), flat=0.4)
    angles = np.array([0.0, 0.5, 0.95])
    turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0])
    load = np.array([[5.0, 12.0, 20.0], [3.0, 4.0, -2.0]])
    loads = np.stack([turns.apply(part) for part in load], axis=1).reshape(3, 1, 6)
    found = read(arm(), campaign_of(arm(), angles[:, None], loads), truth)
    back = np.concatenate([turns.inv().apply(part) for part in np.split(found, 2, axis=1)], axis=1)
    agree(back, np.broadcast_to(back[:1], back.shape), 1e-6)


@pytest.mark.parametrize("form", ["tapered", "elbow", "hinged"])
@pytest.mark.parametrize("wrench", LOADS, ids=["fx", "fy", "fz", "mx", "my", "mz"])
def test_a_link_bends_as_mohrs_integrals_say(form: str, wrench: Array) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", form), flat=1.0)
    p = truth.parameters
    EI, EA = p["EI"], p["EI"] / 0.12**2
    shape = EI, p["twist"] * EI, EA
    root = np.zeros(3)
    if form == "tapered":
        parts = [mohr(root, TIP, TIP, wrench, *shape, lambda x: 1.0 - p["taper"] * x)]
    elif form == "elbow":
        # the corner lies beside the middle: across is x cross y, then x cross that
        z, y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
        corner = 0.5 * TIP + p["offset"] * LONG * (np.cos(p["side"]) * z - np.sin(p["side"]) * y)
        parts = [
            mohr(root, corner, TIP, wrench, *shape, lambda x: 1.1 - 0.2 * x),
            mohr(corner, TIP, TIP, wrench, *shape, lambda x: 0.9 - 0.2 * x),
        ]
    else:  # two hinges that hold the compliance of 0.6 and 0.4 of the length
        parts = []
        for place, share in ((p["first"], 0.6), (p["second"], 0.4)):
            lever = (1.0 - place) * TIP
            M = wrench[3:] + np.cross(lever, wrench[:3])
            turned = share * LONG * M / np.array([p["twist"] * EI, EI, EI])
            along = np.array([share * LONG * wrench[0] / EA, 0.0, 0.0])
            parts.append((np.cross(turned, lever) + along, turned))
    expected = drive(wrench) + np.concatenate([sum(m for m, _ in parts), sum(t for _, t in parts)])
    agree(pushed(arm(), wrench, truth), expected)


def test_a_flat_link_bends_more_about_one_axis() -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "tapered"), flat=0.5, taper=0.0)
    EI = truth.parameters["EI"]
    down, aside = (pushed(arm(), 20.0 * np.eye(6)[axis], truth) for axis in (2, 1))
    assert down[2] == pytest.approx(20.0 * LONG**3 / (3.0 * 0.5 * EI), rel=FIRST_ORDER)
    bent = aside[1] - 20.0 * LONG**2 / STIFF
    assert bent == pytest.approx(20.0 * LONG**3 / (3.0 * EI), rel=FIRST_ORDER)


def crossed(truth: Truth) -> tuple[Array, Array]:
    """Return the two directions across the vertical that the bearing's axes are turned to."""
    c, s = np.cos(truth.parameters["turned"]), np.sin(truth.parameters["turned"])
    y, z = np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    return c * y + s * z, c * z - s * y


@pytest.mark.parametrize("form", ["anisotropic", "off-centre"])
@pytest.mark.parametrize("wrench", LOADS, ids=["fx", "fy", "fz", "mx", "my", "mz"])
def test_a_bearing_gives_way_across_its_axis(form: str, wrench: Array) -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", form)
    p = truth.parameters
    first, second = crossed(truth)
    axial = np.array([0.0, 0.0, 1.0])
    tilting = p["tilt"] * np.outer(first, first) + p["tilt"] * p["other"] * np.outer(second, second)
    moving = p["radial"] * (np.outer(first, first) + np.outer(second, second))
    moving = moving + p["axial"] * np.outer(axial, axial)
    centre = p.get("offset", 0.0) * axial
    M = wrench[3:] + np.cross(TIP - centre, wrench[:3])
    turned = tilting @ M
    found = moving @ wrench[:3] + np.cross(turned, TIP - centre)
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate([found, turned]))


def test_a_loaded_bearing_grows_stiffer_as_its_law_says() -> None:
    truth = changed(drawn(arm(), "bearing-tilt", "q1", "contact"), turned=0.0)
    p = truth.parameters
    for moment in (10.0, 300.0, 3000.0):
        wrench = np.array([0, 0, 0, 0, moment, 0.0])  # about y, the first axis across
        turned = pushed(arm(), wrench, truth)[4]
        carried = 0.7 / p["tilt"] * turned * np.hypot(1.0, turned / p["strain"])
        assert carried == pytest.approx(moment, rel=FIRST_ORDER)


@pytest.mark.parametrize("wrench", LOADS, ids=["fx", "fy", "fz", "mx", "my", "mz"])
def test_a_block_base_turns_about_its_elastic_centre(wrench: Array) -> None:
    truth = drawn(arm(), "base-compliance", None, "block")
    p = truth.parameters
    lever = TIP - np.array([p["x"], p["y"], p["z"]])
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    along = p["tilt"] * p["shift"] ** 2 * np.array([1.0, 0.8, 0.5])
    turned = about * (wrench[3:] + np.cross(lever, wrench[:3]))
    expected = np.concatenate([along * wrench[:3] + np.cross(turned, lever), turned])
    agree(pushed(arm(), wrench, truth), drive(wrench) + expected)


@pytest.mark.parametrize("wrench", LOADS[[2, 3, 4]], ids=["fz", "mx", "my"])
def test_a_base_on_bolts_stands_where_its_energy_is_least(wrench: Array) -> None:
    truth = drawn(arm(), "base-compliance", None, "bolts")
    p = truth.parameters
    half = 0.5 * p["span"]
    feet = half * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    shares = np.array([p[f"bolt{i}"] for i in range(4)])
    k = shares / (p["tilt"] * np.sum(shares * feet[:, 1] ** 2))
    # energy of the feet's vertical springs in (z, rx, ry) less the work of the load
    rise = np.stack([np.ones(4), feet[:, 1], -feet[:, 0]], axis=-1)
    work = np.array([wrench[2], wrench[3], wrench[4] - LONG * wrench[2]])
    z, rx, ry = np.linalg.solve(rise.T @ (k[:, None] * rise), work)
    expected = np.array([0.0, 0.0, z - LONG * ry, rx, ry, 0.0])
    agree(pushed(arm(), wrench, truth), expected)


def test_the_tilt_of_a_base_on_bolts_is_that_of_its_parameter() -> None:
    truth = drawn(arm(), "base-compliance", None, "bolts")
    even = changed(truth, **{f"bolt{i}": 0.7 for i in range(4)})
    assert pushed(arm(), 10.0 * np.eye(6)[3], even)[3] == pytest.approx(
        10.0 * even.parameters["tilt"], rel=1e-3
    )


@pytest.mark.parametrize("wrench", LOADS, ids=["fx", "fy", "fz", "mx", "my", "mz"])
def test_a_tool_gives_way_in_two_places_or_bends_as_a_cantilever(wrench: Array) -> None:
    truth = drawn(arm(), "tool-compliance", None, "series")
    p = truth.parameters
    about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    moved, turned = np.zeros(3), np.zeros(3)
    for share, behind in ((p["share"], p["behind"]), (1.0 - p["share"], 0.4 * p["behind"])):
        lever = np.array([0.0, 0.0, behind])
        gives = share * about * (wrench[3:] + np.cross(lever, wrench[:3]))
        turned = turned + gives
        moved = moved + np.cross(gives, lever) + share * about * 0.05**2 * wrench[:3]
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate([moved, turned]), 1e-3)

    truth = drawn(arm(), "tool-compliance", None, "cantilever")
    p = truth.parameters
    length = 2.0 * p["behind"]
    EI, root = length / p["tilt"], TIP - np.array([0.0, 0.0, length])
    shape = EI, EI / p["about"], EI / 0.03**2
    found = mohr(root, TIP, TIP, wrench, *shape, lambda x: 1.15 - 0.3 * x)
    agree(pushed(arm(), wrench, truth), drive(wrench) + np.concatenate(found), 1e-3)


def test_a_loose_bolt_gives_way_to_moments_of_one_sign_only() -> None:
    truth = changed(drawn(arm(), "loose-bolt", None, "gaping"), angle=0.0, blunt=1.0)
    p, moment = truth.parameters, 500.0
    there, back = (pushed(arm(), [0, 0, 0, sign * moment, 0, 0], truth)[3] for sign in (1.0, -1.0))
    assert there == pytest.approx((p["firm"] + p["tilt"]) * moment, rel=5e-3)
    assert back == pytest.approx(-p["firm"] * moment, rel=2e-2, abs=p["tilt"])


def test_play_in_a_bearing_is_crossed_once_and_then_stays() -> None:
    truth = drawn(arm(), "bearing-play", "q1", "tilting")
    p = truth.parameters
    moments = np.array([0.1, 0.5, 1.0, 30.0, 100.0]) * p["crossing"]
    found = np.array([pushed(arm(), [0, 0, 0, moment, 0, 0], truth)[3] for moment in moments])
    x = moments / p["crossing"]
    np.testing.assert_allclose(found, p["tilt"] * moments + p["half"] * x / np.hypot(1.0, x), rtol=1e-3)


def test_a_stop_at_the_tool_pushes_one_way_only() -> None:
    truth = changed(drawn(arm(), "tool-contact", None, "one-sided"), x=0.0, y=1.0, z=0.0, way=1.0, gap=0.0)
    s = truth.parameters["stiffness"]
    free = pushed(arm(), [0, -4e3, 0, 0, 0, 0], truth)[1]
    held = pushed(arm(), [0, 4e3, 0, 0, 0, 0], truth)[1]
    assert free == pytest.approx(-4e3 * LONG**2 / STIFF, rel=2e-2)
    k = STIFF / LONG**2
    assert held == pytest.approx(4e3 / (k + s), rel=0.05, abs=3e-5)
    assert held < 0.9 * abs(free)


def test_a_beam_of_the_model_stretches_as_much_more_as_it_is_softer() -> None:
    rigid = arm()
    robot = rigid.model_copy(
        update={
            "rigids": (),
            "materials": {"steel": Material(E=2.1e11, G=8e10, density=0.0)},
            "sections": {"bar": Section(A=1e-3, Iy=1e-6, Iz=1e-6, J=2e-6)},
            "beams": (Beam(name="bar", nodes=["b", "tip"], section="bar", material="steel"),),
        }
    )
    truth = drawn(robot, "link-bending", "bar", "tapered")
    stretched = pushed(robot, [1e3, 0, 0, 0, 0, 0], truth)[0]
    assert stretched == pytest.approx(truth.parameters["softer"] * 1e3 * LONG / (2.1e11 * 1e-3), rel=1e-4)
