"""Least squares without negative parameters, against every set of zeros tried by itself."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import non_negative as module
from beamstiff.non_negative import non_negative

whole = st.integers(-4, 4).map(float)


def least(matrix: np.ndarray, right: np.ndarray) -> float:
    """Return the least norm over all sets of parameters that are not zero."""
    norms = [float(np.linalg.norm(right))]
    for used in product((False, True), repeat=matrix.shape[1]):
        columns = matrix[:, np.array(used)]
        if columns.shape[1] and np.linalg.matrix_rank(columns) == columns.shape[1]:
            x = np.linalg.lstsq(columns, right, rcond=None)[0]
            if (x >= 0.0).all():
                norms.append(float(np.linalg.norm(right - columns @ x)))
    return min(norms)


@given(st.lists(st.lists(whole, min_size=5, max_size=5), min_size=1, max_size=5))
def test_no_set_of_zeros_leaves_less(rows: list[list[float]]) -> None:
    table = np.array(rows)
    x, norm = non_negative(table[:, :4], table[:, 4])
    assert (x >= 0.0).all()
    assert norm == pytest.approx(least(table[:, :4], table[:, 4]), abs=1e-9)
    assert norm == pytest.approx(np.linalg.norm(table[:, 4] - table[:, :4] @ x))


def test_a_problem_that_scipy_1_17_does_not_solve() -> None:
    """Its `nnls` leaves 2.83 there and says 0; 1.91 is the least."""
    matrix = np.array([[0.0, -4, -4, 3], [2, -2, -1, -1], [-2, 1, 0, 0]])
    right = np.array([-3.0, 0, 2])
    assert non_negative(matrix, right)[1] == pytest.approx(least(matrix, right), abs=1e-9)


@pytest.mark.parametrize("goes_round", [False, True])
def test_where_the_first_method_fails_the_second_one_answers(
    goes_round: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, float]:
        if goes_round:
            raise RuntimeError("Maximum number of iterations reached.")
        return np.full(matrix.shape[1], 7.0), 0.0

    monkeypatch.setattr(module, "nnls", fails)
    rng = np.random.default_rng(0)
    matrix, right = rng.standard_normal((6, 4)), rng.standard_normal(6)
    assert non_negative(matrix, right)[1] == pytest.approx(least(matrix, right), rel=1e-12)
