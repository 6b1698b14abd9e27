"""The drives' springs and friction, of all authors, against their laws: an arm that turns about its axis."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest

from beamstiff.exam.campaign import Array, Truth
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from tests.exam.campaigns import STIFF, arm, changed, drawn, turned_about_its_axis

EXACT = 1e-7  # the arm turns about its axis only: rotations add

Parameters = Mapping[str, float]


def wound(truth: Truth, torque: Any, q: float = 0.0, **other: Any) -> Array:
    return turned_about_its_axis(arm_of(truth), torque, truth, q=q, **other)


def arm_of(truth: Truth) -> Robot:
    return arm(RIGID) if truth.effect == "joint-compliance" else arm()


def give(truth: Truth, torque: float, step: float) -> float:
    """Return the compliance about a torque."""
    low, high = wound(truth, [torque - step, torque + step])
    return float((high - low) / (2.0 * step))


def truth_of(effect: str, form: str, changes: Mapping[str, float]) -> Truth:
    robot = arm(RIGID) if effect == "joint-compliance" else arm()
    return changed(drawn(robot, effect, "q1", form), **changes)


# --- angles at torques


class Wound(NamedTuple):
    """Torques, N m, and the angles that they make, rad; allowed are a share of each, or an angle."""

    torque: Any
    angle: Any
    share: float = EXACT
    within: float = 0.0
    q: float = 0.0
    other: Mapping[str, Any] = {}


def beyond_the_flanks(p: Parameters) -> Iterator[Wound]:
    torque = np.array([-40.0, 40.0]) * STIFF * p["half"]
    yield Wound(torque, torque / STIFF + np.sign(torque) * p["half"], within=1e-3 * p["half"])


def sharp(p: Parameters) -> Iterator[Wound]:
    """What is left of the drive in the play stays: k e - (1 - left) k h = T."""
    h, left = p["half"], p["left"]
    torque = np.array([-40.0, 40.0]) * STIFF * h
    yield Wound(torque, torque / STIFF + np.sign(torque) * (1.0 - left) * h, within=1e-3 * h)
    yield Wound(0.3 * left * STIFF * h, 0.3 * h, 0.05)


def smooth(p: Parameters) -> Iterator[Wound]:
    yield from beyond_the_flanks(p)
    torque = STIFF * p["half"] * np.array([0.01, 0.05, 0.3, 2.0])
    crossing = 2.0 * p["left"] * STIFF * p["half"]
    yield Wound(torque, torque / STIFF + p["half"] * torque / np.hypot(torque, crossing))


def arctan(p: Parameters) -> Iterator[Wound]:
    crossing = 2.0 * p["left"] * STIFF * p["half"]
    for load, crossed in ((1.0, 0.5), (2e3, 1.0)):
        lost = crossed * p["half"]
        yield Wound(load * crossing, load * crossing / STIFF + lost, within=2e-3 * lost)


def planets(p: Parameters) -> Iterator[Wound]:
    lost = (1.0 - p["left"]) * p["half"] * (1.0 - p["spread"] * 1.4 / 3.0)
    torque = np.array([-50.0, 50.0]) * STIFF * p["half"]
    yield Wound(torque, torque / STIFF + np.sign(torque) * lost, 1e-4)


def runout(p: Parameters) -> Iterator[Wound]:
    """Beyond the flank the whole stiffness holds, within only what is left of it."""
    torque = np.array([-60.0, 60.0]) * STIFF * p["half"]
    for q in (-0.8, 0.0, 0.7):
        lost = (1.0 - p["left"]) * p["half"] * (1.0 + p["depth"] * np.cos(q + p["phase"]))
        yield Wound(torque, torque / STIFF + np.sign(torque) * lost, 0.0, 2e-2 * lost + 1e-8, q)


def scissors(p: Parameters) -> Iterator[Wound]:
    """A split gear is crossed one way, past its preload."""
    far = 200.0 * STIFF * p["half"]
    for torque, lost in ((far, 2.0), (-far, 0.0), (p["preload"] * STIFF, 1.0)):
        angle = torque / STIFF + lost * p["half"]
        yield Wound(p["way"] * torque, p["way"] * angle, 0.0, 1e-2 * p["half"])


def plain(p: Parameters) -> Iterator[Wound]:
    torque = np.array([-500.0, 100.0, 2000.0])
    yield Wound(torque, torque / p["stiffness"])


def helped(p: Parameters) -> Iterator[Wound]:
    angle = p["from"] * np.array([1e-3, 1.0, 50.0])
    share = (angle / p["from"]) ** 2 / (1.0 + (angle / p["from"]) ** 2)
    yield Wound(p["stiffness"] * angle * (1.0 + p["more"] * share), angle)


def preloaded(p: Parameters) -> Iterator[Wound]:
    torque = 20.0 * p["stiffness"] * p["from"]
    lost = (1.0 - p["loose"]) * p["stiffness"] * p["from"]  # what the pair held when one of it went slack
    yield Wound(torque, (torque - lost) / (p["loose"] * p["stiffness"]), 1e-3)


def strands(p: Parameters) -> Iterator[Wound]:
    for q in (-0.9, 0.0, 0.4):  # of a stroke of 1 to either side
        lengths = 1.0 + p["reach"] * q * np.array([1.0, -1.0])
        yield Wound(30.0, 30.0 / (0.5 * p["stiffness"] * np.sum(1.0 / lengths)), 1e-6, q=q)


def piecewise(p: Parameters) -> Iterator[Wound]:
    soft, hard, T = STIFF * p["soft"], STIFF * p["hard"], STIFF * p["bend"]
    middle, one = soft + p["middle"] * (hard - soft), p["first"] * T
    yield Wound(4.0 * T, one / soft + (T - one) / middle + 3.0 * T / hard)


def cubic(p: Parameters) -> Iterator[Wound]:
    end = 2.0 * p["bend"] * np.array([-1.0, 1.0])
    yield Wound(STIFF * end * (2.0 * p["soft"] + p["hard"]) / 3.0, end, 1e-6)  # a parabola's mean height


def lobes(p: Parameters) -> Iterator[Wound]:
    """Pins of a cycloid disc come into contact one after another."""
    angle = np.pi * (np.arange(18) + 0.5) / 18
    # distance of a pin's normal from the pitch point, over the eccentric's arm of longest lever
    pin = np.stack([np.cos(angle), np.sin(angle)], axis=-1) - [p["shortened"], 0.0]
    lever = np.sin(angle) / np.linalg.norm(pin, axis=-1)
    for e in p["bend"] * np.array([0.3, 1.0, 4.0]):
        closed = np.maximum(e * lever - p["bend"] * (1.0 - lever), 0.0)
        torque = STIFF * (p["soft"] * e + (p["hard"] - p["soft"]) * (lever @ closed) / np.sum(lever**2))
        yield Wound([torque, -torque], [e, -e], 1e-6)


def clamped(p: Parameters) -> Iterator[Wound]:
    """A hub slips past its clamp and stays where it went."""
    loads = STIFF * p["breaks"] * np.array([0.5, 1.0, 3.0, 2.0, 1.5, 0.0])
    slipped = p["breaks"] * p["softer"] * np.array([0.0, 0.0, 2.0, 2.0, 2.0, 1.0])
    yield Wound(loads, loads / STIFF + slipped, 1e-6, 1e-12)


def from_sticking_to_sliding(p: Parameters) -> Iterator[Wound]:
    first, rising = 1e-5 * STIFF * p["friction"], np.linspace(0.0, 60.0, 121) * STIFF * p["friction"]
    yield Wound(first, first * (1.0 - p["sliding"]) / STIFF, 1e-3)
    end = np.append(np.full(120, np.nan), rising[-1] / STIFF - p["friction"])
    yield Wound(rising, end, 0.0, 0.06 * p["friction"])


def sliding(p: Parameters) -> Iterator[Wound]:
    """All sliders slip: the spring carries all but the friction, less what was held at the start."""
    rising = np.linspace(0.0, 30.0, 61) * STIFF * p["friction"]
    end = rising[-1] / STIFF - p["friction"] * (1.0 - p.get("arrived", 0.0))
    yield Wound(rising, np.append(np.full(60, np.nan), end), 0.02)


def ripple(p: Parameters) -> Iterator[Wound]:
    for q in (-0.7, 0.0, 0.2, 0.9):
        yield Wound(10.0, 10.0 / (STIFF * np.exp(p["depth"] * np.sin(p["waves"] * q + p["phase"]))), q=q)


def toothed(p: Parameters) -> Iterator[Wound]:
    angle, phase = 1e-3 * np.arange(1.0, 6.0), p["teeth"] * 0.1 + p["phase"]
    wave = p["depth"] / p["teeth"] * (np.sin(phase + p["teeth"] * angle) - np.sin(phase))
    yield Wound(STIFF * (angle + wave), angle, q=0.1)


def warming(course: Callable[[Array, float], Array]) -> Callable[[Parameters], Iterator[Wound]]:
    def rows(p: Parameters) -> Iterator[Wound]:
        time = np.array([0.0, 600.0, 6000.0])
        angle = 50.0 / STIFF * (1.0 + p["softer"] * course(time, p["lag"]))
        yield Wound(np.full(3, 50.0), angle, other={"time": time})

    return rows


def kelvin(p: Parameters) -> Iterator[Wound]:
    time = 2.0 * np.arange(400)
    crept = -np.expm1(-(time + 30.0) / p["time"])  # the first state lasted as long as a pause
    yield Wound(np.full(400, 50.0), 50.0 / STIFF * (1.0 + p["creep"] * crept), other={"time": time})


@pytest.mark.parametrize(
    ("effect", "form", "changes", "rows"),
    [
        ("backlash", "sharp", {"rest": 0.0}, sharp),
        ("backlash", "smooth", {}, smooth),
        ("backlash", "stages", {}, beyond_the_flanks),
        ("backlash", "arctan", {}, arctan),
        ("backlash", "planets", {}, planets),
        ("backlash", "runout", {}, runout),
        ("backlash", "scissors", {"way": 1.0, "preload": 5e-5, "growth": 0.1}, scissors),
        ("backlash", "scissors", {"way": -1.0, "preload": 5e-5, "growth": 0.1}, scissors),
        ("joint-compliance", "plain", {}, plain),
        ("joint-compliance", "helped", {}, helped),
        ("joint-compliance", "preloaded", {"from": 1e-4}, preloaded),
        ("joint-compliance", "strands", {}, strands),
        ("hardening", "piecewise", {}, piecewise),
        ("hardening", "cubic", {}, cubic),
        ("hardening", "lobes", {}, lobes),
        ("hysteresis", "clamped", {"arrived": 0.0}, clamped),
        ("hysteresis", "dahl", {"arrived": 0.0}, from_sticking_to_sliding),
        ("hysteresis", "maxwell-slip", {"arrived": 0.0}, from_sticking_to_sliding),
        ("hysteresis", "iwan", {}, sliding),
        ("hysteresis", "bouc-wen", {}, sliding),
        ("stiffness-ripple", "sine", {}, ripple),
        ("transmission-error", "toothed", {}, toothed),
        ("warm-up", "lagged", {}, warming(lambda time, lag: -np.expm1(-time / lag))),
        ("warm-up", "slow", {}, warming(lambda time, lag: time / (time + lag))),
        ("creep", "kelvin-voigt", {}, kelvin),
    ],
)
def test_the_drive_winds_up_as_its_law_says(
    effect: str, form: str, changes: Mapping[str, float], rows: Callable[[Parameters], Iterator[Wound]]
) -> None:
    truth = truth_of(effect, form, changes)
    for row in rows(truth.parameters):
        found, expected = wound(truth, row.torque, row.q, **row.other), np.atleast_1d(row.angle)
        told = np.isfinite(expected)
        assert told.any()
        np.testing.assert_allclose(found[told], expected[told], rtol=row.share, atol=row.within)


# --- compliance about torques: rows of torque, step, compliance, tolerance

Rates = Iterator[tuple[float, float, float, float]]


def planets_that_carry(p: Parameters) -> Rates:
    """Between the flanks of the planets none, one, two and three of them carry."""
    spread = p["spread"]
    flanks = p["half"] * (1.0 - spread * np.array([1.0, 0.4, 0.0]))
    between = p["half"] * np.array([0.5 - 0.5 * spread, 1.0 - 0.7 * spread, 1.0 - 0.2 * spread, 2.0])
    for carry, e in enumerate(between):
        each = (1.0 - p["left"]) / 3.0
        torque = STIFF * (p["left"] * e + each * np.maximum(e - flanks, 0.0).sum())
        yield torque, 1e-3 * torque, 1.0 / (STIFF * (p["left"] + carry * each)), 0.05


def by_the_cube_root(soft: float, hard: float, preload: float) -> Rates:
    """Contacts give less by the cube root of their load over the preload."""
    for load, share in ((0.0, 1.0), (7.0, 1 / 2), (26.0, 1 / 3)):
        more = (1.0 / soft - 1.0 / hard) * share
        yield preload * load, 1e-3 * preload, 1.0 / hard + more, 2e-3 * more * hard / (1.0 + more * hard)


def hertz_hardening(p: Parameters) -> Rates:
    return by_the_cube_root(STIFF * p["soft"], STIFF * p["hard"], 0.3 * STIFF * p["bend"])


def hertz_joint(p: Parameters) -> Rates:
    k = p["stiffness"]
    return by_the_cube_root(k / (1.0 + p["more"]), k, k * p["from"])


def preloaded_pair(p: Parameters) -> Rates:
    k, at = p["stiffness"], p["from"]
    yield 0.0, 1e-2 * k * at, 1.0 / k, 1e-6
    yield 20.0 * k * at, 0.1 * k * at, 1.0 / (p["loose"] * k), 1e-3


def ends(start: float, far: float, tolerance: tuple[float, float]) -> Callable[[Parameters], Rates]:
    """Return that a drive goes from its soft to its hard stiffness: near rest, and far times its bend."""

    def rows(p: Parameters) -> Rates:
        bend = STIFF * p["bend"]
        yield 0.0, start * bend, 1.0 / (STIFF * p["soft"]), tolerance[0]
        yield far * bend, start * bend, 1.0 / (STIFF * p["hard"]), tolerance[1]

    return rows


def sinh(p: Parameters) -> Rates:
    at = STIFF * p["bend"]
    yield 0.0, 1e-3 * at, 1.0 / (STIFF * p["soft"]), 2e-3
    tangent = STIFF * p["soft"] * np.sqrt(1.0 + 2.0 * np.log(p["hard"] / p["soft"]))
    yield at, 1e-3 * at, 1.0 / tangent, 1e-4


def hypoid(p: Parameters) -> Rates:
    """Uneven flanks harden from torques of their own."""
    soft, hard = STIFF * p["soft"], STIFF * p["hard"]
    knee = 0.5 * STIFF * p["bend"]
    yield 0.0, 1e-3 * knee, 1.0 / soft, 1e-4
    for way, at in ((1.0, knee), (-1.0, p["coast"] * knee)):
        half = 0.5 * (1.0 / soft - 1.0 / hard)  # sqrt(1 + x^2) = 2 at x = sqrt(3)
        yield way * np.sqrt(3.0) * at, 1e-3 * at, 1.0 / hard + half, 1e-3 * half * hard / (1.0 + half * hard)
        yield way * 1e4 * at, at, 1.0 / hard, 1e-2


def uneven(p: Parameters) -> Rates:
    for way in (1.0, -1.0):
        yield way * 5e-3 * STIFF, 1e-6 * STIFF, 1.0 / (STIFF * (1.0 + way * p["uneven"])), 1e-3


def softening(p: Parameters) -> Rates:
    at = STIFF * p["from"]
    yield 0.01 * at, 1e-3 * at, 1.0 / STIFF, 1e-4
    yield 30.0 * at, 1e-3 * at, 1.0 / (p["loose"] * STIFF), 1e-3


@pytest.mark.parametrize(
    ("effect", "form", "changes", "rows"),
    [
        ("backlash", "planets", {}, planets_that_carry),
        ("hardening", "hertz", {}, hertz_hardening),
        ("hardening", "exponential", {}, ends(1e-3, 20.0, (2e-3, 1e-3))),
        ("hardening", "piecewise", {}, ends(1e-3, 20.0, (2e-3, 1e-3))),
        ("hardening", "sinh", {}, sinh),
        ("hardening", "cubic", {}, ends(2e-3, 12.0, (1e-4, 1e-6))),
        ("hardening", "lobes", {}, ends(1e-4, 300.0, (1e-3, 1e-3))),
        ("hardening", "hypoid", {}, hypoid),
        ("joint-compliance", "hertz", {}, hertz_joint),
        ("joint-compliance", "preloaded", {"from": 1e-4}, preloaded_pair),
        ("uneven-drive", "two-way", {}, uneven),
        ("softening-drive", "slackening", {}, softening),
    ],
)
def test_the_drive_gives_as_much_more_as_its_law_says(
    effect: str, form: str, changes: Mapping[str, float], rows: Callable[[Parameters], Rates]
) -> None:
    truth = truth_of(effect, form, changes)
    for torque, step, expected, tolerance in rows(truth.parameters):
        assert give(truth, torque, step) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("form", ["exponential", "piecewise", "sinh"])
def test_hardening_only_rises(form: str) -> None:
    truth = drawn(arm(), "hardening", "q1", form)
    T = STIFF * truth.parameters["bend"]
    rising = [1.0 / give(truth, share * T, 1e-3 * T) for share in (0.01, 0.55, 0.9)]
    assert (np.diff(rising) > -1e-6 * STIFF * truth.parameters["soft"]).all()
    assert rising[-1] > 1.05 * rising[0]


@pytest.mark.parametrize(
    ("effect", "form"),
    [
        ("hardening", "exponential"), ("hardening", "piecewise"), ("hardening", "sinh"),
        ("hardening", "cubic"), ("hardening", "hertz"), ("hardening", "lobes"), ("backlash", "planets"),
        ("backlash", "runout"), ("backlash", "scissors"),
    ],
)  # fmt: skip
def test_a_drive_is_the_same_both_ways(effect: str, form: str) -> None:
    truth = drawn(arm(), effect, "q1", form)
    mirrored = changed(truth, way=-truth.parameters["way"]) if form == "scissors" else truth
    torque = STIFF * np.array([1e-5, 3e-4, 5e-3])
    np.testing.assert_allclose(wound(mirrored, -torque), -wound(truth, torque), rtol=1e-9)


def test_a_drive_that_rests_beside_the_middle_of_its_play_is_not_odd_in_the_torque() -> None:
    truth = truth_of("backlash", "sharp", {"rest": 0.5})
    h, left = truth.parameters["half"], truth.parameters["left"]
    back, there = wound(truth, np.array([-1.0, 1.0]) * 20.0 * STIFF * h)
    # from rest at +h/2 the near flank is h/2 away, the far one 3h/2
    assert there + back == pytest.approx(-2.0 * 0.5 * h * (1.0 - left) - 2.0 * 0.5 * h * left, rel=0.05)
    assert there - back == pytest.approx(2.0 * (20.0 * h + (1.0 - left) * h), rel=1e-3)


def test_a_joint_is_rigid_without_the_effect() -> None:
    np.testing.assert_allclose(turned_about_its_axis(arm(RIGID), [-500.0, 2000.0]), 0.0, atol=1e-12)


def test_a_wheel_gives_the_same_from_spoke_to_spoke() -> None:
    truth = truth_of("joint-compliance", "spokes", {"spokes": 6.0})
    found = np.array([wound(truth, 30.0, q)[0] for q in -0.9 + np.pi / 12.0 * np.arange(5)])
    assert found[0] == pytest.approx(found[4], rel=1e-9)
    # the mean over a whole wave is the plain one's
    assert found[:4].mean() == pytest.approx(30.0 / truth.parameters["stiffness"], rel=1e-9)
    assert np.ptp(found[:4]) > 1e-2 * found.mean()


# --- friction


@pytest.mark.parametrize(
    ("form", "changes", "peak"),  # over the friction, or a strain
    [
        ("iwan", {}, 2.0), ("clamped", {}, None), *(pytest.param(*one, marks=pytest.mark.slow) for one in [
            ("iwan", {}, 6.0), ("bouc-wen", {"arrived": 0.0}, 2.0), ("bouc-wen", {"arrived": 0.0}, 6.0),
            ("dahl", {}, 4.0), ("maxwell-slip", {}, 4.0), ("teeth", {}, None),
        ]),
    ],
)  # fmt: skip
def test_a_load_cycle_closes_and_takes_work(form: str, changes: dict[str, float], peak: float | None) -> None:
    truth = truth_of("hysteresis", form, changes)
    strain = 1.5e-3 if peak is None else peak * truth.parameters["friction"]
    back, there = np.linspace(1, -1, 121)[1:], np.linspace(-1, 1, 121)[1:]
    torque = STIFF * strain * np.concatenate([np.linspace(0, 1, 61), *3 * [back, there]])
    e = wound(truth, torque)
    assert e[-1] == pytest.approx(e[-241], rel=1e-3)  # the same place a cycle later
    last = slice(-241, None)
    lost = float(np.sum(0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(e[last])))
    least = 1e-2 * strain if peak is None else 0.05 * truth.parameters["friction"]
    assert lost > least * STIFF * strain


@pytest.mark.parametrize(("form", "changes"), [("iwan", {}), ("maxwell-slip", {"arrived": 0.0})])
def test_sliders_follow_masings_rule(form: str, changes: dict[str, float]) -> None:
    truth = truth_of("hysteresis", form, changes)
    peak = 3.0 * STIFF * truth.parameters["friction"]
    loading = wound(truth, peak * np.array([0.25, 0.5, 1.0]))
    back = wound(truth, peak * np.array([0.25, 0.5, 1.0, 0.5, 0.0, -1.0]))
    # the way back is the first loading, stretched by two
    np.testing.assert_allclose(back[3:], loading[-1] - 2.0 * loading, rtol=1e-6)


def test_the_answer_of_friction_depends_on_the_history_and_of_play_it_does_not() -> None:
    peak = 2.0 * STIFF * drawn(arm(), "hysteresis", "q1", "iwan").parameters["friction"]
    for effect, form, remembers in (("hysteresis", "iwan", True), ("backlash", "smooth", False)):
        truth = drawn(arm(), effect, "q1", form)
        direct, by_the_peak = (wound(truth, peak * np.array(way))[-1] for way in ([0.5], [1.0, 0.5]))
        assert bool(abs(direct - by_the_peak) > 1e-2 * abs(direct)) is remembers


def test_friction_of_teeth_is_a_share_of_what_passes_them() -> None:
    truth = truth_of("hysteresis", "teeth", {"seals": 0.0, "arrived": 0.0})
    rubbing, peak = truth.parameters["rubbing"], 400.0 * STIFF * truth.parameters["slip"]
    torque = peak * np.concatenate([np.linspace(0.0, 1.0, 401), np.linspace(1.0, 0.0, 401)[1:]])
    e = wound(truth, torque)
    assert e[400] == pytest.approx(peak / STIFF / (1.0 + rubbing), rel=1e-3)
    # on the way back it holds the spring wound up
    assert e[720] == pytest.approx(0.2 * peak / STIFF / (1.0 - rubbing), rel=2e-2)
    lost = float(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(e)))
    assert lost > 0.2 * rubbing * peak**2 / STIFF
