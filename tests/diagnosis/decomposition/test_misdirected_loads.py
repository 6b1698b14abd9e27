"""Displacements under loads that pull elsewhere than stated, on drives that are off: a product of both.

The readings come from the linear statics of another robot under other loads, not from the diagnosis.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.decomposition.fit import build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import folds_of
from beamstiff.diagnosis.decomposition.forms import Form
from beamstiff.diagnosis.decomposition.loads import unlike_linear
from beamstiff.diagnosis.decomposition.open_model import OpenModel, open_stiffness
from beamstiff.diagnosis.decomposition.settling import Settings, all_forms, settle, solution_of
from beamstiff.diagnosis.prior import DEFAULT
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot
from tests.diagnosis.machines import at_random

NOISE = 2e-6  # m
AXIS = "J6.torsional"  # which no force at the flange turns: it stands on the axis
DRIVES = tuple(f"J{number}.torsional" for number in range(1, 7))
OFF = dict(zip(DRIVES, (0.7, 1.4, 0.8, 0.6, 1.3, 1.0), strict=True))  # of the robot file's stiffness
TURNED = np.radians([2.0, -3.0, 1.5])  # a rotation vector


def robot() -> Robot:
    return load_robot("kr240-2").model_copy(update={"identify": DRIVES})


@cache
def rows() -> Measurements:
    """Return 30 postures under forces of the flange that pull elsewhere than the table says."""
    stated = at_random(robot(), 30, seed=4, sigma_position=NOISE)
    force = stated.wrench * [1, 1, 1, 0, 0, 0]
    pulled = np.hstack([Rotation.from_rotvec(TURNED).apply(force[:, :3]), np.zeros((30, 3))])
    real = robot().with_parameters({name: share * robot().parameter(name) for name, share in OFF.items()})
    moved = predict_displacements(real, replace(stated, wrench=pulled))
    moved[:, :3] += NOISE * np.random.default_rng(5).standard_normal((30, 3))
    moved[:, 3:] = np.nan
    return replace(stated, wrench=force, displacement=moved)


@cache
def opened() -> tuple[Settings, OpenModel, tuple[Form, ...]]:
    """Return the open model of these rows, and the form of a load that pulls elsewhere."""
    model = open_stiffness(fit_baseline(robot(), rows()))
    forms = [form for form in all_forms(model, DEFAULT) if form.key == "load-error:null"]
    chosen = tuple(form for form in forms if form.shape.name == "direction")
    return Settings(robot(), None, False, DEFAULT, 0), model, chosen


def test_a_drive_that_no_load_turns_stays_as_it_is() -> None:
    """Rounding made it a compliance of 1e4 rad/(N m), under which the machine buckles."""
    _, model, chosen = opened()
    change, _ = solution_of(model, chosen)
    assert change[DRIVES.index(AXIS)] == 0.0
    assert model.robot(change).parameter(AXIS) == pytest.approx(robot().parameter(AXIS), rel=1e-12)


def test_what_was_calibrated_beside_an_error_of_loads_moves_on_these_drives_as_it_did() -> None:
    """A base that gives way under these loads does so under their errors, on whatever drives."""
    settings, model, chosen = opened()
    there = settings.calibrated(model, chosen, solution_of(model, chosen))
    of_base = [form for form in all_forms(there, DEFAULT) if form.key == "base-compliance:null"]
    again = [*of_base[:1], *(form for form in all_forms(there, DEFAULT) if form.shape.name == "direction")]
    thetas = [np.ones(form.sizes.size) for form in again]
    assert there.stated is not None
    assert unlike_linear(there, again, thetas, np.zeros(len(DRIVES)))[0] == pytest.approx(0.0, abs=1e-9)


def test_drives_and_the_direction_of_the_loads_settle_on_what_is_there() -> None:
    settings, model, chosen = opened()
    there = settle(settings, model, 1.0, chosen)
    assert there is not None
    form = next(form for form in all_forms(there, DEFAULT) if form.shape.name == "direction")
    change, (theta,) = solution_of(there, [form])
    np.testing.assert_allclose(theta * form.sizes, TURNED, atol=2e-3)  # second order in it: 1e-3
    found = there.robot(change)
    for name, share in OFF.items():
        assert found.parameter(name) == pytest.approx(share * robot().parameter(name), rel=0.03), name


def test_the_direction_is_named_and_nothing_else() -> None:
    found = decompose(robot(), rows())
    assert [one.key for one in found.every] == ["load-error:null"]
    assert found.every[0].named
    assert found.scatter < 1.3


def test_folds_of_some_forms_say_what_all_say_and_lack_the_others() -> None:
    _, model, _ = opened()
    choice = build_choice(model, all_forms(model, DEFAULT))
    folds = folds_of(model, choice, 0)
    left = [number for number, form in enumerate(choice.forms) if form.key != "base-compliance:null"]
    some = folds.of_forms(left)
    assert "base-compliance:null" not in some.choice.of_cause
    number = next(number for number in left if choice.forms[number].shape.name == "direction")
    step, same = fit_step(choice, [number]), fit_step(some.choice, [left.index(number)])
    assert same.squares == pytest.approx(step.squares)
    np.testing.assert_allclose(some.squared_errors(same), folds.squared_errors(step), rtol=1e-9)
