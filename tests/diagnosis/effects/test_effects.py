"""What holds for every effect of the library."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.data_selected import best_of, left_by
from beamstiff.diagnosis.inference.evidence import NoisePrior, evidence
from beamstiff.diagnosis.inference.library import build_library
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline, at_rows, fit_baseline
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.se3 import Array
from tests.diagnosis import planted
from tests.diagnosis.hypotheses import of_any_sign
from tests.diagnosis.machines import POSITION, ROTATION, arm_at, at_random, kr240, nominal, rows_of

NAMES = [
    *("link-bending", "bearing-tilt", "base-compliance", "tool-compliance", "actuator-lever", "backlash"),
    *("joint-compliance", "hardening", "hysteresis", "joint-coupling", "gravity-compensator"),
    *("geometry-error", "tool-offset", "load-error", "frame-misalignment", "payload-error"),
    *("thermal-drift", "outliers", "target-slip", "angle-curve", "approach-direction"),
    *("camera-scale", "hand-eye"),  # of rows that a camera read: tests/diagnosis/test_camera.py
]
BY_LOAD = {"link-bending", "bearing-tilt", "base-compliance", "tool-compliance", "backlash", "hardening"}


def campaigns() -> dict[str, Baseline]:
    robot = kr240()
    some = at_random(robot, 6, seed=1, time=np.arange(6.0), step=np.zeros(6), temperature=np.arange(6.0))
    arm = arm_at(some.q)
    vector = Rotation.from_matrix(arm.tool).as_rotvec()
    absolute = rows_of(robot, some.q, some.wrench, position=arm.tip, rotation=vector)
    loop = load_robot("ir663")
    plane = at_random(loop, 6, seed=2, reach=0.4)
    plane = rows_of(loop, plane.q, plane.wrench * [1, 0, 1, 0, 1, 0])
    tables = {"serial": (robot, some), "absolute": (robot, absolute), "loop": (loop, plane)}
    return {name: nominal(*both) for name, both in tables.items()}


@pytest.fixture(scope="module")
def rows() -> dict[str, Baseline]:
    return campaigns()


@pytest.fixture(scope="module")
def loaded(rows: dict[str, Baseline]) -> dict[str, list[Baseline]]:
    """Return ten and twenty times the load; offsets and weight stay: what doubles triples by no chance."""
    return {
        name: [at_rows(one, replace(one.rows, wrench=one.rows.wrench * k)) for k in (10, 20)]
        for name, one in rows.items()
        if name != "loop"
    }


def test_the_effects_are_those_of_the_format() -> None:
    assert [name for name, one in EFFECTS.items() if not one.outside] == sorted(NAMES)


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_says_what_it_is_and_what_tells_it_from_its_look_alikes(effect: str) -> None:
    one = EFFECTS[effect]
    assert one.name == effect
    assert one.meaning.endswith(".")
    assert one.separation
    assert one.sources
    assert set(one.look_alikes) <= set(NAMES) - {effect}


@pytest.mark.parametrize("campaign", ["serial", "absolute", "loop"])
@pytest.mark.parametrize("effect", NAMES)
def test_shapes_are_finite_columns_with_sizes(effect: str, campaign: str, rows: dict[str, Baseline]) -> None:
    there = rows[campaign]
    for component in EFFECTS[effect].components(there):
        shapes = EFFECTS[effect].shapes(there, component)
        assert len({one.name for one in shapes}) == len(shapes)
        for one in shapes:
            assert one.columns.shape == (len(there.rows), 6, len(one.parameters))
            assert np.isfinite(one.columns).all()
            assert one.prior_factor > 1
            assert one.weight > 0
            assert len({item.name for item in one.parameters}) == len(one.parameters)
            assert all(item.size > 0 and item.unit for item in one.parameters)


@pytest.mark.parametrize("effect", sorted(BY_LOAD))
def test_what_gives_way_under_load_does_nothing_without(effect: str) -> None:
    rows = at_random(kr240(), 3, seed=3)
    there = nominal(kr240(), rows_of(kr240(), rows.q, 0 * rows.wrench))
    for component in EFFECTS[effect].components(there):
        for one in EFFECTS[effect].shapes(there, component):
            np.testing.assert_allclose(one.columns, 0, atol=1e-12)


def test_linear_places_do_twice_as_much_under_twice_the_load(rows: dict[str, Baseline]) -> None:
    once = rows["serial"]
    twice = nominal(kr240(), rows_of(kr240(), once.rows.q, 2 * once.rows.wrench))
    for effect in ("link-bending", "bearing-tilt", "base-compliance", "tool-compliance", "joint-coupling"):
        for component in EFFECTS[effect].components(once):
            pairs = zip(*(EFFECTS[effect].shapes(some, component) for some in (once, twice)), strict=True)
            for one, other in pairs:
                # what stiffens has columns that are not linear, and scaled by the rows
                linear = [not re.search("contact|usual|seam", item.name) for item in one.parameters]
                doubled, columns = 2 * one.columns[..., linear], other.columns[..., linear]
                np.testing.assert_allclose(columns, doubled, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("effect", "component", "shape"),
    [
        ("base-compliance", None, "rotation that stiffens"),
        ("bearing-tilt", "q2", "tilt that stiffens"),
        ("bearing-tilt", "q2", "all, softening by axis as its preload is lost at 0.2"),
        ("tool-compliance", None, "by axis, softening as a seam that opens"),
        ("link-bending", "link2", "tapered"),
        ("hysteresis", "q2", "friction that grows with the torque, wound up by the weight"),
    ],
)
def test_nothing_gives_way_against_its_load(effect: str, component: str | None, shape: str) -> None:
    rows = at_random(kr240(), 60, seed=3, sigma_position=POSITION, sigma_rotation=ROTATION)
    there = nominal(kr240(), rows)
    law = next(one for one in EFFECTS[effect].shapes(there, component) if one.name == shape)
    backward = -law.columns @ [3 * item.size * item.positive for item in law.parameters]
    noise = np.random.default_rng(4).standard_normal(backward.shape) * there.sigma
    there = replace(there, measured=there.predicted + backward + noise)
    white = whiten(there)
    key = (effect, component, shape)
    others = Prior(without=tuple(name for name in EFFECTS if name != effect))
    every = build_library(there, white, others).hypotheses
    own = [one for one in every if (one.effect, one.component, one.shape.name) == key]
    found, freely = (
        evidence(white, some, NoisePrior(np.ones(1), np.zeros(1)))
        for some in (own, [of_any_sign(one) for one in own])
    )
    assert freely.hypotheses[0] > freely.unknown + 50
    assert found.hypotheses[0] < found.unknown


@pytest.mark.parametrize("campaign", ["serial", "absolute"])
@pytest.mark.parametrize("effect", NAMES)
def test_beyond_the_loads_that_were_fitted_no_law_grows_faster_than_the_load(
    effect: str, campaign: str, rows: dict[str, Baseline], loaded: dict[str, list[Baseline]]
) -> None:
    ten, twenty = loaded[campaign]
    for component in EFFECTS[effect].components(rows[campaign]):
        shapes = {one.name: one for one in EFFECTS[effect].shapes(ten, component) if not one.data_selected}
        for further in EFFECTS[effect].shapes(twenty, component):
            if further.name in shapes and further.columns.shape == shapes[further.name].columns.shape:
                before, after = (
                    np.abs(one.columns).max(axis=(0, 1)) for one in (shapes[further.name], further)
                )
                assert (after <= 3.0 * before + 1e-9 * after.max()).all(), further.name


@cache
def from_guess(guess: float | None) -> Baseline:
    """Return the fit of a campaign that starts from one stiffness of all drives, or from the described."""
    robot = kr240()
    start = {} if guess is None else dict.fromkeys(robot.identify, guess)
    return fit_baseline(robot.with_parameters(start), planted.campaign(planted.plan()))


@pytest.mark.parametrize(
    "effect", ["link-bending", "bearing-tilt", "tool-compliance", "hardening", "joint-coupling"]
)
def test_realistic_sizes_do_not_depend_on_the_start_values_of_drives(effect: str) -> None:

    def sizes(guess: float | None) -> list[float]:
        base = from_guess(guess)
        component = EFFECTS[effect].components(base)[1 if effect != "tool-compliance" else 0]
        shapes = EFFECTS[effect].shapes(base, component)
        return [item.size for shape in shapes for item in shape.parameters]

    guessed = [sizes(guess) for guess in (1e5, 1e6, 1e8)]
    np.testing.assert_allclose(guessed, [guessed[0]] * 3, rtol=0.02)
    ratio = np.array(guessed[0]) / sizes(None)
    assert ((ratio > 0.1) & (ratio < 10.0)).all()  # without knowing that wrists are softer than shoulders


# What is chosen where it explains most of the gap


SHAPE = (20, 6)


@pytest.fixture
def there() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 20, seed=1))


def seen(there: Baseline, gap: Array) -> Baseline:
    return replace(there, measured=there.predicted + gap)


def drawn(seed: int, count: int = 1) -> Array:
    return 1e-4 * np.random.default_rng(seed).standard_normal((*SHAPE, count))


def test_what_explains_most_beside_the_rest_is_chosen(there: Baseline) -> None:
    rest, some = drawn(1), [drawn(seed) for seed in range(2, 7)]
    left = left_by(seen(there, rest[..., 0] + 0.3 * some[3][..., 0]), rest)
    assert best_of(range(5), left, some.__getitem__) == 3


def test_it_explains_what_least_squares_explain(there: Baseline) -> None:
    rest, some = drawn(1, 2), drawn(2, 3)
    weight = np.repeat([1.0, 0.5], 3)  # rotations by a lever of half a metre
    gap = 1e-4 * np.random.default_rng(3).uniform(-1, 1, SHAPE)  # nothing in it is far off

    def square(columns: Array) -> float:
        flat = (columns * weight[:, None]).reshape(120, -1)
        flat, target = flat / np.linalg.norm(flat, axis=0), (gap * weight).ravel()
        return float(((target - flat @ np.linalg.lstsq(flat, target)[0]) ** 2).sum())

    model = np.concatenate([there.tangent, rest], -1)
    left = left_by(seen(there, gap), rest)
    expected = square(model) - square(np.concatenate([model, some], -1))
    assert left.explained(some) == pytest.approx(expected, rel=1e-6)


def test_of_equals_the_first_is_chosen_whatever_rounding_says(there: Baseline) -> None:
    one, gap = drawn(1, 2), drawn(2)[..., 0]
    turned = one @ np.linalg.qr(np.random.default_rng(3).standard_normal((2, 2)))[0]
    left = left_by(seen(there, gap), np.zeros((*SHAPE, 0)))
    for some in ([one, turned, 7.0 * one], [turned, one]):
        assert best_of(range(len(some)), left, some.__getitem__) == 0


def test_a_wrong_row_does_not_choose(there: Baseline) -> None:
    right, other = drawn(1), drawn(2)
    gap = right[..., 0].copy()
    gap[3] += 100.0 * other[3, :, 0]
    assert best_of([right, other], left_by(seen(there, gap), np.zeros((*SHAPE, 0))), lambda one: one) is right


def test_where_nothing_is_left_nothing_is_chosen(there: Baseline) -> None:
    rest = drawn(1)
    left = left_by(seen(there, rest[..., 0]), rest)
    assert best_of([drawn(2)], left, lambda one: one) is None
    assert best_of([], left, lambda one: one) is None


def test_columns_of_rounding_neither_explain_nor_take_anything(there: Baseline) -> None:
    rest, gap = drawn(1, 2), drawn(2)[..., 0]
    rounding = 1e-13 * drawn(3, 9)
    assert left_by(seen(there, gap), np.concatenate([rest, rounding], -1)).gap == pytest.approx(
        left_by(seen(there, gap), rest).gap
    )
    left = left_by(seen(there, gap), rest)
    absorbed = rest @ np.random.default_rng(4).standard_normal((2, 5))
    assert left.explained(absorbed) == 0.0
    assert best_of([absorbed], left, lambda one: one) is None
