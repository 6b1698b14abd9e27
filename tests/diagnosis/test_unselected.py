"""Causes that are there predict postures that had no say in their selection; what is by chance does not."""

from functools import partial

import numpy as np

from beamstiff.diagnosis.prior import DEFAULT
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.unselected import closes_unselected
from beamstiff.se3 import Array
from tests.diagnosis import planted
from tests.diagnosis.planted import Plan, base_compliance, campaign, kr240, plan


def chance(what: Plan) -> Array:
    """Each posture is moved in proportion to its load in a direction of its own: no machine does that."""
    direction = np.random.default_rng(7).standard_normal((what.pose.max() + 1, 3))
    moved = np.zeros((len(what.q), 6))
    load = np.linalg.norm(what.wrench[:, :3], axis=1, keepdims=True)
    moved[:, :3] = 3e-7 * load * direction[what.pose]
    return moved


def test_causes_that_are_there_close_the_gap_of_postures_that_did_not_select_them() -> None:
    soft_link = partial(planted.link_bending, EI=2e6)
    rows = campaign(plan(14), soft_link, planted.backlash, base_compliance)
    assert closes_unselected(fit_baseline(kr240(), rows), DEFAULT, 0) > 0.9


def test_what_fits_by_chance_closes_nothing_elsewhere() -> None:
    rows = campaign(plan(14), chance)
    assert closes_unselected(fit_baseline(kr240(), rows), DEFAULT, 0) < 0.2
