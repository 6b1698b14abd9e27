"""Closed forms of the evidence against dense covariance matrices and numerical integrals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm, ortho_group

from beamstiff.diagnosis.inference.evidence import (
    AMISS,
    EXACT,
    FACTOR,
    MAGNITUDES,
    SHARES,
    NoisePrior,
    _log_densities,
    evidence,
    logsumexp,
    stacks_of,
)
from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array
from tests.diagnosis.hypotheses import complement, gap_of, hypothesis

ONE = NoisePrior(np.ones(1), np.zeros(1))
SEVERAL = NoisePrior(np.array([0.5, 1.0, 2.0]), np.log([0.2, 0.5, 0.3]))
CASES = [(n, c, t) for n in (4, 5, 6) for c in (1, 2) for t in (0, 1, 2)]


def case(n: int, c: int, t: int, seed: int = 0) -> tuple[Whitened, Hypothesis]:
    rng = np.random.default_rng(100 * n + 10 * c + t + seed)
    unknown = rng.uniform(0.2, 2.0, n)
    white = gap_of(2 * rng.standard_normal(n), rng.standard_normal((n, t)), unknown / unknown.mean())
    return white, hypothesis(3 * rng.standard_normal((n, c)))


def density(white: Whitened, covariance: Array) -> float:
    """Return the restricted density of the gap, fitted parameters integrated out, dense."""
    across = complement(white.tangent)
    return float(multivariate_normal.pdf(across.T @ white.gap, cov=across.T @ covariance @ across))


def dense(
    white: Whitened, scales: NoisePrior, share: float, columns: Array | None = None, u: float = 0.0
) -> float:
    signal = np.zeros((white.gap.size,) * 2) if columns is None else u**2 * columns @ columns.T
    noise = np.diag(1 + share**2 * white.unknown)
    return sum(
        float(np.exp(log)) * density(white, s**2 * noise + signal)
        for s, log in zip(scales.value, scales.log_weight, strict=True)
    )


def share_prior(white: Whitened, columns: Array, u: float) -> Array:
    """Return the prior of the shares of the unknown beside a shape: none, or about AMISS of its own size."""
    left = columns - white.tangent @ (white.tangent.T @ columns)
    size = u * np.sqrt((left**2).sum() / (white.gap.size - white.tangent.shape[1]))
    off = norm.pdf(np.log(SHARES[1:]), np.log(AMISS * size), np.log(FACTOR))
    return np.concatenate([[EXACT], (1 - EXACT) * off / off.sum()])


def constant(white: Whitened) -> float:
    """Return the log of the factor that closed forms leave out of all densities alike."""
    return 0.5 * (white.gap.size - white.tangent.shape[1]) * np.log(2 * np.pi)


@pytest.mark.parametrize(("n", "c", "t"), CASES)
@pytest.mark.parametrize("scales", [ONE, SEVERAL], ids=["one", "several"])
def test_evidence_is_the_mean_of_dense_densities(n: int, c: int, t: int, scales: NoisePrior) -> None:
    white, one = case(n, c, t)
    found = evidence(white, [one], scales)
    sizes = one.shape.prior_factor**MAGNITUDES
    by_size = [[dense(white, scales, share, one.columns, u) for share in SHARES] for u in sizes]
    weighted = [share_prior(white, one.columns, u) @ row for u, row in zip(sizes, by_size, strict=True)]
    assert found.hypotheses[0] == pytest.approx(np.log(np.mean(weighted)) + constant(white), abs=1e-9)
    exact = np.mean([row[0] for row in by_size])
    assert found.exact[0] == pytest.approx(np.log(exact) + constant(white), abs=1e-9)
    assert found.none == pytest.approx(np.log(dense(white, scales, 0.0)) + constant(white), abs=1e-9)
    unknown = np.mean([dense(white, scales, share) for share in SHARES[1:]])
    assert found.unknown == pytest.approx(np.log(unknown) + constant(white), abs=1e-9)


def test_a_density_is_the_integral_over_the_effects_size_and_the_fitted_parameter() -> None:
    white, one = case(5, 1, 1)
    grid = np.linspace(-40, 40, 801)
    theta, b = np.meshgrid(grid, grid, indexing="ij")
    explained = theta[..., None] * one.columns[:, 0] + b[..., None] * white.tangent[:, 0]
    likelihood = norm.pdf(white.gap - explained).prod(axis=-1)
    sums = [(likelihood * norm.pdf(theta, scale=u)).sum() for u in 3.0**MAGNITUDES]
    exact = np.mean(sums) * (grid[1] - grid[0]) ** 2
    found = evidence(white, [one], ONE).exact[0]
    assert found == pytest.approx(np.log(exact) + constant(white), abs=1e-8)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_parameter_that_cannot_be_negative_is_integrated_over_its_half(side: float) -> None:
    white, one = case(5, 1, 1)
    upper = hypothesis(side * one.columns, positive=True)
    # of the wrong sign the density is steep at zero: fine steps
    grid, half = np.linspace(-40, 40, 161), 0.001 * (np.arange(12000) + 0.5)
    theta, b = np.meshgrid(half, grid, indexing="ij")
    explained = theta[..., None] * upper.columns[:, 0] + b[..., None] * white.tangent[:, 0]
    likelihood = norm.pdf(white.gap - explained).prod(axis=-1)
    cell = (grid[1] - grid[0]) * (half[1] - half[0])
    exact = np.mean([(likelihood * 2 * norm.pdf(theta, scale=u)).sum() * cell for u in 3.0**MAGNITUDES])
    found = evidence(white, [upper], ONE).exact[0]
    assert found == pytest.approx(np.log(exact) + constant(white), abs=1e-4)


def test_what_would_have_to_give_way_against_its_load_is_no_explanation() -> None:
    rng = np.random.default_rng(6)
    column = rng.standard_normal((40, 1))
    gap = 5 * column[:, 0] + rng.standard_normal(40)
    there, against, either = (
        hypothesis(sign * column, positive=signed) for sign, signed in ((1, True), (-1, True), (1, False))
    )
    found = evidence(gap_of(gap), [there, against, either], ONE).hypotheses
    assert found[0] == pytest.approx(
        found[2] + np.log(2), abs=1e-6
    )  # half of the sizes, each twice as likely
    assert found[1] < found[2] - 20


def test_of_several_that_are_independent_each_counts_by_itself() -> None:
    first, second = np.eye(4)[:, :1], np.eye(4)[:, 1:2]
    gap = gap_of([2.0, -1.0, 0.3, -0.2])
    both = hypothesis(np.concatenate([first, second], axis=1), positive=True)
    free = hypothesis(np.concatenate([first, second], axis=1))
    gain = evidence(gap, [both], ONE).exact[0] - evidence(gap, [free], ONE).exact[0]
    u = 3.0**MAGNITUDES  # each size weighs with its own evidence
    spread = u / np.sqrt(1 + u**2)
    by_size = -np.log1p(u**2) + 0.5 * (4.0 + 1.0) * spread**2
    odds = norm.cdf(2.0 * spread) * norm.cdf(-1.0 * spread) * 4
    weights = np.exp(by_size - by_size.max())
    assert gain == pytest.approx(np.log((weights @ odds) / weights.sum()), abs=1e-9)


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("seed", range(4))
def test_of_several_that_look_alike_all_have_to_be_positive_at_once(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((30, count)) + 2 * rng.standard_normal((30, 1))
    gap = columns @ (0.4 * rng.standard_normal(count)) + rng.standard_normal(30)
    shapes = [hypothesis(columns, positive=one, spread=1.0) for one in (True, False)]
    both, free = (evidence(gap_of(gap), [one], ONE).exact[0] for one in shapes)
    covariance = np.linalg.inv(columns.T @ columns + np.eye(count))
    mean = covariance @ columns.T @ gap
    below = multivariate_normal(-mean, covariance, seed=1, maxpts=10**5, abseps=0, releps=1e-4)
    exact = count * np.log(2) + np.log(below.cdf(np.zeros(count)))
    apart = np.log(2) * count + norm.logcdf(mean / np.sqrt(np.diag(covariance))).sum()
    if exact > -5:
        assert both - free == pytest.approx(exact, abs=0.25 + 0.1 * abs(exact))
    else:  # far out it is too mild, but far less so than one by one
        assert exact < both - free < 0.6 * exact
    assert abs(both - free - exact) <= abs(apart - exact) + 0.05


def test_many_hypotheses_at_once_are_weighed_as_each_alone() -> None:
    white, _ = case(6, 1, 1)
    rng = np.random.default_rng(5)
    several = [
        hypothesis(rng.standard_normal((6, c)), spread=s) for c, s in ((1, 3), (2, 5), (1, 10), (2, 2))
    ]
    together = evidence(white, several, SEVERAL)
    for at, one in enumerate(several):
        alone = evidence(white, [one], SEVERAL)
        for name in ("hypotheses", "exact", "magnitude", "residual_fraction"):
            assert getattr(together, name)[at] == pytest.approx(getattr(alone, name)[0], rel=1e-9)


@pytest.mark.parametrize("c", [1, 2])
def test_evidence_does_not_depend_on_the_axes_of_the_values(c: int) -> None:
    white, one = case(6, c, 2)
    white = replace(white, unknown=np.ones(6))
    turn = ortho_group.rvs(6, random_state=1)
    turned = replace(white, gap=turn @ white.gap, tangent=turn @ white.tangent)
    other = replace(one, columns=turn @ one.columns)
    before, after = evidence(white, [one], SEVERAL), evidence(turned, [other], SEVERAL)
    assert after.hypotheses[0] == pytest.approx(before.hypotheses[0], abs=1e-9)
    assert after.none == pytest.approx(before.none, abs=1e-9)
    assert after.unknown == pytest.approx(before.unknown, abs=1e-9)


@pytest.mark.parametrize("c", [1, 2])
def test_evidence_does_not_depend_on_where_the_fitted_parameters_are(c: int) -> None:
    white, one = case(6, c, 2)
    rng = np.random.default_rng(2)
    moved = replace(white, gap=white.gap + white.tangent @ [30.0, -20.0])
    mixed = replace(one, columns=one.columns + white.tangent @ rng.standard_normal((2, c)))
    other = replace(moved, tangent=moved.tangent @ ortho_group.rvs(2, random_state=3))
    before, after = evidence(white, [one], SEVERAL), evidence(other, [mixed], SEVERAL)
    assert after.hypotheses[0] == pytest.approx(before.hypotheses[0], abs=1e-8)
    assert after.none == pytest.approx(before.none, abs=1e-8)


def test_what_the_fit_absorbs_is_neither_for_nor_against_a_hypothesis() -> None:
    white, _ = case(6, 1, 2)
    found = evidence(white, [hypothesis(white.tangent[:, :1] * 5)], SEVERAL)
    assert found.exact[0] == pytest.approx(found.none, abs=1e-9)


def odds_of_any(white: Whitened, some: list[Hypothesis], scales: NoisePrior, gaps: Array) -> Array:
    """Return the log odds (d,) of any effect against none for gaps (n, d), each shape taken as exact."""
    spread = np.array([one.shape.prior_factor for one in some])
    (logs,) = _log_densities(white, stacks_of(some), spread, scales, np.zeros(1), gaps)
    each = logsumexp(logs[1:], axis=1) - np.log(MAGNITUDES.size)  # (H, d)
    return np.asarray(logsumexp(each + np.log([one.prior for one in some])[:, None], axis=0) - logs[0, 0])


@pytest.mark.parametrize("scales", [ONE, SEVERAL], ids=["one", "several"])
def test_without_an_effect_the_odds_of_one_are_1_on_average(scales: NoisePrior) -> None:
    # the mean over y of p(y | effect) / p(y | none), y drawn without one, is the integral of p(y | effect)
    rng = np.random.default_rng(7)
    some = [
        hypothesis(0.08 * rng.standard_normal((6, c)), spread=2.0, prior=p) for c, p in ((1, 0.3), (2, 0.7))
    ]
    white = gap_of(np.zeros(6), rng.standard_normal((6, 1)))
    count = 200_000
    s = rng.choice(scales.value, count, p=np.exp(scales.log_weight))
    odds = np.exp(odds_of_any(white, some, scales, s * rng.standard_normal((6, count))))
    error = odds.std() / np.sqrt(count)
    assert error < 2e-3
    assert odds.mean() == pytest.approx(1.0, abs=4 * error)


def test_without_an_effect_large_odds_are_as_rare_as_they_claim() -> None:
    # Markov: odds above k come with a probability below 1/k
    rng = np.random.default_rng(8)
    some = [hypothesis(rng.standard_normal((30, 2)), prior=0.1) for _ in range(10)]
    white = gap_of(np.zeros(30), rng.standard_normal((30, 3)))
    log_odds = odds_of_any(white, some, ONE, rng.standard_normal((30, 20_000)))
    for k in (2.0, 10.0, 100.0):
        rate = (log_odds > np.log(k)).mean()
        assert rate < 1 / k + 3 * np.sqrt(1 / k / 20_000)
        assert rate > 0 or k > 10


def test_the_odds_average_exact_shapes_by_their_priors() -> None:
    white, one = case(6, 1, 1)
    other = replace(case(6, 2, 1)[1], prior=0.2)
    one = replace(one, prior=0.8)
    found = evidence(white, [one, other], SEVERAL)
    expected = np.log(0.8 * np.exp(found.exact[0]) + 0.2 * np.exp(found.exact[1])) - found.none
    odds = odds_of_any(white, [one, other], SEVERAL, white.gap[:, None])[0]
    assert odds == pytest.approx(expected, abs=1e-9)


def planted(size: float, noise: float = 1.0, off: float = 0.0) -> tuple[Whitened, list[Hypothesis]]:
    """Return a gap of a first shape of some size a value, off by a share of it, and two shapes."""
    rng = np.random.default_rng(9)
    shapes = rng.standard_normal((2, 200))
    other = rng.standard_normal(200)
    gap = size * (shapes[0] + off * other) + noise * rng.standard_normal(200)
    return gap_of(gap), [hypothesis(shape[:, None], spread=100.0) for shape in shapes]


def test_the_shape_that_is_there_wins_and_leaves_little() -> None:
    white, shapes = planted(5.0)
    found = evidence(white, shapes, ONE)
    assert found.hypotheses[0] - max(found.hypotheses[1], found.none, found.unknown) > 50
    assert found.residual_fraction[0] < 0.1
    assert found.residual_fraction[1] > 0.7
    assert found.magnitude[0] == pytest.approx(5.0, rel=1.8)


@pytest.mark.parametrize("off", [0.1, 0.3])
def test_what_a_shape_leaves_is_seen(off: float) -> None:
    white, shapes = planted(30.0, off=off)
    found = evidence(white, shapes, ONE)
    assert found.residual_fraction[0] == pytest.approx(off / np.hypot(1, off), rel=0.5)


def test_a_gap_of_noise_speaks_for_none_over_every_shape() -> None:
    white, shapes = planted(0.0)
    found = evidence(white, shapes, ONE)
    assert found.none > found.hypotheses.max()
    assert found.none > found.unknown


def test_a_gap_of_nothing_at_all_is_weighed_without_a_warning() -> None:
    white, shapes = planted(0.0, noise=0.0)
    found = evidence(white, shapes, SEVERAL)
    assert np.isfinite(found.residual_fraction).all()
    assert found.none > found.hypotheses.max()


def test_sums_of_exponentials_neither_overflow_nor_lose_axes() -> None:
    values = np.array([[1000.0, 1000.0], [-1000.0, 0.0]])
    assert logsumexp(values) == pytest.approx(1000 + np.log(2))
    np.testing.assert_allclose(logsumexp(values, axis=1), [1000 + np.log(2), 0.0])
    np.testing.assert_allclose(logsumexp(values, axis=(0, 1)), 1000 + np.log(2))
