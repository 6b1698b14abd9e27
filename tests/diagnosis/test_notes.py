from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff import Mass, diagnose
from beamstiff import predict as predicted
from beamstiff.diagnosis import diagnose as module
from beamstiff.diagnosis.inference.library import Library
from beamstiff.diagnosis.notes import MASSLESS, notes, notes_of_verdict, unloaded, unstated_loads
from beamstiff.diagnosis.residual.baseline import fit_baseline, predict
from beamstiff.diagnosis.residual.outlier_screening import Screened, screen
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.shared_reading import shared_reading
from beamstiff.measure.rows import in_runs
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array
from tests.diagnosis.machines import (
    ONCE,
    POSITION,
    ROTATION,
    at_random,
    cycles,
    elbow,
    kr240,
    nominal,
    rows_of,
)
from tests.diagnosis.planted import backlash, campaign, diagnosed, plan

SILENCE = Library((), ())


def said(
    noise: tuple[float, float] = (1.0, 1.0),
    outliers: int = 0,
    verdict: str = "none",
    scale: float = 1.0,
    silent: bool = False,
    q: Any = None,
    wrench: Any = None,
    **more: Any,
) -> str:
    """Return the notes of a sound campaign of ten postures, changed in one thing."""
    rows = at_random(elbow(), 10, seed=1)
    columns = {"sigma_position": POSITION, "sigma_rotation": ROTATION} | more
    rows = rows_of(elbow(), rows.q if q is None else q, rows.wrench if wrench is None else wrench, **columns)
    there = nominal(elbow(), rows)
    found = replace(
        screen(there, SILENCE),
        noise=np.array(noise),
        outliers=np.arange(outliers, dtype=np.intp),
        below_claim=silent,
    )
    assert isinstance(found, Screened)
    return "\n".join([*notes(found, whiten(there)), *notes_of_verdict(found, verdict, scale)])


def test_a_sound_campaign_lacks_repeats_at_most() -> None:
    assert said() == ONCE
    twice = at_random(elbow(), 10, seed=1)
    told = said(q=np.repeat(twice.q, 2, axis=0), wrench=np.repeat(twice.wrench, 2, axis=0))
    assert ONCE not in told
    assert (
        "repeats scatter 0 times as much as the stated position noise" in told
    )  # the readings have none here


def test_repeats_that_contradict_the_claim_or_drift_are_told() -> None:
    rng = np.random.default_rng(2)
    rows = cycles(elbow(), 40, np.ones(2), time=100.0 * np.arange(80))
    noise = rng.standard_normal((80, 6)) * np.repeat([3 * POSITION, ROTATION], 3)
    noise[:, 4] += 8 * ROTATION * np.tile([0, 1], 40)  # from each reading to the next, 100 s later
    read = replace(rows, displacement=predict(elbow(), rows) + noise)
    found = screen(fit_baseline(elbow(), read), SILENCE)
    told = "\n".join(
        notes(
            replace(found, baseline=replace(found.baseline, sigma=rows.sigma), noise=np.ones(2)),
            whiten(found.baseline),
        )
    )
    assert "times as much as the stated position noise" in told
    assert "repeated rotations drift by 14 mrad an hour" in told


@pytest.mark.parametrize(
    ("changed", "note"),
    [
        ({"wrench": np.eye(6)[1:4] * 500}, "only 16 values beyond those fitted: no confident verdict"),
        ({"q": np.zeros(2)}, "only 1 posture: "),
        ({"sigma_position": None, "sigma_rotation": None}, "states no noise"),
        ({"noise": (2.1, 1.0)}, "the noise of the positions is 2.1 times the stated noise"),
        (
            {"noise": (1.0, 0.5)},
            "the noise of the rotations is 0.5 times the stated noise, which counts per axis: is",
        ),
        ({"wrench": np.zeros((10, 6))}, "no row carries a load"),
        ({"wrench": np.linspace(1, 2, 10)[:, None] * np.eye(6)[1] * 500}, "do not span all directions"),
        ({"wrench": np.tile(np.eye(6)[:3], (4, 1))[:10] * 500}, "one load level only"),
        ({"wrench": np.linspace(1, 2, 10)[:, None] * np.eye(6)[5] * 500}, "do not span all directions"),
        ({"wrench": np.tile(np.eye(6)[3:], (4, 1))[:10] * 500}, "one load level only"),
        ({"silent": True}, "as simulated rows do: effects smaller than the stated noise are ignored"),
        ({"scale": 1.8}, "the residual is 1.8 times the assumed noise"),
        ({"verdict": "unknown"}, "may also be in the table: joint columns in another order"),
        ({"outliers": 1}, "left out as an outlier: "),
        ({"outliers": 3}, "left out as outliers: "),
    ],
)
def test_what_limits_the_conclusions_is_said_in_a_line(changed: dict[str, Any], note: str) -> None:
    q = changed.pop("q", None)
    if q is None and len(changed.get("wrench", range(10))) != 10:
        q = at_random(elbow(), 3, seed=1).q
    lines = said(q=q, **changed).splitlines()
    assert sum(note in line for line in lines) == 1
    assert all(len(line) < 160 for line in lines)


def test_loads_of_the_wrong_sign_are_said_before_all_else_and_once() -> None:
    rows = at_random(elbow(), 10, seed=1, sigma_position=POSITION, sigma_rotation=ROTATION)
    there = nominal(elbow(), rows)
    turned = replace(there.rows, displacement=-there.predicted)
    turned = replace(turned, wrench=np.concatenate([turned.wrench[:6], -turned.wrench[6:]]))
    first, *others = diagnose(elbow(), turned).notes
    assert "moved against its load in " in first
    assert "no elastic machine does" in first
    assert not any("against its load" in other for other in others)


def test_a_cause_that_was_named_says_itself_what_it_leaves() -> None:
    assert said(verdict="backlash", scale=1.8) == ONCE
    assert said(verdict="none", scale=1.4) == ONCE


def pairs(load: float = 0.0, lost: float = 0.0, seed: int = 0) -> Measurements:
    """Return 40 postures of a heavy robot, read twice, as a table that states no load.

    `load`: N, downwards, that acted the second time; `lost`: rad, by which joints stopped short.
    """
    robot, rng = kr240(), np.random.default_rng(seed)
    q = np.repeat(at_random(robot, 40, seed=seed).q, 2, axis=0)
    wrench = np.zeros((80, 6))
    wrench[1::2, 2] = -load
    there = rows_of(robot, q + lost * rng.choice([-1.0, 1.0], q.shape), wrench, position=np.zeros((80, 3)))
    position = predicted(robot, there).pose[:, :3] + 3e-5 * rng.standard_normal((80, 3))
    return rows_of(robot, q, 0.0 * wrench, position=position, sigma_position=3e-5)


def test_loads_that_a_table_does_not_state_move_all_postures_in_one_direction() -> None:
    assert unstated_loads(fit_baseline(kr240(), pairs(load=1000.0))) > 1e-4  # m
    noise = [unstated_loads(fit_baseline(kr240(), pairs(seed=seed))) for seed in range(5)]
    lost = [unstated_loads(fit_baseline(kr240(), pairs(lost=5e-4, seed=seed))) for seed in range(5)]
    assert noise == lost == [0.0] * 5


def test_a_robot_without_masses_is_told_that_gravity_cannot_load_its_drives() -> None:
    robot, rows = kr240(), pairs()
    loaded = replace(rows, wrench=np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (80, 1)))
    heavy = robot.model_copy(update={"masses": (Mass(node=robot.tcp, mass=100.0),)})
    assert MASSLESS in unloaded(fit_baseline(robot, loaded))
    assert MASSLESS not in unloaded(fit_baseline(heavy, loaded))
    afloat = robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    assert MASSLESS not in unloaded(fit_baseline(afloat, loaded))


# Tables that are too large to be diagnosed whole


@pytest.mark.parametrize("rows", [40, 41, 97, 400])
def test_runs_hold_whole_postures_in_their_order_and_no_more_rows_than_asked_for(rows: int) -> None:
    table = at_random(kr240(), 400, seed=1)
    pose = np.arange(400) // 4
    table = replace(table, pose=pose)
    found = in_runs(table, rows)
    assert len(found) <= max(rows, 40)
    assert (np.bincount(found.pose)[np.unique(found.pose)] == 4).all()
    assert (np.diff(found.rows) > 0).all()
    if rows < 400:
        assert found.pose.max() - found.pose.min() > 70  # from one end to the other


def test_of_a_large_table_a_part_is_diagnosed_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_ROWS", 60)
    robot = elbow()
    rows = at_random(robot, 120, seed=2)
    noise = 1e-5 * np.random.default_rng(0).standard_normal((120, 6))
    found = diagnose(robot, replace(rows, displacement=predict(robot, rows) + noise))
    assert found.notes[0] == "60 of 120 rows are diagnosed: ten runs of postures, spread over the table"
    assert len(found.baseline.rows) == 60


# Rows that share one unloaded reading, unknown to the table, are told; nothing else is taken for it


OPTION = "# unloaded_reading: shared"


def off_by(error: Array, name: str | None = "backlash") -> Diagnosis:
    """Return the diagnosis of play with readings that are off by more (N, 3), m."""
    result = diagnosed(name)
    measured = result.baseline.measured.copy()
    measured[:, :3] += error
    return replace(result, baseline=replace(result.baseline, measured=measured))


def of_each_posture(seed: int = 0) -> Array:
    """Return the error of an unloaded reading for the rows of each posture, (N, 3), m."""
    return POSITION * np.random.default_rng(seed).standard_normal((len(plan().q), 3))[plan().pose]


@pytest.mark.parametrize("seed", range(5))
def test_an_error_that_the_rows_of_a_posture_share_is_told_with_the_line_that_states_it(seed: int) -> None:
    assert OPTION in shared_reading(off_by(of_each_posture(seed)))


def test_where_it_is_stated_nothing_is_told() -> None:
    result = off_by(of_each_posture())
    stated = replace(result.baseline, sharing=plan().pose.astype(np.int64))
    assert shared_reading(replace(result, baseline=stated)) == ""


@pytest.mark.parametrize("name", [None, "backlash", "link_bending", "hysteresis", "thermal_drift"])
def test_independent_readings_share_nothing_whatever_the_cause(name: str | None) -> None:
    assert shared_reading(diagnosed(name)) == ""


def test_an_error_that_grows_with_the_load_is_no_unloaded_reading() -> None:
    along = plan().wrench[:, :3] / 1500.0
    assert shared_reading(off_by(2.0 * np.abs(of_each_posture()) * along)) == ""


def test_an_error_far_above_the_scatter_is_no_reading_of_the_same_instrument() -> None:
    assert shared_reading(off_by(10.0 * of_each_posture())) == ""


def test_a_diagnosis_notes_it() -> None:
    rows = campaign(plan(), backlash)
    moved = rows.displacement.copy()
    moved[:, :3] += of_each_posture()
    assert any(OPTION in one for one in diagnose(kr240(), replace(rows, displacement=moved)).notes)


def test_a_law_of_the_load_that_the_library_lacks_is_no_unloaded_reading() -> None:
    assert shared_reading(diagnosed("one_sided_drive")) == ""
