"""What to measure next where several causes make up the gap."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.causes import Decomposition
from beamstiff.diagnosis.decomposition.forms import forms_of
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.next_measurement.between_causes import (
    Ahead,
    alike_in_positions,
    propose_between,
)
from tests.diagnosis.decomposition.test_decompose import found, read

CAUSES = ("approach", "gear", "slip")


def decomposition() -> Decomposition:
    result = found(*CAUSES)[0].decomposition
    assert result is not None
    return result


def test_what_is_foretold_of_the_rows_at_hand_is_what_was_fitted_to_them() -> None:
    several = decomposition()
    model = several.model
    forms = [form for cause in several.causes for form in cause.forms if form.effect != "target-slip"]
    matrix = Ahead(several, model.baseline.rows).foretold(forms).matrix[model.used[:, 0]]
    opened = model.tangent[: model.count] * model.baseline.sigma[model.used][:, None]
    width = model.tangent.shape[1]
    assert matrix[:, :, :width].reshape(-1, width) == pytest.approx(opened, abs=1e-9)
    columns = np.concatenate([form.columns[: model.count] for form in forms], axis=1)
    expected = columns * model.baseline.sigma[model.used][:, None]
    assert matrix[:, :, width:].reshape(-1, columns.shape[1]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_without_look_alikes_the_proposed_postures_bound_the_causes_better_than_others() -> None:
    result, robot = found(*CAUSES)
    assert len(result.next) == 12  # the table has no loads: one reading in each posture
    proposed = np.array([list(item["q"].values()) for item in result.next])
    rows = result.baseline.rows
    others = np.random.default_rng(11).uniform(-2.5, 2.5, proposed.shape)

    def sizes(q: np.ndarray) -> float:
        measured = read(robot, np.concatenate([rows.q, q]), CAUSES, np.random.default_rng(5))
        causes = diagnose(robot, measured).to_dict()["causes"]
        return sum(
            float(np.log(item["std"]))
            for cause in causes
            for name, item in cause["parameters"].items()
            if cause["effect"] != "target-slip" and name != "rows"
        )

    assert sizes(proposed) < sizes(others)


def test_a_look_alike_is_told_apart_where_the_two_foretell_different_positions() -> None:
    several = decomposition()
    first = several.causes[0]
    like = next(form for form in forms_of(several.model) if form.key == "angle-curve:q2")
    doubtful = replace(first, probability=0.6, indistinguishable=(like.key,), rivals=(like,))
    proposed = propose_between(replace(several, causes=(doubtful, *several.causes[1:])), 0)
    assert proposed.separates == (first.key, like.key)
    assert proposed.score.min() > 0
    assert proposed.score[0] == proposed.score.max()


def test_positions_do_not_tell_a_balancer_from_a_curve_of_its_joint_but_torques_do() -> None:
    baseline = decomposition().model.baseline
    alike = partial(alike_in_positions, "angle-curve:q2", baseline=baseline)
    assert "tau_JOINT" in alike("gravity-compensator:q2")
    assert not alike("gravity-compensator:q3")
    assert not alike("geometry-error:q2")
    torque = np.ones_like(baseline.rows.q)
    told = replace(baseline, rows=replace(baseline.rows, torque=torque))
    assert not alike_in_positions("angle-curve:q2", "gravity-compensator:q2", told)


def test_a_diagnosis_without_a_gap_proposes_nothing() -> None:
    result, _ = found()
    assert not result.next
