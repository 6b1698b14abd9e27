"""The gray box: fuzzy corrections of joint compliances that are there where, and only where, springs vary."""

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.models.fuzzy import fit_fuzzy_correction
from beamstiff.model.fuzzy_correction import FuzzyCorrection
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition
from beamstiff.model.linear import predict_displacements
from tests.identification.varying_machines import compliances, kr500, lever, loads, nothing, postures, table


def test_rules_without_correction_are_the_parametric_model() -> None:
    robot, q, push = kr500(), postures(10), loads(10)
    partition = Partition(("q2",), (np.array([-3.0, 3.0]),))
    still = FuzzyCorrection(robot, robot.identify, compliances(), FuzzySystem(partition, np.zeros((2, 6))))
    expected = predict_displacements(robot, table(q, push, nothing))
    assert np.abs(still.predict(q, push) - expected).max() < 1e-12 * np.abs(expected).max()


def test_a_correction_is_a_factor_that_follows_the_input() -> None:
    robot, q = kr500(), postures(10)
    partition = Partition(("q2",), (np.array([-3.0, 3.0]),))
    conclusions = np.zeros((2, 6))
    conclusions[1, 4] = np.log(9.0)
    model = FuzzyCorrection(robot, robot.identify, compliances(), FuzzySystem(partition, conclusions))
    factor = model.compliances(q) / compliances()
    assert np.allclose(factor[:, 4], 9.0 ** ((q[:, 1] + 3) / 6))
    assert np.allclose(np.delete(factor, 4, axis=1), 1.0)


def test_what_varies_is_corrected_by_the_inputs_that_it_follows() -> None:
    rows = table(postures(60), loads(60), lever)
    fit = fit_fuzzy_correction(kr500(), rows)
    sets = dict(zip(fit.model.system.premises.inputs, fit.sets[-1][0], strict=True))
    assert min(sets["q2"], sets["q3"]) >= 2
    assert max(sets["q1"], sets["q4"], sets["q6"]) == 1
    fresh, push = postures(200, seed=9), loads(200, seed=9)
    truth = table(fresh, push, lever, noise=0.0).displacement
    gray = fit.model.extrapolating().predict(fresh, push) - truth
    single = (
        predict_displacements(identify(kr500(), rows, folds=0).robot, table(fresh, push, nothing)) - truth
    )
    assert np.sqrt((gray[:, :3] ** 2).mean()) < 0.4 * np.sqrt((single[:, :3] ** 2).mean())


def test_where_nothing_varies_one_rule_is_enough() -> None:
    fit = fit_fuzzy_correction(kr500(), table(postures(40), loads(40), nothing))
    assert fit.sets[-1][0] == (1, 1, 1, 1, 1, 1)
    assert np.allclose(fit.model.compliances(postures(5)) / compliances(), 1.0, atol=0.05)


def test_each_set_more_had_more_evidence_and_outside_their_range_they_are_refused_or_flagged() -> None:
    fit = fit_fuzzy_correction(kr500(), table(postures(40), loads(40), lever))
    evidence, model = [value for _, value in fit.sets], fit.model
    assert len(evidence) > 1
    assert evidence == sorted(evidence)
    far = postures(1) + np.array([0, 1.5, 0, 0, 0, 0])
    with pytest.raises(BeamstiffError, match=r"row 0: found q2 = .* outside the trained range"):
        model.predict(far, loads(1))
    assert model.outside(far).tolist() == [True]
    assert np.isfinite(model.extrapolating().predict(far, loads(1))).all()
