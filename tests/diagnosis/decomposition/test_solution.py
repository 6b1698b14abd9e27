"""What is left out of a fit stays out, and nothing else with it."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.fit import build_choice, fit_step, forms_in
from beamstiff.diagnosis.decomposition.forms import Form, forms_of
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.decomposition.solution import solved
from tests.diagnosis.decomposition.test_decompose import found


def matrices_of_compliances(model: OpenModel) -> list[Form]:
    effects = ("base-compliance", "tool-compliance", "bearing-tilt", "link-bending")
    return [form for form in forms_of(model, effects=effects) if len(form.couplings)]


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_with_parameters_left_out_is_the_same_when_it_is_solved_again(seed: int) -> None:
    decomposition = found()[0].decomposition
    assert decomposition is not None
    rng, model = np.random.default_rng(seed), decomposition.model
    forms = matrices_of_compliances(model)
    assert forms
    left_out = 0
    for form in forms:
        moved = form.columns @ rng.standard_normal(form.sizes.size)  # gives work away: no machine does
        noise = rng.standard_normal(len(model.residual))
        given = replace(model, residual=30.0 * moved / np.linalg.norm(moved) * np.sqrt(model.count) + noise)
        choice = build_choice(given, [form])
        step = fit_step(choice, (0,))
        (once,) = forms_in(choice, step).values()
        left_out += int((~step.free[0]).sum())
        theta = solved(given, [once])[0][-form.sizes.size :]
        basis = given.open_basis
        left = given.residual - form.columns @ theta
        left = left - basis @ (basis.T @ left)
        assert left @ left == pytest.approx(step.left @ step.left, rel=1e-6)
    assert left_out > 0
