"""Scales of noise, unknown and library against what was planted, and against dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from beamstiff.diagnosis.residual.noise_variance import Variance, estimate, precision
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array
from tests.diagnosis.hypotheses import complement, gap_of

N = 600
SAMPLING = 1 / np.sqrt(N)  # standard deviation of the log of a scale from half of the values


def campaign(
    seed: int = 0, position: float = 1.0, rotation: float = 1.0, unknown: float = 0.0, effect: float = 0.0
) -> tuple[Whitened, Array]:
    """Return a gap of planted noise, unknown and effect, and the library that the effect is of."""
    rng = np.random.default_rng(seed)
    component = np.repeat(np.arange(6), N // 6)
    spread = rng.exponential(size=N) ** 2
    spread = np.tile(spread[: N // 6], 6) / spread[: N // 6].mean()
    noise = np.where(component < 3, position, rotation) * rng.standard_normal(N)
    library = rng.standard_normal((N, 20))
    tangent = rng.standard_normal((N, 6))
    gap = noise + np.sqrt(unknown * spread) * rng.standard_normal(N)
    gap = gap + library[:, :3] @ (effect * rng.standard_normal(3)) + tangent @ rng.normal(0, 50, 6)
    return gap_of(gap, tangent, spread, component), library


@pytest.mark.parametrize(("position", "rotation"), [(1.0, 1.0), (2.0, 0.5), (0.4, 3.0)])
@pytest.mark.parametrize("effect", [0.0, 20.0], ids=["null", "effect"])
def test_planted_noise_is_found_whatever_the_effect(position: float, rotation: float, effect: float) -> None:
    white, library = campaign(1, position, rotation, effect=effect)
    found = estimate(white, library, width=2.0, sound=True)
    np.testing.assert_allclose(np.log(found.noise), np.log([position, rotation]), atol=3.5 * SAMPLING)


def test_planted_noise_is_found_without_bias() -> None:
    logs = [np.log(estimate(*campaign(seed), width=2.0, sound=True).noise) for seed in range(20)]
    np.testing.assert_allclose(np.mean(logs, axis=0), 0, atol=4 * SAMPLING / np.sqrt(20))
    assert np.std(logs) == pytest.approx(SAMPLING, rel=0.4)


def test_an_unknown_is_not_taken_for_noise() -> None:
    white, library = campaign(2, unknown=25.0)
    found = estimate(white, library, width=2.0, sound=True)
    np.testing.assert_allclose(np.log(found.noise), 0, atol=6 * SAMPLING)
    assert found.unknown == pytest.approx(25.0, rel=0.4)


def test_a_few_wrong_values_do_not_make_noise() -> None:
    white, library = campaign(3)
    gap = white.gap.copy()
    gap[::100] += 50.0
    assert (estimate(replace(white, gap=gap), library, width=2.0).noise < 1.5).all()


def test_a_firm_claim_holds_the_noise_where_the_values_say_little() -> None:
    rng = np.random.default_rng(4)
    white = gap_of(3 * rng.standard_normal(8), rng.standard_normal((8, 6)))
    loose = estimate(white, np.zeros((8, 0)), width=2.0).noise[0]
    firm = estimate(white, np.zeros((8, 0)), width=0.05).noise[0]
    assert firm == pytest.approx(1.0, abs=0.1)
    assert abs(np.log(firm)) < abs(np.log(loose))


def test_a_component_that_was_not_measured_keeps_its_claim() -> None:
    white, library = campaign(5)
    white = replace(white, component=np.zeros(N, dtype=np.intp))
    assert estimate(white, library, width=0.6, sound=True).noise[1] == pytest.approx(1.0)


@pytest.mark.parametrize("t", [0, 1, 3])
@pytest.mark.parametrize("c", [0, 2, 9])
def test_precision_is_the_dense_inverse_with_the_fitted_parameters_taken_out(t: int, c: int) -> None:
    rng = np.random.default_rng(10 * t + c)
    component = np.array([0, 1, 2, 3, 4, 5, 0])
    white = gap_of(rng.standard_normal(7), rng.standard_normal((7, t)), rng.uniform(0, 2, 7), component)
    columns = rng.standard_normal((7, c))
    inverse, log = precision(white, columns, Variance(np.array([0.7, 1.6]), 0.4, 2.5))
    own = np.array([0.7, 1.6])[(component >= 3).astype(int)] ** 2 + 0.4 * white.unknown
    dense = np.diag(own) + 2.5 * columns @ columns.T
    across = complement(white.tangent)
    seen = across.T @ dense @ across
    expected = across @ np.linalg.inv(seen) @ across.T
    found = np.stack([inverse.times(unit) for unit in np.eye(7)], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-7)
    density = multivariate_normal.logpdf(across.T @ white.gap, cov=seen)
    closed = log - 0.5 * white.gap @ inverse.times(white.gap) - 0.5 * (7 - t) * np.log(2 * np.pi)
    assert closed == pytest.approx(density, abs=1e-7)
