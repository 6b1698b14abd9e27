"""Stiffness that follows the angle: cranks and spring balancers by the geometry of their own."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.actuator_lever import _lever
from beamstiff.diagnosis.effects.gravity_compensator import _spring
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array
from tests.diagnosis.machines import arm_at, close, kr240, nominal, rows_of, shape_of, unexplained

TINY = 1e-5


@pytest.fixture(scope="module")
def campaign() -> Baseline:
    rng = np.random.default_rng(1)
    q = np.repeat(np.array([0, 1.2, -1.5, 0, 0.8, 0]) + rng.uniform(-0.8, 0.8, (15, 6)), 2, axis=0)
    return nominal(kr240(), rows_of(kr240(), q, rng.normal(0, 1000, (30, 6)) * [1, 1, 1, 0.2, 0.2, 0.2]))


def screw_length(angle: Array, ratio: float) -> Array:
    """Return the length of a screw between points 1 and `ratio` from the axis."""
    a, b = np.array([1.0, 0.0]), ratio * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.linalg.norm(b - a, axis=-1)


@pytest.mark.parametrize("ratio", [0.15, 0.5, 0.85])
def test_a_screws_lever_is_its_stroke_by_the_angle(ratio: float) -> None:
    angle = np.linspace(0.2, 2.9, 20)
    stroke = (screw_length(angle + TINY, ratio) - screw_length(angle - TINY, ratio)) / (2 * TINY)
    assert _lever(angle, ratio) == pytest.approx(np.abs(stroke), rel=1e-8)


def test_beyond_the_measured_angles_no_screw_stands_at_its_dead_point(campaign: Baseline) -> None:
    q = np.repeat(campaign.rows.q[:1], 48, axis=0)
    q[:, 1] = np.arange(48) * np.pi / 24  # the dead points of many cranks among them
    turned = nominal(kr240(), rows_of(kr240(), q, np.tile([0, 0, -1000.0, 0, 0, 0], (48, 1))))
    measured = {"angles": (1.0, 1.3, 1.6), "counts": (1.0, 1.0, 1.0)}
    shapes = EFFECTS["actuator-lever"].shapes(replace(turned, stated=measured), "q2")
    within = EFFECTS["actuator-lever"].shapes(replace(campaign, stated=measured), "q2")
    assert shapes
    for there, here in zip(shapes, within, strict=True):
        assert np.isfinite(there.columns).all()
        assert np.abs(there.columns).max() < 100 * np.abs(here.columns).max()


def test_between_measured_angles_a_lever_is_no_other_than_at_them(campaign: Baseline) -> None:
    """Nobody drives through a dead point: in a gap of forty degrees no law of a screw runs away."""
    q = np.repeat(campaign.rows.q[:1], 41, axis=0)
    q[:, 1] = np.linspace(0.6, 1.6, 41)
    swept = nominal(kr240(), rows_of(kr240(), q, np.tile([0, 0, -1000.0, 0, 0, 0], (41, 1))))
    measured = {"angles": (0.6, 0.65, 0.7, 1.5, 1.55, 1.6), "counts": (1.0,) * 6}
    torque = arm_at(q).torque(swept.rows.wrench)[:, 1]
    for shape in EFFECTS["actuator-lever"].shapes(replace(swept, stated=measured), "q2"):
        if shape.name.startswith("any"):
            law = np.linalg.norm(shape.columns, axis=(1, 2)) / np.abs(torque)
            at = np.isin(np.round(q[:, 1], 3), measured["angles"])
            assert law[~at].max() < 3.0 * law[at].max()


@pytest.mark.parametrize("free", [0.0, 0.4, 0.8])
@pytest.mark.parametrize("ratio", [0.15, 0.4, 0.7])
def test_a_balancers_torque_and_stiffness_are_slopes_of_its_energy(ratio: float, free: float) -> None:
    def energy(angle: Array) -> Array:
        a, r = np.array([1.0, 0.0]), ratio * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return 0.5 * (np.linalg.norm(a + r, axis=-1) - free * (1 - ratio)) ** 2

    angle, step = np.linspace(-3, 3, 25), 1e-4
    slope = (energy(angle + step) - energy(angle - step)) / (2 * step)
    curve = (energy(angle + step) - 2 * energy(angle) + energy(angle - step)) / step**2
    torque, stiffness = _spring(angle, ratio, free)
    scale = stiffness @ stiffness / (curve @ stiffness)
    np.testing.assert_allclose(stiffness, scale * curve, atol=1e-6)
    np.testing.assert_allclose(torque, scale * slope, atol=1e-6)
    assert np.abs(_spring(np.linspace(0, 2 * np.pi, 1001), ratio, free)[1]).max() == pytest.approx(
        1, abs=1e-3
    )


def elastic(campaign: Baseline, compliance: Array) -> Array:
    """Return the displacement (N, 6) of a second drive whose compliance (N,) follows its angle."""
    arm = arm_at(campaign.rows.q)
    return arm.slipped(compliance * arm.torque(campaign.rows.wrench)[:, 1], 1)


def constant(campaign: Baseline) -> Array:
    return elastic(campaign, np.ones(len(campaign.rows)))[..., None]


def test_a_crank_is_a_drive_whose_compliance_goes_with_1_over_its_lever_squared(campaign: Baseline) -> None:
    shapes = [one for one in EFFECTS["actuator-lever"].shapes(campaign, "q2") if one.name.startswith("crank")]
    assert len(shapes) > 20
    for shape in shapes[::5]:
        ratio, degrees = shape.name.removeprefix("crank ").removesuffix(" deg").split(", ")
        phase = np.pi / 8 * round(float(degrees) / 22.5)  # the name rounds it
        angle = campaign.rows.q[:, 1] + phase
        stroke = screw_length(angle + TINY, float(ratio)) - screw_length(angle - TINY, float(ratio))
        lever = stroke / (2 * TINY)
        follows = (lever**2).mean() / lever**2
        # its mean is the drive's own compliance, which is fitted already
        close(shape.columns[..., 0], elastic(campaign, follows - follows.mean()), 1e-6)


def test_any_crank_is_nearly_one_of_the_main_modes(campaign: Baseline) -> None:
    """And so is a screw whose free length gives way."""
    laws, angle = [], campaign.rows.q[:, 1]
    for ratio, phase in ((0.22, 0.3), (0.6, 0.5), (0.4, 0.1)):
        lever = _lever(angle + phase, ratio)
        laws.append((lever**2).mean() / lever**2)
    for ratio in (0.220 / 0.750, 0.250 / 0.750):  # of the IR-663
        for phase, fixed in ((0.3, 0.0), (0.5, 0.2), (0.1, 0.4)):
            lever, free = _lever(angle + phase, ratio), screw_length(angle + phase, ratio) - fixed
            laws.append(lever.min() ** 2 * free / lever**2)
    modes = shape_of(campaign, "actuator-lever", "q2", "any crank").columns
    for law in (elastic(campaign, follows) for follows in laws):
        whole = unexplained(law, constant(campaign))
        assert unexplained(law, modes, constant(campaign)) < 0.1 * whole


def test_a_crank_that_stays_away_from_its_dead_points_has_modes_of_its_own(campaign: Baseline) -> None:
    angle, ratio = campaign.rows.q[:, 1], 0.2
    phase = np.pi / 2 - 0.5 * (angle.min() + angle.max())  # the lever is largest near the middle
    lever = screw_length(angle + phase + TINY, ratio) - screw_length(angle + phase - TINY, ratio)
    assert np.abs(lever).min() > 0.5 * np.abs(lever).max()
    law = elastic(campaign, lever.max() ** 2 / lever**2)
    modes = shape_of(campaign, "actuator-lever", "q2", "any gentle crank").columns
    whole = unexplained(law, constant(campaign))
    assert unexplained(law, np.concatenate([modes, constant(campaign)], -1)) < 0.03 * whole


def test_a_balancer_beside_the_drive_takes_from_its_compliance(campaign: Baseline) -> None:
    k = 6.6e6  # of the second drive, table 2
    ratio, free, phase = 0.4, 0.0, np.radians(45)
    along = shape_of(campaign, "gravity-compensator", "q2", "spring 0.4, free 0, 45 deg").columns
    added = 1e-4 * k * _spring(campaign.rows.q[:, 1] - phase, ratio, free)[1]
    moved = elastic(campaign, 1 / (k + added) - 1 / k)
    assert unexplained(moved, np.concatenate([along, constant(campaign)], axis=-1)) < 1e-3
    # and in its own size: what is left of the best constant compliance is the column times the stiffness
    rest = moved - along[..., 0] * 1e-4 * k
    assert unexplained(rest, constant(campaign)) < 1e-3


@pytest.mark.parametrize(("ratio", "free", "phase"), [(0.22, 0.5, 0.3), (0.6, 0.2, 2.2), (0.5, 0.7, 4.0)])
def test_of_positions_any_balancers_wind_up_is_nearly_one_of_the_main_modes(
    campaign: Baseline, ratio: float, free: float, phase: float
) -> None:
    arm = arm_at(campaign.rows.q)
    rows = rows_of(kr240(), campaign.rows.q, campaign.rows.wrench, position=arm.tip)
    there = nominal(kr240(), rows)
    modes = shape_of(there, "gravity-compensator", "q2", "any spring").columns
    wound = arm.slipped(-_spring(campaign.rows.q[:, 1] - phase, ratio, free)[0], 1)
    grid = [
        shape.columns
        for shape in EFFECTS["gravity-compensator"].shapes(there, "q2")
        if shape.name.startswith("spring")
    ]
    whole = min(unexplained(wound[:, :3], one[:, :3]) for one in grid)
    assert unexplained(wound[:, :3], modes[:, :3]) < min(0.02, 0.5 * whole)


def test_of_positions_a_wound_spring_is_one_as_well_whose_torque_no_crank_gives(campaign: Baseline) -> None:
    arm = arm_at(campaign.rows.q)
    rows = rows_of(kr240(), campaign.rows.q, campaign.rows.wrench, position=arm.tip)
    there = nominal(kr240(), rows)
    wound = arm.slipped(-(1.0 + 0.3 * campaign.rows.q[:, 1]), 1)
    columns = shape_of(there, "gravity-compensator", "q2", "any spring, and a wound one").columns
    assert unexplained(wound[:, :3], columns[:, :3, :2]) < 1e-9


def test_what_a_balancer_pulls_winds_up_the_drive_and_stiffens_it_by_its_slope(campaign: Baseline) -> None:
    q, k = campaign.rows.q[:, 1], 6.6e6
    arm = arm_at(campaign.rows.q)
    load = arm.torque(campaign.rows.wrench)[:, 1]
    there = nominal(kr240(), rows_of(kr240(), campaign.rows.q, campaign.rows.wrench, position=arm.tip))
    stated = replace(there, stated={"angles": tuple(q), "counts": (1.0,) * len(q), "compliance": 1 / k})

    def pull(angle: Array) -> Array:
        return _spring(angle - np.radians(45), 0.4, 0.0)[0]  # N m: a small one, whose effect is linear

    turned = load / k
    for _ in range(20):  # until drive and balancer hold the load together
        turned = (load - pull(q + turned)) / k
    moved, wound = arm.slipped(turned - load / k, 1), arm.slipped(-pull(q) / k, 1)[..., None]
    shape = shape_of(there, "gravity-compensator", "q2", "spring 0.4, free 0, 45 deg")
    assert [one.name for one in shape.parameters] == ["largest_torque"]
    shape = shape_of(stated, "gravity-compensator", "q2", "spring 0.4, free 0, 45 deg")
    assert unexplained(moved, shape.columns[..., :1], constant(campaign)) < 1e-6
    assert unexplained(moved, wound, constant(campaign)) > 1e-4


def test_what_a_balancer_pulls_shows_in_positions_alone(campaign: Baseline) -> None:
    name = ("gravity-compensator", "q2", "spring 0.4, free 0, 45 deg")
    assert [one.name for one in shape_of(campaign, *name).parameters] == ["largest_stiffness"]
    # once it is written beside a robot it means the same for either kind of rows
    stated = replace(campaign, stated={"angles": (0.1, 0.5), "counts": (1.0, 2.0), "compliance": 1e-7})
    shape = shape_of(stated, *name)
    assert [one.name for one in shape.parameters] == ["largest_torque", "largest_stiffness"]
    assert unexplained(shape.columns[..., 0], shape.columns[..., 1:]) < 1e-9


def test_angles_that_stand_still_show_neither() -> None:
    rows = rows_of(kr240(), [0, 1, -1, 0, 0.5, 0], np.random.default_rng(2).normal(0, 500, (6, 6)))
    there = nominal(kr240(), rows)
    for effect in ("actuator-lever", "gravity-compensator"):
        for shape in EFFECTS[effect].shapes(there, "q2"):
            np.testing.assert_allclose(shape.columns, 0, atol=1e-9)


def test_once_a_turn_the_compliance_follows_cosine_and_sine(campaign: Baseline) -> None:
    columns = shape_of(campaign, "actuator-lever", "q2", "once a turn").columns
    angle = campaign.rows.q[:, 1]
    for at, law in enumerate((np.cos, np.sin)):
        close(columns[..., at], elastic(campaign, law(angle) - law(angle).mean()), 1e-6)


def test_a_rod_whose_stiffness_has_two_waves_is_once_and_twice_a_turn(campaign: Baseline) -> None:
    q = campaign.rows.q[:, 1]
    stiffness = 3.0 + np.cos(q - 0.4) + 0.5 * np.cos(2 * q + 0.7)
    moved = elastic(campaign, 1.0 / stiffness)
    once, twice = (
        shape_of(campaign, "actuator-lever", "q2", name).columns
        for name in ("once a turn", "once and twice a turn")
    )
    assert twice.shape[-1] == 4
    close(twice[..., :2], once)
    found = [
        unexplained(moved, np.concatenate([columns, constant(campaign)], -1)) for columns in (once, twice)
    ]
    assert found[1] < 0.1 * found[0]


def test_a_joint_that_goes_round_has_no_lever(campaign: Baseline) -> None:
    effect = EFFECTS["actuator-lever"]
    assert effect.components(campaign) == ["q2", "q5"]  # 130 and 250 degrees; the third has 274
    assert len(effect.components(replace(campaign, stated={}))) == 6
