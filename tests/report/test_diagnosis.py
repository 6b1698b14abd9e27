"""A verdict in words: as sure as its probability, and the rows behind it, allow."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.notes import quoted
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure.rows import subset
from beamstiff.report.calibrated_text import far_stiffness
from beamstiff.report.diagnosis import diagnosis_figure, diagnosis_tables, in_full, sized
from beamstiff.report.diagnosis_tables import Step
from beamstiff.report.diagnosis_text import headline, summary, verdict
from beamstiff.report.diagnosis_words import told
from beamstiff.report.next_action import proposed, separations
from tests.diagnosis.machines import POSITION, at_random, elbow, nominal
from tests.diagnosis.planted import diagnosed


def baseline(rows: int) -> Baseline:
    return nominal(elbow(), at_random(elbow(), rows, seed=1, sigma_position=POSITION))


def said(verdict: Candidate, *others: Candidate, rows: int = 20, **features: float) -> tuple[str, str]:
    """Return headline and summary of a diagnosis of so many rows."""
    result = replace(
        diagnosed(None),
        baseline=baseline(rows),
        candidates=(verdict, *others),
        verdict=verdict,
        indistinguishable=(),
        features=features,
    )
    return headline(result), summary(result)


NONE, UNKNOWN = Candidate("none", None, 0.46), Candidate("unknown", None, 0.3)
PLAY = Candidate("backlash", "q2", 0.24)


def test_what_is_less_likely_than_not_is_no_verdict() -> None:
    head, text = said(NONE, UNKNOWN, PLAY)
    assert head == "Undecided"
    assert "\nUndecided: nothing beyond noise (46 %), unknown (30 %), backlash at q2 (24 %)." in text
    assert said(replace(NONE, probability=0.9))[0] == "Nothing beyond noise"
    assert said(replace(PLAY, probability=0.47))[0] == "Likeliest cause: backlash at q2"
    assert said(replace(PLAY, probability=0.7))[0] == "Cause: backlash at q2"


def test_a_cause_less_likely_than_none_or_unknown_is_not_called_the_likeliest() -> None:
    for other in (NONE, UNKNOWN):
        head, text = said(PLAY, other)
        assert head == "Undecided"
        assert "ikeliest" not in text
        assert "backlash at q2 (24 %)" in text


def test_few_rows_are_no_proof_that_there_is_nothing() -> None:
    head, text = said(replace(NONE, probability=0.99), rows=2)
    assert head == "Too few rows to say anything"
    assert "99 %" not in text


@pytest.mark.parametrize(
    ("scale", "words"),
    [(3.3, " mm (3.3 times the stated noise)"), (1.2, " mm; the best fit by effects of the library leaves")],
)
def test_noise_that_is_not_the_stated_one_is_called_so(scale: float, words: str) -> None:
    assert words in said(NONE, scale=scale, noise_position=1.0)[1]


def test_sizes_are_told_in_mrad() -> None:
    found = diagnosed("backlash")
    name, value, _, _, unit = sized(found.verdict.estimates[0])
    assert (name, unit) == ("half_width", "mrad")
    assert float(value) == pytest.approx(1e3 * found.verdict.estimates[0].value, rel=1e-3)


def with_second(also: Candidate, *others: str) -> Diagnosis:
    """Return the diagnosis of play with a second cause, and what else one of the two could be."""
    return replace(diagnosed("backlash"), also=also, indistinguishable=others)


def test_of_two_causes_both_stand_in_the_verdict_and_what_closes_is_theirs() -> None:
    floor = Candidate("base-compliance", None, 0.83)
    result = with_second(floor, "bearing-tilt:q1", "unknown:null")
    text = summary(result)
    assert headline(result) == "Causes: backlash at q3 and base-compliance"
    assert re.search(r"With both, 0\.\d+ mm are left on held-out postures", text)
    assert "Possible in place of one of the two: bearing-tilt at q1." in text
    [unknown] = [one.probability for one in result.candidates if one.effect == "unknown"]
    assert f"A cause outside the library remains possible ({100 * unknown:.0f} %)." in text
    assert in_full(result.verdict, result) == "backlash at q3 and base-compliance"
    assert floor in told(result)
    assert any("To check base-compliance" in line for line in separations(result))


def test_wrong_rows_beside_a_cause_are_no_second_one() -> None:
    result = with_second(Candidate("outliers", None, 0.9))
    assert headline(result) == "Cause: backlash at q3"
    assert re.search(r"With it, 0\.\d+ mm are left on held-out postures", summary(result))
    assert "Also: outliers (probability 90 %)." in summary(result)


def test_what_only_the_unknown_rivals_is_said_in_a_sentence_of_its_own() -> None:
    text = summary(replace(diagnosed("backlash"), indistinguishable=("unknown:null",)))
    assert "A cause outside the library remains possible (" in text
    assert "Indistinguishable" not in text


def test_of_one_posture_nothing_is_said_of_held_out_data() -> None:
    result = diagnosed("backlash")
    one = at_random(elbow(), 1, seed=1, sigma_position=POSITION)
    result = replace(result, baseline=nominal(elbow(), subset(one, np.zeros(8, dtype=int))))
    text = summary(result)
    assert "in one posture" in text
    assert "held-out data" not in text
    assert "The reduction cannot be tested" in text
    assert "%" not in text.partition("cannot be tested")[2]


def test_rounding_is_told_as_zero_and_a_negative_compliance_as_implausible() -> None:
    dust = Estimate("torsion_flexibility", -2.9e-19, 1e-5, "1/(N*m^2)", (1e-7, 1e-5), positive=True)
    assert float(sized(dust)[1]) == 0
    assert dust.plausible
    assert not replace(dust, value=-3e-5).plausible
    assert replace(dust, value=-3e-5, realistic=(1e-7, 1e-4), positive=False).plausible


def test_rows_left_out_stand_in_the_order_of_the_file() -> None:
    text = summary(replace(diagnosed("backlash"), outliers=("a.csv:13", "a.csv:113", "a.csv:63")))
    assert "a.csv:13, a.csv:63, a.csv:113" in text


def test_a_likely_unknown_that_is_not_sure_is_undecided() -> None:
    head, text = said(replace(UNKNOWN, probability=0.46), replace(PLAY, probability=0.31))
    assert head == "Undecided"
    assert "unknown (46 %), backlash at q2 (31 %). The gap is systematic, not noise." in text


def test_a_second_reflector_is_proposed_with_what_it_tells() -> None:
    item = {"q": {}, "wrench": [], "separates": ["backlash:q2", "hardening:q2"]}
    tool, head = ({**item, "point": point, "discrimination": d} for point, d in (("n6b", 2.0), ("n1a", 30.0)))
    result = replace(diagnosed("backlash"), next=[tool, head])
    assert proposed(result) == (
        "the 1 state that discriminates best between the causes; also read a reflector on n1a (J1), which "
        "discriminates 15 times as well"
    )


def test_states_that_decide_nothing_are_called_so() -> None:
    item = {"q": {}, "wrench": [0.0] * 6, "separates": ["backlash:q2", "hardening:q2"], "point": "n6b"}
    for size, says in (
        (0.1, "More readings like these will not decide: even the"),
        (9.0, "Also measure the"),
    ):
        result = replace(diagnosed("backlash"), next=[{**item, "discrimination": size}])
        assert says in verdict(result).action


def test_a_drive_that_contradicts_the_robot_file_is_marked() -> None:
    result = diagnosed("backlash")
    assert far_stiffness(result) == {}
    name, (_, value) = max(result.fitted_stiffness.items(), key=lambda item: item[1][1])
    assert name not in result.undetermined
    stiff = result.baseline.nominal.with_parameters({name: 20.0 * value})
    wrong = replace(result, baseline=replace(result.baseline, nominal=stiff))
    assert far_stiffness(wrong) == {name: pytest.approx(1 / 20, rel=0.2)}  # that of the fit beside the cause
    told = " ".join(map(str, diagnosis_tables(wrong)))
    assert f"(!) Far from the robot file: {name} (" in told


def test_no_title_and_no_label_of_the_figure_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    longest = Step("robot file with its start values of stiffness, measuring frame fitted", 1e-3)
    monkeypatch.setattr("beamstiff.report.diagnosis.steps", lambda _: [longest])
    figure = diagnosis_figure(diagnosed("backlash"))
    figure.savefig(io.BytesIO())  # lays it out
    width, height = figure.get_size_inches() * figure.dpi
    for axes in figure.axes:
        for text in (axes.title, *axes.get_yticklabels()):
            box = text.get_window_extent()
            assert box.x0 >= 0.0
            assert box.x1 <= width
            assert box.y1 <= height


def test_names_with_spaces_stand_in_quotation_marks() -> None:
    assert quoted("link2") == "link2"
    assert summary(replace(diagnosed("backlash"), indistinguishable=("link-bending:upper arm",))).count(
        'link-bending at "upper arm"'
    )
