"""The stiffness about which effects are linear, where a fit without the effect is far from it."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Node, Rigid, Robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects.torque_laws import change_of_drives
from beamstiff.diagnosis.held_out.score import Weighted, fitted
from beamstiff.diagnosis.inference.library import build_library
from beamstiff.diagnosis.residual.baseline import around, fit_baseline
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from tests.diagnosis.machines import POSITION, ROTATION, kr240, rows_of
from tests.diagnosis.planted import REAL, bearing_tilt, campaign, plan

AWAY = (0.1, -0.05, 0.25)  # m: where the load really acts, in the tool's frame


def machine() -> Robot:
    """Return the KR240-2 with drives of its own stiffness, and a node where the load really acts."""
    robot = kr240()
    names = robot.identify
    real = dict(zip(names, (REAL * [robot.parameter(name) for name in names]).tolist(), strict=True))
    update = {
        "nodes": (*robot.nodes, Node(name="lug", frame="f6", at=AWAY)),
        "rigids": (*robot.rigids, Rigid(name="bracket", nodes=["n6b", "lug"])),
    }
    return robot.with_parameters(real).model_copy(update=update)


def measured(seed: int = 0) -> Measurements:
    """Return a campaign whose load acts there, and whose table says it acts at the TCP."""
    how = plan(12, seed)
    rows = rows_of(kr240(), how.q, how.wrench)
    moved = predict_displacements(machine(), replace(rows, load_point=np.full(len(rows), "lug")))
    noise = np.random.default_rng(seed).standard_normal(moved.shape) * np.repeat([POSITION, ROTATION], 3)
    sigma = {"sigma_position": POSITION, "sigma_rotation": ROTATION}
    order = {"pose": how.pose, "step": how.step}
    return rows_of(kr240(), how.q, how.wrench, displacement=moved + noise, **order, **sigma)


@pytest.mark.slow
def test_effects_are_weighed_about_the_stiffness_beside_the_cause_and_not_the_one_bent_to_the_gap() -> None:
    found = diagnose(kr240(), measured())
    assert found.verdict.key == "tool-offset:null"
    names = kr240().identify
    nominal = np.array([kr240().parameter(name) for name in names])
    bent = np.log([found.baseline.robot.parameter(name) for name in names] / (REAL * nominal))
    near = np.log([found.linear.robot.parameter(name) for name in names] / (REAL * nominal))
    assert np.abs(bent).max() > 0.2
    assert np.abs(near).max() < 0.5 * np.abs(bent).max()
    assert found.verdict.shape == "load"
    values = [one.value for one in found.verdict.estimates]
    assert np.linalg.norm(np.subtract(values, AWAY)) < 0.1 * np.linalg.norm(AWAY)
    (load,) = (
        one
        for one in build_library(found.baseline, whiten(found.baseline)).hypotheses
        if (one.key, one.shape.name) == ("tool-offset:null", "load")
    )
    about_bent = fitted(found.baseline, found.baseline.used, [[Weighted(load, 1.0, 10.0)]], 1.0)[0]
    assert np.linalg.norm(about_bent.theta * load.sizes - AWAY) > 0.25 * np.linalg.norm(AWAY)


def test_a_fit_is_the_same_from_anywhere() -> None:
    fit = fit_baseline(kr240(), measured(1))
    other = around(fit, REAL * [kr240().parameter(name) for name in fit.fitted])
    before, after = ([1 / at.robot.parameter(name) for name in fit.fitted] for at in (fit, other))
    np.testing.assert_array_equal(other.sigma, fit.sigma)
    np.testing.assert_array_equal(other.used, fit.used)
    # linear in the compliances but for the stiffness that the load itself makes
    predicted = fit.predicted + fit.tangent @ np.subtract(after, before)
    moved = np.abs(other.predicted - fit.predicted).max()
    np.testing.assert_allclose(other.predicted, predicted, rtol=0, atol=0.01 * moved)


@pytest.mark.parametrize("guess", [1e4, 1e8])
def test_guessed_drives_do_not_change_the_verdict(guess: float) -> None:
    rows = campaign(plan(), bearing_tilt)
    robot = kr240().with_parameters(dict.fromkeys(kr240().identify, guess))
    assert diagnose(robot, rows).verdict.key == "bearing-tilt:q3"  # as described: test_diagnose.py


def test_a_fit_that_a_cause_bent_is_no_guess_of_two_drives() -> None:
    """Of six drives the median is what guesses are off by; a cause may bend both of two."""
    fit = fit_baseline(kr240(), measured(1))
    bent = replace(fit, robot=fit.robot.with_parameters(dict.fromkeys(fit.fitted[:2], 10000.0)))
    assert 0.5 < change_of_drives(bent) < 2.0
    two = fit.nominal.with_parameters(dict.fromkeys(fit.fitted[2:], float("inf")))
    assert change_of_drives(replace(bent, given=two)) == 1.0
