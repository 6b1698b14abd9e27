from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.gap.evidence import evidence
from beamstiff.gap.library import state_library
from beamstiff.gap.next import PROGRAMME, STEPS, Programme, as_plain, programme, programme_csv
from beamstiff.gap.noise import scales_of
from beamstiff.gap.search import search
from beamstiff.gap.whitened import whiten
from beamstiff.measure.reader import parse_measurements
from tests.gap.machines import kr240
from tests.gap.planted import Plan, campaign, diagnosed, hardening, plan


@pytest.fixture(scope="module")
def split() -> tuple[object, Programme]:
    """Return a baseline, and the programme that splits backlash from hardening at the second joint."""
    from beamstiff.gap.baseline import fit_baseline

    there = fit_baseline(kr240(), campaign(plan(8), hardening))
    white = whiten(there)
    library = state_library(there, white)
    found = search(white, library.hypotheses, scales_of(there), pairs=False)
    rivals = [(key, 0.5, found.shapes[key]) for key in ("hardening:q2", "backlash:q2")]
    result = programme(there, there.used, rivals, 1.0, 0)
    assert result is not None
    return there, result


def test_load_cycles_at_some_postures_within_the_limits_are_proposed(split: tuple[object, Programme]) -> None:
    rows = split[1].rows
    assert len(rows) == PROGRAMME * len(STEPS)
    assert len(np.unique(rows.q, axis=0)) == PROGRAMME
    limits = np.array([item.limits for item in kr240().actuated])
    assert (rows.q >= limits[:, 0]).all()
    assert (rows.q <= limits[:, 1]).all()
    force = np.linalg.norm(rows.wrench[:, :3], axis=1)
    assert force.max() == pytest.approx(1500.0)  # what the campaign had
    assert not rows.measured_mask.any()
    assert split[1].separates == ("hardening:q2", "backlash:q2")


def test_the_proposed_states_tell_more_than_states_at_random(split: tuple[object, Programme]) -> None:
    _, found = split
    rows = found.rows

    def odds(what: Plan) -> float:
        """Return how much likelier the true cause is than its rival, after these states as well."""
        both = [campaign(plan(8), hardening, seed=1), campaign(what, hardening, seed=2)]
        joined = Plan(
            *(
                np.concatenate(parts)
                for parts in zip(
                    *((t.q, t.wrench, t.pose + 100 * k, t.step, t.time) for k, t in enumerate(both)),
                    strict=True,
                )
            )
        )
        rows = campaign(joined, hardening, seed=3)
        from beamstiff.gap.baseline import fit_baseline

        there = fit_baseline(kr240(), rows)
        white = whiten(there)
        some = [one for one in state_library(there, white).hypotheses if one.key in found.separates]
        log = evidence(white, some, scales_of(there)).hypotheses
        by_key = {key: max(log[k] for k, one in enumerate(some) if one.key == key) for key in found.separates}
        return by_key["hardening:q2"] - by_key["backlash:q2"]

    designed = Plan(rows.q, rows.wrench, rows.pose, rows.step, rows.time)
    at_random = [odds(plan(PROGRAMME, seed=seed, steps=np.array(STEPS))) for seed in (11, 12, 13, 14)]
    assert odds(designed) > np.mean(at_random)


def test_expected_discrimination_falls_with_the_noise(split: tuple[object, Programme]) -> None:
    there, found = split
    assert (found.score >= 0).all()
    whole = found.score.reshape(PROGRAMME, -1).sum(axis=1)
    assert whole.tolist() == sorted(whole, reverse=True)
    assert len(as_plain(found)) == len(found.rows)
    assert there is not None


def test_one_explanation_alone_leaves_nothing_to_split() -> None:
    there = diagnosed("backlash").baseline
    assert programme(there, there.used, [("backlash:q3", 1.0, ())], 1.0, 0) is None
    assert as_plain(None) == []


def test_a_programme_is_a_table_to_fill_in() -> None:
    found = diagnosed("backlash")
    assert found.next
    text = programme_csv(found)
    rows = parse_measurements(text, kr240(), require_measured=False)
    assert len(rows) == len(found.next)
    assert rows.wrench.tolist() == [list(item["wrench"]) for item in found.next]
    with pytest.raises(BeamstiffError, match="no states to propose"):
        programme_csv(replace(found, next=()))
