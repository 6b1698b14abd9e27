"""Effects in the robot's file: what a diagnosis writes predicts as it did, and leaves nothing to find."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.diagnosis.added_effect import needed_scales, rounded
from beamstiff.diagnosis.apply import effects_displacement, extended
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.held_out.score import Weighted, fitted
from beamstiff.diagnosis.inference.library import build_library
from beamstiff.diagnosis.residual.baseline import at_rows, fit_baseline, predict
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.identification.identify import identify
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array
from tests.added import added
from tests.diagnosis.machines import ELBOW, FORE, SHOULDER, UPPER, elbow

# two links in a horizontal plane: gravity turns neither joint
STIFFNESS = np.array([SHOULDER, ELBOW])
NOISE = 1e-5  # m
SIZE = 4e-4  # rad, of the dead zone
TILT = 1.5e-7  # rad/(N m), of the floor


def levers(q: Array) -> Array:
    """Return what slips about both axes move the tip by, (N, 3, 2), by plane geometry."""
    elbow = UPPER * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0]), 0 * q[:, 0]], -1)
    tip = elbow + FORE * np.stack([np.cos(q.sum(1)), np.sin(q.sum(1)), 0 * q[:, 0]], -1)
    up = np.array([0.0, 0.0, 1.0])
    return np.stack([np.cross(up, tip), np.cross(up, tip - elbow)], -1)


def campaign(seed: int, poses: int = 24, loads: int = 5) -> tuple[Array, Array]:
    """Return joint values and forces of a campaign; the last force of a pose is the first, turned around."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform([-2.5, -2.2], [2.5, 2.2], (poses, 2)), loads, axis=0)
    wrench = np.zeros((poses * loads, 6))
    wrench[:, :3] = rng.uniform(-900, 900, (poses * loads, 3))
    return q, wrench


def read(q: Array, wrench: Array, moved: Array, seed: int, noise: float = NOISE, **more: Any) -> Measurements:
    noisy = moved + noise * np.random.default_rng(seed).standard_normal(moved.shape)
    more |= {"wrench": wrench, "displacement": noisy, "sigma_position": NOISE}
    return make_measurements(["q1", "q2"], q, tcp="tip", **more)


def truth(q: Array, wrench: Array, effect: str) -> Array:
    """Return displacements (N, 3) of the arm with an effect, statics by hand."""
    lever = levers(q)
    torque = np.einsum("nac,na->nc", lever, wrench[:, :3])
    slip = torque / (STIFFNESS * [1.2, 0.8])  # not the model's stiffness
    if effect == "backlash":
        slip[:, 1] += SIZE * np.tanh(torque[:, 1] / 30.0)  # tooth flanks meet within some 30 N m
    moved: Array = np.einsum("nac,nc->na", lever, slip)
    if effect == "base-compliance":
        tip = np.cross(lever[:, :, 0], [0.0, 0.0, 1.0])
        turned = TILT * np.cross(tip, wrench[:, :3]) * [1, 1, 0]
        moved += np.cross(turned, tip)
    return moved


CAUSES = [("backlash", "q2"), ("base-compliance", None)]


@cache
def diagnosed(effect: str) -> Diagnosis:
    q, wrench = campaign(1)
    return diagnose(elbow(), read(q, wrench, truth(q, wrench, effect), 2))


@pytest.mark.parametrize(("effect", "component"), CAUSES)
def test_the_robot_written_has_the_effect_and_its_stiffness(effect: str, component: str | None) -> None:
    result = diagnosed(effect)
    assert (result.verdict.effect, result.verdict.component) == (effect, component)
    robot = parse_robot(robot_to_yaml(extended(result)))
    assert {(one.effect, one.component) for one in robot.effects} == {(effect, component)}
    found = [robot.parameter(name) for name in robot.identify]
    np.testing.assert_allclose(found, STIFFNESS * [1.2, 0.8], rtol=0.01)
    if effect == "backlash":
        (entry,) = robot.effects
        size = 0.0
        for part in entry.each:
            widths = [v for name, v in part.parameters.items() if name.startswith("half_width")]
            assert all(str(value).endswith(" mrad") for value in widths)
            size += part.weight * sum(float(str(value).split()[0]) for value in widths)
        assert size == pytest.approx(1e3 * SIZE, rel=0.05)
        assert sum(part.weight for part in entry.each) == pytest.approx(1.0)


@pytest.mark.parametrize("effect", ["backlash", "base-compliance"])
def test_the_robot_written_predicts_new_rows_as_the_diagnosis(effect: str) -> None:
    result = diagnosed(effect)
    robot = parse_robot(robot_to_yaml(extended(result)))
    q, wrench = campaign(7, poses=9)
    rows = read(q, 1.4 * wrench, truth(q, 1.4 * wrench, effect), 8)
    before, after = result.predict_shift(rows)
    assert np.abs(after - before)[:, :3].max() > 1e-4
    # the diagnosis is linear in the compliances, the robot's stiffness under load is not: no other difference
    stiffening = [
        predict_displacements(one, rows, preload=True) - predict_displacements(one, rows)
        for one in (robot, result.linear.robot)
    ]
    found = predict(robot, rows) - (stiffening[0] - stiffening[1])
    np.testing.assert_allclose(found, after, rtol=0, atol=1e-12)
    assert np.abs(stiffening[0] - stiffening[1]).max() < 0.02 * np.abs(after - before).max()
    # the effects' own part is the same
    there = at_rows(result.linear, rows)
    change = 1 / np.array([robot.parameter(name) for name in robot.identify])
    change -= 1 / np.array([result.linear.robot.parameter(name) for name in robot.identify])
    expected = after - there.predicted - there.tangent @ change
    np.testing.assert_allclose(effects_displacement(robot, rows), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("effect", ["backlash", "base-compliance"])
def test_where_the_load_does_not_stiffen_the_machine_the_prediction_is_the_same(effect: str) -> None:
    result = diagnosed(effect)
    robot = parse_robot(robot_to_yaml(extended(result)))
    q, _ = campaign(9, poses=20, loads=1)
    lever = levers(q)
    # a force across both levers has no arm to turn them with: with the arm stretched or folded
    q[:, 1] = np.where(q[:, 1] > 0, 0.0, np.pi)
    lever = levers(q)
    wrench = np.zeros((20, 6))
    wrench[:, :3] = lever[:, :, 0] * np.linspace(-900, 900, 20)[:, None]
    wrench[:, 2] = 0.0
    rows = read(q, wrench, truth(q, wrench, effect), 3)
    apart = predict(robot, rows) - result.predict_shift(rows)[1]
    across = wrench[:, :3] / np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
    along = apart[:, :3] - (apart[:, :3] * across).sum(axis=1, keepdims=True) * across
    np.testing.assert_allclose(apart[:, :3] - along, 0, atol=1e-9)
    np.testing.assert_allclose(apart[:, 3:], 0, atol=1e-9)
    # along the levers the tip draws in as it goes on its circle, by half the square of the turn
    np.testing.assert_allclose(along, 0, atol=1e-8)


@pytest.mark.parametrize("effect", ["backlash", "base-compliance"])
def test_beside_the_effect_there_is_nothing_more(effect: str) -> None:
    robot = extended(diagnosed(effect))
    q, wrench = campaign(11)
    again = diagnose(robot, read(q, wrench, truth(q, wrench, effect), 12))
    assert again.verdict.effect == "none"
    assert again.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.15)


@pytest.mark.parametrize("effect", ["backlash", "base-compliance"])
def test_identification_beside_the_effects_finds_the_stiffness(effect: str) -> None:
    robot = extended(diagnosed(effect))
    q, wrench = campaign(13)
    rows = read(q, wrench, truth(q, wrench, effect), 14)
    with pytest.raises(BeamstiffError, match=f"its effects .*{effect}.* take them off"):
        identify(robot, rows)
    found = identify(*without_effects(robot, rows), folds=0)
    assert found.robot.effects == ()
    np.testing.assert_allclose(found.stiffness, STIFFNESS * [1.2, 0.8], rtol=0.01)
    assert found.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.15)


def test_shapes_between_which_the_data_do_not_choose_and_second_causes_are_all_written() -> None:
    result = diagnosed("backlash")
    known = build_library(result.linear, whiten(result.linear)).hypotheses
    shapes = {(one.key, one.shape.name): one for one in known}
    knees = [shapes["backlash:q2", f"flank within {width}"] for width in ("0.005", "0.03")]
    floor = shapes["base-compliance:null", "tilt"]
    models = [[Weighted(knees[0], 0.3, 1.0), Weighted(knees[1], 0.7, 1.0)], [Weighted(floor, 1.0, 1.0)]]
    found = fitted(result.linear, result.linear.used, models, 1.0)
    found = [replace(fit, theta=np.abs(fit.theta)) for fit in found]  # what is negative is written as nothing
    both = replace(result, fits=tuple(found))
    robot = parse_robot(robot_to_yaml(extended(both)))
    play, tilt = robot.effects
    written = [(part.shape, part.weight) for part in play.each]
    assert written == [("flank within 0.03", 0.7), ("flank within 0.005", 0.3)]
    assert (tilt.effect, tilt.shape) == ("base-compliance", "tilt")
    rows = any_rows("displacement", 4)
    after = both.predict_shift(rows)[1]
    near, change = at_rows(both.linear, rows), sum(one.weight * one.compliance for one in both.fits)
    expected = after - near.predicted - near.tangent @ change
    np.testing.assert_allclose(effects_displacement(robot, rows), expected, rtol=0, atol=1e-14)


def test_what_the_noise_made_negative_is_written_as_nothing() -> None:
    """The arm lies flat: nothing turns the floor about x but noise."""
    result = diagnosed("backlash")
    known = build_library(result.linear, whiten(result.linear)).hypotheses
    floor = next(one for one in known if (one.effect, one.shape.name) == ("base-compliance", "rotation"))
    (fit,) = fitted(result.linear, result.linear.used, [[Weighted(floor, 1.0, 1.0)]], 1.0)
    assert (fit.theta < 0).any()
    (written,) = extended(replace(result, fits=(fit,))).effects
    values = np.array([float(str(value).split()[0]) for value in written.parameters.values()])
    np.testing.assert_allclose(values, np.maximum(fit.theta * floor.sizes, 0.0), rtol=1e-12)


def test_no_compliance_becomes_negative() -> None:
    result = diagnosed("backlash")
    (first, *others) = result.fits
    none_left = -1.5 / result.linear.robot.parameter("J1.torsional")
    fits = (replace(first, compliance=np.array([none_left / first.weight, 0.0])), *others)
    robot = extended(replace(result, fits=fits))
    # the best fit beside the effects, which is inside the bounds here
    np.testing.assert_allclose(
        [robot.parameter(name) for name in robot.identify], STIFFNESS * [1.2, 0.8], rtol=0.01
    )


def any_rows(kind: str, seed: int) -> Measurements:
    """Return rows with all that a table can hold."""
    rng = np.random.default_rng(seed)
    q, wrench = campaign(seed, poses=6, loads=4)
    wrench[:, 3:] = rng.uniform(-100, 100, (24, 3))
    common: dict[str, Any] = {
        "wrench": wrench,
        "step": np.tile([1, 2, 3, 4], 6),
        "time": 100.0 * (seed + 1) + np.arange(24) * 30.0,
        "temperature": rng.uniform(20, 30, 24),
        "tcp": "tip",
    }
    if kind == "absolute":
        return make_measurements(["q1", "q2"], q, position=rng.uniform(-1, 1, (24, 3)), **common)
    return make_measurements(["q1", "q2"], q, displacement=1e-3 * rng.standard_normal((24, 6)), **common)


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
@pytest.mark.parametrize("effect", EFFECTS)
def test_every_shape_means_the_same_without_the_rows_it_was_fitted_to(effect: str, kind: str) -> None:
    """All shapes of a component at once, each of other sizes: the robot is written, read and asked."""
    fitted, rows = any_rows(kind, 0), any_rows(kind, 5)
    fit = fit_baseline(elbow(), fitted)
    there = at_rows(fit, rows)
    rng = np.random.default_rng(3)
    law = EFFECTS[effect]
    for component in law.components(fit):
        shapes, expected = law.shapes(there, component), np.zeros((len(rows), 6))
        every: dict[str, AddedEffect] = {}
        for shape in shapes[:: max(len(shapes) // 6, 1)] + shapes[-1:]:
            if all(item.posture_specific for item in shape.parameters) or shape.name in every:
                continue  # of the campaign alone: no part of a robot
            values = rng.uniform(-1, 1, len(shape.parameters)) * [item.size for item in shape.parameters]
            values[[item.posture_specific for item in shape.parameters]] = 0.0
            values = np.where([item.positive for item in shape.parameters], np.abs(values), values)
            sizes = zip((item.name for item in shape.parameters), values.tolist(), strict=True)
            every[shape.name] = AddedEffect(
                effect=effect,
                component=component,
                shape=shape.name,
                parameters={name: value for name, value in sizes if value},
                scales=needed_scales(shape, law.scales(fit, component)),
            )
            expected += shape.columns @ values
        robot = fit.robot.model_copy(update={"effects": tuple(every.values())})
        robot = parse_robot(robot_to_yaml(robot))
        found = effects_displacement(robot, rows)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max(initial=1e-12))
        np.testing.assert_allclose(
            predict(robot, rows), there.predicted + expected, rtol=0, atol=1e-9 * np.abs(expected).max()
        )


BACKLASH = {
    "effect": "backlash",
    "component": "q2",
    "shape": "flank within 0.03",
    "parameters": {"half_width": "0.2 mrad"},
    "scales": {"torque": 700.0},
}


def test_an_effect_written_by_hand() -> None:
    robot = elbow().model_copy(update={"effects": (AddedEffect(**BACKLASH),)})
    q, wrench = campaign(0)
    rows = read(q, wrench, 0 * wrench[:, :3], 0)
    lever = levers(q)
    torque = np.einsum("na,na->n", lever[:, :, 1], wrench[:, :3])
    by_hand = lever[:, :, 1] * (2e-4 * np.tanh(torque / (0.03 * 700.0)))[:, None]
    np.testing.assert_allclose(effects_displacement(robot, rows)[:, :3], by_hand, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"effect": "backlasch"}, r"effects\[0\] \(backlasch\): unknown effect .*did you mean 'backlash'"),
        ({"component": "q3"}, "unknown component 'q3'; known: q1, q2"),
        ({"component": None}, "component: is missing, expected one of q1, q2"),
        ({"effect": "base-compliance"}, "component 'q2': it is of the machine as a whole"),
        ({"effect": "joint-compliance"}, "component 'q2': this robot has no place for it"),
        ({"shape": "flank within 0.04"}, "unknown shape .*did you mean 'flank within 0.03'"),
        ({"parameters": {"width": 1e-4}}, "unknown parameter 'width' .*did you mean 'half_width'"),
        (
            {"parameters": {"half_width": "0.2 mm"}},
            "parameters.half_width: found the unit 'mm', expected .*rad",
        ),
        ({"parameters": {"half_width": -1e-4}}, "half_width: found -0.0001, expected nothing negative"),
        ({"parameters": {"half_width": 30.0}}, "half_width: found 30.0, expected at most 1 rad"),
        ({"scales": {}}, "scales: torque missing"),
        ({"scales": {"torque": (1.0, 2.0)}}, "scales.torque: found .*expected a number"),
        ({"scales": {"torque": 0.0}}, "scales.torque: found 0.0, expected a positive number"),
        ({"scales": {"torque": 1.0, "torgue": 1.0}}, "unknown scale 'torgue'"),
    ],
)
def test_what_the_library_does_not_know_is_refused(change: dict[str, Any], message: str) -> None:
    robot = elbow().model_copy(update={"effects": (AddedEffect(**(BACKLASH | change)),)})
    q, wrench = campaign(0)
    rows = read(q, wrench, 0 * wrench[:, :3], 0)
    with np.errstate(all="ignore"), pytest.raises(BeamstiffError, match=message):
        predict(robot, rows)


def test_a_payload_does_not_show_in_differences_and_is_checked_all_the_same() -> None:
    for shape in ("mass", "mast"):
        payload = added("payload-error", shape, mass="3 kg")
        robot = elbow().model_copy(update={"effects": (payload,)})
        if shape == "mass":
            assert not effects_displacement(robot, any_rows("displacement", 0)).any()
    with pytest.raises(BeamstiffError, match=r"unknown shape 'mast' .*did you mean 'mass'"):
        effects_displacement(robot, any_rows("displacement", 0))


def test_an_effect_stands_in_the_file_once() -> None:
    play = AddedEffect(**BACKLASH)
    twice = elbow().model_copy(update={"effects": (play, play)})
    with pytest.raises(BeamstiffError, match=r"effects\[1\] \(backlash\): shape .* stands there before"):
        effects_displacement(twice, any_rows("displacement", 0))


def test_of_several_shapes_only_the_sum_cannot_be_negative() -> None:
    one = AddedEffect(**BACKLASH)
    other = one.model_copy(update={"shape": "flank within 0.1", "parameters": {"half_width": -5e-5}})
    both = elbow().model_copy(update={"effects": (one, other)})
    assert effects_displacement(both, any_rows("displacement", 0)).any()


def test_what_is_known_of_two_parameters_together_outlasts_their_rounding() -> None:
    sizes = {"sine_1": "21.523471 mrad", "cosine_1": "-21.487652 mrad"}  # each known by itself to 5 mrad
    spread = dict.fromkeys(sizes, "5.0 mrad")
    curve = AddedEffect(effect="angle-curve", component="q2", shape="order 1", parameters=sizes, std=spread)
    short = rounded(curve).parameters
    assert all(len(str(short[name])) < len(size) for name, size in sizes.items())
    total = sum(float(str(value).split()[0]) for value in short.values())
    assert total == pytest.approx(21.523471 - 21.487652, abs=1e-4)


def test_a_floor_gives_way_under_the_payload_that_the_file_does_not_know() -> None:
    mass, gravity = 30.0, 9.81
    q, _ = campaign(3, poses=9, loads=1)
    tip = np.cross(levers(q)[:, :, 0], [0.0, 0.0, 1.0])
    floor = added("base-compliance", "tilt", tilting_compliance=TILT)
    payload = added("payload-error", "mass", mass=mass)
    rows = make_measurements(["q1", "q2"], q, tcp="tip", position=np.zeros((len(q), 3)))
    turned = TILT * np.cross(tip, [0.0, 0.0, -mass * gravity])
    for effects in ((floor, payload), (payload, floor)):
        moved = effects_displacement(elbow().model_copy(update={"effects": effects}), rows)
        np.testing.assert_allclose(moved[:, :3], np.cross(turned, tip), rtol=1e-6, atol=1e-12)


def test_a_floor_gives_way_under_the_force_that_acts_and_not_that_which_a_cell_says() -> None:
    q, wrench = campaign(4, poses=9, loads=3)
    tip = np.cross(levers(q)[:, :, 0], [0.0, 0.0, 1.0])
    gain = {f"gain_{axis}": 0.1 for axis in "xyz"}
    effects = (
        added("base-compliance", "tilt", tilting_compliance=TILT),
        added("load-error", "gain by axis", {"force": 900.0}, **gain),
    )
    rows = make_measurements(["q1", "q2"], q, tcp="tip", wrench=wrench, displacement=np.zeros((len(q), 3)))
    moved, cell = (
        effects_displacement(elbow().model_copy(update={"effects": some}), rows)[:, :3]
        for some in (effects, effects[1:])
    )
    turned = 1.1 * TILT * np.cross(tip, wrench[:, :3]) * [1, 1, 0]
    np.testing.assert_allclose(moved - cell, np.cross(turned, tip), rtol=1e-6, atol=1e-12)
