"""A dead zone of one joint, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.torque_laws import axis_at
from beamstiff.diagnosis.inference.evidence import NoisePrior, evidence
from beamstiff.diagnosis.inference.library import build_library
from beamstiff.diagnosis.residual.whitened import whiten
from tests.diagnosis.hypotheses import of_any_sign
from tests.diagnosis.machines import FORE, POSITION, close, elbow, kr240, nominal, rows_of, shape_of

SIDEWAYS = np.array([0.0, 1.0, 0, 0, 0, 0])  # of the straight arm along x: turns the elbow by FORE a newton
STEP = np.array([0.0, FORE, 0, 0, 0, 1.0])  # what the tip does per radian of the elbow


@pytest.mark.parametrize("shape", ["flank within 0.005", "flank within 0.03", "flank within 0.1"])
def test_a_torque_beyond_the_flank_moves_the_joint_by_half_the_zone_to_its_side(shape: str) -> None:
    rows = rows_of(elbow(), [0, 0], np.array([1000, -1000, 600, -600])[:, None] * SIDEWAYS)
    found = shape_of(nominal(elbow(), rows), "backlash", "q2", shape).columns[..., 0]
    close(found, np.array([1, -1, 1, -1])[:, None] * STEP, 1e-4)


def test_a_drive_that_is_rigid_in_the_file_has_play_all_the_same() -> None:
    machine = elbow(torsional="rigid")
    rows = rows_of(machine, [0, 0], np.array([1000, -1000])[:, None] * SIDEWAYS)
    there = nominal(machine, rows)
    assert "q2" in EFFECTS["backlash"].components(there)
    found = shape_of(there, "backlash", "q2", "flank within 0.03").columns[..., 0]
    close(found, np.array([1, -1])[:, None] * STEP, 1e-4)


def test_a_drive_that_rests_off_the_middle_of_its_play_goes_farther_to_one_flank() -> None:
    rows = rows_of(elbow(), [0, 0], np.array([1000, -1000])[:, None] * SIDEWAYS)
    found = shape_of(nominal(elbow(), rows), "backlash", "q2", "flank within 0.03, asymmetric")
    close(found.columns @ [2e-4, 4e-4], np.array([2e-4, -4e-4])[:, None] * STEP, 1e-4)


def test_a_soft_stage_is_wound_up_to_its_stop() -> None:
    share = np.array([1.0, 0.05, -0.025, -0.6])
    there = nominal(elbow(), rows_of(elbow(), [0, 0], 1000 * share[:, None] * SIDEWAYS))
    found = shape_of(there, "backlash", "q2", "straight flank within 0.1, asymmetric")
    usual = axis_at(there, "q2").typical / (1000 * FORE)  # a tenth of which is the way to the stop
    wound = np.clip(share / (0.1 * usual), -1, 1)
    expected = np.where(wound > 0, 2e-4, 4e-4) * wound
    close(found.columns @ [2e-4, 4e-4], expected[:, None] * STEP, 1e-4)


def test_about_zero_torque_the_flank_is_steep() -> None:
    torque = np.array([1000.0, 5.0, -5.0, 2.0])
    rows = rows_of(elbow(), [0, 0], torque[:, None] / FORE * SIDEWAYS)
    found = shape_of(nominal(elbow(), rows), "backlash", "q2", "flank within 0.005").columns[:, 5, 0]
    assert found == pytest.approx(np.tanh(torque / 5), rel=1e-9)


def test_weight_that_presses_on_one_flank_hides_it_from_displacements() -> None:
    pressed = elbow(mass=500.0, gravity=(0.0, -9.81, 0.0))  # 3.9 kN m about the elbow
    rows = rows_of(pressed, [0, 0], np.array([2000, -2000, 1000, -1000])[:, None] * SIDEWAYS)
    shape = shape_of(nominal(pressed, rows), "backlash", "q2", "flank within 0.03")
    np.testing.assert_allclose(shape.columns, 0, atol=1e-9)


def test_a_load_that_lifts_the_weight_crosses_the_whole_zone() -> None:
    pressed = elbow(mass=50.0, gravity=(0.0, -9.81, 0.0))
    rows = rows_of(pressed, [0, 0], np.array([2000, -2000])[:, None] * SIDEWAYS)
    shape = shape_of(nominal(pressed, rows), "backlash", "q2", "flank within 0.03")
    close(shape.columns[..., 0], np.array([2, 0])[:, None] * STEP, 1e-4)


def test_a_joint_whose_torque_is_only_rounding_shows_none_of_it() -> None:
    """In the plane of its arm the KR240-2 turns neither its base nor its wrist."""
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (12, 6)) * [0, 1, 1, 0, 1, 0] + [0, 1.2, -1.2, 0, 0, 0]
    force = np.random.default_rng(2).uniform(-900, 900, (12, 6)) * [1, 0, 1, 0, 0, 0]
    there = nominal(kr240(), rows_of(kr240(), q, force))
    for joint in ("q1", "q4", "q6"):
        assert not axis_at(there, joint).load.any()
        for shape in EFFECTS["backlash"].shapes(there, joint):
            assert not shape.columns.any()
    assert axis_at(there, "q2").load.all()
    # nor is anything of their stiffness known
    assert there.tangent.any(axis=(0, 1)).tolist() == [False, True, True, False, True, False]


def test_an_uneven_wheel_has_another_zone_at_another_angle() -> None:
    q = np.array([[0.0, 0.3], [0.0, 1.9], [0.0, -2.2]])
    rows = rows_of(elbow(), q, np.tile(1000 * SIDEWAYS, (3, 1)))
    there = nominal(elbow(), rows)
    even = shape_of(there, "backlash", "q2", "flank within 0.03").columns[..., 0]
    turning = shape_of(there, "backlash", "q2", "flank within 0.03, by the angle").columns
    wave = 3e-5 * np.cos(q[:, 1]) - 4e-5 * np.sin(q[:, 1])
    close(turning @ [2e-4, 3e-5, -4e-5], (2e-4 + wave - wave.mean())[:, None] * even)


def test_no_zone_that_follows_the_angle_makes_up_for_one_below_nothing() -> None:
    """Over few degrees waves could be a level of their own; a drive that softens is no play."""
    rng = np.random.default_rng(3)
    q = np.column_stack([np.zeros(60), rng.uniform(0.4, 0.8, 60)])
    force = rng.uniform(-2000, 2000, 60)[:, None] * SIDEWAYS
    there = nominal(elbow(), rows_of(elbow(), q, force, sigma_position=POSITION))
    less = -2e-4 * shape_of(there, "backlash", "q2", "flank within 0.03").columns[..., 0]
    noise = POSITION * rng.standard_normal((60, 3))
    measured = replace(there, measured=there.predicted + less + np.pad(noise, ((0, 0), (0, 3))))
    white = whiten(measured)
    own = [one for one in build_library(measured, white).hypotheses if one.effect == "backlash"]
    found, freely = (
        evidence(white, some, NoisePrior(np.ones(1), np.zeros(1)))
        for some in (own, [of_any_sign(one) for one in own])
    )
    assert max(freely.hypotheses) > found.none + 300
    assert max(found.hypotheses) < found.none + 60


def test_each_side_may_have_flanks_of_its_own() -> None:
    rows = rows_of(elbow(), [0, 0], np.array([1000, -1000])[:, None] * SIDEWAYS)
    name = "flanks one after another, other ones to each side"
    shape = shape_of(nominal(elbow(), rows), "backlash", "q2", name)
    width = [item.name for item in shape.parameters].index("width_0.03_up")
    close(shape.columns[..., width], np.array([1, 0])[:, None] * STEP, 1e-4)
    close(shape.columns[..., width + 1], np.array([0, -1])[:, None] * STEP, 1e-4)
