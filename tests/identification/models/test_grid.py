"""Gridded stiffness from readings: cube by cube, shrunk; cubes without data."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.models.grid import cubes_about, fit_grid
from beamstiff.measure.rows import subset
from beamstiff.model.grid import Cubes, tcp_positions
from beamstiff.model.grid_sampling import sample, sampling_points
from beamstiff.robot.kinematics import compile_kinematics
from tests.identification.varying_machines import (
    DOWN,
    HOME,
    WORKSPACE,
    compliances,
    kr500,
    lever,
    loads,
    nothing,
    postures,
    table,
)


def sampled(cubes: Cubes = WORKSPACE) -> np.ndarray:
    return sample(compile_kinematics(kr500()), sampling_points(cubes), DOWN, start=HOME).q


def test_each_cube_for_itself_is_what_identify_says_of_its_rows() -> None:
    q = sampled()
    rows = table(q, loads(len(q)), lever)
    fit = fit_grid(kr500(), rows, WORKSPACE, shrink=False)
    inside = WORKSPACE.inside(tcp_positions(kr500(), q))
    assert inside.sum(axis=0).tolist() == fit.model.rows.tolist() == [27, 27]
    for cube in range(2):
        alone = identify(kr500(), subset(rows, inside[:, cube]), folds=0)
        assert np.allclose(fit.model.compliance[cube], 1 / alone.stiffness, rtol=1e-9)


def test_planted_cubes_come_back() -> None:
    q = postures(60)
    left = tcp_positions(kr500(), q)[:, 1] > 0
    rows = table(q, loads(60), lambda _: 0.3 * left[:, None] * np.array([1, -1, 1, 0, 0.5, 0]), noise=1e-9)
    for shrink in (False, True):
        found = fit_grid(kr500(), rows, WORKSPACE, shrink=shrink).model.compliance / compliances()
        assert np.allclose(np.log(found), [np.zeros(6), [0.3, -0.3, 0.3, 0, 0.15, 0]], atol=3e-3)


def test_shrinking_takes_the_scatter_out_where_nothing_varies() -> None:
    cubes = Cubes(WORKSPACE.low, 0.3, (2, 4, 2))
    q = sampled(cubes)
    rows = table(q, loads(len(q)), nothing, noise=4e-5, sigma=4e-5)
    alone, shrunk = (
        np.log(fit_grid(kr500(), rows, cubes, shrink=shrink).model.compliance / compliances()).std(axis=0)
        for shrink in (False, True)
    )
    # chance may leave one spring some spread
    assert (shrunk < 0.1 * alone).sum() >= 5
    assert (shrunk < alone).all()


def test_springs_that_only_act_together_in_a_cube_are_lumped_there() -> None:
    """With the wrist stretched joints 4 and 6 turn about one line (seed 001, table 1: k4 = k6)."""
    q = np.deg2rad(
        [[10.0 * a, -60.0 + 5 * b, 60.0 - 5 * b, 5.0, 0.0, 3.0 * a] for a in range(3) for b in range(3)]
    )
    rows = table(q, loads(9), nothing)
    cubes = cubes_about(kr500(), rows, 5.0)
    fit = fit_grid(kr500(), rows, cubes, shrink=False)
    assert fit.notes == ("cube 1.1.1: only 1/J4.torsional + 1/J6.torsional is known",)
    sums = fit.model.compliance[0, 3] + fit.model.compliance[0, 5]
    assert np.isclose(sums, compliances()[3] + compliances()[5], rtol=0.02)


def test_springs_that_no_row_of_a_cube_feels_are_said() -> None:
    q = sampled()
    rows = table(q, np.tile([0, 0, -500.0, 0, 0, 0], (len(q), 1)), nothing)
    notes = fit_grid(kr500(), rows, WORKSPACE, shrink=False).notes
    assert "cube 1.1.1: its rows do not feel J1.torsional, J6.torsional" in notes


def test_a_cube_without_data_is_refused_or_has_the_common_value_and_a_flag() -> None:
    q = postures(60)
    q = q[tcp_positions(kr500(), q)[:, 1] < -0.01]
    rows = table(q, loads(len(q)), nothing)
    with pytest.raises(
        BeamstiffError, match=r"cube 1.2.1 holds no row; measure there, make the cubes larger"
    ):
        fit_grid(kr500(), rows, WORKSPACE, shrink=False)
    model = fit_grid(kr500(), rows, WORKSPACE).model
    assert model.rows[1] == 0
    assert np.allclose(model.compliance[1], model.compliance[0], rtol=0.02)
    beyond = postures(60)[tcp_positions(kr500(), postures(60))[:, 1] > 0.01][:1]
    assert model.outside(beyond).tolist() == [True]
    with pytest.raises(BeamstiffError, match=r"cube 1.2.1 that has no data"):
        model.predict(beyond, loads(1))


def test_a_cube_with_too_few_rows_is_named() -> None:
    q = postures(60)
    across = tcp_positions(kr500(), q)[:, 1]
    left, right = np.flatnonzero(across > 0.01), np.flatnonzero(across < -0.01)
    rows = table(q[np.append(right, left[:1])], loads(len(right) + 1), nothing)
    seen = np.where(np.arange(6) < 3, rows.displacement, np.nan)
    rows = replace(rows, displacement=seen)
    with pytest.raises(BeamstiffError, match=r"cube 1.2.1: .*3 measured components .* for 6 parameters"):
        fit_grid(kr500(), rows, WORKSPACE, shrink=False)


def test_rows_beyond_the_grid_are_refused() -> None:
    rows = table(postures(20), loads(20), nothing)
    with pytest.raises(BeamstiffError, match=r"<arrays>:\d+: the TCP at .* m lies beyond the grid"):
        fit_grid(kr500(), rows, Cubes(WORKSPACE.low, 0.3, (1, 1, 1)))


def test_cubes_about_a_table_hold_all_its_rows() -> None:
    rows = table(postures(50), loads(50), nothing)
    for size in (0.2, 0.45, 3.0):
        assert cubes_about(kr500(), rows, size).inside(tcp_positions(kr500(), rows.q)).any(axis=1).all()


def test_cubes_that_nobody_could_fit_are_refused_before_they_take_all_memory() -> None:
    rows = table(postures(50), loads(50), nothing)
    with pytest.raises(BeamstiffError, match=r"cubes of 0.001 mm about the TCP, expected 1000 at most"):
        cubes_about(kr500(), rows, 1e-6)
