"""What remains. Truth: noise that was drawn, beside geometry drawn as it is known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.remainder import remainder_of
from beamstiff.diagnosis.decomposition.solution import solved
from tests.diagnosis.decomposition.test_selection import found


def test_of_noise_alone_the_noise_remains_however_much_is_known_beforehand() -> None:
    model = found()[0].decomposition.model
    known = len(model.residual) - model.count
    assert known > 10
    rows = int(model.used[:, :3].any(axis=1).sum())
    noise2 = float((model.baseline.sigma[:, :3][model.used[:, :3]] ** 2).sum())
    squares = []
    for seed in range(300):
        drawn = replace(model, residual=np.random.default_rng(seed).standard_normal(model.count + known))
        rest = remainder_of(drawn, [], solved(drawn, [])[0], noise2, 2.0 * noise2, rows)
        squares.append(rest.rms**2 * rows / noise2)
    assert np.mean(squares) == pytest.approx(1.0, abs=4.0 * np.std(squares) / np.sqrt(300))
