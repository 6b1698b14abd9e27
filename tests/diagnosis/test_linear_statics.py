"""Readings that linear statics explains better than the equilibrium of the loaded machine are told."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from tests.diagnosis.machines import kr240

NOISE = 2e-6  # m: what second order adds is beyond it


@pytest.mark.slow
@pytest.mark.parametrize("preload", [True, False])
def test_linear_statics_is_told_where_it_made_the_readings_and_only_there(preload: bool) -> None:
    robot = kr240()
    rng = np.random.default_rng(5)
    q = np.array([0.0, 1.1, -1.4, 0.0, 0.6, 0.0]) + rng.uniform(-0.6, 0.6, (24, 6))
    wrench = np.concatenate([rng.uniform(-6000.0, 6000.0, (24, 3)), np.zeros((24, 3))], axis=1)
    names = [variable.name for variable in robot.actuated]
    nothing = np.zeros((24, 3))
    rows = make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench, displacement=nothing, sigma_position=NOISE
    )
    moved = predict_displacements(robot, rows, preload)[:, :3] + NOISE * rng.standard_normal((24, 3))
    result = diagnose(robot, replace(rows, displacement=np.hstack([moved, np.full((24, 3), np.nan)])))
    told = [
        note for note in result.notes if note.startswith("these displacements are those of linear statics")
    ]
    assert len(told) == (not preload)
    assert result.verdict.effect == "none"
