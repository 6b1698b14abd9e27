import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.exam import score
from beamstiff.exam.blind import Examiner, examined
from beamstiff.exam.cases import Exam, draw_case, kind_of
from beamstiff.exam.labelled import examine_folder
from beamstiff.exam.record import Record
from beamstiff.exam.run import SINGLE, Void, read_results, run_exam
from beamstiff.exam.score import brier, calibration_error
from beamstiff.exam.table import headline
from tests.exam.standins import Oracle, always_none, anything, broken, draw_once

COUNT = 24
EXAM = Exam(
    seed=11,
    shares={"null": 6, "single": 12, "pair": 2, "outside": 2, "removed": 2},
    effects=("link-bending", "tool-compliance", "hardening", "load-error", "frame-misalignment"),
    robots=("kr240-2",),
    lean=0.8,
)


@pytest.fixture(scope="module", autouse=True)
def drawn_once() -> Iterator[None]:
    """Draw each case once: who is examined has no say in it (the same by itself: below)."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beamstiff.exam.run.SINGLE", replace(SINGLE, draw=draw_once))
        yield


@pytest.fixture(scope="module")
def oracle() -> tuple[Oracle, list[Record]]:
    knows = Oracle([draw_once(EXAM, case) for case in range(COUNT)])
    return knows, run_exam(EXAM, COUNT, Examiner(knows))


@pytest.fixture(scope="module")
def silent() -> list[Record]:
    return run_exam(EXAM, COUNT, Examiner(always_none))


def test_who_knows_the_labels_passes_with_full_marks(oracle: tuple[Oracle, list[Record]]) -> None:
    knows, records = oracle
    assert len(records) == COUNT
    singles = score.clear_singles(records)
    assert len(singles) >= 4
    assert score.false_alarms(records).value == 0.0
    for figure in (
        score.detection(singles),
        score.exact(singles),
        score.right_family(singles),
        score.coverage(singles),
        score.set_size(singles),
    ):
        assert figure.value == 1.0
    assert all(map(score.is_nameless, score.of_kind(records, "outside")))
    assert all(map(score.is_flagged, score.of_kind(records, "removed")))
    assert score.shrink_difference(records).value == pytest.approx(0.0, abs=1e-9)
    assert calibration_error(records).value == 0.0
    assert brier(records).value == 0.0
    assert not [row.name for row in headline(records) if row.met == "missed"]
    withheld = [record.label.withheld for record in records if record.label.kind == "removed"]
    assert sorted(filter(None, knows.withheld)) == sorted(withheld)


def test_who_always_says_none_raises_no_alarm_and_finds_nothing(silent: list[Record]) -> None:
    singles = score.clear_singles(silent)
    assert score.false_alarms(silent).value == 0.0
    assert score.detection(singles).value == 0.0
    assert score.exact(singles).value == 0.0
    assert score.coverage(singles).value == 0.0
    assert score.set_size(singles).count == 0
    assert all(map(score.is_nameless, score.of_kind(silent, "outside")))
    assert not any(map(score.is_flagged, score.of_kind(silent, "removed")))
    assert all(record.shrink is None for record in silent)


def test_who_guesses_is_right_by_chance_and_always_alarmed() -> None:
    records = run_exam(EXAM, 12, Examiner(anything))
    assert score.false_alarms(records).value == 1.0
    singles = score.of_kind(records, "single")
    assert score.detection(singles).value == 1.0
    # one in 18 effects and 7 places is right: two of a handful would be no chance any more
    assert sum(map(score.is_exact, singles)) <= 1


def test_a_diagnosis_that_breaks_off_is_wrong_everywhere_and_the_exam_goes_on() -> None:
    records = run_exam(EXAM, 12, Examiner(broken))
    assert len(records) == 12
    assert all(
        record.error is not None and record.error.startswith("ZeroDivisionError") for record in records
    )
    assert score.false_alarms(records).value == 1.0
    assert not any(map(score.is_nameless, score.of_kind(records, "outside")))
    assert not any(map(score.is_flagged, score.of_kind(records, "removed")))
    assert score.detection(records).value == 0.0


def test_labels_are_the_same_for_all(oracle: tuple[Oracle, list[Record]], silent: list[Record]) -> None:
    drawn_anew = run_exam(replace(EXAM), 4, Examiner(anything))
    assert [r.label_sha256 for r in oracle[1]] == [r.label_sha256 for r in silent]
    assert [r.label_sha256 for r in drawn_anew] == [r.label_sha256 for r in silent[:4]]
    np.testing.assert_array_equal([r.gap for r in drawn_anew], [r.gap for r in silent[:4]])
    assert len({r.label_sha256 for r in silent}) == COUNT


def test_a_case_is_the_same_in_any_order_and_by_itself(silent: list[Record]) -> None:
    for case in (17, 3):
        alone, _ = examined(EXAM, draw_case(EXAM, case), Examiner(always_none))
        assert replace(alone, seconds=0.0) == replace(silent[case], seconds=0.0)


def test_other_processes_find_the_same(silent: list[Record], tmp_path: Path) -> None:
    records = run_exam(EXAM, 6, Examiner(always_none), processes=2, results=tmp_path / "results.jsonl")
    assert [replace(r, seconds=0.0) for r in records] == [replace(r, seconds=0.0) for r in silent[:6]]
    assert read_results(tmp_path / "results.jsonl")[1] == {r.label.case: r for r in records}


def test_a_cluster_finds_the_same_and_files_are_written_here(
    silent: list[Record], scheduler: str, tmp_path: Path
) -> None:
    results, reports = tmp_path / "results.jsonl", tmp_path / "reports"
    reports.mkdir()
    examiner = Examiner(always_none, reports=Path(reports))
    records = run_exam(EXAM, 4, examiner, scheduler=scheduler, results=results)
    assert [replace(r, seconds=0.0) for r in records] == [replace(r, seconds=0.0) for r in silent[:4]]
    assert sorted(path.name for path in reports.iterdir()) == [f"case-00000{case}.json" for case in range(4)]
    lines = [json.loads(line) for line in results.read_text().splitlines()[1:]]
    for case in range(4):
        mine = [
            next(iter(line))
            for line in lines
            if line.get("sealed", line.get("record", {}).get("label", {}).get("case")) == case
        ]
        assert mine == ["sealed", "record"]
    run_exam(EXAM, 4, examiner, scheduler="tcp://nobody:1", results=results)  # all is done: nobody is asked


def test_labelled_campaigns_are_examined_alike_by_more_processes(shared_path: Callable[[str], Path]) -> None:
    folder, examiner = shared_path("practice/labels.json").parent, Examiner(always_none)
    alone = examine_folder(folder, examiner)
    found = examine_folder(folder, examiner, processes=2)
    assert [replace(r, seconds=0.0) for r in found] == [replace(r, seconds=0.0) for r in alone]


def test_the_seal_is_on_disk_before_the_diagnosis_and_fits_the_label(tmp_path: Path) -> None:
    results, seen = tmp_path / "results.jsonl", []

    def looks(*arguments: object, **more: object) -> object:
        seen.append(json.loads(results.read_text().splitlines()[-1]))
        return always_none(*arguments, **more)

    records = run_exam(EXAM, 3, Examiner(looks), results=results)
    assert [line["sealed"] for line in seen] == [0, 1, 2]
    assert [line["label_sha256"] for line in seen] == [r.label.digest() for r in records]


def test_the_diagnosis_sees_rows_and_nothing_of_the_label() -> None:
    seen = []

    def looks(robot: object, measurements: object, **more: object) -> object:
        seen.append((robot, measurements, more))
        return always_none(robot, measurements)

    singles = [case for case in range(COUNT) if kind_of(EXAM, case)[0] == "single"]
    case = draw_case(EXAM, singles[0])
    examined(EXAM, case, Examiner(looks))
    robot, measurements, more = seen[0]
    assert robot == case.robot
    assert robot != case.machine
    assert more == {"without": (), "seed": 0}
    text = f"{measurements!r} {measurements.metadata} {measurements.sources}"
    assert case.truths[0].effect not in text
    assert str(EXAM.seed) not in text


def test_an_exam_that_broke_off_is_taken_up_where_it_was(silent: list[Record], tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    run_exam(EXAM, 4, Examiner(always_none), results=results)
    lines = results.read_bytes().splitlines(keepends=True)
    results.write_bytes(b"".join(lines[:-2]) + lines[-2][:25])  # cut in the middle of a line
    asked = []

    def counted(*arguments: object, **more: object) -> object:
        asked.append(1)
        return always_none(*arguments, **more)

    shown: list[Record | Void] = []
    records = run_exam(EXAM, 5, Examiner(counted), results=results, progress=shown.append)
    assert len(asked) == 2
    assert len(shown) == 5
    assert [replace(r, seconds=0.0) for r in records] == [replace(r, seconds=0.0) for r in silent[:5]]


def test_results_of_another_exam_are_not_mixed_in(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    run_exam(EXAM, 1, Examiner(always_none), results=results)
    with pytest.raises(BeamstiffError, match=r"results of another exam \(seed: 11 there, 12 asked\)"):
        run_exam(replace(EXAM, seed=12), 1, Examiner(always_none), results=results)


def test_what_are_no_results_is_said(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    results.write_text("pose,fx\n1,2\n")
    with pytest.raises(BeamstiffError, match=r"results.jsonl:1: found 'pose,fx', expected a line"):
        run_exam(EXAM, 1, Examiner(always_none), results=results)


@pytest.mark.parametrize(
    "content",
    [
        "\n",
        '{"precious": 1}',
        '{"precious": 1}\n',
        '{"format": "beamstiff-exam/1", "exam": {}}',
        '{"format": "beamstiff-exam/1", "exam": {}}\nmine',
        "[" * 100_000,
        "mine",
    ],
)
def test_a_file_of_the_users_is_refused_and_stays(tmp_path: Path, content: str) -> None:
    results = tmp_path / "results.jsonl"
    results.write_text(content)
    with pytest.raises(BeamstiffError, match=r"results.jsonl"):
        run_exam(EXAM, 1, Examiner(always_none), results=results)
    assert results.read_text() == content
    assert [path.name for path in tmp_path.iterdir()] == ["results.jsonl"]


def test_an_empty_file_is_a_new_one(tmp_path: Path) -> None:
    for name in ("new.jsonl", "empty.jsonl"):
        run_exam(EXAM, 1, Examiner(always_none), results=tmp_path / name)
        (tmp_path / "empty.jsonl").touch()
    new, empty = (
        [json.loads(line) for line in (tmp_path / name).read_text().splitlines()]
        for name in ("new.jsonl", "empty.jsonl")
    )
    assert [line.keys() for line in new] == [line.keys() for line in empty]
    assert new[0] == empty[0]


def test_a_line_that_was_cut_short_anywhere_is_taken_up(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    run_exam(EXAM, 2, Examiner(always_none), results=results)
    whole = results.read_bytes()
    first = whole.index(b"\n") + 1
    for size in (first, first + 1, first + 7, first + 13, len(whole) - 2, len(whole) - 1):
        results.write_bytes(whole[:size])
        assert len(run_exam(EXAM, 2, Examiner(always_none), results=results)) == 2
        assert len(read_results(results)[1]) == 2


def test_a_second_exam_to_the_same_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beamstiff.files.PATIENCE", 0.1)
    results = tmp_path / "results.jsonl"

    def meanwhile(*arguments: object, **more: object) -> object:
        with pytest.raises(BeamstiffError, match="another exam is writing to it: wait until it ends"):
            run_exam(EXAM, 2, Examiner(always_none), results=results)
        return always_none(*arguments, **more)

    assert [one.error for one in run_exam(EXAM, 1, Examiner(meanwhile), results=results)] == [None]


def test_blocks_hold_every_kind_in_its_share_and_effects_in_turn() -> None:
    exam = Exam(seed=3)
    kinds = [kind_of(exam, case) for case in range(300)]
    for block in range(3):
        some = [kind for kind, _ in kinds[100 * block : 100 * block + 100]]
        assert {kind: some.count(kind) for kind in set(some)} == dict(exam.shares)
    singles = [before for kind, before in kinds if kind == "single"]
    assert singles == list(range(126))
    assert [kind for kind, _ in kinds[:100]] != [kind for kind, _ in kinds[100:200]]


def test_reports_are_kept_on_request(tmp_path: Path) -> None:
    run_exam(EXAM, 1, Examiner(always_none, reports=tmp_path))
    report = json.loads((tmp_path / "case-000000.json").read_text())
    assert report["verdict"]["effect"] == "none"


def test_a_control_is_asked_beside_the_diagnosis() -> None:
    report = always_none(*_nothing()).to_dict()
    controls = {"name": lambda *_: "backlash:q3", "report": lambda *_: report, "bad": _bad}
    record, _ = examined(EXAM, draw_case(EXAM, 1), Examiner(always_none, controls=controls))
    assert record.controls == {"name": "backlash:q3", "report": "none:null", "bad": "failed:null"}


def _nothing() -> tuple[Any, Any]:
    return None, None


def _bad(*_: object) -> str:
    raise ValueError
