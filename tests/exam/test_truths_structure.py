"""Structural effects of all authors against closed forms of first order, on an arm."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Beam, Material, Section
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.forms.author2.structure import strutted
from beamstiff.exam.forms.author3.structure import carriage, girder
from tests.exam.campaigns import LONG, STIFF, arm, campaign_of, changed, drawn, pushed, read
from tests.exam.closed_forms import CLOSED_FORMS, FIRST_ORDER, TIP, ClosedForm, Parameters, Z

NAMES = ["fx", "fy", "fz", "mx", "my", "mz"]
LOADS = np.concatenate([20.0 * np.eye(3, 6), 5.0 * np.eye(6)[3:]])


def give(truth: Truth, axis: int, load: float, step: float) -> float:
    """Return the compliance along or about an axis of the base under a load at the tip."""
    low, high = (pushed(arm(), (load + way * step) * np.eye(6)[axis], truth)[axis] for way in (-1.0, 1.0))
    return float((high - low) / (2.0 * step))


def drive(wrench: Array) -> Array:
    """Return what the arm's drive alone does."""
    turned = (wrench[5] + LONG * wrench[1]) / STIFF * Z
    return np.concatenate([np.cross(turned, TIP), turned])


def agree(found: Array, expected: Array, tolerance: float = FIRST_ORDER) -> None:
    """Ask for agreement within a share of the largest translation, and of the largest rotation."""
    for part in (slice(0, 3), slice(3, 6)):
        scale = np.abs(expected[..., part]).max() + 1e-15
        np.testing.assert_allclose(found[..., part], expected[..., part], atol=tolerance * scale)


AT = {"bearing-tilt": "q1", "link-bending": "arm"}  # the component of the arm; the others have none


@pytest.mark.parametrize(
    ("case", "axis"),
    [
        pytest.param(case, axis, id=f"{case.form}{case.changes.get('end', '')}-{NAMES[axis]}")
        for case in CLOSED_FORMS
        for axis in case.axes
    ],
)
def test_the_tip_moves_as_the_closed_form_says(case: ClosedForm, axis: int) -> None:
    truth = changed(drawn(arm(), case.effect, AT.get(case.effect), case.form), **case.changes)
    wrench = LOADS[axis]
    agree(pushed(arm(), wrench, truth), drive(wrench) + case.motion(truth.parameters, wrench), case.tolerance)


# --- compliance that changes with the load: rows of axis, load, step, compliance there, tolerance

Rates = list[tuple[int, float, float, float, float]]


def mounts(p: Parameters) -> Rates:
    stiff = 1.0 / (1.0 + p["more"])
    rows: Rates = []
    for axis, c in ((3, p["tilt"]), (4, p["about_y"] * p["tilt"])):
        rows += [(axis, 0.0, 0.01, c, 1e-2), (axis, 1e4, 10.0, stiff * c, 1e-2)]
    return rows


def opening(p: Parameters) -> Rates:
    """Return that a flange gives more once it opens."""
    rows: Rates = []
    for axis, c, at in ((3, p["tilt"], p["opens"]), (4, p["other"] * p["tilt"], p["later"] * p["opens"])):
        rows += [(axis, 0.0, 1e-2 * at, c, 1e-3), (axis, 8.0 * at, 1e-2 * at, c / p["loose"], 1e-2)]
    return rows


def unloading(p: Parameters) -> Rates:
    """Return that one row of a bearing is left once the other is unloaded."""
    at = p["from"] / p["tilt"]
    rows: Rates = []
    for axis, c in ((4, p["tilt"]), (3, p["other"] * p["tilt"])):  # not turned: y is the first way across
        rows += [(axis, 0.0, 1e-2 * at, c, 2e-3), (axis, 40.0 * at, 1e-2 * at, c / p["loose"], 2e-2)]
    return rows


@pytest.mark.parametrize(
    ("effect", "form", "changes", "rates"),
    [
        ("base-compliance", "mounts", {"moment": 10.0}, mounts),
        ("tool-compliance", "opening", {}, opening),
        ("bearing-tilt", "unloading", {"turned": 0.0}, unloading),
    ],
    ids=["mounts", "opening", "unloading"],
)
def test_stiffness_goes_from_one_end_to_the_other(
    effect: str, form: str, changes: dict[str, float], rates: Callable[[Parameters], Rates]
) -> None:
    truth = changed(drawn(arm(), effect, AT.get(effect), form), **changes)
    for axis, load, step, expected, tolerance in rates(truth.parameters):
        assert give(truth, axis, load, step) == pytest.approx(expected, rel=tolerance)


def test_a_loaded_bearing_grows_stiffer_as_its_law_says() -> None:
    truth = changed(drawn(arm(), "bearing-tilt", "q1", "contact"), turned=0.0)
    p = truth.parameters
    for moment in (10.0, 300.0, 3000.0):
        turned = pushed(arm(), moment * np.eye(6)[4], truth)[4]  # about y, the first axis across
        carried = 0.7 / p["tilt"] * turned * np.hypot(1.0, turned / p["strain"])
        assert carried == pytest.approx(moment, rel=FIRST_ORDER)


def test_balls_on_a_ring_carry_the_power_three_halves_of_the_tilt() -> None:
    truth = changed(drawn(arm(), "bearing-tilt", "q1", "hertz"), turned=0.0, moment=1e-3)
    small, large = (pushed(arm(), moment * np.eye(6)[4], truth)[4] for moment in (10.0, 80.0))
    assert large / small == pytest.approx(4.0, rel=1e-3)
    light = changed(truth, moment=1e5)
    assert pushed(arm(), np.eye(6)[4], light)[4] == pytest.approx(truth.parameters["tilt"] / 0.8, rel=1e-3)


def test_balls_give_less_when_they_are_pressed_and_more_when_they_are_lifted() -> None:
    truth = changed(drawn(arm(), "tool-compliance", None, "balls"), ball0=1.0, ball1=1.0, ball2=1.0)
    clamped = truth.parameters["clamped"]
    pressed, light, lifted = (
        give(truth, 2, at, 1.0) for at in (-3.0 * 6.75 * clamped, 0.0, 3.0 * 0.99 * clamped)
    )
    # root 2 of 1 + approach / (1.5 P / k): 0.45 P from the clamp, 0.9 (2^3 - 1) P from the contact
    assert light / pressed == pytest.approx(0.1 + 0.9 * 2.0, rel=1e-2)
    assert lifted > 1.5 * light


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
    free, held = (pushed(arm(), [0, way * 4e3, 0, 0, 0, 0], truth)[1] for way in (-1.0, 1.0))
    k = STIFF / LONG**2
    assert free == pytest.approx(-4e3 / k, rel=2e-2)
    assert held == pytest.approx(4e3 / (k + truth.parameters["stiffness"]), rel=0.05, abs=3e-5)
    assert held < 0.9 * abs(free)


def test_a_tether_holds_the_tool_along_its_line_only() -> None:
    truth = changed(drawn(arm(), "tether", None, "straight"), x=0.0, y=1.0, z=0.0)
    k = STIFF / LONG**2
    held = pushed(arm(), [0, 50.0, 0, 0, 0, 0], truth)[1]
    assert held == pytest.approx(50.0 / (k + truth.parameters["stiffness"]), rel=1e-4)
    free = pushed(arm(), [0, 50.0, 0, 0, 0, 0], changed(truth, x=1.0, y=0.0))[1]
    assert free == pytest.approx(50.0 / k, rel=1e-3)


def test_a_flange_slips_sideways_and_stays() -> None:
    truth = changed(drawn(arm(), "slipping-flange", None, "clearance"), arrived=0.0)
    bolts, grip = 1.0 / truth.parameters["give"], truth.parameters["grip"]
    loads = np.outer([1e-3 * grip, 40.0 * grip, 20.0 * grip, 0.0], np.eye(6)[0])
    found = pushed(arm(), loads, truth)[:, 0]
    np.testing.assert_allclose(found[1:], np.array([39.0, 21.0, 1.0]) * grip / bolts, rtol=1e-3)
    assert found[0] == pytest.approx(loads[0, 0] / (bolts * 5.0), rel=1e-2)
    up = 50.0 * np.eye(6)[2]
    np.testing.assert_allclose(pushed(arm(), up, truth), pushed(arm(), up), atol=1e-9)
    aside = pushed(arm(), [0.0, 50.0 * grip, 0, 0, 0, 0], truth)[1]
    assert aside == pytest.approx(49.0 * grip / bolts + 50.0 * grip * LONG**2 / STIFF, rel=2e-2)


# --- sections, symmetry, textbook cases


@pytest.mark.parametrize("form", ["tapered", "elbow", "hinged", "hollow", "bolted", "channel", "fork"])
def test_a_links_section_turns_with_it(form: str) -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", form), flat=0.4)
    angles = np.array([0.0, 0.5, 0.95])
    turns = Rotation.from_rotvec(angles[:, None] * Z)
    load = np.array([[5.0, 12.0, 20.0], [3.0, 4.0, -2.0]])
    loads = np.stack([turns.apply(part) for part in load], axis=1).reshape(3, 1, 6)
    found = read(arm(), campaign_of(arm(), angles[:, None], loads), truth)
    back = np.concatenate([turns.inv().apply(part) for part in np.split(found, 2, axis=1)], axis=1)
    agree(back, np.broadcast_to(back[:1], back.shape), 1e-6)


@pytest.mark.parametrize(
    ("form", "changes", "stretch", "twist"),  # shares of what the beam is softer by
    [
        ("tapered", {}, 1.0, None),
        ("hollow", {}, 0.5, 1.0),
        ("bolted", {"end": 1.0, "opens": 1.0}, 0.0, 0.5),
        ("channel", {"beside": 1e-6}, 1.0, 1.0),
        ("fork", {"beside": 1e-6}, 1.0, 1.0),
    ],
)
def test_a_beam_is_softer(form: str, changes: dict[str, float], stretch: float, twist: float | None) -> None:
    steel = Material(E=2.1e11, G=8e10, density=0.0)
    bar = Beam(name="bar", nodes=["b", "tip"], section="bar", material="steel")
    parts = {"sections": {"bar": Section(A=1e-3, Iy=1e-6, Iz=1e-6, J=2e-6)}, "beams": (bar,)}
    robot = arm().model_copy(update={"rigids": (), "materials": {"steel": steel}, **parts})
    truth = changed(drawn(robot, "link-bending", "bar", form), **changes)
    more = truth.parameters["softer"] - 1.0
    tolerance = 1e-3 if "beside" in changes else 1e-4
    stretched = pushed(robot, 1e3 * np.eye(6)[0], truth)[0]
    assert stretched == pytest.approx(1e3 * LONG / 2.1e8 * (1.0 + stretch * more), rel=tolerance)
    if twist is not None:
        twisted = pushed(robot, 5.0 * np.eye(6)[3], truth)[3]
        assert twisted == pytest.approx(5.0 * LONG / (8e10 * 2e-6) * (1.0 + twist * more), rel=tolerance)


def test_a_flat_link_bends_more_about_one_axis() -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "tapered"), flat=0.5, taper=0.0)
    EI = truth.parameters["EI"]
    down, aside = (pushed(arm(), 20.0 * np.eye(6)[axis], truth) for axis in (2, 1))
    assert down[2] == pytest.approx(20.0 * LONG**3 / (3.0 * 0.5 * EI), rel=FIRST_ORDER)
    across = aside[1] - 20.0 * LONG**2 / STIFF
    assert across == pytest.approx(20.0 * LONG**3 / (3.0 * EI), rel=FIRST_ORDER)


def test_a_skewed_link_bends_aside_unless_it_is_pushed_along_its_own_axes() -> None:
    truth = changed(drawn(arm(), "link-bending", "arm", "hollow"), flat=0.5)
    loads = 20.0 * np.eye(6)[1:3]
    for skew in (0.0, 0.6, 0.5 * np.pi):
        found = np.array([pushed(arm(), load, changed(truth, skew=skew)) - drive(load) for load in loads])
        assert found[0, 2] == pytest.approx(found[1, 1], rel=1e-3, abs=1e-4 * found[0, 1])
        assert bool(abs(found[0, 2] / found[0, 1]) > 0.05) is (skew == 0.6)


def test_the_tilt_of_a_base_or_a_tool_is_that_of_its_parameter() -> None:
    truth = drawn(arm(), "base-compliance", None, "bolts")
    even = changed(truth, **{f"bolt{i}": 0.7 for i in range(4)})
    assert give(even, 3, 0.0, 10.0) == pytest.approx(even.parameters["tilt"], rel=1e-3)
    made = (("base-compliance", "carriage", carriage), ("base-compliance", "girder", girder))
    for effect, form, stiffness in (*made, ("tool-compliance", "struts", strutted)):
        p = dict(drawn(arm(), effect, None, form).parameters)
        K = stiffness(p)
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
    aside = np.linalg.inv(girder(p | {"beside": 0.2}))
    assert abs(aside[2, 3]) == pytest.approx(0.2 * aside[3, 3], rel=1e-6)


@pytest.mark.parametrize("q", [-0.8, 0.0, 0.6])
def test_a_housing_stays_soft_the_same_way_while_the_joint_turns(q: float) -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", "housing")
    p = truth.parameters
    axes, still = (
        np.stack([pushed(arm(), 5.0 * np.eye(6)[axis], truth, q=at)[3:5] for axis in (3, 4)]) / 5.0
        for at in (q, 0.0)
    )
    np.testing.assert_allclose(np.linalg.eigvalsh(axes), [p["other"] * p["tilt"], p["tilt"]], rtol=1e-3)
    np.testing.assert_allclose(axes, still, atol=1e-3 * p["tilt"])


def test_a_housing_lets_the_joint_sink_and_shift() -> None:
    truth = drawn(arm(), "bearing-tilt", "q1", "housing")
    p = truth.parameters
    lifted = pushed(arm(), [0.0, 0.0, 20.0, 0.0, LONG * 20.0, 0.0], truth)  # no moment at the joint
    assert lifted[2] == pytest.approx(20.0 * p["axial"], rel=1e-3)
    aside = np.array([[20.0, 0, 0, 0, 0, 0], [0, 20.0, 0, 0, 0, -20.0 * LONG]])
    shifted = np.stack([pushed(arm(), load, truth)[:2] for load in aside]) / 20.0
    softness = np.linalg.eigvalsh(shifted)
    np.testing.assert_allclose(softness, [p["other"] * p["radial"], p["radial"]], rtol=1e-3)


def test_six_equal_struts_are_alike_every_third_of_a_turn() -> None:
    truth = drawn(arm(), "tool-compliance", None, "struts")
    K = strutted({**truth.parameters, **{f"strut{i}": 0.8 for i in range(6)}})
    third = np.kron(np.eye(2), Rotation.from_rotvec(2.0 * np.pi / 3.0 * Z).as_matrix())
    np.testing.assert_allclose(third @ K @ third.T, K, atol=1e-9 * np.abs(K).max())


def test_a_force_at_a_remote_centre_does_not_tilt_the_tool() -> None:
    truth = changed(drawn(arm(), "tool-compliance", None, "remote-centre"), ahead=0.0)
    found = pushed(arm(), 20.0 * np.eye(6)[0], truth)
    np.testing.assert_allclose(found[3:], 0.0, atol=1e-9)
    assert found[0] > 1e-7
