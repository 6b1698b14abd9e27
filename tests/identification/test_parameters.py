"""Free values: ties keep ratios, held values stay, bounds of tied values hold for all, nonsense is named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.identification.parameters import SPAN, build_parameters

NAMES = ("a", "b", "c", "d")
START = np.array([1e3, 4e5, 2e7, 5.0])
seeds = st.integers(0, 2**32 - 1)


def test_by_themselves_the_values_are_the_exponentials_of_theta() -> None:
    stated = build_parameters(NAMES, START)
    assert stated.stiffness(stated.begin) == pytest.approx(START, rel=1e-14)
    assert (stated.sums == np.eye(4)).all()
    assert np.exp(stated.lower) == pytest.approx(START / SPAN)
    assert np.exp(stated.upper) == pytest.approx(START * SPAN)


@given(seed=seeds)
def test_tied_values_keep_the_ratio_of_their_starts_and_held_ones_stay(seed: int) -> None:
    stated = build_parameters(NAMES, START, ties=[["c", "a"]], held={"d"})
    assert stated.first.tolist() == [0, 1]
    thetas = stated.begin + np.random.default_rng(seed).normal(size=(5, 2))
    for theta in thetas:
        k = stated.stiffness(theta)
        assert k[2] / k[0] == pytest.approx(START[2] / START[0], rel=1e-12)
        assert k[3] == START[3]
        assert k[:2] == pytest.approx(np.exp(theta), rel=1e-12)
    assert (stated.stiffness(thetas) == [stated.stiffness(theta) for theta in thetas]).all()


def test_bounds_of_tied_values_hold_for_each_of_them() -> None:
    """a >= 500 and c <= 4e7 at a ratio of 2e4: a from 500 to 2000."""
    stated = build_parameters(NAMES, START, ties=[["a", "c"]], bounds={"a": (500.0, None), "c": (None, 4e7)})
    assert np.exp([stated.lower[0], stated.upper[0]]) == pytest.approx([500.0, 2000.0], rel=1e-12)


def test_a_start_outside_the_bounds_begins_at_the_nearer_one() -> None:
    stated = build_parameters(NAMES, START, bounds={"a": (2e3, None), "b": (None, 1e5)})
    assert np.exp(stated.begin) == pytest.approx([2e3, 1e5, 2e7, 5.0], rel=1e-12)


def test_priors_count_logarithms_in_standard_deviations() -> None:
    stated = build_parameters(NAMES, START, priors={"b": (2e5, 1.5)})
    k = START.copy()
    assert stated.prior(k).tolist() == pytest.approx([0, np.log(0.5) / np.log(1.5), 0, 0])
    k[1] = 2e5 * 1.5**2
    assert stated.prior(k)[1] == pytest.approx(-2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ties": [["a", "x"]]}, "ties: .*'x'"),
        ({"ties": [["a"]]}, "ties: found 'a', expected two or more different parameters"),
        ({"ties": [["a", "a"]]}, "ties: found 'a, a', expected two or more different parameters"),
        ({"ties": [["a", "b"], ["b", "c"]]}, "ties: b, c: a parameter is tied twice"),
        ({"bounds": {"aa": (1, 2)}}, r"bounds: .*'aa'.*did you mean 'a'"),
        ({"bounds": {"a": (5, 5)}}, "bounds of a: found 5 to 5, expected low < high"),
        ({"bounds": {"a": (-1, 5)}}, "bounds of a: found -1, expected a positive number"),
        ({"bounds": {"a": (np.nan, 5)}}, "bounds of a: found nan, expected a positive number"),
        (
            {"ties": [["a", "c"]], "bounds": {"a": (1e3, None), "c": (None, 1e7)}},
            "bounds: those tied to a leave no value for all of them",
        ),
        ({"priors": {"a": (0.0, 2)}}, "prior of a: found 0.0, expected a positive number"),
        ({"priors": {"a": (1.0, 1.0)}}, "prior of a: found the factor 1.0, expected a number above 1"),
        ({"priors": {"a": (1.0, np.inf)}}, "prior of a: found the factor inf, expected a number above 1"),
    ],
)
def test_what_makes_no_sense_is_named(options: dict, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        build_parameters(NAMES, START, **options)
