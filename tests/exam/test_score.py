import json
from functools import partial
from math import nan
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from beamstiff.exam import score
from beamstiff.exam.names import EFFECTS, FAMILIES, NONE, UNKNOWN, family, normal
from beamstiff.exam.rates import mean, median, rate
from beamstiff.exam.record import Record, answer_of, record_from
from beamstiff.exam.score import brier, calibration_error, reliability
from tests.exam.answered import answered


@pytest.mark.parametrize(("hits", "total"), [(0, 20), (3, 7), (19, 20), (500, 500)])
def test_the_interval_of_a_rate_is_wilsons_as_scipy_has_it(hits: int, total: int) -> None:
    figure = rate([True] * hits + [False] * (total - hits))
    expected = binomtest(hits, total).proportion_ci(0.95, method="wilson")
    assert figure.value == hits / total
    assert (figure.low, figure.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_no_case_has_no_rate() -> None:
    for figure in (rate([]), mean([]), median([])):
        assert (figure.value, figure.low, figure.high, figure.count) == (None, None, None, 0)


def test_the_interval_of_a_median_holds_the_true_one_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    figures = [median(rng.normal(size=60)) for _ in range(2000)]
    held = np.mean([f.low <= 0 <= f.high for f in figures if f.low is not None and f.high is not None])
    assert held == pytest.approx(0.95, abs=0.02)


def test_every_effect_of_the_format_has_one_family(shared_path) -> None:
    text = Path(shared_path("FORMATS.md")).read_text(encoding="utf-8")
    table = text.split("| effect | component |")[1].split("\n\n")[0]
    assert sorted(line.split("`")[1] for line in table.splitlines() if line.startswith("| `")) == sorted(
        EFFECTS
    )
    assert len(EFFECTS) == len(set(EFFECTS)) == sum(map(len, FAMILIES.values()))
    assert {family(e) for e in EFFECTS} == set(FAMILIES)
    assert family("stiffness-ripple") == "stiffness-ripple"


def test_the_two_of_a_pair_may_stand_in_either_order() -> None:
    assert normal("joint-coupling:q6+q5") == normal("joint-coupling:q5+q6")


# --- what a case is

B, H = "backlash:q3", "hardening:q3"


@pytest.mark.parametrize(
    ("truth", "verdict", "exact", "family_", "place"),
    [
        (B, B, True, True, True),
        (B, "backlash:q2", False, True, False),
        (B, H, False, True, True),
        (B, "hardening:q2", False, True, False),
        (B, "bearing-tilt:q3", False, False, True),
        (B, UNKNOWN, False, False, False),
        ("base-compliance", "base-compliance:null", True, True, True),
        ("joint-coupling:q5+q6", "joint-coupling:q6+q5", True, True, True),
        # these have no place, not even `null`
        *(("base-compliance", verdict, False, False, False) for verdict in (NONE, UNKNOWN, "failed")),
    ],
)
def test_a_verdict_is_judged_by_cause_family_and_place(
    truth: str, verdict: str, exact: bool, family_: bool, place: bool
) -> None:
    record = answered(truth, verdict)
    found = score.is_exact(record), score.is_family(record), score.is_place(record)
    assert found == (exact, family_, place)


def test_exact_asks_for_nothing_else() -> None:
    assert not score.is_exact(answered(B, B, also=["link-bending:link2"]))


# --- figures: cases, and each figure's value and count

OUTSIDE, REMOVED = {"kind": "outside"}, {"kind": "removed", "withheld": ("backlash",)}
RIPPLE, PAIR = "stiffness-ripple:q2", f"{B} link-bending:link2"
FIGURES: dict[str, tuple[list[Record], dict[score.Score, tuple[float, int]]]] = {
    "the set is the verdict and its declared equivalents": (
        [
            answered(B, B),
            answered(B, H, set=[B, "hysteresis:q3"]),
            answered(B, H),
            answered(B, UNKNOWN),
        ],
        {
            score.coverage: (2 / 4, 4),
            score.coverage_of_names: (2 / 3, 3),
            score.set_size: (5 / 3, 3),
            score.unknowns: (1 / 4, 4),
        },
    ),
    "a null is answered by none only, and no other case is asked": (
        [*(answered("none", said) for said in (NONE, NONE, UNKNOWN, B, "failed")), answered(B, B)],
        {score.false_alarms: (3 / 5, 5)},
    ),
    "an effect outside the library gets no name; too small ones do not count": (
        [
            *(answered(RIPPLE, said, **OUTSIDE) for said in (UNKNOWN, NONE, "actuator-lever:q2", "failed")),
            answered(RIPPLE, "actuator-lever:q2", gap=0.5, **OUTSIDE),
        ],
        {score.not_named: (2 / 4, 4)},
    ),
    "a removed class is flagged by unknown or a set, strictly by its name": (
        [
            answered(B, H, set=[B], **REMOVED),
            answered(B, H, set=["hysteresis:q3"], **REMOVED),
            *(answered(B, said, **REMOVED) for said in (UNKNOWN, H, NONE, "failed")),
        ],
        {score.flagged: (3 / 6, 6), score.truly_flagged: (2 / 6, 6)},
    ),
    "pairs are compared without order, and only where each effect can be seen": (
        [
            answered(PAIR, "link-bending:link2", also=[B]),  # both
            answered(PAIR, B),  # one, nothing false
            answered(PAIR, B, also=[H]),  # one of them false
            answered(PAIR, UNKNOWN),  # nothing false
            answered(PAIR, "failed"),
            answered(PAIR, "hardening:q1", gaps=(3.0, 0.2)),  # too small to count
            answered(PAIR, "hardening:q1", gaps=(3.0, nan)),  # no baseline: not known to be large
        ],
        {score.both: (1 / 5, 5), score.nothing_false: (3 / 5, 5)},
    ),
    "promises are compared from one and a half sigma on": (
        [
            answered(B, B, gap=2.0, promised=0.9, shrink=0.8),
            answered(B, H, gap=2.0, promised=0.5, shrink=0.1),  # a wrong name counts
            answered(B, B, gap=1.5, promised=0.6, shrink=0.8),
            answered(B, B, gap=1.4, promised=0.0, shrink=1.0),
            answered(B, UNKNOWN, gap=2.0),  # promises nothing
        ],
        {score.shrink_difference: (0.2, 3)},
    ),
    "a control is judged where it was asked": (
        [*(answered(B, controls={"bic": said}) for said in (B, H)), answered(B)],
        {partial(score.control_exact, name="bic"): (0.5, 2)},
    ),
}


@pytest.mark.parametrize(("records", "figures"), FIGURES.values(), ids=FIGURES)
def test_each_figure_counts_as_its_docstring_says(
    records: list[Record], figures: dict[score.Score, tuple[float, int]]
) -> None:
    for figure, (value, count) in figures.items():
        found = figure(records)
        assert (found.value, found.count) == (pytest.approx(value), count)


def test_the_worst_class_stands_first() -> None:
    good = [answered("backlash:q3", "backlash:q3")] * 3
    middling = [answered("hardening:q3", "hardening:q3"), answered("hardening:q3", "backlash:q3")]
    bad = [answered("hysteresis:q3", "link-bending:link2")]
    small = [answered("load-error", NONE, gap=0.4)]
    order = [effect for effect, _ in score.worst_first(good + middling + bad + small)]
    assert order == ["hysteresis", "hardening", "backlash"]


def test_the_confusion_matrix_counts_every_case_but_pairs_and_small_gaps_once() -> None:
    records = [
        answered("backlash:q3", "hardening:q3"),
        answered("backlash:q3", "backlash:q2"),
        answered("none", NONE),
        answered("stiffness-ripple:q2", UNKNOWN, kind="outside"),
        answered("backlash:q3", UNKNOWN, kind="removed"),
        answered("backlash:q3", NONE, gap=0.2),
        answered("backlash:q3 hardening:q2", "backlash:q3"),
    ]
    assert score.confusion(records) == {
        "backlash": {"hardening": 1, "backlash": 1},
        "none": {"none": 1},
        "outside": {"unknown": 1},
        "removed": {"unknown": 1},
    }


def test_shuffled_labels_fall_to_chance() -> None:
    keys = [f"backlash:q{k}" for k in range(1, 6)]
    records = [answered(key, key) for key in keys * 20]
    assert score.exact(records).value == 1.0
    assert score.chance(records) == pytest.approx(0.2)
    shuffled = score.shuffled(records)
    assert shuffled.value == pytest.approx(0.2, abs=0.01)
    assert shuffled.low is not None
    assert shuffled.high is not None
    assert shuffled.low < 0.2 < shuffled.high < 0.4


def test_a_guess_among_twenty_is_right_once_in_twenty() -> None:
    rng = np.random.default_rng(0)
    effects = ("backlash", "hardening", "load-error", "link-bending")
    keys = [f"{effect}:q{k}" for effect in effects for k in range(5)]
    truths, verdicts = rng.integers(20, size=(2, 4000))
    records = [answered(keys[t], keys[v]) for t, v in zip(truths, verdicts, strict=True)]
    figure = score.exact(records)
    assert figure.low is not None
    assert figure.high is not None
    assert figure.low < 1 / 20 < figure.high
    assert score.right_family(records).value == pytest.approx((10**2 + 5**2 + 5**2) / 20**2, abs=0.03)
    assert score.right_place(records).value == pytest.approx(1 / 5, abs=0.03)
    assert score.chance(records) == pytest.approx(1 / 20, abs=0.002)


# --- records


def test_a_record_comes_back_from_its_line_of_json() -> None:
    record = answered("backlash:q3 link-bending:link2", "backlash:q3", also=["a:b"], gap=nan, gaps=(1.0, nan))
    line = json.dumps(record.to_dict(), allow_nan=False)
    again = record_from(json.loads(line))
    assert json.dumps(again.to_dict()) == line
    assert again.named == record.named
    assert np.isnan(again.gap)


def test_the_answer_is_read_from_the_json_of_the_format() -> None:
    report = {
        "which": [
            {"effect": "backlash", "component": "q3", "probability": 0.9, "shrink": 0.93},
            {"effect": "unknown", "component": None, "probability": 0.1, "shrink": 0},
        ],
        "verdict": {
            "effect": "backlash",
            "component": "q3",
            "probability": 0.9,
            "indistinguishable": ["joint-coupling:q6+q5", "base-compliance:null"],
            "also": {"effect": "link-bending", "component": "link2", "probability": 0.7},
        },
    }
    answer = answer_of(report)
    assert (answer.verdict, answer.probability, answer.promised) == ("backlash:q3", 0.9, 0.93)
    assert answer.also == ("link-bending:link2",)
    assert answer.indistinguishable == ("joint-coupling:q5+q6", "base-compliance:null")
    assert answer.probabilities == {"backlash:q3": 0.9, "unknown:null": 0.1}
    report["verdict"] = {"effect": "unknown", "component": None, "probability": 0.1}
    assert answer_of(report).promised is None


def test_the_calibration_error_by_hand() -> None:
    # 0.8 to 0.9: four at 0.85, three right; 1.0: one, wrong
    records = [answered("backlash:q3", "backlash:q3", p=0.85)] * 3
    records += [answered("backlash:q3", "hardening:q3", p=0.85), answered("none", "hardening:q3", p=1.0)]
    bins = reliability(records)
    assert [(b.low, b.said, b.right.value) for b in bins] == [(0.8, 0.85, 0.75), (0.9, 1.0, 0.0)]
    assert calibration_error(records).value == pytest.approx((4 * 0.10 + 1 * 1.0) / 5)


def test_right_is_the_effect_none_of_a_null_and_unknown_of_what_has_no_name() -> None:
    right = [
        answered("backlash:q3", "backlash:q3"),
        answered("none", NONE),
        answered("stiffness-ripple:q2", UNKNOWN, kind="outside"),
        answered("backlash:q3", UNKNOWN, kind="removed"),
        answered("backlash:q3", NONE, gap=0.2),
        answered("backlash:q3", "backlash:q3", gap=0.2),
    ]
    wrong = [
        answered("backlash:q3", NONE, gap=0.4),
        answered("stiffness-ripple:q2", NONE, kind="outside"),
        answered("none", UNKNOWN),
    ]
    assert calibration_error(right).value == 0.0
    assert calibration_error(wrong).value == 1.0
    assert brier(right).value == 0.0
    assert brier(wrong).value == 2.0


def test_the_brier_score_by_hand() -> None:
    probabilities = {"backlash:q3": 0.6, "hardening:q3": 0.3, "none": 0.1}
    record = answered("backlash:q3", "backlash:q3", probabilities=probabilities)
    assert brier([record]).value == pytest.approx(0.4**2 + 0.3**2 + 0.1**2)
    record = answered("hysteresis:q3", "backlash:q3", probabilities=probabilities)  # not even a candidate
    assert brier([record]).value == pytest.approx(1 + 0.6**2 + 0.3**2 + 0.1**2)


def test_probabilities_that_come_true_as_often_as_they_say_have_no_error() -> None:
    rng = np.random.default_rng(1)
    said = rng.uniform(size=20000)
    records = [
        answered("backlash:q3", "backlash:q3" if hit else "hardening:q3", p=float(p))
        for p, hit in zip(said, rng.uniform(size=said.size) < said, strict=True)
    ]
    error = calibration_error(records).value
    assert error is not None
    assert error < 0.015
    assert [round(b.low, 1) for b in reliability(records)] == [round(0.1 * k, 1) for k in range(10)]


def test_pairs_and_failures_are_not_judged() -> None:
    records = [answered("backlash:q3 hardening:q2", "backlash:q3"), answered("none", "failed")]
    assert reliability(records) == []
    assert brier(records).count == 0
    assert calibration_error(records).value is None
