"""Which of two fits stands, by hand-made errors on held-out postures."""

from types import SimpleNamespace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.answer import _no_worse
from beamstiff.se3 import Array

POSTURES = 30


@pytest.mark.parametrize(
    ("parameters", "times", "stands"),
    [
        (2.0, 1.0, True),  # a simpler fit that leaves as much
        (2.0, 2.0, False),  # and one that leaves more
        (6.0, 1.0, False),  # one with as many parameters has to help
        (5.8, 1.0, False),
        (6.0, 0.5, True),
        (9.0, 0.5, True),
    ],
)
def test_a_simpler_fit_needs_to_do_no_harm_and_another_to_help(
    parameters: float, times: float, stands: bool
) -> None:
    left: Array = np.random.default_rng(0).chisquare(3, POSTURES)
    fits = {
        "now": SimpleNamespace(determined=6.0, left=left),
        "other": SimpleNamespace(determined=parameters, left=times * left),
    }
    folds = SimpleNamespace(squared_errors=lambda fit: fit.left)
    assert _no_worse(folds, fits["now"], fits["other"]) == stands
