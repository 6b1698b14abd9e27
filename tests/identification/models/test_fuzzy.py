"""Fuzzy compliance from displacements: exact rules, definite rules, partitions."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.identification.models.fuzzy import fit_fuzzy, solis_wets
from beamstiff.identification.models.fuzzy_rules import build_readings, fit_conclusions
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition

LENGTH = 2.0
SIGMA = 1e-5


def ir663() -> Robot:
    return load_robot("ir663")


def rows(
    model: Callable[[np.ndarray, np.ndarray], np.ndarray],
    count: int = 80,
    noise: float = 0.0,
    loads: int = 3,
    **more: Any,
) -> Measurements:
    """Return displacements that a function of q (N, 2) and wrench says, under random forces."""
    random = np.random.default_rng(count)
    q = random.uniform(-1, 1, (count, 2))
    q[:4] = [[-1, -1], [-1, 1], [1, -1], [1, 1]]
    wrench = np.zeros((count, 6))
    wrench[:, :loads] = random.normal(size=(count, loads)) * 900
    seen = model(q, wrench) + noise * random.standard_normal((count, 6))
    if loads <= 3:
        seen[:, 3:] = np.nan
    table = {"wrench": wrench, "displacement": seen, "sigma_position": SIGMA, "sigma_rotation": SIGMA}
    return make_measurements(["q2", "q8"], q, tcp="n7", **(table | more))


def definite(count: int, seed: int = 1) -> np.ndarray:
    """Return compliance matrices (R, 6, 6) of a machine's size."""
    root = np.random.default_rng(seed).normal(size=(count, 6, 6)) / np.array(
        [1, 1, 1, LENGTH, LENGTH, LENGTH]
    )
    matrix = root.swapaxes(1, 2) @ root + 0.2 * np.eye(6)
    return 1e-6 * matrix


def planted(partition: Partition, seed: int = 1) -> FuzzyCompliance:
    system = FuzzySystem(partition, definite(partition.count, seed))
    return FuzzyCompliance(("q2", "q8"), system, extrapolate=True)


PARTITION = Partition(("q2", "q8"), (np.array([-1.0, 0.2, 1.0]), np.array([-1.0, 1.0])))


@pytest.mark.parametrize("loads", [3, 6])
def test_planted_conclusions_come_back(loads: int) -> None:
    truth = planted(PARTITION)
    table = rows(truth.predict, 120, loads=loads)
    readings = build_readings(table, LENGTH, "n7")
    found = readings.matrices(fit_conclusions(readings, PARTITION, PARTITION.firing(table.q)))
    assert np.isfinite(found[0]).sum() == loads**2
    error = (found - truth.system.conclusions)[:, :loads, :loads]
    # neighbours draw a little (SMOOTH), as a ten-thousandth of a reading does
    assert np.abs(error).max() < 3e-4 * np.abs(truth.system.conclusions[:, :loads, :loads]).max()


def barely_definite(table: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Return the best 3 x 3 conclusion of one rule, and the best whose eigenvalues are not below the least.

    By scipy from Cholesky factors: another formulation.
    """
    force, seen = table.wrench[:, :3], table.displacement[:, :3]
    free = np.linalg.lstsq(force, seen)[0].T
    free = 0.5 * (free + free.T)
    unit = 1e-6

    def matrix(x: np.ndarray, least: float) -> np.ndarray:
        root = np.zeros((3, 3))
        root[np.tril_indices(3)] = x
        return unit * (root @ root.T + least * np.eye(3))

    def cost(x: np.ndarray, least: float) -> float:
        gap = seen - force @ matrix(x, least)
        return float((gap**2).sum() / SIGMA**2)

    least = 1e-6
    best = min(
        (
            minimize(cost, np.random.default_rng(seed).normal(size=6), (least,), options={"gtol": 1e-10})
            for seed in range(4)
        ),
        key=lambda one: float(one.fun),
    )
    return free, matrix(best.x, least)


def test_definite_conclusions_are_the_best_that_are() -> None:
    """A compliance that is no compliance (an eigenvalue below zero): the closest that is one."""
    wrong = np.zeros((6, 6))
    wrong[:3, :3] = 1e-6 * np.array([[2.0, 1.5, 0.3], [1.5, 1.0, -0.2], [0.3, -0.2, 0.8]])
    assert np.linalg.eigvalsh(wrong[:3, :3])[0] < 0
    table = rows(lambda _, wrench: wrench @ wrong, 50, noise=1e-5)
    single = Partition(("q2", "q8"), (np.array([0.0]), np.array([0.0])))
    readings, firing = build_readings(table, LENGTH, "n7"), np.ones((50, 1))
    found = readings.matrices(fit_conclusions(readings, single, firing, positive=True))[0, :3, :3]
    _, best = barely_definite(table)
    values = np.linalg.eigvalsh(found)
    assert 0 < values[0] < 2e-3 * values[-1]
    assert np.abs(found - best).max() < 3e-3 * np.abs(best).max()


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_definite_conclusions_stay_definite_whatever_the_readings(seed: int) -> None:
    random = np.random.default_rng(seed)
    table = rows(lambda q, _: 1e-3 * random.standard_normal((len(q), 6)), 30)
    readings, firing = build_readings(table, LENGTH, "n7"), PARTITION.firing(table.q)
    found = readings.matrices(fit_conclusions(readings, PARTITION, firing, positive=True))[:, :3, :3]
    assert np.abs(found - found.swapaxes(1, 2)).max() == 0.0
    assert np.linalg.eigvalsh(found)[:, 0].min() > 0


def test_conclusions_that_are_definite_anyway_are_left_alone() -> None:
    table = rows(planted(PARTITION).predict, 60, noise=1e-6)
    readings, firing = build_readings(table, LENGTH, "n7"), PARTITION.firing(table.q)
    free, held = (fit_conclusions(readings, PARTITION, firing, positive=p) for p in (False, True))
    assert np.array_equal(free, held)


def test_a_rule_that_no_reading_reaches_follows_its_neighbours() -> None:
    modal = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    line = Partition(("q2", "q8"), (modal, np.array([0.0])))
    table = rows(lambda q, wrench: (2e-6 + 1e-6 * q[:, :1]) * wrench, 60)
    few = replace(table, q=np.where(np.arange(2) == 0, np.minimum(table.q, 0.4), table.q))
    few = replace(
        few, displacement=np.where(np.arange(6) < 3, (2e-6 + 1e-6 * few.q[:, :1]) * few.wrench, np.nan)
    )
    readings = build_readings(few, LENGTH, "n7")
    found = readings.matrices(fit_conclusions(readings, line, line.firing(few.q)))
    assert np.allclose(found[:, 0, 0], 2e-6 + 1e-6 * modal, rtol=1e-3)


def test_solis_and_wets_find_the_bottom_of_a_pit_that_has_no_gradient() -> None:
    def valley(x: np.ndarray) -> float:
        return float(np.abs(x[0] - 0.3) + 2 * np.abs(x[1] + 0.3))

    found, least = solis_wets(valley, np.zeros(2), 0.3, 4000, np.random.default_rng(0))
    assert np.abs(found - [0.3, -0.3]).max() < 1e-2
    assert least == valley(found)


def test_the_partition_is_placed_where_the_compliance_bends() -> None:
    truth = planted(PARTITION)
    fit = fit_fuzzy(ir663(), rows(truth.predict, 150, noise=1e-5), seed=1)
    tests = [step.test for step in fit.steps]  # each set more made the test set better
    assert tests == sorted(tests, reverse=True)
    assert len(tests) >= 3
    assert 0 < fit.test_rows.mean() < 0.5
    premises = fit.model.system.premises
    assert premises.sets[0] >= 3
    assert np.abs(premises.modal_values[0] - 0.2).min() < 0.03
    assert premises.sets[1] == 2
    q = np.random.default_rng(1).uniform(-0.9, 0.9, (200, 2))
    push = np.tile([900.0, -500.0, 300.0, 0, 0, 0], (200, 1))
    gap = fit.model.predict(q, push)[:, :3] - truth.predict(q, push)[:, :3]
    assert np.sqrt((gap**2).mean()) < 1e-5


@pytest.mark.parametrize("modal", [[-1.0, 1.0], [0.0]], ids=["of one input", "constant"])
def test_an_input_that_plays_no_part_gets_no_set(modal: list[float]) -> None:
    line = Partition(("q2", "q8"), (np.array(modal), np.array([0.0])))
    fit = fit_fuzzy(ir663(), rows(planted(line).predict, 100, noise=2e-5))
    assert fit.steps[-1].sets == (len(modal), 1)


def test_the_same_seed_gives_the_same_rules() -> None:
    table = rows(planted(PARTITION).predict, 40, noise=1e-5)
    one, other = (fit_fuzzy(ir663(), table, seed=4).model.system for _ in range(2))
    assert np.array_equal(one.conclusions, other.conclusions, equal_nan=True)


def test_a_fitted_compliance_is_symmetric_and_definite_everywhere() -> None:
    table = rows(planted(PARTITION).predict, 40, noise=3e-4)
    model = fit_fuzzy(ir663(), table).model.extrapolating()
    everywhere = model.compliance(np.random.default_rng(0).uniform(-2, 2, (300, 2)))[:, :3, :3]
    assert np.array_equal(everywhere, everywhere.swapaxes(1, 2))
    assert np.linalg.eigvalsh(everywhere)[:, 0].min() > 0


def test_readings_elsewhere_or_of_another_kind_are_refused() -> None:
    table = rows(planted(PARTITION).predict, 20)
    with pytest.raises(
        BeamstiffError, match=r"measured at 'n10' under a load at 'n7', expected the TCP 'n7'"
    ):
        build_readings(replace(table, point=np.full(20, "n10")), LENGTH, "n7")
    with pytest.raises(BeamstiffError, match=r"holds absolute positions"):
        build_readings(make_measurements(["q2"], [[0.0]], tcp="n7", position=[[0.0, 0, 0]]), LENGTH, "n7")
    with pytest.raises(BeamstiffError, match=r"no loaded row with a measured displacement"):
        build_readings(replace(table, wrench=0 * table.wrench), LENGTH, "n7")


def test_too_few_poses_for_a_test_set_are_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"found 1 poses, expected enough to hold a share of 0.3"):
        fit_fuzzy(ir663(), replace(rows(planted(PARTITION).predict, 20), pose=np.zeros(20, dtype=np.int64)))
