"""Covariances and intervals against dense generalised least squares, which is exact for a serial robot."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from beamstiff import BeamstiffError
from beamstiff.identification.identify import estimate, identify
from beamstiff.identification.information import Profile
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import build_identification
from beamstiff.identification.whitening import Disturbance, disturbed_covariance, inverse_root
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.identification.campaigns import (
    compliances,
    kr240,
    least_squares,
    measured,
    rows,
    sensitivities,
    shared_covariance,
    white,
)

ROBOT = kr240()
NORMAL = stats.norm.ppf(0.975)


def diagonal(table) -> np.ndarray:
    return np.diag(np.tile(np.repeat([3e-5, 5e-5], 3), len(table)) ** 2)


def test_values_and_covariance_are_those_of_least_squares_in_the_compliances() -> None:
    table = rows(ROBOT, 12)
    table = measured(ROBOT, table, 0.9 * white(table, 1))
    a = sensitivities(ROBOT, table).reshape(-1, 6)
    expected, covariance, squares = least_squares(a, table.displacement.ravel(), diagonal(table))
    found = identify(ROBOT, table)
    assert squares / (72 - 6) < 1
    assert found.chi_square == pytest.approx(squares / (72 - 6), rel=1e-9)
    np.testing.assert_allclose(1 / found.stiffness, expected, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, covariance / np.outer(expected, expected), rtol=1e-6)
    for item, c, s in zip(found.parameters, expected, np.sqrt(np.diagonal(covariance)), strict=True):
        np.testing.assert_allclose(item.interval, (1 / (c + NORMAL * s), 1 / (c - NORMAL * s)), rtol=1e-6)


def test_rows_that_share_an_unloaded_reading_weigh_as_their_dense_covariance() -> None:
    table = rows(ROBOT, 6, 3, shared=True)
    table = measured(ROBOT, table, white(table, 2))
    a = sensitivities(ROBOT, table).reshape(-1, 6)
    expected, covariance, squares = least_squares(a, table.displacement.ravel(), shared_covariance(table))
    found = identify(ROBOT, table)
    np.testing.assert_allclose(1 / found.stiffness, expected, rtol=1e-7)
    factor = max(squares / (108 - 6), 1)
    np.testing.assert_allclose(
        found.covariance, factor * covariance / np.outer(expected, expected), rtol=1e-6
    )


@pytest.mark.parametrize("size", [0.5, 1.02, 3.0])
def test_a_residual_beyond_the_noise_widens_the_intervals(size: float) -> None:
    """The residual is laid exactly outside of what the model can absorb, so that chi square is size^2."""
    table = rows(ROBOT, 5)
    a = sensitivities(ROBOT, table).reshape(-1, 6) / np.tile(np.repeat([3e-5, 5e-5], 3), 5)[:, None]
    rest = np.random.default_rng(3).standard_normal(30)
    rest -= a @ np.linalg.lstsq(a, rest)[0]
    rest *= size * np.sqrt(24) / np.linalg.norm(rest)
    data = measured(ROBOT, table, (rest * np.tile(np.repeat([3e-5, 5e-5], 3), 5)).reshape(5, 6))
    found = identify(ROBOT, data)
    assert found.chi_square == pytest.approx(size**2, rel=1e-8)
    np.testing.assert_allclose(1 / found.stiffness, compliances(ROBOT), rtol=1e-7)
    relative = np.sqrt(np.diagonal(np.linalg.inv(a.T @ a))) / compliances(ROBOT)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance)), max(size, 1) * relative, rtol=1e-6)
    reach = stats.t.ppf(0.975, 24) if size > 2 else NORMAL  # 1.02 is within chance
    item = found.parameters[0]
    assert item.interval[0] == pytest.approx(item.value / (1 + reach * max(size, 1) * relative[0]), rel=1e-6)


def test_noise_that_nobody_states_is_told_by_the_residual() -> None:
    """Positions only, so that joint 6, which passes through the TCP, stays out."""
    table = rows(ROBOT, 8, sigma=False)
    data = measured(ROBOT, table, white(table, 4) + np.repeat([0, np.nan], 3))
    a = sensitivities(ROBOT, data)[:, :3, :5].reshape(-1, 5)
    expected, covariance, squares = least_squares(a, data.displacement[:, :3].ravel(), np.eye(24))
    found = identify(ROBOT, data, ROBOT.identify[:5])
    relative = np.sqrt(np.diagonal(covariance) * squares / 19) / expected
    np.testing.assert_allclose(1 / found.stiffness, expected, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance)), relative, rtol=1e-5)
    low = 1 / (expected * (1 + stats.t.ppf(0.975, 19) * relative))
    np.testing.assert_allclose([item.interval[0] for item in found.parameters], low, rtol=1e-5)


def test_errors_of_loads_and_joint_values_add_what_they_move_to_the_covariance() -> None:
    table = rows(ROBOT, 5, 2)
    errors = InputErrors(load=30.0, force=20.0, moment=5.0, angle=0.004, hold_angle=1e-4)
    statement = build_identification(ROBOT, measured(ROBOT, table), errors=errors)
    c = compliances(ROBOT)

    def displacement(q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        moved = sensitivities(ROBOT, replace(table, q=q, wrench=wrench))
        return moved @ c

    expected = np.kron(np.eye(10), np.diag(np.repeat([3e-5, 5e-5], 3) ** 2))
    size = np.linalg.norm(table.wrench[:, :3], axis=1)[:, None]
    for wrench, spread in [(table.wrench / size, 30.0)] + [
        (np.tile(unit, (10, 1)), 20.0 if at < 3 else 5.0) for at, unit in enumerate(np.eye(6))
    ]:
        moved = spread * displacement(table.q, wrench)
        for row in range(10):
            at = slice(6 * row, 6 * row + 6)
            expected[at, at] += np.outer(moved[row], moved[row])
    kinematics = compile_kinematics(ROBOT)
    jacobian = twist_jacobian(kinematics, posture(kinematics, table.q), ROBOT.tcp)
    for row in range(10):
        at = slice(6 * row, 6 * row + 6)
        expected[at, at] += 1e-8 * jacobian[row] @ jacobian[row].T
    for joint in range(6):
        step = 1e-5 * np.eye(6)[joint]
        moved = displacement(table.q + step, table.wrench) - displacement(table.q - step, table.wrench)
        moved *= 0.004 / 2e-5
        for pose in np.unique(table.pose):
            at = (table.pose == pose)[:, None] * np.ones(6)
            expected += np.outer((moved * at).ravel(), (moved * at).ravel())
    white_ = statement.problem.whitening.toarray()
    np.testing.assert_allclose(white_ @ expected @ white_.T, np.eye(60), atol=2e-6)


def test_a_drive_that_does_not_hold_counts_by_itself_too() -> None:
    statement = build_identification(
        ROBOT, measured(ROBOT, rows(ROBOT, 4)), errors=InputErrors(hold_angle=1e-4)
    )
    disturbance = statement.problem.disturbance
    assert np.abs(disturbance.own).max() > 1e-4
    assert not disturbance.common.any()


def test_errors_of_the_inputs_need_the_noise_of_the_readings() -> None:
    table = measured(ROBOT, rows(ROBOT, 8, sigma=False))
    with pytest.raises(BeamstiffError, match="sigma_position"):
        identify(ROBOT, table, components="position", errors=InputErrors(load=1.0))
    with pytest.raises(BeamstiffError, match=r"angle = -1"):
        InputErrors(angle=-1.0)


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
@settings(max_examples=40)
def test_whitening_makes_any_covariance_one(seed: int, shared: bool, common: bool) -> None:
    random = np.random.default_rng(seed)
    n = 7
    used = random.random((n, 6)) < 0.7
    used[0] = True
    pose = random.integers(0, 3, n)
    sharing = np.where(random.random(n) < 0.6, random.integers(0, 2, n), -1) if shared else np.full(n, -1)
    sigma = random.uniform(0.5, 2, (n, 6))
    own = random.normal(size=(n, 6, 2))
    moved = random.normal(size=(n, 6, 3)) * common
    row, component = np.nonzero(used)
    same = (sharing[row] >= 0)[:, None] & (sharing[row][:, None] == sharing[row])
    same &= component[:, None] == component
    reading = np.where(same, 0.5 * (1 + np.eye(len(row))), np.eye(len(row)))
    dense = np.outer(sigma[used], sigma[used]) * reading
    dense += (row[:, None] == row) * (own[used] @ own[used].T)
    dense += (pose[row][:, None] == pose[row]) * (moved[used] @ moved[used].T)
    blocks = disturbed_covariance(sigma, used, sharing, pose, Disturbance(own, moved))
    root = inverse_root(blocks).toarray()
    np.testing.assert_allclose(root @ dense @ root.T, np.eye(len(row)), atol=1e-9)


@pytest.mark.parametrize("bad", [0.0, 0.1])
def test_robust_losses_tell_the_scatter_that_they_have(bad: float) -> None:
    """Standard deviations under Huber's loss against the scatter of 400 refits, mean of the joints."""
    table = rows(ROBOT, 40)
    clean = measured(ROBOT, table)
    statement = build_identification(ROBOT, clean, loss="huber")
    begin = statement.parameters.begin
    random = np.random.default_rng(5)
    told, found = [], []
    for _ in range(400):
        noise = random.standard_normal((40, 6)) * np.repeat([3e-5, 5e-5], 3)
        noise *= np.where(random.random((40, 6)) < bad, 5.0, 1.0)
        again = statement.measuring(clean.displacement + noise)
        theta = refit(again.objective, begin)
        found.append(theta)
        told.append(np.sqrt(np.diagonal(estimate(again, theta).covariance)))
    ratio = np.mean(told, axis=0) / np.std(found, axis=0)
    assert ratio.mean() == pytest.approx(1, abs=0.05)


def brute_force(profile: Profile, at: int) -> tuple[float, float]:
    """Return the profile interval of the compliance `at` of two, by a grid."""
    axis = np.linspace(0, 8, 1201)
    x = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    away = x - 1
    q = np.einsum("abi,ij,abj->ab", away, profile.information, away) + 2 * away @ profile.gradient
    best = q.min(axis=1 - at)
    inside = axis[best - q.min() <= profile.quantile**2]
    return float(inside[0]) - 1, float(inside[-1]) - 1


@pytest.mark.parametrize("correlation", [-0.9, 0.3, 0.8])
@pytest.mark.parametrize("near", [0.3, 1.0, 5.0])
def test_profile_intervals_agree_with_a_grid(correlation: float, near: float) -> None:
    spread = np.array([1 / near, 0.4])
    covariance = np.outer(spread, spread) * np.array([[1, correlation], [correlation, 1]])
    information = np.linalg.inv(covariance)
    free = np.zeros(2)
    profile = Profile(information, free, np.zeros(2), np.full(2, 1e16), 1.96)
    for at in range(2):
        low, high = profile.interval(np.eye(2)[at], float(spread[at]))
        expected = brute_force(profile, at)
        assert max(low, -1.0) == pytest.approx(expected[0], abs=1e-2)
        assert min(high, 7.0) == pytest.approx(expected[1], abs=1e-2)


def test_beside_a_bound_that_holds_intervals_keep_their_promise() -> None:
    """A spring as good as rigid, its compliance stopped at zero: the other's interval holds in 95 %."""
    random = np.random.default_rng(6)
    spread = np.array([1.0, 0.2])
    covariance = np.outer(spread, spread) * np.array([[1, -0.85], [-0.85, 1]])
    information, root = np.linalg.inv(covariance), np.linalg.cholesky(covariance)
    held = plain = 0
    for _ in range(800):
        free = np.array([0.0, 1.0]) + root @ random.standard_normal(2)
        found = free.copy()
        if free[0] < 0:
            found = np.array([0.0, free[1] - covariance[0, 1] / covariance[0, 0] * free[0]])
        low = np.array([-found[0] + 1, 0.0]) * [1, 1]  # x counts from the optimum, where it is 1
        profile = Profile(information, information @ (found - free), low, np.full(2, np.inf), 1.96)
        down, up = profile.interval(np.array([0.0, 1.0]), 0.2)
        held += found[1] + down <= 1.0 <= found[1] + up
        plain += abs(found[1] - 1.0) <= 1.96 * 0.2
    assert held / 800 == pytest.approx(0.95, abs=0.015)
    assert plain / 800 > 0.965


def test_results_are_labelled_by_parameter() -> None:
    table = measured(ROBOT, rows(ROBOT, 6), white(rows(ROBOT, 6), 7))
    found = identify(ROBOT, table)
    frame, covariance = found.to_frame(), found.covariance_frame()
    assert list(frame.index) == list(covariance.columns) == list(covariance.index) == list(ROBOT.identify)
    item = found["J3.torsional"]
    assert frame.loc["J3.torsional", ["low", "high"]].tolist() == list(item.interval)
    assert covariance.loc["J3.torsional", "J3.torsional"] == pytest.approx((item.std / item.value) ** 2)
    assert found.held_out.rms == found.rms_held_out
    with pytest.raises(BeamstiffError, match=r"'J3.tilting' was not identified"):
        found["J3.tilting"]
