"""Gaussian processes of joint compliances: exact where all is linear, calibrated, and never much harm."""

from dataclasses import replace

import numpy as np
from scipy.optimize import check_grad
from scipy.spatial.distance import cdist
from scipy.special import gamma, kv

from beamstiff import load_robot
from beamstiff.identification.identify import identify
from beamstiff.identification.models.gaussian_process import (
    Evidence,
    LinearReadings,
    fit_gaussian_process,
    most_evident,
)
from beamstiff.measure.table import make_measurements
from beamstiff.model.gaussian_process import COMMON, Covariance, matern
from beamstiff.model.linear import predict_displacements
from tests.identification.varying_machines import compliances, kr500, lever, loads, nothing, postures, table


def prior(spread: float = 0.3, own: float = 0.2) -> Covariance:
    return Covariance(
        own=np.array([0, 1, 2, 3, 4, -1]),
        scale=np.ones(6),
        own_length=0.7,
        lengths=np.array([0.8, 1.0, 1.2, 0.9, 1.1, 1.5]),
        own_spread=np.full(6, own),
        spread=np.full(6, spread),
    )


def readings(count: int = 12, seed: int = 0) -> tuple[LinearReadings, np.ndarray]:
    random = np.random.default_rng(seed)
    postures = random.uniform(-1, 1, (count, 6))
    of = np.repeat(np.arange(count), 3)
    return LinearReadings(
        random.normal(size=len(of)) * 3, random.normal(size=(len(of), 6)) * 5, of, 40.0, 30
    ), postures


def test_the_covariance_is_that_of_matern() -> None:
    """By the Bessel function it is defined with (Rasmussen and Williams, eq. 4.14, nu = 5/2)."""
    r = np.linspace(0.01, 5, 30)
    scaled = np.sqrt(5) * r
    assert np.allclose(matern(r), 2**-1.5 / gamma(2.5) * scaled**2.5 * kv(2.5, scaled), rtol=1e-12)


def test_covariances_are_those_of_their_parts() -> None:
    random, own = np.random.default_rng(1), prior()
    one, other = random.normal(size=(4, 6)), random.normal(size=(3, 6))
    whole = 0.3**2 * matern(cdist(one / own.lengths, other / own.lengths))
    found = own.between(one, other)
    along = 0.2**2 * matern(np.abs(one[:, None, 2] - other[:, 2]) / 0.7)
    assert np.allclose(found[2], COMMON**2 + whole + along, rtol=1e-12)
    assert np.allclose(found[5], COMMON**2 + whole, rtol=1e-12)
    assert np.allclose(np.diagonal(own.between(one, one), axis1=1, axis2=2).T, own.variance)
    assert np.linalg.eigvalsh(own.between(one, one)).min() > 0


def test_the_gradient_of_the_evidence_is_its_finite_difference() -> None:
    own, at = readings()
    evidence = Evidence(own, at, prior())
    theta = evidence.theta(1.3) + 0.2 * np.random.default_rng(2).normal(size=20)
    size = np.linalg.norm(evidence(theta)[1])
    assert check_grad(lambda x: evidence(x)[0], lambda x: evidence(x)[1], theta, epsilon=1e-6) < 1e-5 * size


def test_the_evidence_is_a_normal_density_of_the_readings() -> None:
    own, at = readings()
    evidence = Evidence(own, at, prior())
    theta = evidence.theta(1.3)
    at_readings = at[own.posture]
    between = prior().between(at_readings, at_readings)
    total = sum(between[j] * np.outer(u, u) for j, u in enumerate(own.slopes.T)) + 1.3**2 * np.eye(36)
    _, size = np.linalg.slogdet(total)
    expected = 0.5 * (own.value @ np.linalg.solve(total, own.value) + size)
    expected += 0.5 * own.rest / 1.3**2 + own.lost * np.log(1.3)
    mean, std = evidence.priors.T
    expected += 0.5 * (((theta - mean) / std) ** 2).sum()
    assert np.isclose(evidence(theta)[0], expected, rtol=1e-9)


def test_spreads_and_noise_that_made_the_readings_are_found() -> None:
    random, own = np.random.default_rng(5), prior(spread=0.01, own=0.8)
    at = random.uniform(-2, 2, (60, 6))
    of = np.repeat(np.arange(60), 6)
    slopes = random.normal(size=(360, 6)) * 20
    between = own.between(at, at)
    x = np.stack([np.linalg.cholesky(one + 1e-9 * np.eye(60)) @ random.normal(size=60) for one in between])
    value = np.einsum("nj,jn->n", slopes, x[:, of]) + 2.0 * random.normal(size=360)
    found, noise = most_evident(LinearReadings(value, slopes, of, 0.0, 0), at, prior(), 1.0, True)
    assert abs(noise - 2.0) < 0.3
    assert np.abs(np.log(found.own_spread[:5] / 0.8)).max() < 0.7
    assert abs(np.log(found.own_length / 0.7)) < 0.5
    assert found.spread.max() < 0.15


def test_what_varies_is_learned_and_intervals_hold_it() -> None:
    q = postures(60)
    fit = fit_gaussian_process(kr500(), table(q, loads(60), lever))
    fresh, push = postures(200, seed=9), loads(200, seed=9)
    truth = table(fresh, push, lever, noise=0.0).displacement
    predicted, std = fit.model.predict_with_std(fresh, push)
    single = identify(kr500(), table(q, loads(60), lever), folds=0)
    left = predict_displacements(single.robot, table(fresh, push, nothing)) - truth
    gap = predicted - truth
    assert np.sqrt((gap[:, :3] ** 2).mean()) < 0.15 * np.sqrt((left[:, :3] ** 2).mean())
    within = (np.abs(gap) < 2 * std).mean()
    assert 0.85 < within <= 1.0
    assert np.sqrt(((gap / std) ** 2).mean()) > 0.3
    own = fit.model.covariance.own_spread
    assert sorted(np.argsort(own)[-2:].tolist()) == [1, 2]


def test_where_nothing_varies_it_does_as_the_parametric_model_does() -> None:
    q = postures(40)
    rows = table(q, loads(40), nothing)
    fit = fit_gaussian_process(kr500(), rows)
    fresh, push = postures(100, seed=9), loads(100, seed=9)
    truth = table(fresh, push, nothing, noise=0.0).displacement
    gap = fit.model.predict(fresh, push) - truth
    single = (
        predict_displacements(identify(kr500(), rows, folds=0).robot, table(fresh, push, nothing)) - truth
    )
    rms = [np.sqrt((one[:, :3] ** 2).mean()) for one in (gap, single)]
    assert rms[0] < max(1.5 * rms[1], 3e-6)


def test_compliances_are_positive_and_far_from_all_readings_only_the_common_value_is_known() -> None:
    q = postures(30)
    fit = fit_gaussian_process(kr500(), table(q, loads(30), lever))
    assert (fit.model.compliances(np.random.default_rng(0).uniform(-3, 3, (50, 6))) > 0).all()
    assert np.abs(np.log(fit.model.compliances(q) / compliances()) - lever(q)).max() < 0.2
    mean, covariance = fit.model.logarithms(np.full((1, 6), 1e3))
    own = fit.model.covariance
    variance = np.diagonal(covariance[0])
    apart = own.spread**2 + own.own_spread**2
    assert (variance >= 0.99 * apart).all()
    assert (variance <= own.variance).all()
    assert np.abs(mean).max() < 0.5


def test_several_loads_in_a_posture_count_as_they_do_one_by_one() -> None:
    """Their reduction to as many readings as springs loses nothing."""
    q = np.repeat(postures(10), 4, axis=0)
    rows = table(q, loads(40), lever)
    fit = fit_gaussian_process(kr500(), rows)
    apart = replace(rows, pose=np.arange(40), q=rows.q + 1e-9 * np.arange(40)[:, None])
    other = fit_gaussian_process(kr500(), apart)
    fresh, push = postures(20, seed=9), loads(20, seed=9)
    one, two = (model.predict(fresh, push) for model in (fit.model, other.model))
    assert np.abs(one - two).max() < 2e-2 * np.abs(one).max()


def test_understated_noise_widens_the_intervals() -> None:
    rows = table(postures(60), loads(60), nothing, noise=4e-5, sigma=1e-5)
    fit = fit_gaussian_process(kr500(), rows)
    assert 3.2 < fit.noise < 4.8
    assert (fit.model.misfit > 2.5e-5).all()


def test_springs_without_a_joint_value_of_their_own_follow_the_posture() -> None:
    robot, random = load_robot("ir663"), np.random.default_rng(0)
    q, wrench = random.uniform([-0.2, 0.6], [0.4, 0.9], (24, 2)), 900 * random.normal(size=(24, 6))
    still = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench)
    seen = predict_displacements(robot, still)[:, :3]
    rows = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench, displacement=seen, sigma_position=1e-5)
    fit = fit_gaussian_process(robot, rows, ["J12.torsional", "J1010.radial"])
    assert fit.model.covariance.own.tolist() == [0, -1]
