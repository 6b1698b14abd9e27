"""Errors of loads settle with what is compliant under them."""

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.settling import SETTLING, _part
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.exam.crowded.cases import CrowdedExam, draw_crowded_case

LOAD = ("payload-error:null", "mass")


@pytest.mark.parametrize("slope", [-2.5, -1.9, -0.5])
def test_turns_that_overshoot_by_more_than_they_mend_settle(slope: float) -> None:
    """x becomes slope x + 3 in a turn: turn by turn alone that diverges below -1."""
    limit = np.array([3.0 / (1.0 - slope), 1.0])
    state, part, before = np.array([10.0, 1.0]), 0.5, None
    for _ in range(SETTLING - 1):
        way = {LOAD: np.array([slope * state[0] + 3.0, 1.0]) - state}
        part = _part(part, before, way)
        state, before = state + part * way[LOAD], way
    np.testing.assert_allclose(state, limit, atol=1e-6 * 10.0)


@pytest.mark.slow
def test_the_compliance_of_a_base_is_found_beside_the_payload_that_it_carries() -> None:
    """Fits in turn overshot: the answer was one without the payload, and left ten times as much."""
    drawn = draw_crowded_case(CrowdedExam(seed=20270501), 49)
    found = diagnose(drawn.robot, drawn.measured(np.random.default_rng([20270501, 49, 4]))).decomposition
    assert {"base-compliance:null", "link-bending:link2"} <= {one.key for one in found.every}
    assert found.scatter < 2.0


@pytest.mark.slow
def test_a_fit_that_is_worse_than_no_cause_on_other_postures_is_no_start() -> None:
    """Displacements about another calibration: its criterion was the least, and then no cause was told."""
    drawn = draw_crowded_case(CrowdedExam(seed=20270501), 74)
    found = diagnose(drawn.robot, drawn.measured(np.random.default_rng([20270501, 74, 4]))).decomposition
    ground = {"base-compliance:null", "bearing-tilt:q1"}
    assert ground & {found.every[0].key, *found.every[0].indistinguishable}
    assert found.scatter < 10.0
