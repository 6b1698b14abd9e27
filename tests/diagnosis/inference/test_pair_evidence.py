"""Two causes together: against dense densities, and on gaps made of bare columns."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from beamstiff.diagnosis.inference.component_subspaces import ComponentSubspace, modes_of
from beamstiff.diagnosis.inference.evidence import MAGNITUDES, NoisePrior
from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.inference.pair_evidence import COMMON, Pair, alone, together
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array
from tests.diagnosis.hypotheses import complement, gap_of, hypothesis

VALUES = 40
ONE = NoisePrior(np.ones(1), np.zeros(1))


def columns_of(seed: int, count: int = 1, size: float = 3.0) -> Array:
    return size * np.random.default_rng(seed).standard_normal((VALUES, count))


def gap_with(signal: Array, seed: int = 0) -> Whitened:
    rng = np.random.default_rng(seed)
    return gap_of(signal + rng.standard_normal(VALUES), rng.standard_normal((VALUES, 2)), np.ones(VALUES))


def weighed(white: Whitened, first: Hypothesis, second: Hypothesis, *laws: ComponentSubspace) -> Pair:
    return together(white, [first], [second], first, ONE, laws)


def test_both_are_weighed_as_one_gaussian_with_the_columns_of_both() -> None:
    a, b = columns_of(1), columns_of(2, 2)
    white = gap_with(a[:, 0] + b @ [1.0, -0.5])
    found = weighed(white, hypothesis(a), hypothesis(b))
    first, second = (shapes[0] for shapes in found.shapes)
    both = np.concatenate([first.magnitude * a, second.magnitude * b], axis=1)
    across = complement(white.tangent)

    def density(u: float, share: float) -> float:
        covariance = (1.0 + share**2) * np.eye(VALUES) + u**2 * both @ both.T
        return float(multivariate_normal.logpdf(across.T @ white.gap, cov=across.T @ covariance @ across))

    exact = [density(u, 0.0) for u in COMMON**MAGNITUDES]
    constant = 0.5 * across.shape[1] * np.log(2 * np.pi)
    prior = np.log(hypothesis(a).prior * hypothesis(b).prior)
    # the unknown beside them can add what it may be (30 % of the prior are exact shapes), and no more
    least = np.log(0.3) + np.logaddexp.reduce(exact) - np.log(len(exact)) + constant + prior
    most = max(density(u, r) for u in COMMON**MAGNITUDES for r in np.linspace(0, 4, 41)) + constant + prior
    assert least - 1e-6 <= found.log_weight <= most


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_the_two_is_of_no_account(seed: int) -> None:
    a, b = hypothesis(columns_of(1)), hypothesis(columns_of(2))
    white = gap_with(a.columns[:, 0] - b.columns[:, 0], seed)
    one, other = weighed(white, a, b), weighed(white, b, a)
    assert one.log_weight == pytest.approx(other.log_weight, abs=0.05)
    assert one.residual_fraction == pytest.approx(other.residual_fraction, abs=0.02)


def test_the_two_that_are_there_outweigh_one_and_each_other_pair() -> None:
    a, b, c = (hypothesis(columns_of(k)) for k in (1, 2, 3))
    white = gap_with(a.columns[:, 0] + b.columns[:, 0])
    right = weighed(white, a, b).log_weight
    assert right > weighed(white, a, c).log_weight + 20
    assert right > weighed(white, b, c).log_weight + 20
    assert right > max(alone(white, [one], ONE, ()) for one in (a, b, c)) + 20


def test_a_second_that_is_not_there_adds_nothing() -> None:
    a, b = hypothesis(columns_of(1)), hypothesis(columns_of(2))
    white = gap_with(a.columns[:, 0])
    assert weighed(white, a, b).log_weight < alone(white, [a], ONE, ()) + np.log(b.prior) + 1.0


def test_each_shape_is_chosen_beside_the_other_cause() -> None:
    # alone the wrong shape of the first looks best: it holds a part of the second
    right, second = columns_of(1), columns_of(2)
    wrong = right + 0.8 * (second + columns_of(3, size=1.0))
    white = gap_with(2 * right[:, 0] + 2 * second[:, 0])
    shapes = [hypothesis(right, shape="right"), hypothesis(wrong, shape="wrong")]
    assert alone(white, shapes[1:], ONE, ()) > alone(white, shapes[:1], ONE, ()) + 5
    found = together(white, shapes, [hypothesis(second)], shapes[1], ONE, ())
    assert max(found.shapes[0], key=lambda one: one.weight).hypothesis.shape.name == "right"
    assert sum(one.weight for one in found.shapes[0]) == pytest.approx(1.0)


def test_what_a_place_does_beside_its_shape_counts_for_the_pair_at_that_place() -> None:
    a, b = columns_of(1), columns_of(2)
    more = columns_of(4)
    law = ComponentSubspace("q1", more / np.sqrt((more**2).mean()))
    white = gap_with(2 * a[:, 0] + 2 * b[:, 0] + 0.6 * more[:, 0])
    there, elsewhere = (hypothesis(b, places=(place,)) for place in ("q1", "q2"))
    first = hypothesis(a, places=("q3",))
    with_it = weighed(white, first, there, law).log_weight
    assert with_it > weighed(white, first, elsewhere, law).log_weight + 3
    assert alone(white, [there], ONE, [law]) > alone(white, [elsewhere], ONE, [law])


def test_modes_of_places_have_mean_square_1_together() -> None:
    laws = []
    for place in ("q1", "q2", "base"):
        modes = columns_of(len(laws), 3)
        laws.append(ComponentSubspace(place, modes / np.sqrt((modes**2).sum() / VALUES)))
    both = modes_of(laws, {"q1", "base", "tool"}, VALUES)
    assert both.shape == (VALUES, 6)
    assert (both**2).sum() / VALUES == pytest.approx(1.0)
    assert modes_of(laws, (), VALUES).shape == (VALUES, 0)
