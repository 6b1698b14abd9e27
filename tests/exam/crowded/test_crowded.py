"""The exam of crowded machines: what its labels claim, that it is blind, what it says of who knows all."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot
from beamstiff.exam.blind import Examiner
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.cases import Exam
from beamstiff.exam.crowded import score
from beamstiff.exam.crowded.cases import FALLS, LARGEST, CrowdedCase, CrowdedExam, draw_crowded_case, in_order
from beamstiff.exam.crowded.record import EXAMINED, CrowdedLabel, CrowdedRecord, Reply, TrueCause
from beamstiff.exam.run import CROWDED, read_results, run_cases, run_exam
from beamstiff.exam.sizes import true_rows
from beamstiff.measure.table import Measurements

COUNT = 5
EXAM = CrowdedExam(seed=5, shares={"crowded": 2, "outside": 1, "geometry": 1, "clean": 1})
SMALL = CrowdedExam(seed=5, shares={"geometry": 1, "clean": 1})  # drawn at once


class Says:
    """A diagnosis that says this."""

    def __init__(
        self,
        verdict: str = "unknown",
        causes: Sequence[tuple[str, float]] = (),
        remainder: float = 0.0,
        predict: Callable[[], tuple[Array, Array]] | None = None,
    ) -> None:
        self.verdict, self.causes, self.remainder, self.predict = verdict, causes, remainder, predict

    def to_dict(self) -> dict[str, Any]:
        def parts(key: str) -> dict[str, Any]:
            effect, _, component = key.partition(":")
            return {"effect": effect, "component": None if component in ("", "null") else component}

        causes = [{**parts(key), "closes": closes, "indistinguishable": []} for key, closes in self.causes]
        verdict = {**parts(self.verdict), "probability": 1.0}
        return {"verdict": verdict, "causes": causes, "remainder": {"rms_mm": self.remainder}}

    def predict_shift(self, measurements: Measurements) -> tuple[Array, Array]:
        assert np.isnan(measurements.measured).all(), "the new rows must not tell what was measured"
        assert self.predict is not None
        return self.predict()


def unsure(*_: object, **__: object) -> Says:
    """Say that there is something, always."""
    return Says(remainder=1e3)


def broken(*_: object, **__: object) -> Says:
    """Break off."""
    raise ZeroDivisionError


class Knows:
    """A diagnosis that has seen the labels: it knows a case by its poses."""

    def __init__(self, cases: Sequence[CrowdedCase]) -> None:
        self.cases = {case.campaign.q.tobytes(): case for case in cases}

    def __call__(self, _: Robot, measurements: Measurements, **__: object) -> Says:
        case = self.cases[measurements.q.tobytes()]
        label = case.label
        if not label.causes:
            return Says("none", (), label.noise_mm)
        seen = [cause for cause in label.library if not cause.hidden]
        left = float(np.hypot(1e3 * case.left_by(seen), label.noise_mm))

        def predict() -> tuple[Array, Array]:
            return true_rows(case.machine, case.geometry, case.fresh)[:, :3], case.fresh_positions()

        share = 1.0 / max(len(seen), 1)
        verdict = "unknown" if label.kind == "outside" else seen[0].key
        return Says(verdict, [(cause.key, share) for cause in seen], left, predict)


@pytest.fixture(scope="module")
def cases() -> list[CrowdedCase]:
    return [draw_crowded_case(EXAM, case) for case in range(COUNT)]


@pytest.fixture(scope="module")
def effects(cases: list[CrowdedCase]) -> list[CrowdedCase]:
    return [case for case in cases if case.truths]


def test_who_knows_the_labels_scores_full_marks(cases: list[CrowdedCase]) -> None:
    drawn = replace(CROWDED, draw=lambda _, case: cases[case])
    records = run_cases(drawn, EXAM, COUNT, Examiner(Knows(cases), controls={"guess": unsure_control}))
    mine = score.pairs_of(records, EXAMINED)
    for figure in (
        score.main_exact(mine),
        score.main_in_set(mine),
        score.named_real(mine),
        score.found(mine),
        score.nothing_named(mine, "clean"),
        score.nothing_named(mine, "geometry"),
        score.called_unknown(mine),
        score.remainder_right(mine),
    ):
        assert figure.count
        assert figure.value == 1.0
    assert score.false_main(mine).value == 0.0
    assert score.promise_ninety(mine).value == pytest.approx(0.0, abs=1e-9)
    assert score.promise_median(mine).count == 3
    other = score.pairs_of(records, "guess")
    assert score.main_exact(other).value == 0.0
    assert score.called_unknown(other).value == 1.0
    met = {row.name: row.met for rows in score.figures(records) for row in rows.values()}
    assert "missed" not in met.values()


def unsure_control(robot: Robot, rows: Measurements, withheld: Sequence[str]) -> Says:
    assert withheld == ()
    return unsure(robot, rows)


def test_who_always_says_unknown_or_breaks_off_scores_nothing() -> None:
    for who in (unsure, broken):
        pairs = score.pairs_of(run_cases(CROWDED, SMALL, 4, Examiner(who)), EXAMINED)
        assert score.nothing_named(pairs, "clean").value == 0.0
        assert score.nothing_named(pairs, "geometry").value == 0.0
        assert score.remainder_right(pairs).value == 0.0
        assert score.broke_off(pairs).value == float(who is broken)


def test_effects_fall_in_size_from_the_largest_on(effects: list[CrowdedCase]) -> None:
    for case in effects:
        label = case.label
        assert 3 <= len(label.causes) <= 6
        sizes = sorted((cause.contribution_mm for cause in label.causes), reverse=True)
        assert sizes[0] > 0.5e3 * LARGEST[0] > 5 * label.noise_mm / 3**0.5
        assert sizes[-1] < FALLS[1] * 1.7 / 0.6 * sizes[0]
        assert label.kind != "outside" or label.causes[0].outside
        assert sum(cause.closes for cause in label.causes) == pytest.approx(1.0, abs=0.1)
        places = [cause.key.partition(":")[2] for cause in label.causes]
        named = [place for place in places if place != "null"]
        assert len(named) == len(set(named))


def test_a_contribution_is_what_leaving_the_effect_out_changes_on_refit(effects: list[CrowdedCase]) -> None:
    """Columns of the refit here: differences of the loaded machine's own answers, not of its skeleton's."""
    case = next(one for one in effects if one.label.data == "absolute")
    machine, campaign = case.machine, case.campaign

    def rows(truths: Sequence[Truth], robot: Robot = machine) -> Array:
        return true_rows(robot, truths, campaign)[:, :3]

    still = rows(())
    columns = []
    for frame in machine.frames:
        for name in (f"{frame.name}.{p}" for p in ("alpha", "beta", "d", "r")):
            moved = Truth("geometry-error", name, "single", {"error": 1e-5})
            columns.append((rows((moved,)) - still) / 1e-5)
    for variable in machine.actuated:
        moved = Truth("geometry-error", variable.name, "single", {"error": 1e-5})
        columns.append((rows((moved,)) - still) / 1e-5)
    for name in case.robot.identify:
        softer = machine.with_parameters({name: machine.parameter(name) / 1.01})
        columns.append((rows((), softer) - still) / 0.01)
    for unit in np.eye(3):
        columns += [np.tile(unit, (len(still), 1)), np.cross(unit, still)]
    # the reflectors: where the nodes of the model differ from the machine's
    for point in np.unique(campaign.point):
        for axis in range(3):
            nodes = [
                node
                if node.name != point
                else node.model_copy(
                    update={"at": tuple(a + 1e-5 * (k == axis) for k, a in enumerate(node.at))}
                )
                for node in machine.nodes
            ]
            columns.append((rows((), machine.model_copy(update={"nodes": tuple(nodes)})) - still) / 1e-5)
    matrix = np.stack([column.reshape(-1) for column in columns], axis=1)
    matrix /= np.linalg.norm(matrix, axis=0)
    whole = rows((*case.geometry, *case.truths))
    for at, cause in enumerate(case.label.causes):
        others = [truth for k, truth in enumerate(case.truths) if k != at]
        assert case.truths[at].label == cause.key
        change = (whole - rows((*case.geometry, *others))).reshape(-1)
        # redundant parameters of the frames, which only the deflections here tell apart, are none
        left = change - matrix @ np.linalg.lstsq(matrix, change, rcond=1e-4)[0]
        rms = 1e3 * np.sqrt(3.0 * np.mean(left**2))
        assert cause.contribution_mm == pytest.approx(rms, rel=0.05, abs=0.003)


def test_causes_come_in_the_order_in_which_taking_them_away_closes_most() -> None:
    parts = np.eye(3) * [1.0, 3.0, 2.0]
    order, closes = in_order(parts.sum(axis=1), parts)
    assert order == [1, 2, 0]
    assert closes == pytest.approx([9 / 14, 4 / 14, 1 / 14])
    # one effect that undoes most of another: it closes nothing, however much it moves
    parts = np.array([[2.0, -1.5], [0.0, 0.0]])
    order, closes = in_order(parts.sum(axis=1), parts)
    assert order == [0, 1]
    assert sum(closes) == pytest.approx(1.0)
    assert closes[0] < 0.0


def test_the_model_is_off_as_said(cases: list[CrowdedCase]) -> None:
    for case in cases:
        if case.label.data != "absolute":
            continue
        nodes = {node.name: np.array(node.at) for node in case.machine.nodes}
        away = [
            np.linalg.norm(np.array(node.at) - nodes[node.name])
            for node in case.robot.nodes
            if node.name in case.campaign.point
        ]
        assert all(2e-3 <= one <= 2e-2 for one in away)
        assert bool(case.geometry) == (case.label.kind != "clean")
        assert case.robot.identify
        assert all(case.robot.parameter(n) != case.machine.parameter(n) for n in case.robot.identify)


def test_a_slip_is_found_by_later_campaigns_where_it_ended(effects: list[CrowdedCase]) -> None:
    case = next(one for one in effects if one.label.data == "absolute")
    point = str(case.campaign.point[0])
    slip = Truth("target-slip", point, "once", {"when": 0.5, "again": 0.0, "x": 1e-3, "y": 0.0, "z": 0.0})
    without = replace(case, truths=()).fresh_positions()
    moved = replace(case, truths=(slip,)).fresh_positions() - without
    own = case.fresh.point == point
    np.testing.assert_allclose(np.linalg.norm(moved[own], axis=1), 1e-3, rtol=1e-9)
    assert not moved[~own].any()


def test_the_seal_is_on_disk_before_the_diagnosis_and_fits_the_label(tmp_path: Path) -> None:
    results, seen = tmp_path / "results.jsonl", []

    def looks(*arguments: Any, **more: Any) -> Says:
        seen.append(json.loads(results.read_text().splitlines()[-1]))
        return unsure(*arguments, **more)

    records = run_cases(CROWDED, SMALL, 2, Examiner(looks), results=results)
    assert [line["sealed"] for line in seen] == [0, 1]
    assert [line["label_sha256"] for line in seen] == [record.label.digest() for record in records]
    assert read_results(results)[1] == {record.label.case: record for record in records}


@pytest.mark.slow
def test_one_process_or_two_the_same_cases_and_a_broken_exam_goes_on(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    alone = run_cases(CROWDED, SMALL, 4, Examiner(unsure))
    run_cases(CROWDED, SMALL, 2, Examiner(unsure), results=results)
    more = run_cases(CROWDED, SMALL, 4, Examiner(unsure), processes=2, results=results)
    assert [record.label for record in more] == [record.label for record in alone]
    assert len({record.label_sha256 for record in alone}) == 4


def test_crowded_results_and_others_are_not_mixed(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    run_cases(CROWDED, SMALL, 1, Examiner(unsure), results=results)
    with pytest.raises(BeamstiffError, match="results of another exam"):
        run_exam(Exam(seed=5), 1, Examiner(unsure), results=results)


def made(kind: Any = "crowded", **more: Any) -> CrowdedLabel:
    causes = (
        TrueCause("backlash:q3", "sharp", 1, (), False, 0.8, 0.7, False),
        TrueCause("base-compliance:null", "bolts", 1, ("link-bending:link0",), False, 0.5, 0.28, False),
        TrueCause("hysteresis:q1", "iwan", 1, (), False, 0.02, 0.02, True),
    )
    given = {"data": "absolute", "causes": causes, "noise_mm": 0.03, "gap_mm": 1.0, "remainder_mm": 0.0}
    return CrowdedLabel(case=0, kind=kind, robot="r", poses=50, rows=50, **{**given, **more})


def answered(*named: str, **more: Any) -> list[tuple[CrowdedLabel, Reply]]:
    return [(made(), Reply(more.pop("verdict", named[0] if named else "none:null"), tuple(named), **more))]


def test_what_counts_as_named() -> None:
    assert score.main_exact(answered("backlash:q3")).value == 1.0
    assert score.main_exact(answered("base-compliance:null", "backlash:q3")).value == 0.0
    assert score.main_in_set(answered("hardening:q3", alike=("backlash:q3",))).value == 1.0
    assert score.named_real(answered("backlash:q3", "hysteresis:q1", "link-bending:link0")).value == 1.0
    assert score.named_real(answered("backlash:q3", "backlash:q2")).value == 0.5
    assert score.named_real(answered("backlash:q3", "geometry-error:f3.d")).value == 1.0
    assert score.found(answered("backlash:q3", "link-bending:link0")).value == 1.0
    assert score.found(answered("link-bending:link0")) == score.rate([True, False])
    even = replace(made(), causes=tuple(replace(one, closes=0.4) for one in made().causes))
    assert score.main_exact([(even, Reply("none:null"))]).count == 0, "no cause closes half"


def test_the_remainder_may_hold_what_is_hidden_or_not() -> None:
    def off(said: float) -> float:
        return score.remainder_off(Reply("none:null", said_mm=said, least_mm=0.1, left_mm=0.2))

    assert off(0.1) == off(0.15) == off(0.2) == 0.0
    assert off(0.08) == pytest.approx(0.2)
    assert off(0.3) == pytest.approx(0.5)
    assert score.remainder_off(Reply("failed:null")) == 1.0


def test_records_come_back_from_their_file(tmp_path: Path) -> None:
    record = CrowdedRecord(made(), {EXAMINED: Reply("none:null", ("a:b",), closing=0.5)}, "x", "y")
    path = tmp_path / "results.jsonl"
    head = {"format": "beamstiff-exam/2", "exam": EXAM.settings()}
    path.write_text(json.dumps(head) + "\n" + json.dumps({"record": record.to_dict()}) + "\n")
    assert read_results(path)[1] == {record.label.case: record}
