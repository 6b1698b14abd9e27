"""The causes of a gap that has several, and its remainder, as people read them."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.decomposition.causes import Cause, RunnerUp
from beamstiff.diagnosis.notes import in_words
from beamstiff.report.calibrated_text import calibrated_worse, changes_table, changes_text
from beamstiff.report.diagnosis import (
    by_causes,
    diagnosis_figure,
    diagnosis_tables,
    names_text,
    next_best_text,
    notable,
    places_table,
    probability_text,
    sizes_table,
)
from beamstiff.report.diagnosis_tables import TITLE, steps, steps_table
from beamstiff.report.diagnosis_text import (
    headline,
    remainder_text,
    summary,
    undecided_text,
    verdict,
)
from beamstiff.report.diagnosis_words import hardly_checked, percent, sure, unrealistic
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.provenance import provenance
from beamstiff.report.next_action import separations
from beamstiff.report.tables import worth
from beamstiff.report.verdict import rounded
from tests.diagnosis.decomposition.test_decompose import SLIP, SLIPS_AT, found, machine_changes


def test_causes_stand_in_their_order_with_what_each_closes() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    rows = [row for row in steps_table(result).rows if row[2]]
    assert sorted(row[0] for row in rows) == [
        "and angle-curve at q3",
        "and approach-direction at q2",
        "and target-slip",
    ]
    closes = [int(row[2].removesuffix(" %")) for row in rows]
    assert closes == sorted(closes, reverse=True)
    assert sum(closes) in (99, 100, 101)  # each is rounded
    assert remainder_text(several).startswith("Remainder: 0.0")
    assert TITLE in [getattr(item, "title", None) for item in diagnosis_tables(result)]


def test_a_cause_that_few_searches_find_is_said_to_be_one() -> None:
    several = found("approach", "gear", "slip")[0].decomposition
    assert several is not None
    assert "find" not in probability_text(several)
    first, *others = several.causes
    rare = replace(several, causes=(replace(first, found_again=0.4), *others))
    assert "finds target-slip in only 40 % of the cases" in probability_text(rare)


def test_a_cause_without_look_alikes_has_a_next_best() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    alone = {one.key for one in several.causes if not one.indistinguishable}
    assert {one.cause for one in result.runners_up} == alone
    for one in result.runners_up:
        assert one.cause not in one.keys
        assert one.odds > 20.0  # nearer ones are look-alikes
        assert one.rms > one.rms_with
    assert len(next_best_text(result)) == len(alone)
    play = RunnerUp("angle-curve:q3", ("backlash:q3",), 123.0, 1.1e-4, 1e-4)
    named = tuple(replace(several.causes[0], runner_up=one) for one in (play, replace(play, keys=()), None))
    assert next_best_text(replace(result, decomposition=replace(several, causes=named))) == [
        "Without angle-curve at q3 the best explanation is backlash at q3: 100 times less likely, held-out "
        "gap 10 % larger.",
        "Without angle-curve at q3 no other effect explains its share: 1.1 times as much is left.",
    ]


def test_a_cause_has_one_probability_in_summary_table_and_page() -> None:
    result, _ = found("gear")
    several = result.decomposition
    assert several is not None
    assert several.verdict is not None
    less = replace(several, causes=(replace(several.causes[0], probability=0.89), *several.causes[1:]))
    told = replace(result, decomposition=less)
    assert told.verdict.probability != pytest.approx(0.89)
    assert sure(told) == "89 %"
    assert "(probability 89 %)" in summary(told)
    assert next(row for row in steps_table(told).rows if row[2])[4] == "89 %"
    assert "89 %" in diagnosis_html(told, provenance([], 0, []))


def test_an_unrealistic_size_reaches_headline_and_next_action() -> None:
    result, _ = found("gear")
    assert unrealistic(result) == []
    size = Estimate("sine_1", 5e-3, 1e-6, "rad", (1e-5, 1e-3))
    far = replace(result, verdict=replace(result.verdict, estimates=(size,)))
    far = replace(
        far,
        candidates=tuple(far.verdict if one.key == far.verdict.key else one for one in far.candidates),
    )
    first = verdict(far)
    name = f"{far.verdict.effect} at {far.verdict.component}"
    assert first.doubt == (
        f"Doubt {name}: its sine_1 is 5 times the largest realistic size. Another effect may look like it."
    )
    assert first.action.startswith(f"To check {name}: ")
    page = diagnosis_html(far, provenance([], 0, []))
    assert "Doubt " in page
    assert "(--next" not in page  # how to call commands is for the terminal
    slightly = replace(size, value=1.5e-3)
    assert not unrealistic(replace(far, verdict=replace(far.verdict, estimates=(slightly,)), candidates=()))


def test_weights_that_measured_torques_contradict_are_corrected_first() -> None:
    result, _ = found("gear")
    assert not verdict(result).action.startswith("Correct the weights")
    first, *_ = verdict(replace(result, loads_contradicted=True)).action.splitlines()
    assert first.startswith("Correct the weights in the robot file, or the loads in the table: ")
    assert first.endswith("Then diagnose again.")


def test_of_terms_only_the_sum_cannot_be_negative() -> None:
    result, _ = found("gear")
    terms = [Estimate(f"half_width_{flank}", 3e-4, 1e-6, "rad", (1e-5, 6e-4), True) for flank in (0.03, 0.1)]
    less = Estimate("half_width_0.005", -5e-5, 1e-5, "rad", (1e-5, 6e-4), True)
    for estimates, doubted in (
        ((less, *terms), False),
        ((less,), True),
        ((less, replace(less, name="k")), True),
    ):
        candidate = replace(result.verdict, estimates=estimates)
        others = tuple(candidate if one.key == candidate.key else one for one in result.candidates)
        told = replace(result, decomposition=None, verdict=candidate, candidates=others)
        assert bool(unrealistic(told)) == doubted


def test_what_is_left_far_beyond_the_noise_is_said_with_the_causes() -> None:
    result, _ = found("gear")
    assert "are left" not in verdict(result).doubt
    shrink = replace(result.verdict.shrink, after=8.0 * result.noise)
    far = replace(result, verdict=replace(result.verdict, shrink=shrink))
    assert "8 times the noise floor: something else is missing" in verdict(far).doubt


def test_the_page_has_them_too() -> None:
    result, _ = found("approach", "gear", "slip")
    assert TITLE in diagnosis_html(result, provenance([], 0, []))


def test_where_there_is_no_gap_no_causes_are_shown() -> None:
    result, _ = found()
    assert [one.head for one in steps_table(result).heads] == ["model", "error"]


def test_causes_that_close_the_gap_together_are_the_headline_where_none_makes_most_of_it() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    said = headline(result)
    assert said.startswith("Causes of 9") or said.startswith("Causes of 100 %")
    assert all(name in said for name in ("angle-curve at q3", "approach-direction at q2", "target-slip"))
    text = summary(result)
    assert "no effect in the library" not in text
    assert "Undecided" not in text
    for cause in several.causes:
        assert f"{percent(cause.closes)}" in verdict(result).causes
    assert several.causes[-1].rms_after in [step.error for step in steps(result)]


def test_each_of_several_causes_is_told_with_its_size_and_its_check() -> None:
    result, _ = found("approach", "gear", "slip")
    rows = {row[0].strip(): row for row in sizes_table(result, "How large").rows}
    assert float(rows["half_lost_motion"][1]) == pytest.approx(0.4, rel=0.02)
    assert float(rows["slip_x"][1]) == pytest.approx(1e3 * SLIP[0], rel=0.02)
    said = names_text(result)[-1]
    assert said.startswith("target-slip: from ")
    assert said.endswith(f":{SLIPS_AT + 1} on (FILE:LINE).")
    checked = [line.removeprefix("To check ").partition(":")[0] for line in separations(result)]
    assert sorted(checked) == ["angle-curve", "approach-direction", "target-slip"]


def test_table_page_and_figure_draw_the_same_causes_and_steps() -> None:
    result, _ = found("approach", "gear", "slip")
    several = by_causes(result)
    assert several is not None
    which, _, how_far, *_ = diagnosis_figure(result).axes
    assert len(which.patches) == len(several.causes)
    assert sorted(bar.get_width() for bar in which.patches) == sorted(one.closes for one in several.causes)
    drawn = [bar.get_width() for bar in how_far.patches]
    assert drawn == [1e3 * step.error for step in steps(result)]
    assert 1e3 * several.causes[-1].rms_after in drawn  # what is left in the end


def test_what_cannot_be_distinguished_stands_below_the_headline_and_beside_the_probability() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    assert "joined by" not in probability_text(replace(several, causes=_with(several.causes, ())))
    alike = replace(several, causes=_with(several.causes, ("backlash:q2", "hardening:q2")))
    assert "joined by" in probability_text(alike)
    assert "(or backlash at q2, hardening at q2)" in verdict(replace(result, decomposition=alike)).causes


def test_a_headline_of_several_causes_says_where_its_first_is_undecided() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    first, *others = several.causes
    assert ", the largest undecided" not in verdict(result).headline
    open_one = replace(first, probability=0.53, indistinguishable=("backlash:q2",))
    told = replace(result, decomposition=replace(several, causes=(open_one, *others)))
    said = "explained by 3 causes, the largest undecided: target-slip, probability 53 % (or backlash at q2)"
    assert verdict(told).headline.endswith(said)
    assert said in diagnosis_html(told, provenance([], 0, []))


def test_few_postures_make_the_share_uncertain_and_not_the_cause() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    wide = tuple(replace(one, closes_interval=(0.0, 1.0)) for one in several.causes)
    doubtful = replace(result, decomposition=replace(several, causes=wide))
    assert hardly_checked(doubtful)
    said = verdict(doubtful).headline
    assert "perhaps" not in said
    assert "explained by target-slip and 2 other causes; the share, " in said
    assert said.endswith(" %, is uncertain")
    assert "This share is uncertain: it differs much between the postures, as its interval shows." in summary(
        doubtful
    )


def test_a_noise_that_the_table_does_not_state_is_called_an_assumption() -> None:
    result, _ = found("approach", "gear", "slip")
    assert "the table states none" not in summary(result)
    unclaimed = replace(result, baseline=replace(result.baseline, claimed=False))
    assert "mm (a laser tracker's: the table states none" in summary(unclaimed)
    assert unclaimed.decomposition is not None
    nothing = replace(unclaimed.decomposition, causes=())
    without = replace(unclaimed, decomposition=nothing, verdict=Candidate("unknown", None, 0.95))
    assert "exceeds a laser tracker's noise (state the instrument's own as sigma_position)" in summary(
        without
    )
    stated = replace(without, baseline=result.baseline)
    assert "the gap is systematic" in summary(stated)


@pytest.mark.parametrize(
    ("follows", "said"),
    [
        ("angle of q3", "The gap follows the angle of q3: move q3 alone through its range in small steps"),
        ("direction of approach of q2", "the direction of approach of q2: move q2 alone to the same values"),
        ("time", "The gap follows the time: return to one posture now and then"),
        ("order of the rows", "The gap follows the order of the rows: return to one posture now and then"),
        ("load", "The gap follows the load: load some postures step by step"),
        ("reflector", "The gap follows the reflector: read all reflectors in the same postures"),
        (None, "Read some postures several times without moving the robot"),
    ],
)
def test_of_an_unknown_cause_is_measured_what_the_gap_follows(follows: str | None, said: str) -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    rest = replace(several.remainder, follows=() if follows is None else ((follows, 0.5),))
    nothing = replace(several, causes=(), remainder=rest, scatter=9.0)
    unknown = Candidate("unknown", None, 0.95)
    told = replace(result, decomposition=nothing, verdict=unknown, candidates=(unknown,), next=())
    assert said in verdict(told).action
    page = diagnosis_html(told, provenance([], 0, []))
    assert said in page
    assert ("It follows the " in page) == (follows is not None)


def test_a_gap_beyond_any_effect_sends_to_the_table() -> None:
    result, _ = found("gear")
    assert verdict(replace(result, rms=1.5)).action == (
        "Check joint readings, units and robot file: 1500 mm are too much for an effect."
    )


def test_without_places_the_figure_draws_no_empty_axes() -> None:
    result, _ = found("gear")
    assert diagnosis_figure(result).axes[1].axison
    bare = diagnosis_figure(replace(result, where={**result.where, "components": []})).axes[1]
    assert not bare.axison
    assert bare.texts[0].get_text() == "Where: no place accounts for the gap"


def test_undecided_effects_of_the_written_robot_are_named() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    assert undecided_text(replace(several, unclear=())) == ""
    slip, *others = several.causes
    assert slip.rows
    assert undecided_text(replace(several, unclear=(slip,))) == ""  # which is not written
    assert in_words([others[0].key]) in undecided_text(replace(several, unclear=(slip, others[0])))


def test_what_the_calibration_changed_is_told() -> None:
    result, _ = found("approach", "gear", "slip")
    changed = result.recalibration
    assert changed is not None
    assert changed.after == result.rms < changed.placed <= changed.before
    assert changed.stiff is None
    assert [(step.model, step.error) for step in steps(result)[:3]] == [
        ("robot file, measuring frame fitted", changed.before),
        ("and places of the reflectors", changed.placed),
        ("and geometry", changed.after),
    ]
    off, left = f"The robot file is {rounded(1e3 * changed.placed)} mm off", "calibration of geometry leaves"
    expected = f". {off} (measuring frame and reflectors fitted); the gap is what {left}"
    assert verdict(result).data.endswith(expected)
    assert "RMS, frame and reflectors fitted" in diagnosis_html(result, provenance([], 0, []))
    told_apart = replace(result)
    told_apart.__dict__["recalibration"] = replace(changed, before=changed.placed)
    assert verdict(told_apart).data.endswith(expected.replace(" and reflectors", ""))
    first = changed.changes[0]
    value, std = worth(1e3 * first.by, 1e3 * first.std)
    largest = changes_text(result)
    along = f"{first.parameter.name} (shift along x)"
    assert f": {along} {'+' * (first.by > 0)}{value} ± {std} mm, " in largest
    held = replace(result)
    held.__dict__["recalibration"] = replace(changed, changes=(replace(first, std=0.0),))
    assert "±" not in changes_text(held)  # it was not sought
    by = {unit: [one for one in changed.changes if one.parameter.unit == unit] for unit in ("m", "rad")}
    assert min(map(len, by.values())) > 3
    most, _, moved = largest.partition(". Reflectors stand elsewhere than in the robot file: ")
    assert most.count(" mm") == most.count(" mrad") == 3
    assert moved == f"reflector by {rounded(1e3 * float(np.linalg.norm(SLIP)))} mm."
    assert re.search(r"deviations\. Lengths: [^;]* mm; angles: [^;]* mrad \(", largest)
    rest = len(changed.changes) - 6
    assert f"({rest} more in --json and --apply)" in largest
    table = changes_table(changed, "title")
    assert [*table.columns] == ["parameter", "length, mm", "std", "angle, mrad", "std"]
    for kind, own in enumerate(by.values()):
        rows = [row for row in table.rows if row[1 + 2 * kind]]
        assert [float(row[1 + 2 * kind]) for row in rows] == pytest.approx(
            [1e3 * one.by for one in own], rel=0.06
        )
    told = result.to_dict()["calibration"]
    assert told["before_mm"] == 1e3 * changed.before
    assert told["changes"][first.parameter.name]["std"] == first.std


def test_changes_of_the_geometry_are_right_to_their_standard_deviations() -> None:
    result, _ = found()
    assert result.recalibration is not None
    by_name = {one.parameter.name: one for one in result.recalibration.changes}
    for name in ("f2.d", "f3.d", "f2.alpha", "f5.alpha", "q2", "q3", "q4", "q5"):
        one = by_name[name]
        assert one.by == pytest.approx(machine_changes()[name], abs=4.0 * one.std)
        assert one.std < 2e-5  # m, rad: well below the 3e-4 by which it was changed


def test_a_file_that_calibration_brought_to_agree_is_said_to_be_off_and_how_to_write_it() -> None:
    result, _ = found()
    changed = result.recalibration
    assert changed is not None
    first = verdict(result)
    off = rounded(1e3 * changed.placed)
    assert first.headline.startswith(
        f"Geometry in the robot file is off by {off} mm; calibrated, model and machine agree (gap 0.0"
    )
    assert first.level == "doubtful"
    assert first.action.startswith(
        "Write the calibrated robot (--apply FILE, or beamstiff calibrate --out FILE) and use it"
    )


def test_a_reflector_that_was_elsewhere_is_no_geometry_and_a_right_file_agrees_by_itself() -> None:
    result, _ = found()
    changed = result.recalibration
    assert changed is not None
    right: dict[str, Any] = {"placed": result.noise}
    beside = replace(result)
    beside.__dict__["recalibration"] = replace(changed, **right)
    assert verdict(beside).headline.startswith("The reflector's place in the robot file is off by ")
    beside.__dict__["recalibration"] = replace(changed, **right, before=result.noise)
    assert verdict(beside).headline.startswith("Model and machine agree: gap ")
    assert verdict(beside).level == "agrees"


def test_postures_too_few_to_correct_a_robot_file_are_said_to_be_and_what_is_written_too() -> None:
    result, _ = found("approach", "gear", "slip")
    changed, several = result.recalibration, result.decomposition
    assert changed is not None
    assert several is not None
    assert not calibrated_worse(result)
    left = [*several.causes, *several.unclear][-1].rms_after
    other = replace(result)
    other.__dict__["recalibration"] = replace(changed, placed=0.5 * left)  # the file predicts better
    first = verdict(other)
    assert "Do not write this robot" in first.doubt
    assert (
        f"leaves {rounded(1e3 * left)} mm on held-out ones, as it is {rounded(500.0 * left)} mm"
        in first.doubt
    )
    assert first.action.startswith("Measure more postures")


def test_no_share_above_all_is_written_and_an_open_end_is_told_as_at_least() -> None:
    result, _ = found("gear")
    several = result.decomposition
    assert several is not None
    wide = replace(several.causes[0], closes=1.01, closes_interval=(0.35, 1.73))
    told = replace(result, decomposition=replace(several, causes=(wide, *several.causes[1:])))
    [written] = told.to_dict()["causes"]
    assert written["closes"] == 1.0
    assert written["closes_interval"] == [0.35, 1.0]
    assert told.decomposition is not None
    assert next(row for row in steps_table(told).rows if row[2])[3] == "at least 35 %"


def test_places_of_look_alikes_stand_beside_the_place_of_their_cause() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    others = ("backlash:q2", "link-bending:forearm", "base-compliance:null")
    alike = replace(several, causes=(replace(several.causes[1], indistinguishable=others), several.causes[2]))
    told = replace(result, decomposition=alike)
    places = {one["component"]: one["indistinguishable"] for one in told.to_dict()["where"]["components"]}
    assert places["q2"] == ["forearm", "base"]
    assert places["q3"] == []
    made = places_table(notable(told), "Where")
    assert [row[4] for row in made.rows if row[0] == "q2"] == ["forearm, base"]
    assert len(places_table(notable(result), "Where").columns) == 4  # nothing to tell


def _with(causes: tuple[Cause, ...], alike: tuple[str, ...]) -> tuple[Cause, ...]:
    return tuple(replace(one, indistinguishable=alike) for one in causes)


def test_a_law_outside_the_library_that_explains_more_than_any_cause_is_in_the_headline() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    first = next(one for one in several.causes if not one.past)
    for share, told in ((0.3, False), (several.causes[0].closes + 0.1, True)):
        form = replace(first.forms[0], effect="unknown", component="q3 creeps")
        law = replace(first, forms=(form,), closes=share, indistinguishable=())
        other = replace(result, decomposition=replace(several, unmodelled=(law,)))
        assert verdict(other).headline.endswith("look as if q3 creeps, outside the library") == told
        assert verdict(other).action.startswith("Check whether q3 creeps; mend that") == told
        row = next(row for row in steps_table(other).rows if row[0] == "and q3 creeps (outside the library)")
        assert row[2] == percent(share)
