from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.whitened import LARGE, Whitened, whiten
from beamstiff.se3 import Array
from tests.diagnosis.machines import cycles, elbow, nominal


def baseline(poses: int = 4, loads: int = 3, shared: bool = False, without: int = 2) -> Baseline:
    """Return a campaign with a few values missing."""
    robot = elbow(tilting=1e6)
    rows = cycles(robot, poses, np.linspace(0.4, 1, loads), shared_unloaded=shared)
    found = nominal(robot, rows)
    used = found.used.copy()
    used[np.arange(without), np.arange(without) + 1] = False
    return replace(found, used=used)


def covariance(found: Baseline) -> Array:
    """Return the covariance of the used values, dense: half of it shared where a reading is."""
    sigma = found.sigma[found.used]
    row, component = np.nonzero(found.used)
    pose = found.rows.pose[row]
    together = np.eye(sigma.size)
    if found.rows.shared_unloaded:
        same = (pose[:, None] == pose) & (component[:, None] == component)
        together = 0.5 * (together + same)
    return together * np.outer(sigma, sigma)


def matrix(white: Whitened) -> Array:
    """Return the matrix (n, n) by which values become whitened ones."""
    columns = np.zeros((*white.used.shape, int(white.used.sum())))
    columns[white.used] = np.eye(columns.shape[-1])
    return white.whiten(columns)


@pytest.mark.parametrize("shared", [False, True], ids=["independent", "shared reading"])
def test_noise_becomes_white(shared: bool) -> None:
    found = baseline(shared=shared)
    W = matrix(whiten(found))
    np.testing.assert_allclose(W @ covariance(found) @ W.T, np.eye(len(W)), atol=1e-10)


def unknown_covariance(found: Baseline) -> Array:
    """Return the covariance of a displacement nobody thought of, by what the module says of it."""
    rows = found.rows
    acts = np.abs(rows.wrench).max(axis=0) > 0
    load = rows.wrench[:, acts] / np.sqrt((rows.wrench[:, acts] ** 2).mean(axis=0))
    size = np.linalg.norm(load, axis=1) / np.linalg.norm(load, axis=1).max()
    row, component = np.nonzero(found.used)
    result = np.zeros((row.size, row.size))
    for i, (a, p) in enumerate(zip(row, component, strict=True)):
        for j, (b, q) in enumerate(zip(row, component, strict=True)):
            if p == q:
                near = np.exp(-0.5 * ((rows.q[a] - rows.q[b]) ** 2).sum())
                posture = 0.5 * near + 0.5 * (rows.pose[a] == rows.pose[b])
                grows = 0.3**2 + load[a] @ load[b] * (1 + 0.5**2 * size[a] * size[b])
                result[i, j] = posture * grows * (1.0 if p < 3 else 1 / 0.7**2)
    return result


@pytest.mark.parametrize("shared", [False, True], ids=["independent", "shared reading"])
def test_the_unknown_is_diagonal_in_the_same_axes(shared: bool) -> None:
    found = baseline(shared=shared)
    white = whiten(found)
    W = matrix(white)
    turned = W @ unknown_covariance(found) @ W.T
    turned /= np.trace(turned) / len(turned)
    np.testing.assert_allclose(turned, np.diag(white.unknown), atol=1e-10)
    assert white.unknown.mean() == pytest.approx(1)


def test_rounding_does_not_turn_the_axes() -> None:
    """Axes of one variance could be any: of rows in one posture more than kinds of loads have none."""
    found = baseline(loads=6, shared=True)
    sigma = found.sigma * (1.0 + 1e-13 * np.random.default_rng(0).standard_normal(found.sigma.shape))
    one, other = whiten(found), whiten(replace(found, sigma=sigma))
    assert (one.unknown < 1e-9).sum() > 10
    along = (matrix(one) @ np.linalg.inv(matrix(other))) ** 2  # whichever way each axis points
    np.testing.assert_allclose(along, np.eye(len(along)), atol=1e-6)


def test_each_whitened_value_is_of_one_component() -> None:
    white = whiten(baseline())
    component = np.nonzero(white.used)[1]
    for at, row in enumerate(matrix(white)):
        assert set(component[np.abs(row) > 0]) == {white.component[at]}


def test_turning_back_is_the_transpose() -> None:
    white = whiten(baseline(shared=True))
    values = np.random.default_rng(0).standard_normal((int(white.used.sum()), 2))
    np.testing.assert_allclose(white.adjoint(values), matrix(white).T @ values, atol=1e-6)


def test_the_fit_leaves_nothing_of_the_tangent_and_all_that_is_across_it() -> None:
    found = baseline()
    white = whiten(found)
    tangent = white.whiten(found.tangent)
    np.testing.assert_allclose(white.project_out(tangent) / np.linalg.norm(tangent), 0, atol=1e-12)
    left = white.project_out(np.random.default_rng(1).standard_normal((white.gap.size, 3)))
    np.testing.assert_allclose(white.project_out(left), left, atol=1e-12)
    np.testing.assert_allclose(left.T @ tangent / np.linalg.norm(tangent), 0, atol=1e-10)
    assert white.freedom == found.used.sum() - 2


def test_a_parameter_that_does_nothing_costs_no_freedom() -> None:
    found = baseline()
    idle = np.concatenate([found.tangent, np.zeros_like(found.tangent), found.tangent], axis=-1)
    assert whiten(replace(found, tangent=idle)).freedom == whiten(found).freedom


def test_what_is_fitted_beside_is_left_out_as_well() -> None:
    white = whiten(baseline())
    columns = np.random.default_rng(2).standard_normal((white.gap.size, 2))
    beside = white.with_fitted(columns)
    np.testing.assert_allclose(beside.project_out(columns), 0, atol=1e-10)
    assert beside.freedom == white.freedom - 2
    assert white.with_fitted(white.tangent).freedom == white.freedom


def test_values_left_out_are_as_good_as_never_measured() -> None:
    found = baseline(without=0)
    chosen = np.ones_like(found.used)
    chosen[3] = False
    left_out, never = whiten(found, chosen), whiten(replace(found, used=found.used & chosen))
    np.testing.assert_allclose(left_out.gap, never.gap)
    assert left_out.gap.size == found.used.sum() - 6


def test_many_rows_are_taken_posture_by_posture_and_noise_is_white_all_the_same() -> None:
    found = baseline(poses=LARGE // 20 + 1, loads=20, shared=True)
    white = whiten(found)
    assert sum(len(at) for at, _ in white.axes) == 6 * (LARGE // 20 + 1)
    some = np.random.default_rng(3).standard_normal((int(white.used.sum()), 4))
    back = white.adjoint(some)  # W^T x; its covariance is the product x^T x
    np.testing.assert_allclose(back.T @ (covariance(found) @ back), some.T @ some, rtol=1e-9, atol=1e-9)
