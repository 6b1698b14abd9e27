"""Whitened residuals and their derivatives, several data sets, and data that can carry no identification."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.problem import build_problem
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from tests.identification.campaigns import (
    POSITION,
    ROTATION,
    compliances,
    kr240,
    least_squares,
    measured,
    rows,
    sensitivities,
    white,
)

SPREAD = np.repeat([POSITION, ROTATION], 3)
BY = ("log", "stiffness", "compliance")


@pytest.mark.parametrize("by", BY)
@pytest.mark.parametrize("name", ["kr240-2", "ir663", "ir663-screws-beams"])
def test_derivatives_by_every_parametrisation_are_differences_of_the_residuals(name: str, by: str) -> None:
    """Fourth-order central differences in the parametrisation itself."""
    problem = build_problem(*any_data(name))
    stiffness = problem.model.start * 10 ** np.random.default_rng(3).uniform(
        -0.5, 0.5, len(problem.model.start)
    )
    at, back = {
        "log": (np.log(stiffness), np.exp),
        "stiffness": (stiffness, lambda x: x),
        "compliance": (1 / stiffness, lambda x: 1 / x),
    }[by]
    residuals, jacobian = problem.jacobian(stiffness, by)
    assert residuals == pytest.approx(problem.residuals(stiffness), rel=1e-12, abs=1e-9)
    for column, value in enumerate(at):
        step = 1e-3 * (1.0 if by == "log" else value)
        unit = step * np.eye(len(at))[column]
        two, four = (
            (problem.residuals(back(at + n * unit)) - problem.residuals(back(at - n * unit))) / (2 * n * step)
            for n in (1, 2)
        )
        expected = (4 * two - four) / 3
        assert jacobian[:, column] == pytest.approx(expected, abs=1e-8 * np.abs(jacobian[:, column]).max())


def test_an_unknown_parametrisation_is_named() -> None:
    problem = build_problem(*any_data("kr240-2"))
    with pytest.raises(
        BeamstiffError, match=r"no derivatives by 'compliances' \(did you mean 'compliance'\?\)"
    ):
        problem.jacobian(problem.model.start, "compliances")


def any_data(name: str) -> tuple[Robot, Measurements]:
    """Return a robot and loads at a few of its poses, with noise."""
    robot = load_robot(name)
    random = np.random.default_rng(0)
    limits = np.array([variable.limits or (-1.0, 1.0) for variable in robot.actuated])
    middle, half = limits.mean(axis=1), 0.15 * (limits[:, 1] - limits[:, 0])
    count = 8
    table = make_measurements(
        [variable.name for variable in robot.actuated],
        middle + half * random.uniform(-1, 1, (count, len(middle))),
        tcp=robot.tcp,
        wrench=random.normal(size=(count, 6)) * [900, 900, 900, 200, 200, 200],
        displacement=np.zeros((count, 6)),
        sigma_position=POSITION,
        sigma_rotation=ROTATION,
    )
    return robot, measured(robot, table, white(table, 1))


# several data sets


def test_several_tables_are_one_campaign_each_row_with_its_own_noise() -> None:
    """A rough and a fine tracker: the estimate is that of weighted least squares over both."""
    robot, table = kr240(), rows(kr240(), 12)
    rough = subset(
        replace(table, sigma=10 * table.sigma, sigma_position=None, sigma_rotation=None), np.arange(6)
    )
    fine = subset(table, np.arange(6, 12))
    noise = white(table, 4)
    parts = [measured(robot, rough, 10 * noise[:6]), measured(robot, fine, noise[6:])]
    found = identify(robot, parts, folds=0)
    sigma = np.concatenate([np.tile(10 * SPREAD, 6), np.tile(SPREAD, 6)])
    readings = np.concatenate([part.displacement.ravel() for part in parts])
    best, covariance, _ = least_squares(
        sensitivities(robot, table).reshape(-1, 6), readings, np.diag(sigma**2)
    )
    assert 1 / found.stiffness == pytest.approx(best, rel=1e-7)
    spread = np.sqrt(np.diagonal(covariance) * max(found.chi_square, 1.0)) / best
    assert np.sqrt(np.diagonal(found.covariance)) == pytest.approx(spread, rel=1e-6)


def test_tables_of_other_variables_are_refused_with_both_names() -> None:
    robot, table = kr240(), measured(kr240(), rows(kr240(), 4))
    other = replace(table, variables=tuple(reversed(table.variables)), sources=("other",))
    with pytest.raises(BeamstiffError, match="campaign and other: found variables"):
        identify(robot, [table, other])


# bad data


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wrench": np.zeros((4, 6))}, "campaign: all loads are zero; without load no stiffness can be"),
        ({"displacement": np.full((4, 6), np.nan)}, "campaign: found no measured displacements"),
        ({"kind": "absolute"}, "campaign: holds absolute positions"),
    ],
)
def test_data_that_cannot_carry_an_identification_are_refused(change: dict, message: str) -> None:
    table = measured(kr240(), rows(kr240(), 4))
    with pytest.raises(BeamstiffError, match=message):
        build_problem(kr240(), replace(table, **change))


def test_fewer_readings_than_parameters_are_counted() -> None:
    table = measured(kr240(), rows(kr240(), 1))
    displacement = table.displacement.copy()
    displacement[:, 3:] = np.nan
    with pytest.raises(
        BeamstiffError, match=r"3 measured components in 1 row for 6 parameters \(J1\.torsional, "
    ):
        build_problem(kr240(), replace(table, displacement=displacement))


def test_noise_stated_for_some_rows_only_is_refused_with_the_row() -> None:
    table = measured(kr240(), rows(kr240(), 4))
    sigma = table.sigma.copy()
    sigma[2] = np.nan
    with pytest.raises(BeamstiffError, match="the noise of this row is not stated"):
        build_problem(kr240(), replace(table, sigma=sigma))


def test_rotations_of_unknown_noise_are_left_aside_and_it_is_said() -> None:
    table = measured(kr240(), rows(kr240(), 4))
    sigma = table.sigma.copy()
    sigma[:, 3:] = np.nan
    problem = build_problem(kr240(), replace(table, sigma=sigma))
    assert not problem.used[:, 3:].any()
    assert "sigma_rotation" in problem.notes[0]


def test_only_the_components_asked_for_count() -> None:
    """Position only, rotation only, both: each the least squares of its rows of A."""
    robot, table = kr240(), rows(kr240(), 12)
    data = measured(robot, table, white(table, 2))
    a, d = sensitivities(robot, table) / SPREAD[:, None], data.displacement / SPREAD
    for components, some in (("position", slice(0, 3)), ("rotation", slice(3, 6)), ("both", slice(0, 6))):
        free = list(range(5 if components == "position" else 6))  # joint 6 turns about the tool
        names = [robot.identify[at] for at in free]
        rest = np.delete(np.arange(6), free)
        target = d[:, some] - (a[:, some][:, :, rest] @ compliances(robot)[rest])
        best = np.linalg.lstsq(a[:, some][:, :, free].reshape(-1, len(free)), target.ravel())[0]
        found = identify(robot, data, names, components=components, folds=0)
        assert 1 / found.stiffness == pytest.approx(best, rel=1e-7)
