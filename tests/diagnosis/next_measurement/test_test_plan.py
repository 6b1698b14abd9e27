from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import beamstiff
from beamstiff import BeamstiffError
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.held_out.score import Weighted
from beamstiff.diagnosis.inference.evidence import evidence
from beamstiff.diagnosis.inference.library import build_library
from beamstiff.diagnosis.inference.noise_scale import noise_prior_of
from beamstiff.diagnosis.inference.search import search
from beamstiff.diagnosis.next_measurement.candidates import NEAR, STEPS, inside
from beamstiff.diagnosis.next_measurement.test_plan import (
    PROGRAMME,
    READINGS,
    WORTH,
    Programme,
    as_plain,
    propose_tests,
    proposed_csv,
)
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, at_random, elbow, kr240, rows_of
from tests.diagnosis.planted import Plan, base_compliance, campaign, diagnosed, hardening, plan


def rivals_at(
    there: Baseline, keys: tuple[str, str] = ("hardening:q2", "backlash:q2")
) -> list[tuple[str, float, list[Weighted]]]:
    """Return two causes, such as backlash and hardening at the second joint, as likely as one another."""
    white = whiten(there)
    others = tuple(name for name in EFFECTS if name not in {key.partition(":")[0] for key in keys})
    library = build_library(there, white, Prior(without=others))
    found = search(white, library.hypotheses, noise_prior_of(there), pairs=False)
    return [(key, 0.5, found.shapes[key]) for key in keys]


@pytest.fixture(scope="module")
def split() -> tuple[Baseline, Programme]:
    """Return a baseline, and the tests that distinguish backlash from hardening at the second joint."""
    there = fit_baseline(kr240(), campaign(plan(8), hardening))
    result = propose_tests(there, there.used, rivals_at(there), 1.0, 0)
    assert result is not None
    return there, result


def test_load_cycles_at_postures_within_the_limits_are_proposed(split: tuple[Baseline, Programme]) -> None:
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


def test_what_foretells_the_same_is_not_distinguished_whatever_the_weight_of_its_shape(
    split: tuple[Baseline, Programme],
) -> None:
    there = split[0]
    shapes = rivals_at(there)[0][2]
    own = max(shapes, key=lambda one: one.hypothesis.columns.shape[1])
    same = [("a", 0.5, [replace(own, weight=1.0)]), ("b", 0.5, [replace(own, weight=0.3)])]
    found = propose_tests(there, there.used, same, 1.0, 0)
    assert found is not None
    assert found.alike == ("b",)
    assert found.score.sum() < 1e-6
    assert as_plain(found)[0]["alike"] == ["b"]


@pytest.mark.parametrize(
    ("keys", "whole"), [(("hysteresis:q2", "hardening:q2"), True), (("hardening:q2", "hardening:q3"), False)]
)
def test_a_batch_is_whole_cycles_where_only_they_tell(
    split: tuple[Baseline, Programme], keys: tuple[str, str], whole: bool
) -> None:
    """What only the way back tells needs a cycle; what any load tells is asked at as many postures as fit."""
    there = replace(split[0], rows=replace(split[0].rows, batch=2 * len(STEPS)))
    found = propose_tests(there, there.used, rivals_at(there, keys), 1.0, 0)
    steps = [*range(len(STEPS))] * 2 if whole else [0] * (2 * len(STEPS))
    assert found.rows.step.tolist() == steps
    assert len(np.unique(found.rows.q, axis=0)) == (2 if whole else 2 * len(STEPS))


def tool_at(q: Array) -> Array:
    kinematics = compile_kinematics(kr240())
    return posture(kinematics, q).node_positions[:, kinematics.node_index[kr240().tcp]]


def test_postures_are_proposed_where_the_tool_was_or_in_a_region(split: tuple[Baseline, Programme]) -> None:
    there, near = split
    seen, proposed = tool_at(there.rows.q), tool_at(near.rows.q)
    far = np.linalg.norm(proposed[:, None] - seen[None], axis=2).min(axis=1)
    assert far.max() <= NEAR * compile_kinematics(kr240()).size
    region = ((-np.inf, np.inf), (-np.inf, 0.0), (0.8, 1.8))
    stated = replace(there, rows=replace(there.rows, region=region))
    rivals = [(key, 0.5, ()) for key in near.separates]
    assert inside(region, tool_at(propose_tests(stated, there.used, rivals, 1.0, 0).rows.q)).all()
    assert not inside(region, proposed).all()
    far = replace(there, rows=replace(there.rows, region=((9, 10),) * 3))
    with pytest.raises(BeamstiffError, match="make it larger"):
        propose_tests(far, there.used, rivals, 1.0, 0)


def test_postures_have_a_pendants_digits_in_the_units_of_the_table(split: tuple[Baseline, Programme]) -> None:
    in_degrees = replace(split[0].rows, units=dict.fromkeys(split[0].rows.variables, "deg"))
    there = replace(split[0], rows=in_degrees)
    rows = propose_tests(there, there.used, rivals_at(there), 1.0, 0)
    measured = set(map(tuple, np.unique(there.rows.q, axis=0).tolist()))
    new = [q for q in rows.rows.q.tolist() if tuple(q) not in measured]
    assert new
    np.testing.assert_allclose(np.degrees(new), np.round(np.degrees(new), 1), atol=1e-12)
    again = replace(diagnosed("backlash"), baseline=there, next=as_plain(rows))
    header, *lines = (line for line in proposed_csv(again).splitlines() if not line.startswith("#"))
    assert header.startswith("q1 [deg],q2 [deg]")
    assert not any("-0.0," in line for line in lines)


def test_the_proposed_states_tell_more_than_states_at_random(split: tuple[Baseline, Programme]) -> None:
    there, found = split
    rivals = rivals_at(there)

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
        there = fit_baseline(kr240(), campaign(joined, hardening, seed=3))
        white = whiten(there)
        others = tuple(name for name in EFFECTS if name not in ("hardening", "backlash"))
        library = build_library(there, white, Prior(without=others))
        some = [one for one in library.hypotheses if one.key in found.separates]
        log = evidence(white, some, noise_prior_of(there)).hypotheses
        by_key = {key: max(log[k] for k, one in enumerate(some) if one.key == key) for key in found.separates}
        return by_key["hardening:q2"] - by_key["backlash:q2"]

    designed = []
    for seed in range(4):
        rows = propose_tests(there, there.used, rivals, 1.0, seed).rows
        designed.append(odds(Plan(rows.q, rows.wrench, rows.pose, rows.step, rows.time)))
    at_random = [odds(plan(PROGRAMME, seed=seed, steps=np.array(STEPS))) for seed in (11, 12, 13, 14)]
    assert np.mean(designed) > np.mean(at_random)


def test_no_row_is_expected_to_make_the_choice_harder(split: tuple[Baseline, Programme]) -> None:
    there, found = split
    assert (found.score >= 0).all()
    assert len(as_plain(found)) == len(found.rows)
    assert there is not None


LEANING = ("base-compliance:null", "bearing-tilt:q1")


def between_pedestal_and_bearing(rows: Measurements) -> Programme:
    """Return what would tell the pedestal from the first bearing, either as likely as the other."""
    there = fit_baseline(kr240(), rows)
    proposed = propose_tests(there, there.used, rivals_at(there, LEANING), 1.0, 0)
    assert proposed is not None
    return proposed


def test_what_no_reading_at_the_tool_tells_is_read_where_it_shows() -> None:
    """A pedestal and a first bearing that tilt move the tool alike; the head of the pedestal they do not."""
    proposed = between_pedestal_and_bearing(campaign(plan(8), base_compliance))
    rows = proposed.rows
    (head,) = set(rows.point.tolist()) - {kr240().tcp}
    kinematics = compile_kinematics(kr240())
    at = posture(kinematics, rows.q).node_positions[:, kinematics.node_index[head]]
    np.testing.assert_allclose(at, [[0.0, 0.0, 0.675]] * len(rows), atol=1e-9)  # where axes 1 and 2 begin
    assert rows.point.tolist() == [kr240().tcp, head] * (PROGRAMME * len(STEPS))
    np.testing.assert_array_equal(rows.q[::2], rows.q[1::2])
    np.testing.assert_array_equal(rows.wrench[::2], rows.wrench[1::2])
    at_tool, at_head = proposed.score.reshape(-1, 2).sum(axis=0)
    assert at_head > WORTH * at_tool
    assert at_head > 100


def leaning(what: Plan, at: Array | None = None) -> Array:
    """Return how the tool, or a point (3,), moves where all above a point below the floor leans, (N, 6)."""
    pivot = np.array([0.0, 0.0, -0.2])
    moment = what.wrench[:, 3:] + np.cross(what.arm.tip - pivot, what.wrench[:, :3])
    turned = 2e-7 * moment * [1.0, 1.0, 0.0]
    return np.concatenate([np.cross(turned, (what.arm.tip if at is None else at) - pivot), turned], axis=1)


HEAD = np.array([0.0, 0.0, 0.675])


@cache
def asked_of_leaning() -> tuple[Measurements, Measurements]:
    first = campaign(plan(8), leaning)
    return first, between_pedestal_and_bearing(first).rows


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "moves"), [("base-compliance:null", True), ("bearing-tilt:q1", False)])
def test_with_the_same_readings_at_the_tool_the_second_reflector_decides(cause: str, moves: bool) -> None:
    """The machine leans about a point below the floor: by its pedestal, or by a bearing off its centre."""
    first, rows = asked_of_leaning()
    states = Plan(rows.q, rows.wrench, rows.pose, rows.step, rows.time)
    on_tool = (rows.point == kr240().tcp)[:, None]
    moved = np.where(on_tool, states.elastic + leaning(states), moves * leaning(states, HEAD))[:, :3]
    read = np.full((len(rows), 6), np.nan)
    read[:, :3] = moved + POSITION * np.random.default_rng(5).standard_normal(moved.shape)
    sigma = np.tile(np.repeat([POSITION, ROTATION], 3), (len(rows), 1))
    told = diagnose(kr240(), concatenate([first, replace(rows, displacement=read, sigma=sigma)]))
    assert told.verdict.key == cause
    (other,) = {*LEANING} - {cause}
    assert sum(one.probability for one in told.candidates if one.key == other) < 0.01


def test_no_second_reflector_is_asked_for_where_little_is_left(split: tuple[Baseline, Programme]) -> None:
    """Where a drive rattles, the tool shows it best; and what is settled needs no reflector anywhere."""
    assert set(split[1].rows.point.tolist()) == {kr240().tcp}
    there = diagnosed("base_compliance")
    assert {item["point"] for item in there.next} == {kr240().tcp}


def test_where_nothing_shows_it_is_loaded_as_it_was_not() -> None:
    """Loads in its plane showed nothing of an arm; what lets it nod shows under loads across it only."""
    robot, rng = elbow(), np.random.default_rng(1)
    rows = at_random(robot, 16, 2, sigma_position=POSITION)
    rows = replace(rows, wrench=1000.0 * np.eye(6)[rng.integers(2, size=16)])
    read = predict_displacements(robot, rows) + POSITION * rng.standard_normal((16, 6))
    rows = replace(rows, displacement=np.where([True] * 3 + [False] * 3, read, np.nan))
    told = beamstiff.diagnose(robot, rows, batch=8, directions=("x", "y", "-z"))
    assert told.verdict.effect == "none"
    loads = np.array([one["wrench"] for one in told.next])
    assert (loads[:, 2] < 0.0).sum() >= 2
    assert not (loads[:, 2] > 0.0).any()
    assert loads[:, :2].any(axis=1).sum() >= 2  # and what the rows leave open of the others
    told = beamstiff.diagnose(robot, rows, batch=8)  # as the rows were loaded
    assert not np.array([one["wrench"] for one in told.next])[:, 2].any()


def test_positions_without_loads_are_proposed_where_none_was_measured() -> None:
    robot, q = kr240(), plan(8, steps=np.ones(1)).q
    nothing = np.zeros((len(q), 6))
    rows = rows_of(robot, q, nothing, position=tool_at(q), sigma_position=POSITION)
    there = fit_baseline(robot, rows)
    white = whiten(there)
    found = search(white, build_library(there, white).hypotheses, noise_prior_of(there), pairs=False)
    keys = list(found.shapes)[:2]
    proposed = propose_tests(there, there.used, [(key, 0.5, found.shapes[key]) for key in keys], 1.0, 0)
    new = proposed.rows
    assert (new.kind, new.wrench.any(), new.measured_mask.any()) == ("absolute", False, False)
    assert not {tuple(one) for one in new.q} & {tuple(one) for one in q}
    assert 1 < len(np.unique(new.q, axis=0)) <= READINGS


def test_one_explanation_alone_leaves_nothing_to_split() -> None:
    there = diagnosed("backlash").baseline
    assert propose_tests(there, there.used, [("backlash:q3", 1.0, ())], 1.0, 0) is None
    assert as_plain(None) == []


def test_a_programme_is_a_table_to_fill_in() -> None:
    found = diagnosed("backlash")
    assert found.next
    text = proposed_csv(found)
    assert text.startswith("# robot: kr240-2\n")
    rows = parse_measurements(text, kr240(), require_measured=False)
    assert len(rows) == len(found.next)
    assert rows.wrench.tolist() == [list(item["wrench"]) for item in found.next]
    known = found.baseline.rows
    assert (rows.sigma_position, rows.sigma_rotation) == (known.sigma_position, known.sigma_rotation)
    assert ",t [s]" not in text
    timed = replace(known, units={**known.units, "t": "s"})
    assert ",t [s]\n" in proposed_csv(replace(found, baseline=replace(found.baseline, rows=timed)))
    with pytest.raises(BeamstiffError, match="no states to propose"):
        proposed_csv(replace(found, next=()))
