"""What fits by chance promises nothing of postures that had no say in its selection."""

import numpy as np

from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.se3 import Array
from tests.diagnosis.planted import Plan, campaign, kr240, plan


def chance(what: Plan) -> Array:
    """Each posture is moved in proportion to its load in a direction of its own: no machine does that."""
    direction = np.random.default_rng(7).standard_normal((what.pose.max() + 1, 3))
    moved = np.zeros((len(what.q), 6))
    load = np.linalg.norm(what.wrench[:, :3], axis=1, keepdims=True)
    moved[:, :3] = 3e-7 * load * direction[what.pose]
    return moved


def test_what_fits_by_chance_closes_nothing_elsewhere() -> None:
    found = decompose(kr240(), campaign(plan(14), chance))
    assert sum(cause.closes for cause in (*found.causes, *found.unclear)) < 0.2
