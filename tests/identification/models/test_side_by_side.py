"""Every model on the same rows: those that know what varies do better, those that cannot be fitted say so."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.identification.models.side_by_side import FITS, Models, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.table import Measurements
from tests.identification.varying_machines import kr500, lever, loads, nothing, postures, table


def measured(poses: int = 40, change: object = lever) -> Measurements:
    q = np.repeat(postures(poses), 2, axis=0)
    wrench = np.repeat(loads(poses), 2, axis=0) * np.tile([[0.5], [1.0]], (poses, 1))
    return table(q, wrench, change)


@pytest.fixture(scope="module")
def models() -> Models:
    rows = measured(40)
    return fit_models(kr500(), rows, split_rows(rows))


def test_all_models_are_fitted_and_judged(models: Models) -> None:
    assert [one.name for one in models.judged] == list(FITS)
    assert all(one.model is not None for one in models.judged)
    assert all(np.isfinite(one.error).all() for one in models.judged)


def test_models_that_let_springs_vary_leave_less_on_new_poses(models: Models) -> None:
    unseen = ~models.split.fitted
    left = {one.name: one.rms(unseen) or 0.0 for one in models.judged}
    assert left["gaussian process"] < left["gray box"] < left["parametric"] < left["rigid"]
    assert left["gaussian process"] < 0.3 * left["parametric"]
    assert left["grid"] < left["parametric"]


def test_errors_are_those_of_the_models_themselves(models: Models) -> None:
    one = models["gaussian process"]
    gap = models.table.displacement[:, :3] - one.model.predict(models.table.q, models.table.wrench)[:, :3]
    assert np.allclose(one.error, np.linalg.norm(gap, axis=1))
    some = models.split.new_pose
    assert np.isclose(one.rms(some) or 0.0, np.sqrt((gap[some] ** 2).sum(axis=1).mean()))
    assert np.isclose(one.largest(some) or 0.0, one.error[some].max())


def test_no_model_sees_what_is_held_out(models: Models) -> None:
    """Other readings there change no prediction."""
    rows = models.table
    seen = np.where(models.split.fitted[:, None], rows.displacement, rows.displacement + 1e-3)
    names = ["parametric", "grid", "fuzzy", "gaussian process"]
    again = fit_models(kr500(), replace(rows, displacement=seen), models.split, names)
    for other in again.judged:
        assert np.array_equal(models[other.name].predicted, other.predicted)


def test_the_noise_is_what_the_table_states(models: Models) -> None:
    assert np.isclose(models.noise or 0.0, np.sqrt(3) * 1e-5)


def test_a_model_that_the_rows_cannot_carry_says_why() -> None:
    alone = measured(1)
    split = split_rows(alone, 0.0)
    with pytest.raises(BeamstiffError, match=r"found 1 poses"):
        fit_models(kr500(), alone, split, ["fuzzy", "rigid"])
    refused = fit_models(kr500(), alone, split, ["fuzzy", "rigid", "parametric"])
    assert refused["fuzzy"].model is None
    assert "found 1 poses, expected enough to hold a share" in refused["fuzzy"].about
    assert refused["fuzzy"].rms(np.ones(2, dtype=bool)) is None
    assert refused["rigid"].model is not None


def test_rows_measured_elsewhere_are_refused() -> None:
    rows = measured(8)
    with pytest.raises(
        BeamstiffError, match=r"measured at 'n1a' under a load at 'n6b', expected the TCP 'n6b'"
    ):
        fit_models(kr500(), replace(rows, point=np.full(len(rows), "n1a")), split_rows(rows))


def test_an_unknown_model_is_refused(models: Models) -> None:
    rows = measured(8, nothing)
    with pytest.raises(BeamstiffError, match=r"there is no model 'fuzy' \(did you mean 'fuzzy'\?\)"):
        fit_models(kr500(), rows, split_rows(rows), ["fuzy"])
    with pytest.raises(BeamstiffError, match=r"there is no model 'gray' "):
        models["gray"]
