"""Compliances that give back no more work than was done on them.

Truth: the same least squares in another formulation: a compliance written as ``L L^T``, from many starts.
"""

import numpy as np
import pytest
from scipy.optimize import least_squares

from beamstiff.diagnosis.decomposition.passive import matrix_of, passive
from beamstiff.se3 import Array

PAIRS = ((0, 1), (0, 2), (1, 2))
COUPLINGS = np.array([(3 + number, a, b) for number, (a, b) in enumerate(PAIRS)])
POSITIVE = np.array([True, True, True, False, False, False, True, False])
MATRIX = matrix_of(COUPLINGS, np.ones(8), np.ones(8))


def problem(seed: int) -> tuple[Array, Array]:
    """Return a triangle and right side of 8 parameters: a compliance, a positive one, and any other."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((40, 8))
    basis, triangle = np.linalg.qr(columns)
    return triangle, basis.T @ (columns @ rng.standard_normal(8) + 0.1 * rng.standard_normal(40))


def parameters(factor: Array) -> Array:
    lower = np.zeros((3, 3))
    lower[np.tril_indices(3)] = factor[:6]
    made = lower @ lower.T
    return np.array([*np.diag(made), *(made[pair] for pair in PAIRS), factor[6] ** 2, factor[7]])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_least_squares_of_a_compliance_by_its_factor(seed: int) -> None:
    triangle, right = problem(seed)
    rng = np.random.default_rng(seed)
    found = passive(triangle, right, POSITIVE, [MATRIX])
    close = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
    fits = [
        least_squares(lambda at: triangle @ parameters(at) - right, rng.standard_normal(8), **close)
        for _ in range(12)
    ]
    least = min(2.0 * fit.cost for fit in fits)
    left = np.sum((triangle @ found - right) ** 2)
    assert least * (1.0 - 1e-4) < left <= least * (1.0 + 1e-6)  # its factor comes to an end a little earlier
    assert np.linalg.eigvalsh(MATRIX.of(found))[0] >= 0.0
    assert found[6] >= 0.0


def test_what_gives_no_work_away_is_plain_least_squares() -> None:
    triangle, _ = problem(0)
    wanted = np.array([2.0, 3.0, 4.0, 1.0, -1.0, 0.5, 1.0, -7.0])
    np.testing.assert_allclose(passive(triangle, triangle @ wanted, POSITIVE, [MATRIX]), wanted, rtol=1e-9)


def test_parameters_know_their_units() -> None:
    """Of 2 m/N and 8 rad/(N m) what couples them is 4 at most; columns are in other units."""
    units = np.array([1e-3, 1e-6, 10.0])
    matrix = matrix_of(np.array([[2, 0, 1]]), np.array([1e-7, 1e-5, 1.0]), units)
    bound = np.array([2.0, 8.0, 4.0]) / units
    assert np.linalg.eigvalsh(matrix.of(bound))[0] == pytest.approx(0.0, abs=1e-6)
    assert matrix.gives_work_away(bound * [1.0, 1.0, 1.01])
    assert not matrix.gives_work_away(bound * [1.0, 1.0, 0.99])
