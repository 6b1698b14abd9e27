"""Priors of causes that a user sets: they move probabilities the right way, and wrong names are refused."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.prior import Prior
from tests.diagnosis.decomposition import test_decompose as ur10
from tests.diagnosis.machines import POSITION, elbow, kr240, sound
from tests.diagnosis.planted import backlash, campaign, load_error, plan, thermal_drift


def probability(prior: dict[str, float]) -> float:
    """Return how likely play at q3 is against hardening there, of a campaign with three load steps only."""
    others = [name for name in EFFECTS if name not in ("backlash", "hardening")]
    some = plan(4, steps=np.array([0.3, 0.6, 1.0]))
    found = diagnose(kr240(), campaign(some, backlash), prior=prior, without=others)
    share = {one.key: one.probability for one in found.candidates}
    return share["backlash:q3"] / (share["backlash:q3"] + share["hardening:q3"])


def test_what_is_expected_more_often_is_likelier() -> None:
    usual, likelier = probability({}), probability({"backlash:q3": 0.5})
    assert probability({"backlash": 0.005}) < usual < likelier


@pytest.mark.parametrize(
    ("prior", "said"),
    [
        ({"backlsh": 0.1}, "did you mean 'backlash'"),
        ({"backlash:q9": 0.1}, "no component 'q9'"),
        ({"backlash": 0.0}, "expected a number above 0, at most 1"),
        ({"backlash": 1.5}, "expected a number above 0, at most 1"),
        ({"backlash": float("nan")}, "expected a number above 0, at most 1"),
    ],
)
def test_priors_of_nothing_are_refused(prior: dict[str, float], said: str) -> None:
    with pytest.raises(BeamstiffError, match=said):
        diagnose(kr240(), campaign(plan(3), backlash), prior=prior)


def test_what_other_readings_say_counts_in_place_of_what_was_given() -> None:
    prior = Prior(given={"backlash": 0.2, "backlash:q2": 0.6}, measured={"backlash:q2": 0.9})
    assert [prior.expected("backlash", one) for one in ("q1", "q2")] == [0.2, 0.9]


def test_a_gap_that_an_excluded_cause_explains_is_no_noise() -> None:
    """Nothing else explains a load that pulls askew."""
    found = diagnose(kr240(), campaign(plan(), load_error), without=["load-error"])
    assert found.verdict.key == "unknown:null"
    assert "load-error" not in {one.effect for one in found.candidates}
    assert found.noise == pytest.approx(np.sqrt(3) * POSITION, rel=0.1)
    assert sum(one.probability for one in found.candidates) == pytest.approx(1.0)
    assert "with no cause excluded, the verdict is load-error (" in " ".join(found.notes)


@pytest.mark.slow
def test_nor_does_another_cause_explain_a_drift() -> None:
    found = diagnose(kr240(), campaign(plan(), thermal_drift), without=["thermal-drift"])
    assert found.verdict.key == "unknown:null"


def test_neither_is_lost_motion_of_all_joints_of_a_ur10() -> None:
    found = diagnose(*ur10.table(("friction",)), without=["approach-direction"])
    assert found.verdict.key == "unknown:null"
    assert found.noise == pytest.approx(np.sqrt(3) * ur10.NOISE, rel=0.1)


def test_where_there_is_noise_alone_excluding_a_cause_finds_none() -> None:
    found = diagnose(elbow(), sound(), without=["load-error"])
    assert found.verdict.key == "none:null"
    assert "excluded" not in " ".join(found.notes)
