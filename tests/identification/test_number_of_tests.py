"""Values from the first n tests: those of the tests by themselves; and from how many on they stay."""

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.identification.bootstrap import NumberOfTests, number_of_tests
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import Statement, build_identification
from tests.identification.campaigns import kr240, measured, rows, sensitivities, white

ROBOT = kr240()
SPREAD = np.repeat([3e-5, 5e-5], 3)


def fitted(count: int, loads: int = 1, noise: float = 1.0, **options: bool) -> tuple[Statement, np.ndarray]:
    table = rows(ROBOT, count, loads, **options)
    statement = build_identification(ROBOT, measured(ROBOT, table, noise * white(table, 1)))
    return statement, refit(statement.objective, statement.parameters.begin)


def test_all_tests_give_the_final_value_and_each_n_that_of_some_n_tests() -> None:
    """The two tests of an order that count n = 2 says are one of the 15 pairs there are."""
    statement, theta = fitted(6)
    found = number_of_tests(statement, theta, [2, 6], orders=10)
    np.testing.assert_allclose(found.stiffness[:, -1], np.tile(found.final, (10, 1)), rtol=1e-6)
    table = rows(ROBOT, 6)
    a = sensitivities(ROBOT, table) / SPREAD[:, None]
    y = measured(ROBOT, table, white(table, 1)).displacement / SPREAD
    pairs = [
        1 / np.linalg.lstsq(a[[i, j]].reshape(-1, 6), y[[i, j]].ravel())[0]
        for i in range(6)
        for j in range(i)
    ]
    pairs = np.array([pair for pair in pairs if (pair > 0).all()])
    for order in found.stiffness[:, 0]:
        if np.isfinite(order).all():
            assert np.abs(pairs / order - 1).max(axis=1).min() < 1e-5


def test_without_noise_every_number_that_determines_the_values_gives_the_truth() -> None:
    statement, theta = fitted(7, noise=0.0)
    found = number_of_tests(statement, theta, orders=5)
    assert found.counts.tolist() == list(range(1, 8))
    known = ~np.isnan(found.stiffness)
    assert known[:, 1:].all()
    truth = np.broadcast_to([ROBOT.parameter(name) for name in ROBOT.identify], found.stiffness.shape)
    np.testing.assert_allclose(found.stiffness[known], truth[known], rtol=1e-5)


def test_the_band_narrows_with_the_root_of_the_number() -> None:
    statement, theta = fitted(200, noise=1.0)
    found = number_of_tests(statement, theta, [10, 40], orders=60)
    width = found.band()[:, 2] - found.band()[:, 0]
    # of 200 tests, n are drawn without replacement: 1/n - 1/200
    expected = np.sqrt((1 / 10 - 1 / 200) / (1 / 40 - 1 / 200))
    assert np.median(width[0] / width[1]) == pytest.approx(expected, rel=0.2)


def by_hand(*ratios: list[float]) -> NumberOfTests:
    """Return one order's values of a spring over its final one, from 1, 2, ... tests."""
    values = np.array(ratios)[:, :, None]
    return NumberOfTests(
        ("k",), (), np.arange(1, values.shape[1] + 1), values, np.zeros((1, 1, 0)), np.array([1.0])
    )


def test_enough_is_where_the_values_no_longer_leave_the_tolerance() -> None:
    assert by_hand([1.5, 1.05, 1.2, 1.05, 1.0]).enough(0.1) == {"k": 4}
    assert by_hand([1.0, 1.05, 0.95, 1.05, 1.0]).enough(0.1) == {"k": 1}
    assert by_hand([1.5, 1.5, 1.5, 1.5, 1.0]).enough(0.1) == {"k": None}
    assert by_hand([np.nan, 1.05, 1.02, 1.0]).enough(0.1) == {"k": 2}
    assert by_hand([1.0, 1.0, 1.0], [1.0, 1.5, 1.0]).enough(0.1) == {"k": None}


def test_rows_are_tests_of_their_own_unless_they_share_a_reading() -> None:
    statement, theta = fitted(5, 2)
    assert number_of_tests(statement, theta, orders=1).counts[-1] == 5
    assert number_of_tests(statement, theta, orders=1, by="row").counts[-1] == 10
    shared, theta = fitted(5, 2, shared=True)
    with pytest.raises(BeamstiffError, match="share a reading"):
        number_of_tests(shared, theta, by="row")
    table = measured(ROBOT, rows(ROBOT, 5, 2))
    errors = build_identification(ROBOT, table, errors=InputErrors(angle=0.01))
    with pytest.raises(BeamstiffError, match="share a reading"):
        number_of_tests(errors, theta, by="row")


def test_many_tests_are_looked_at_in_thirty_numbers() -> None:
    statement, theta = fitted(120)
    counts = number_of_tests(statement, theta, orders=1).counts
    assert counts[0] == 1
    assert counts[-1] == 120
    assert len(counts) <= 30


@pytest.mark.parametrize("counts", [[], [3, 2], [0, 1], [1, 9]])
def test_numbers_that_make_no_sense_are_refused(counts: list[int]) -> None:
    statement, theta = fitted(6)
    with pytest.raises(BeamstiffError, match="growing numbers from 1 to 6"):
        number_of_tests(statement, theta, counts)
    with pytest.raises(BeamstiffError, match="0 orders"):
        number_of_tests(statement, theta, orders=0)
