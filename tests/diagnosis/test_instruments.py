"""Rows that are read along one direction, in identification and diagnosis: a tracker's, told another way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError, identify, load_robot, verify
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.next_measurement.candidates import UNREAD, load_cycles, noise_of
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.measure.instruments import target
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements

ROBOT = load_robot("kr240-2")
AXES = Rotation.random(random_state=3).as_matrix()


def displaced() -> Measurements:
    rng = np.random.default_rng(0)
    low, high = np.array([variable.limits for variable in ROBOT.actuated]).T
    q = np.repeat(rng.uniform(0.5 * low, 0.5 * high, (8, 6)), 3, axis=0)
    wrench = np.hstack([np.tile(800.0 * np.eye(3), (8, 1)), np.zeros((24, 3))])
    rows = make_measurements(
        [variable.name for variable in ROBOT.actuated], q, tcp=ROBOT.tcp, wrench=wrench, sigma_position=2e-5
    )
    moved = predict_displacements(ROBOT, rows)[:, :3] + 2e-5 * rng.standard_normal((24, 3))
    return replace(rows, displacement=np.hstack([moved, np.full((24, 3), np.nan)]))


def by_gauges(rows: Measurements, axes: np.ndarray) -> Measurements:
    count, each = len(rows), len(axes)
    at, along = np.repeat(np.arange(count), each), np.tile(axes, (count, 1))
    read = np.full((count * each, 6), np.nan)
    read[:, 0] = (along * rows.displacement[at, :3]).sum(axis=1)
    return make_measurements(
        rows.variables,
        rows.q[at],
        tcp=ROBOT.tcp,
        wrench=rows.wrench[at],
        displacement=read,
        sigma_position=rows.sigma_position,
        direction=along,
        target=np.tile([f"G{k}" for k in range(each)], count),
        targets=[replace(target(f"G{k}", "gauge", normal=one), sought=()) for k, one in enumerate(axes)],
    )


TRACKED = displaced()
GAUGED = by_gauges(TRACKED, AXES)


def test_three_perpendicular_gauges_identify_what_a_tracker_does() -> None:
    one, other = identify(ROBOT, TRACKED, folds=0), identify(ROBOT, GAUGED, folds=0)
    for a, b in zip(one.parameters, other.parameters, strict=True):
        assert b.value == (None if a.value is None else pytest.approx(a.value, rel=1e-7))
        assert b.std == (None if a.std is None else pytest.approx(a.std, rel=1e-6))


def test_the_gap_and_what_effects_add_are_read_along_the_gauges() -> None:
    one, other = fit_baseline(ROBOT, TRACKED), fit_baseline(ROBOT, GAUGED)
    np.testing.assert_allclose(other.gap[:, 0].reshape(-1, 3), one.gap[:, :3] @ AXES.T, atol=1e-10)
    for effect, component in (("backlash", "q2"), ("link-bending", "link2"), ("load-error", None)):
        for a, b in zip(
            EFFECTS[effect].shapes(one, component), EFFECTS[effect].shapes(other, component), strict=True
        ):
            moved = np.einsum("ij,njc->nic", AXES, a.columns[:, :3])
            size = np.abs(moved).max() or 1.0
            np.testing.assert_allclose(b.columns[:, 0].reshape(moved.shape) / size, moved / size, atol=1e-6)
    first, second = whiten(one), whiten(other)
    assert first.freedom == second.freedom
    assert (second.gap**2).sum() == pytest.approx((first.gap**2).sum(), rel=1e-6)
    # of what nobody thought of: the same covariance, in other axes
    assert np.sort(second.unknown)[-10:] == pytest.approx(np.sort(first.unknown)[-10:], rel=1e-5)


def test_a_vertical_gauge_does_not_see_an_upright_axis() -> None:
    found = identify(ROBOT, by_gauges(TRACKED, np.array([[0.0, 0.0, 1.0]])), folds=0)
    assert found.parameters[0].value is None
    assert found.parameters[1].value is not None


def test_what_is_proposed_is_read_by_the_same_gauges() -> None:
    baseline = fit_baseline(ROBOT, by_gauges(TRACKED, np.eye(3)[2:]))
    rows, _, _ = load_cycles(baseline, 0)
    assert set(rows.target) == {"G0"}
    np.testing.assert_allclose(rows.direction, np.tile([0.0, 0.0, 1.0], (len(rows), 1)))
    noise = noise_of(rows, np.full(3, 1e-5))
    assert (noise[:, 0] == 1e-5).all()
    assert (noise[:, 1:] == UNREAD).all()


def test_what_needs_positions_refuses_such_rows() -> None:
    with pytest.raises(BeamstiffError, match="instrument: verify needs x y z or dx dy dz in every row"):
        verify(ROBOT, GAUGED)
