"""The causes of a gap that has several, and its remainder, as people read them."""

from dataclasses import replace

import pytest

from beamstiff.diagnosis.decomposition.causes import Cause, RunnerUp
from beamstiff.diagnosis.result import Candidate, Estimate
from beamstiff.report.diagnosis import (
    CAUSES,
    by_causes,
    causes_table,
    diagnosis_figure,
    diagnosis_tables,
    next_best_text,
    probability_text,
    sizes_table,
    steps,
)
from beamstiff.report.diagnosis_text import (
    headline,
    recalibration_text,
    remainder_text,
    separations,
    summary,
    undecided_text,
    verdict,
)
from beamstiff.report.diagnosis_words import hardly_checked, percent, sure, unrealistic
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.provenance import provenance
from beamstiff.report.verdict import rounded
from tests.diagnosis.decomposition.test_decompose import SLIP, found


def test_causes_stand_in_their_order_with_what_each_closes() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    rows = causes_table(several, CAUSES).rows
    assert sorted(row[0] for row in rows) == ["angle-curve at q3", "approach-direction at q2", "target-slip"]
    closes = [int(row[1].removesuffix(" %")) for row in rows]
    assert closes == sorted(closes, reverse=True)
    assert sum(closes) in (99, 100, 101)
    assert remainder_text(several).startswith("Remainder, all rows fitted: 0.0")
    assert CAUSES in [getattr(item, "title", None) for item in diagnosis_tables(result)]


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
        "Next best in place of angle-curve at q3: backlash at q3, 100 times less likely; the gap on held-out "
        "data would be 10 % larger.",
        "Next best in place of angle-curve at q3: nothing; the gap would be 1.1 times as large.",
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
    assert causes_table(less, CAUSES).rows[0][4] == "89 %"
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
    assert first.headline.endswith(f"; unrealistic size: {name}")
    assert first.action.startswith(
        f"Doubt {name}, or its name: its sine_1 is 5 times the largest realistic size."
    )
    page = diagnosis_html(far, provenance([], 0, []))
    assert "Doubt " in page
    assert "(--next" not in page  # how to call commands is for the terminal
    slightly = replace(size, value=1.5e-3)
    assert not unrealistic(replace(far, verdict=replace(far.verdict, estimates=(slightly,)), candidates=()))


def test_the_page_has_them_too() -> None:
    result, _ = found("approach", "gear", "slip")
    assert CAUSES in diagnosis_html(result, provenance([], 0, []))


def test_where_there_is_no_gap_no_causes_are_shown() -> None:
    result, _ = found()
    assert CAUSES not in [getattr(item, "title", None) for item in diagnosis_tables(result)]


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
        assert f"({percent(cause.closes)})" in text
    assert f"reduces the residual to {1e3 * several.causes[-1].rms_after:.3f} mm" in text


def test_each_of_several_causes_is_told_with_its_size_and_its_check() -> None:
    result, _ = found("approach", "gear", "slip")
    rows = {tuple(row[:2]): row for row in sizes_table(result, "How large").rows}
    assert float(rows["approach-direction at q2", "half_lost_motion"][2]) == pytest.approx(0.4, rel=0.02)
    assert float(rows["target-slip", "slip_x"][2]) == pytest.approx(1e3 * SLIP[0], rel=0.02)
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
    assert drawn == [1e3 * value for value in steps(result).values()]
    assert 1e3 * several.causes[-1].rms_after in drawn  # what is left in the end


def test_what_cannot_be_distinguished_stands_in_the_headline_and_beside_the_probability() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    assert "cannot distinguish" not in probability_text(replace(several, causes=_with(several.causes, ())))
    alike = replace(several, causes=_with(several.causes, ("backlash:q2", "hardening:q2")))
    assert "cannot distinguish" in probability_text(alike)
    assert "(or backlash at q2, hardening at q2)" in verdict(replace(result, decomposition=alike)).headline


def test_few_postures_weaken_the_headline() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    wide = tuple(replace(one, closes_interval=(0.0, 1.0)) for one in several.causes)
    doubtful = replace(result, decomposition=replace(several, causes=wide))
    assert hardly_checked(doubtful)
    said = verdict(doubtful).headline
    assert "perhaps" in said
    assert said.endswith("too few postures to check it")
    assert "are too few to check these shares" in summary(doubtful)


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


def test_undecided_effects_of_the_written_robot_are_named() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    assert undecided_text(replace(several, unclear=())) == ""
    assert "undecided" in undecided_text(replace(several, unclear=several.causes[:1]))


def test_what_the_calibration_changed_is_told() -> None:
    result, _ = found("approach", "gear", "slip")
    changed = result.recalibration
    assert changed is not None
    assert changed.after == result.rms
    gap, *_ = recalibration_text(changed)
    assert f"leaves a gap of {rounded(1e3 * changed.before)} mm RMS" in gap
    assert result.to_dict()["calibration"]["before_mm"] == 1e3 * changed.before


def _with(causes: tuple[Cause, ...], alike: tuple[str, ...]) -> tuple[Cause, ...]:
    return tuple(replace(one, indistinguishable=alike) for one in causes)
