"""The five observability indices against their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.planning.observability import observability
from beamstiff.se3 import Array


def test_the_indices_of_a_diagonal_sensitivity_by_hand() -> None:
    found = observability(np.diag([4.0, 2.0, 1.0]))
    assert pytest.approx(2.0 / np.sqrt(3)) == found.O1  # (4*2*1)^(1/3) / sqrt(3)
    assert pytest.approx(0.25) == found.O2
    assert pytest.approx(1.0) == found.O3
    assert pytest.approx(0.25) == found.O4
    assert pytest.approx(1 / 1.75) == found.O5


@given(st.integers(0, 10**6))
def test_relations_between_the_indices_and_the_covariance(seed: int) -> None:
    """Of the information M = S^T S: O1^2 n = det(M)^(1/m), O3^-2 = largest variance of any direction."""
    rng = np.random.default_rng(seed)
    sensitivity = rng.normal(size=(12, 4)) * rng.uniform(0.1, 10, 4)
    found = observability(sensitivity)
    information = sensitivity.T @ sensitivity
    assert pytest.approx(np.linalg.det(information) ** (1 / 4)) == found.O1**2 * 12
    assert pytest.approx(np.linalg.eigvalsh(np.linalg.inv(information))[-1]) == found.O3**-2
    assert pytest.approx(found.O2 * found.O3) == found.O4
    assert found.O3 / 4 <= found.O5 <= found.O3
    # the root of the information says the same
    root = observability(np.linalg.cholesky(information).T, 12)
    for name in ("O1", "O2", "O3", "O4", "O5"):
        assert getattr(root, name) == pytest.approx(getattr(found, name))


def test_twice_the_same_measurements_leave_o1_and_o2_alone() -> None:
    sensitivity = np.random.default_rng(0).normal(size=(8, 3))
    one, two = observability(sensitivity), observability(np.concatenate([sensitivity, sensitivity]))
    assert pytest.approx(one.O1) == two.O1
    assert pytest.approx(one.O2) == two.O2
    assert pytest.approx(np.sqrt(2) * one.O3) == two.O3


def test_what_cannot_be_seen_at_all_has_no_observability() -> None:
    found = observability(np.array([[1.0, 0.0], [2.0, 0.0]]))
    assert (found.O1, found.O2, found.O3, found.O4, found.O5) == (0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("sensitivity", "message"),
    [
        (np.ones((2, 3)), "found 2 components for 3 parameters, too few"),
        (np.array([[np.nan, 1.0], [0, 1]]), "expected a table of finite numbers"),
        (np.ones(3), r"found shape \(3,\), expected a table"),
        (np.ones((0, 0)), "expected a table"),
    ],
)
def test_bad_sensitivities_are_refused(sensitivity: Array, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        observability(sensitivity)
