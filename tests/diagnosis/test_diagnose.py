"""Diagnoses end to end: the effect that was put in is named, and nothing is where there is nothing."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from tests.diagnosis import planted
from tests.diagnosis.machines import (
    ONCE,
    POSITION,
    arm_at,
    at_random,
    elbow,
    kr240,
    nominal,
    rows_of,
    sound,
)
from tests.diagnosis.planted import backlash, base_compliance, campaign, diagnosed, plan, tool_offset

TRUTHS = [
    *("link-bending:link2", "bearing-tilt:q3", "base-compliance:null", "tool-compliance:null", "backlash:q3"),
    *("hardening:q2", "hysteresis:q3", "joint-coupling:q5+q6", "actuator-lever:q2", "load-error:null"),
    *("tool-offset:null", "frame-misalignment:null", "thermal-drift:null", "outliers:null"),
]
# the rest of them takes another ten seconds
SLOW = ("bearing-tilt", "hardening", "joint-coupling", "tool-offset", "frame-misalignment")


@pytest.mark.parametrize(
    "key", [pytest.param(key, marks=pytest.mark.slow if key.startswith(SLOW) else ()) for key in TRUTHS]
)
def test_the_effect_that_was_put_in_is_named_at_its_place(key: str) -> None:
    found = diagnosed(key.partition(":")[0].replace("-", "_"))
    assert found.verdict.key == key
    assert found.also is None
    if key != "outliers:null":
        assert found.verdict.shrink.shrink > 0.7


@pytest.mark.slow
def test_play_in_a_bearing_is_no_soft_bearing() -> None:
    found = diagnosed("bearing_play")
    assert found.verdict.key == "unknown:null"
    assert found.where["components"][0]["component"] in ("q3", "link2")  # the link that ends in that bearing
    assert found.notes[-1] == "most of the gap looks as if q3 has play, which is no effect of the library"


def test_a_drive_that_is_softer_to_one_side_has_no_name() -> None:
    found = diagnosed("one_sided_drive")
    assert found.verdict.key == "unknown:null"
    assert found.where["components"][0]["component"] == "q2"
    assert found.notes[-1].startswith(
        "most of the gap looks as if q2 stays softer to one side, whatever its torque"
    )


def test_wrong_rows_are_unknown_where_outliers_are_ruled_out() -> None:
    found = diagnose(kr240(), campaign(plan(), planted.outliers), without=["outliers"])
    assert found.verdict.key == "unknown:null"


def test_without_an_effect_the_verdict_is_none() -> None:
    found = diagnosed(None)
    assert found.verdict.key == "none:null"
    assert found.verdict.probability > 0.9
    assert (found.also, found.indistinguishable, found.outliers) == (None, (), ())
    assert found.notes == (ONCE,)
    assert found.rms == pytest.approx(np.sqrt(3) * POSITION, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_other_noise_is_no_effect_either(seed: int) -> None:
    assert diagnose(kr240(), campaign(plan(8, seed=seed), seed=seed)).verdict.key == "none:null"


def test_two_effects_are_both_named_the_larger_first_and_each_has_its_share() -> None:
    what = plan(14)
    large, small = partial(base_compliance, compliance=1e-7), planted.hardening
    found = diagnose(kr240(), campaign(what, large, small))
    sizes = [np.square(effect(what)[:, :3]).sum() for effect in (large, small)]
    assert (found.verdict.key, found.also.key) == ("base-compliance:null", "hardening:q2")
    causes = found.to_dict()["causes"]
    closes = [cause["closes"] for cause in causes]
    assert closes[0] == pytest.approx(sizes[0] / sum(sizes), abs=0.1)
    assert sum(closes) > 0.97
    for cause in causes:
        low, high = cause["closes_interval"]
        assert low <= cause["closes"] <= high


@pytest.mark.slow
def test_what_no_pair_explains_is_taken_apart() -> None:
    """A link as soft as the base, and play: the gap without what three causes explain is noise."""
    soft_link = partial(planted.link_bending, EI=2e6)
    found = diagnose(kr240(), campaign(plan(14), soft_link, backlash, base_compliance))
    assert not [note for note in found.notes if "not clear which" in note]  # of a verdict that is not given
    assert found.decomposition.unexplained < 0.01
    several = (*found.decomposition.causes, *found.decomposition.unclear)
    assert sum(cause.closes for cause in several) > 0.9  # of postures that had no say in the selection
    assert {"link-bending:link2", "backlash:q3", "base-compliance:null"} <= {cause.key for cause in several}
    assert found.verdict.key == "base-compliance:null"


def test_an_effect_of_no_library_is_refused_with_its_neighbour() -> None:
    with pytest.raises(BeamstiffError, match=r"unknown effect 'backlsh' \(did you mean 'backlash'\?\)"):
        diagnose(kr240(), campaign(plan(3)), without=["backlsh"])


def test_where_no_effect_could_be_seen_that_is_said_in_a_line() -> None:
    rows = campaign(plan(3))
    turned = rows.displacement.copy()
    turned[:, :3] = np.nan
    with pytest.raises(BeamstiffError, match="no row has a measured position"):
        diagnose(kr240(), replace(rows, displacement=turned))
    with pytest.raises(BeamstiffError, match="no effect is left that these rows could show"):
        diagnose(kr240(), rows, without=list(EFFECTS))


@pytest.mark.slow
def test_the_order_of_the_rows_is_of_no_account_where_their_times_are_known() -> None:
    rows = campaign(plan(6), backlash)
    mixed = subset(rows, np.random.default_rng(0).permutation(len(rows)))
    one, other = diagnose(kr240(), rows), diagnose(kr240(), mixed)
    assert one.verdict.key == other.verdict.key
    assert other.verdict.probability == pytest.approx(one.verdict.probability, abs=0.05)


def absolute(error: np.ndarray, q: np.ndarray) -> Diagnosis:
    """Return the diagnosis of absolute poses (N, 6), as deviations from the nominal ones."""
    arm = arm_at(q)
    noise = np.random.default_rng(0).standard_normal((len(q), 6)) * np.repeat([POSITION, 5e-5], 3)
    moved = error + noise
    turn = Rotation.from_rotvec(moved[:, 3:]) * Rotation.from_matrix(arm.tool)
    read = {"position": arm.tip + moved[:, :3], "rotation": turn.as_rotvec()}
    sigma = {"sigma_position": POSITION, "sigma_rotation": 5e-5}
    rows = rows_of(kr240(), q, np.zeros((len(q), 6)), **read, **sigma)
    return diagnose(kr240(), rows)


@pytest.mark.parametrize(
    ("component", "joint", "parameter", "size"),
    [("q3", 2, "theta", 8e-4), ("f4.r", 3, "r", 3e-4), ("f3.alpha", 2, "alpha", 8e-4)],
)
def test_errors_of_geometry_are_named(component: str, joint: int, parameter: str, size: float) -> None:
    q = at_random(kr240(), 40, seed=3).q
    arm, built = arm_at(q), arm_at(q, (joint, parameter, size))
    turned = Rotation.from_matrix(built.tool) * Rotation.from_matrix(arm.tool).inv()
    found = absolute(np.concatenate([built.tip - arm.tip, turned.as_rotvec()], axis=1), q)
    assert found.verdict.key == f"geometry-error:{component}"
    assert found.verdict.estimates[0].value == pytest.approx(size, rel=0.1)


FEW = {
    "three rows": np.array([2, 8, 14]),
    "one posture": np.arange(6),
    "two postures": np.arange(12),
    "one row": np.array([2]),
}


@pytest.mark.parametrize(
    ("some", "name"),
    [
        pytest.param("three rows", None, marks=pytest.mark.slow),
        ("three rows", "backlash"),
        ("one posture", None),
        pytest.param("one posture", "backlash", marks=pytest.mark.slow),
        ("two postures", "thermal_drift"),
        ("one row", None),
    ],
)
def test_of_too_few_rows_nothing_is_said_with_confidence(some: str, name: str | None) -> None:
    effects = [] if name is None else [getattr(planted, name)]
    found = diagnose(kr240(), subset(campaign(plan(), *effects), FEW[some]))
    assert found.verdict.effect == "none" or found.verdict.probability < 0.8
    assert found.notes[0].startswith("only ")
    if name is None:
        assert found.verdict.effect == "none"


@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_scatter_of_a_few_positions_whose_noise_nobody_states_has_no_sure_name(seed: int) -> None:
    q = at_random(kr240(), 5, seed).q
    scatter = 1e-3 * np.random.default_rng(seed).standard_normal((5, 3))
    rows = rows_of(kr240(), q, np.zeros((5, 6)), position=arm_at(q).tip + scatter)
    found = diagnose(kr240(), rows)
    assert found.verdict.effect in ("none", "outliers") or found.verdict.probability < 0.6
    assert found.notes[0].startswith("only 15 values")


def pulled_down(*effects: planted.Effect) -> Measurements:
    """Return a campaign with one load in one direction."""
    once = plan(24, steps=np.array([1.0]))
    return campaign(replace(once, wrench=np.tile([0, 0, -1500.0, 0, 0, 0], (24, 1))), *effects)


def test_rows_without_a_load_show_none_and_say_why() -> None:
    found = diagnose(elbow(), sound(load=0.0))
    assert found.verdict.key == "none:null"
    assert "no row carries a load: no compliance can show" in found.notes
    hidden = {one.effect: one.why for one in found.untestable}
    for effect in ("backlash", "link-bending", "base-compliance", "load-error"):
        assert "load" in hidden[effect]


def test_with_one_load_laws_of_the_load_are_not_told_apart() -> None:
    found = diagnose(kr240(), pulled_down(backlash))
    assert found.verdict.probability < 0.8
    assert {"backlash:q3", "hardening:q3"} <= {found.verdict.key, *found.indistinguishable}
    assert any("one load level only" in note for note in found.notes)
    assert any("do not span all directions" in note for note in found.notes)


def test_noise_that_nobody_claims_is_said_to_be_estimated() -> None:
    rows = sound()
    rows = replace(rows, sigma=np.full((40, 6), np.nan), sigma_position=None, sigma_rotation=None)
    found = diagnose(elbow(), rows)
    assert found.verdict.key == "none:null"
    assert any("states no noise" in note for note in found.notes)


@pytest.mark.parametrize("noise", [2.0, 0.5])
def test_a_claim_that_is_off_by_two_makes_no_effect_and_is_said(noise: float) -> None:
    found = diagnose(elbow(), sound(noise=noise))
    assert found.verdict.key == "none:null"
    assert any("times the stated noise" in note for note in found.notes)


@pytest.mark.slow
def test_positions_alone_show_the_gap_and_keep_its_cause_in_the_set() -> None:
    rows = campaign(plan(), tool_offset)
    moved = rows.displacement.copy()
    moved[:, 3:] = np.nan
    found = diagnose(kr240(), replace(rows, displacement=moved))
    assert found.verdict.key in ("tool-offset:null", "unknown:null")
    assert "tool-offset:null" in {found.verdict.key, *found.indistinguishable}


def test_a_campaign_in_the_plane_of_the_arm_is_diagnosed() -> None:
    rng = np.random.default_rng(4)
    q = np.repeat(rng.uniform(-0.5, 0.5, (8, 6)) * [0, 1, 1, 0, 1, 0] + [0, 1.2, -1.2, 0, 0, 0], 3, axis=0)
    force = rng.uniform(-900, 900, (24, 6)) * [1, 0, 1, 0, 0, 0]
    rows = rows_of(kr240(), q, force, pose=np.repeat(np.arange(8), 3))
    noise = 3e-5 * rng.standard_normal((24, 6))
    result = diagnose(kr240(), replace(rows, displacement=nominal(kr240(), rows).predicted + noise))
    assert result.verdict.key == "none:null"
    hidden = {(one.effect, one.component) for one in result.untestable}
    assert {("backlash", "q1"), ("backlash", "q4"), ("backlash", "q6")} <= hidden
