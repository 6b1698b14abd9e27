"""What is written of drives that the weights of a calibrated robot hardly turn."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.applied import _as_described
from beamstiff.diagnosis.decomposition.open_model import open_geometry, orthonormal
from beamstiff.diagnosis.decomposition.solution import solved
from tests.diagnosis.decomposition.test_decompose import POSES, UR10, read

START = 1e6  # N m/rad
DRIVES = tuple(f"J{number}.torsional" for number in range(2, 6))


@pytest.mark.parametrize("undetermined", [0, 1000])
def test_a_drive_is_as_described_where_chance_alone_says_otherwise(undetermined: int) -> None:
    """Though what its value moves by itself shows: an error of the geometry makes up for a part.

    Parameters that the readings do not determine, such as of an arm that was not moved, say nothing of it.
    """
    robot, rng = load_robot(UR10).with_parameters(dict.fromkeys(DRIVES, START)), np.random.default_rng(1)
    robot = robot.model_copy(update={"identify": DRIVES})
    model = open_geometry(robot, read(robot, rng.uniform(-2.5, 2.5, (POSES, 6)), (), rng), settled=True)
    model = replace(model, tangent=np.pad(model.tangent, ((0, 0), (undetermined, 0))))
    geometry, own = orthonormal(np.delete(model.tangent, -1, axis=1)), model.tangent[:, -1]  # J5's
    seen = own - geometry @ (geometry.T @ own)
    noise, every = rng.standard_normal(len(seen)), orthonormal(model.tangent)
    noise = 0.99 * (noise - every @ (every.T @ noise))
    for deviations, described in ((1.75, True), (6.0, False)):
        change = np.append(np.zeros(model.tangent.shape[1] - 1), 1 / START - model.present[-1])
        about = noise + model.tangent @ change + deviations * seen / np.linalg.norm(seen)
        shifted = replace(model, residual=about)
        free = solved(shifted, ())[0][-1] - change[-1]
        assert np.linalg.norm(own) * free > 2.0
        found = _as_described(shifted)
        assert (abs(found[-1] - change[-1]) < 1e-12 / START) == described
