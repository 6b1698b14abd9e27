"""What readers of a diagnosis asked, and what it says of it."""

import io
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.text import Text

from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.residual.baseline import predict
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.smallest import smallest_sizes
from beamstiff.diagnosis.verify import verify
from beamstiff.functions.checks import start_values
from beamstiff.report.calibrated_text import as_read_elsewhere, drives_table, far_stiffness
from beamstiff.report.diagnosis import candidates_table, diagnosis_tables, likely, names_text
from beamstiff.report.diagnosis_tables import REVEALED, drift_tables, hidden_text, smallest_table, steps
from beamstiff.report.diagnosis_text import verdict
from beamstiff.report.diagnosis_words import load_lever
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.provenance import provenance
from beamstiff.report.html.robot_view import Shown, robot_view
from beamstiff.report.html.rows import Compared, row_figures
from beamstiff.report.tables import Table
from beamstiff.report.verdict import rounded
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array, rotation_from_vector
from tests.diagnosis.decomposition import test_decompose as ur10
from tests.diagnosis.machines import elbow, kr240, rows_of
from tests.diagnosis.planted import campaign, diagnosed, plan

PLACE = np.array([0.07, 0.0, -0.1])  # m: where the load acts from where the file says


def misread(levers: Array) -> Candidate:
    """Return the error of a load whose moments grow with its force by levers (3, 3), m."""
    names = [f"moment_tool_{a}_by_{b}" for a in "xyz" for b in "xyz"]
    sizes = [Estimate(n, v, 3e-3, "m", (2.5e-3, 0.04)) for n, v in zip(names, levers.ravel(), strict=True)]
    return Candidate("load-error", None, 0.97, "cross-talk of the cell into moments", tuple(sizes))


def of(cause: Candidate) -> Diagnosis:
    """Return a diagnosis with a cause as its verdict."""
    return replace(diagnosed("backlash"), verdict=cause, candidates=(cause,), indistinguishable=(), also=None)


def test_a_load_that_acts_elsewhere_is_told_with_its_place() -> None:
    levers = np.cross(PLACE, np.eye(3)).T  # moment of a force that acts there: p x F
    np.testing.assert_allclose(levers @ [1.0, 2.0, 3.0], np.cross(PLACE, [1.0, 2.0, 3.0]))
    cause = misread(levers + 4e-3 * np.random.default_rng(0).standard_normal((3, 3)))
    found = load_lever(cause)
    assert found is not None
    np.testing.assert_allclose(found, PLACE, atol=8e-3)
    action = verdict(of(cause)).action
    assert action.startswith("Check where the load acts.")
    assert "--tcp" in action
    assert f"acts about ({1e3 * found[0]:+.0f}, {1e3 * found[1]:+.0f}, " in action


def test_another_error_of_a_load_is_no_place_but_may_look_like_one() -> None:
    cause = misread(0.1 * np.random.default_rng(0).standard_normal((3, 3)))
    assert load_lever(cause) is None
    action = verdict(of(cause)).action
    assert "check that the load acts where the robot file says" in action


def test_a_size_that_may_have_either_sign_is_not_doubted_for_being_negative() -> None:
    cause = misread(np.diag([-0.3, 0.01, 0.01]))
    doubt = verdict(of(cause)).doubt
    assert "its moment_tool_x_by_x is 7.5 times the largest realistic size" in doubt


@cache
def only_from_above() -> Diagnosis:
    """Return the diagnosis of loads along z alone, which turn nothing about the first axis."""
    what = plan()
    wrench = np.zeros_like(what.wrench)
    wrench[:, 2] = np.abs(what.wrench[:, 2])
    return diagnose(kr240(), campaign(replace(what, wrench=wrench)))


def test_a_stiffness_that_no_load_touches_is_not_shown_as_fitted() -> None:
    result = only_from_above()
    ends = kr240().identify[0], kr240().identify[-1]  # about the vertical, and through the TCP
    assert result.untouched == ends
    told = {row[0].split()[0]: row[3] for row in drives_table(result, "").rows}
    assert [name for name, said in told.items() if said == "kept: no load touches it"] == [*ends][::-1]
    fitted = result.to_dict()["fitted"]
    assert [name for name, one in fitted.items() if not one["touched"]] == [*ends]
    for name in ends:
        assert fitted[name]["given"] == pytest.approx(fitted[name]["value"])
    page = diagnosis_html(result, provenance([], 0, []))
    assert page.count("no load touches it") == 2
    assert extended(result).unmeasured == ends  # `compensate` says what comes of these
    assert diagnosed("backlash").untouched == ()
    assert extended(diagnosed("backlash")).unmeasured == ()


def test_fitted_drives_are_told_softest_first_with_what_the_rows_say_of_them() -> None:
    result = only_from_above()
    rows = drives_table(result, "").rows
    assert {row[0].split()[0] for row in rows} == {*result.fitted_stiffness}
    values = [float(row[2]) for row in rows if row[3].endswith("%")]
    assert len(values) >= 3
    assert values == sorted(values)
    vague = replace(result)
    vague.__dict__["compliance_std"] = dict.fromkeys(result.fitted_stiffness, 1.0)
    told = {row[3] for row in drives_table(vague, "").rows}
    assert told == {"not determined", "kept: no load touches it"}  # so soft is no machine
    name, (_, value) = next(
        item for item in result.fitted_stiffness.items() if item[0] not in result.untouched
    )
    doubtful = replace(result)
    doubtful.__dict__["compliance_std"] = result.compliance_std | {name: 1.0 / value}
    (said,) = (row[3] for row in drives_table(doubtful, "").rows if row[0].startswith(name))
    assert said == f"not determined, over {value / 3.0:.2g}"  # two standard deviations of the compliance
    assert next(iter(result.fitted_stiffness)) in verdict(vague).action


def test_beside_a_calibration_it_is_the_joint_that_no_load_turns() -> None:
    robot, rng = load_robot(ur10.UR10), np.random.default_rng(1)
    names = tuple(f"J{k}.torsional" for k in range(1, 7))
    robot = robot.with_parameters(dict.fromkeys(names, 1e5))
    robot = robot.model_copy(update={"identify": names, "masses": ()})
    rows = ur10.read(robot, rng.uniform(-2.5, 2.5, (60, 6)), (), rng)
    wrench = rng.choice([-100.0, 100.0], (60, 6)) * [1, 1, 1, 0, 0, 0]
    on_the_last_axis = next(joint for joint in robot.joints if joint.name == "J6").nodes[1]
    loaded = replace(rows, wrench=wrench, load_point=np.full(60, on_the_last_axis))
    result = diagnose(robot, loaded)
    assert result.untouched == ("J6.torsional",)
    said = "No load in these rows deforms J6.torsional: "
    said += "to fit it, apply a force with a lever arm about the joint's axis"
    assert said in verdict(result).action


@cache
def guessed() -> Diagnosis:
    """Return the diagnosis of a machine whose drives have start values in the file, 30 times too stiff."""
    rng = np.random.default_rng(1)
    names = tuple(f"J{k}.torsional" for k in range(1, 7))
    machine = load_robot(ur10.UR10).with_parameters(dict.fromkeys(names, 1e5))
    robot = machine.with_parameters(dict.fromkeys(names, 3e6))
    robot = robot.model_copy(update={"identify": names, "unmeasured": names})
    rows = ur10.read(robot, rng.uniform(-2.5, 2.5, (60, 6)), (), rng)
    loads = rng.choice([-100.0, 100.0], (60, 6)) * [1, 1, 1, 0, 0, 0]
    rows = replace(rows, wrench=loads)
    sag = predict(machine, rows)[:, :3] @ rotation_from_vector(ur10.FRAME).T
    return diagnose(robot, replace(rows, position=rows.position + sag))


def test_the_report_has_the_stiffness_that_is_written() -> None:
    for result in (guessed(), only_from_above(), diagnosed("backlash")):
        fitted, written = result.to_dict()["fitted"], extended(result)
        assert fitted
        for name, one in fitted.items():
            assert one["value"] == written.parameter(name)
        told = {row[0].split()[0]: row[3] for row in drives_table(result, "").rows}
        for name, one in fitted.items():  # a std stands where the table has one
            assert (one["std"] is not None) == told[name].endswith("%")
            if one["std"] is not None:
                assert told[name] == f"{100 * one['std'] / one['value']:.2g} %"


def test_start_values_of_stiffness_are_guesses_and_no_statement_of_the_file() -> None:
    result = guessed()
    assert result.decomposition is not None
    assert result.start_values
    assert not far_stiffness(result)
    first, second = steps(result)[:2]
    assert first.model == "robot file, drives and links rigid, measuring frame fitted"
    assert second.model in (
        "and places of the reflectors",
        "and geometry",
    )  # what the guess leaves says nothing
    assert "before" not in verdict(result).headline
    page = diagnosis_html(result, provenance([], 0, []))
    assert "Uncalibrated" not in page
    given = result.baseline.given
    assert given is not None
    stated = given.model_copy(update={"unmeasured": ()})
    other = replace(result, baseline=replace(result.baseline, given=stated))
    assert far_stiffness(other)
    assert steps(other)[1].model == "robot file, its stiffness"
    assert "Uncalibrated" in diagnosis_html(other, provenance([], 0, []))


@cache
def warming() -> Diagnosis:
    """Return the diagnosis of a machine whose readings creep away, in the base frame by DRIFT."""
    robot, rng = load_robot(ur10.UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    rows = ur10.read(robot, rng.uniform(-2.5, 2.5, (ur10.POSES, 6)), (), rng)
    time: Array = 60.0 * np.arange(len(rows), dtype=np.float64)
    moved = course(time)[:, None] * DRIFT @ rotation_from_vector(ur10.FRAME).T
    return diagnose(robot, replace(rows, time=time, position=rows.position + moved))


DRIFT = np.array([4e-4, 0.0, -6e-4])  # m


def course(time: Array) -> Array:
    return 1.0 - np.exp(-time / (0.3 * 60.0 * (ur10.POSES - 1)))


def test_a_drift_is_told_over_time_and_in_its_frame() -> None:
    result = warming()
    assert result.verdict.effect == "thermal-drift"
    (told,) = drift_tables(result)
    assert "base frame" in told.title
    assert "of the campaign" in told.title
    time = result.baseline.rows.time
    means = [course(part).mean() for part in np.array_split(time, len(told.rows))]
    expected = 1e3 * (np.array(means) - means[0])[:, None] * DRIFT
    found = np.array([[float(cell) for cell in row[2:]] for row in told.rows])
    np.testing.assert_allclose(found, expected, atol=0.02)
    assert told.rows[0][0] == "0 s"
    late = time > np.median(time)  # the same in two tables, each with a clock of its own
    two = replace(
        result.baseline.rows,
        time=np.where(late, time - time[late].min(), time),
        run=late.astype(np.int64),
        sources=("a.csv", "b.csv"),
    )
    (again,) = drift_tables(replace(result, baseline=replace(result.baseline, rows=two)))
    assert [row[2:] for row in again.rows] == [row[2:] for row in told.rows]
    assert again.rows[0][0] == "a.csv: 0 s"
    assert again.rows[-1][1].startswith("b.csv: ")
    assert "drift, turn: along and about the axes of the base frame" in " ".join(names_text(result))
    assert told.title in [getattr(part, "title", None) for part in diagnosis_tables(result)]
    page = diagnosis_html(result, provenance([], 0, []))
    assert told.title.replace("'", "&#39;") in page
    assert "What drifts" in page
    (parts,) = (one["course"] for one in result.to_dict()["causes"] if one["effect"] == "thermal-drift")
    np.testing.assert_allclose([part["mean_mm"] for part in parts], found, atol=6e-4)
    assert [parts[0]["from"], parts[-1]["to"]] == [time.min(), time.max()]


def test_what_drifts_while_displacements_are_read_is_told_too() -> None:
    (told,) = drift_tables(diagnosed("thermal_drift"))
    assert "displacements" in told.title
    assert list(drift_tables(diagnosed("backlash"))) == []


def test_a_written_robot_is_told_as_others_read_it() -> None:
    result, _ = ur10.found("approach", "gear", "slip")
    written = extended(result)
    bare = written.model_copy(update={"effects": (), "gravity": (0.0, 0.0, 0.0)})
    off = verify(bare, result.baseline.rows, refit_frame=True).after
    assert f"is {rounded(1e3 * off)} mm off with it" in as_read_elsewhere(result, written)
    assert not as_read_elsewhere(diagnosed("backlash"), written)  # displacements know no geometry


def test_no_cause_is_told_with_the_smallest_size_that_would_have_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result, robot = ur10.found()
    assert result.verdict.effect == "none"
    sizes = {one.key: one for one in smallest_sizes(result)}
    slip = sizes["target-slip:null"]
    assert ur10.NOISE < slip.size < 10.0 * ur10.NOISE
    assert REVEALED in [getattr(part, "title", None) for part in diagnosis_tables(result)]
    assert REVEALED in diagnosis_html(result, provenance([], 0, []))
    assert next(row for row in smallest_table(result).rows if row[0] == "target-slip")[3].endswith(" mm")
    assert "tool-compliance" in hidden_text(result)
    assert hidden_text(result) in diagnosis_html(result, provenance([], 0, []))
    shown = []
    for times in (1.2, 0.3):
        monkeypatch.setattr(ur10, "SLIP", np.array([times * slip.size, 0.0, 0.0]))
        rng = np.random.default_rng(1)
        rows = ur10.read(robot, rng.uniform(-2.5, 2.5, (ur10.POSES, 6)), ("slip",), rng)
        shown.append(diagnose(robot, rows).verdict.effect != "none")
    assert shown == [True, False]


def test_residuals_over_the_load_are_those_of_loads_along_the_axis() -> None:
    robot = elbow()
    wrench = np.zeros((12, 6))
    wrench[range(12), np.tile([0, 1, 2], 4)] = np.repeat([-200.0, -100.0, 100.0, 200.0], 3)
    wrench[:2] = 0.0
    rows = rows_of(robot, np.zeros((12, 2)), wrench)
    gap = np.random.default_rng(0).standard_normal((12, 6))
    made = row_figures(Compared(robot, rows, gap, np.zeros((12, 6)), np.ones((12, 6), dtype=bool)))
    figures = {one.key: one for section in made for one in section.figures}
    traces = figures["residual-load-before"].traces
    assert [len(one["x"]) for one in traces] == [3, 3, 4]
    for k, trace in enumerate(traces):
        own = np.flatnonzero(wrench[:, k])
        np.testing.assert_allclose(trace["x"], wrench[own, k])
        np.testing.assert_allclose(trace["y"], 1e3 * gap[own, k], rtol=1e-3)
        assert len(trace["text"]) == own.size


def test_what_the_readings_miss_is_marked_at_the_reflector() -> None:
    robot = kr240()
    node = robot.nodes[3].name
    shown = Shown("here", np.zeros(6) + 0.2, np.zeros(6), robot.tcp, {"readings": 0.8}, {"readings": node})
    made = robot_view(robot, [shown], "share")
    assert made is not None
    marks: dict[str, Any] = made.views[0]["traces"][3]
    assert marks["shares"] == [0.0, 0.0, 0.8]
    assert marks["hovertext"][2] == "readings: 80.0 %"
    (label,) = made.views[0]["labels"]
    assert label["text"] == "readings 80 %"
    assert label["at"] == [marks[axis][2] for axis in "xyz"]


def test_the_page_of_a_drift_marks_where_it_was_read() -> None:
    page = diagnosis_html(warming(), provenance([], 0, []))
    assert '"text": "readings' in page or '"text":"readings' in page


def test_a_terminal_of_80_columns_shows_a_diagnosis_with_no_word_cut() -> None:
    for result in (ur10.found()[0], ur10.found("approach", "gear", "slip")[0], diagnosed("backlash")):
        console = Console(width=80, file=io.StringIO(), markup=False, emoji=False, highlight=False)
        for part in diagnosis_tables(result):
            console.print(part)
        text = console.file.getvalue()
        assert max(map(len, text.splitlines())) <= 80
        assert "…" not in text
        for part in diagnosis_tables(result):
            for row in part.drawn("console")[1][: part.most] if isinstance(part, Table) else ():
                for word in " ".join(row).split():
                    assert word in text


def test_an_interval_says_of_what_it_is_90_percent() -> None:
    for result in (ur10.found("approach", "gear", "slip")[0], diagnosed("backlash")):
        parts = list(diagnosis_tables(result))
        heads = {str(one) for part in parts if isinstance(part, Table) for one in part.columns}
        assert "90 %" not in heads
        assert "90 % interval" in heads
        texts = " ".join(part.plain for part in parts if isinstance(part, Text))
        assert "Its 90 % interval says how far the share depends on the postures." in texts


def test_where_nothing_is_beyond_noise_no_part_is_coloured_and_nothing_proposed() -> None:
    nothing, play = (
        diagnosis_html(one, provenance([], 0, [])) for one in (diagnosed(None), diagnosed("backlash"))
    )
    assert diagnosed(None).next
    for told in ("Colour shows each part", " states that "):
        assert told in play
        assert told not in nothing


def test_a_list_of_candidates_accounts_for_all_of_the_probability() -> None:
    rare = [replace(one, probability=0.004) for one in diagnosed("backlash").candidates[1:4]]
    result = diagnosed("backlash")
    play = replace(result.verdict, probability=0.988)
    listed = replace(result, verdict=play, candidates=(play, *rare))
    rows = candidates_table(listed, likely(listed, 8), "Which").rows
    assert [(row[1], row[3]) for row in rows] == [("backlash at q3", "99 %"), ("all others", "1 %")]


def test_how_sure_a_page_is_says_of_what() -> None:
    page = diagnosis_html(ur10.found()[0], provenance([], 0, []))
    assert "probability that nothing is beyond noise" in page
    assert "probability of the cause" not in page
    assert "probability of the cause" in diagnosis_html(diagnosed("backlash"), provenance([], 0, []))
    unknown = replace(diagnosed("backlash"), verdict=Candidate("unknown", None, 0.9))
    assert "probability that these data show no known cause" in diagnosis_html(unknown, provenance([], 0, []))


@pytest.mark.parametrize(("moment", "determined"), [(3.0, False), (60.0, True)])
def test_a_drive_keeps_the_file_s_stiffness_where_its_rows_do_not_determine_it(
    moment: float, determined: bool
) -> None:
    """A moment of 3 N m turns the last drive by a tenth of the noise of a rotation, one of 60 by twice."""
    what = plan()
    wrench = np.abs(what.wrench) * [0, 0, 1, 0, 0, 0] + [0, 0, 0, 0, 0, moment]
    result = diagnose(kr240(), campaign(replace(what, wrench=wrench)))
    name = kr240().identify[-1]
    written = extended(result)
    assert (written.parameter(name) != kr240().parameter(name)) == determined
    assert (name not in written.unmeasured) == determined
    assert bool(start_values(written)) != determined
    told = {row[0].split()[0]: row[3] for row in drives_table(result, "").rows}
    assert told[name].startswith("kept: not determined, over ") != determined
