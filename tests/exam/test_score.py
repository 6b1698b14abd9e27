import json
from math import nan
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from beamstiff.exam import score
from beamstiff.exam.names import EFFECTS, FAMILIES, NONE, UNKNOWN, family, normal
from beamstiff.exam.rates import mean, median, rate
from beamstiff.exam.record import answer_of, record_from
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
    assert score.is_exact(answered("joint-coupling:q5+q6", "joint-coupling:q6+q5"))


# --- what a case is


def test_exact_asks_for_effect_and_component_and_nothing_else() -> None:
    assert score.is_exact(answered("backlash:q3", "backlash:q3"))
    assert not score.is_exact(answered("backlash:q3", "backlash:q2"))
    assert not score.is_exact(answered("backlash:q3", "hardening:q3"))
    assert not score.is_exact(answered("backlash:q3", "backlash:q3", also=["link-bending:link2"]))
    assert not score.is_exact(answered("backlash:q3", UNKNOWN))
    assert score.is_exact(answered("base-compliance", "base-compliance:null"))


def test_family_and_place_are_judged_apart() -> None:
    right_family = answered("backlash:q3", "hardening:q2")
    assert score.is_family(right_family)
    assert not score.is_place(right_family)
    right_place = answered("backlash:q3", "bearing-tilt:q3")
    assert not score.is_family(right_place)
    assert score.is_place(right_place)
    for verdict in (NONE, UNKNOWN, "failed"):  # these have no place, not even `null`
        assert not score.is_place(answered("base-compliance", verdict))
        assert not score.is_family(answered("base-compliance", verdict))


def test_the_set_is_the_verdict_and_its_declared_equivalents() -> None:
    records = [
        answered("backlash:q3", "backlash:q3"),
        answered("backlash:q3", "hardening:q3", set=["backlash:q3", "hysteresis:q3"]),
        answered("backlash:q3", "hardening:q3"),
        answered("backlash:q3", UNKNOWN),
    ]
    assert score.coverage(records).value == 2 / 4
    assert score.coverage_of_names(records).value == 2 / 3
    assert score.set_size(records).value == pytest.approx((1 + 3 + 1) / 3)
    assert score.unknowns(records).value == 1 / 4


def test_a_null_is_answered_by_none_only() -> None:
    records = [
        answered("none", NONE),
        answered("none", NONE),
        answered("none", UNKNOWN),
        answered("none", "backlash:q3"),
        answered("none", "failed"),
        answered("backlash:q3", "backlash:q3"),  # no null: not asked
    ]
    alarms = score.false_alarms(records)
    assert (alarms.value, alarms.count) == (3 / 5, 5)


def test_an_effect_outside_the_library_must_get_no_name() -> None:
    outside = {"kind": "outside"}
    records = [
        answered("stiffness-ripple:q2", UNKNOWN, **outside),
        answered("stiffness-ripple:q2", NONE, **outside),
        answered("stiffness-ripple:q2", "actuator-lever:q2", **outside),
        answered("stiffness-ripple:q2", "failed", **outside),
        answered("stiffness-ripple:q2", "actuator-lever:q2", gap=0.5, **outside),  # too small to count
    ]
    figure = score.not_named(records)
    assert (figure.value, figure.count) == (2 / 4, 4)


def test_a_removed_class_is_flagged_by_unknown_or_a_set_and_strictly_by_its_name() -> None:
    removed = {"kind": "removed", "withheld": ("backlash",)}
    records = [
        answered("backlash:q3", UNKNOWN, **removed),
        answered("backlash:q3", "hardening:q3", set=["backlash:q3"], **removed),
        answered("backlash:q3", "hardening:q3", set=["hysteresis:q3"], **removed),
        answered("backlash:q3", "hardening:q3", **removed),
        answered("backlash:q3", NONE, **removed),
        answered("backlash:q3", "failed", **removed),
    ]
    assert score.flagged(records).value == 3 / 6
    assert score.truly_flagged(records).value == 2 / 6


def test_pairs_are_compared_without_order_and_only_where_each_effect_can_be_seen() -> None:
    truth = "backlash:q3 link-bending:link2"
    records = [
        answered(truth, "link-bending:link2", also=["backlash:q3"]),  # both
        answered(truth, "backlash:q3"),  # one, nothing false
        answered(truth, "backlash:q3", also=["hardening:q3"]),  # one of them false
        answered(truth, UNKNOWN),  # nothing false
        answered(truth, "failed"),
        answered(truth, "hardening:q1", gaps=(3.0, 0.2)),  # too small to count
        answered(truth, "hardening:q1", gaps=(3.0, nan)),  # no baseline: not known to be large
    ]
    assert len(score.clear_pairs(records)) == 5
    assert score.both(records).value == 1 / 5
    assert score.nothing_false(records).value == 3 / 5


def test_promises_are_compared_from_one_and_a_half_sigma_on() -> None:
    records = [
        answered("backlash:q3", "backlash:q3", gap=2.0, promised=0.9, shrink=0.8),
        answered("backlash:q3", "hardening:q3", gap=2.0, promised=0.5, shrink=0.1),  # a wrong name counts
        answered("backlash:q3", "backlash:q3", gap=1.5, promised=0.6, shrink=0.8),
        answered("backlash:q3", "backlash:q3", gap=1.4, promised=0.0, shrink=1.0),
        answered("backlash:q3", UNKNOWN, gap=2.0),  # promises nothing
    ]
    figure = score.shrink_difference(records)
    assert figure.value == pytest.approx(0.2)
    assert figure.count == 3


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
    keys = [
        f"{effect}:q{k}"
        for effect in ("backlash", "hardening", "load-error", "link-bending")
        for k in range(5)
    ]
    truths, verdicts = rng.integers(20, size=(2, 4000))
    records = [answered(keys[t], keys[v]) for t, v in zip(truths, verdicts, strict=True)]
    figure = score.exact(records)
    assert figure.low is not None
    assert figure.high is not None
    assert figure.low < 1 / 20 < figure.high
    assert score.right_family(records).value == pytest.approx((10**2 + 5**2 + 5**2) / 20**2, abs=0.03)
    assert score.right_place(records).value == pytest.approx(1 / 5, abs=0.03)
    assert score.chance(records) == pytest.approx(1 / 20, abs=0.002)


def test_a_control_is_judged_where_it_was_asked() -> None:
    records = [
        answered("backlash:q3", controls={"bic": "backlash:q3"}),
        answered("backlash:q3", controls={"bic": "hardening:q3"}),
        answered("backlash:q3"),
    ]
    assert (score.control_exact(records, "bic").value, score.control_exact(records, "bic").count) == (0.5, 2)


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
