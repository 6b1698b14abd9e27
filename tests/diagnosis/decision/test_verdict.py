"""The verdict's logic, on evidence made by hand."""

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from beamstiff.diagnosis.decision.tempering import tempered
from beamstiff.diagnosis.decision.verdict import MOST, SLIGHT, Judged, judge, larger_first
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.component_subspaces import CREEPING
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, OUTLIERS, UNKNOWN, Search

NOISE = 5e-5  # m
GOOD = HeldOutError(4e-4, 5.2e-5, 0.99, (0.97, 1.0), postures=14, noise=NOISE, misfit=1.02)
USELESS = HeldOutError(4e-4, 4e-4, 0.0, (0.0, 0.05), postures=14, noise=NOISE, misfit=8.0)
HALF = HeldOutError(4e-4, 3e-4, 0.5, (0.4, 0.6), postures=14, noise=NOISE, misfit=6.0)
CLEAN, WRONG = (0, 0.0, False), (3, 3.0, True)  # rows left out: how many, how strongly, whether isolated


def search_of(
    effects: dict[str, float],
    none: float = -200.0,
    unknown: float = -60.0,
    left: float = 0.02,
    pairs: tuple[Pair, ...] = (),
    free: float = -40.0,
    unmodelled: float = -100.0,
) -> Search:
    """Return evidence: log weights of effects, none, the unknown and free laws; the effects leave a share."""
    weights = effects | {NONE: none, UNKNOWN: unknown}
    shares = dict.fromkeys(effects, left)
    laws = {"q3": free, "base": free - 50.0}
    return Search(weights, pairs, {}, shares, laws, {("q3", CREEPING): unmodelled})


def pair_of(first: str, second: str, log_weight: float, left: float = 0.02) -> Pair:
    return Pair(first, second, log_weight, left, ([], []))


def judged(search: Search, **more: Any) -> Judged:
    usual: dict[str, Any] = {"freedom": 400, "outliers": CLEAN, "single": GOOD, "both": None}
    found = judge(search, **(usual | more))
    assert sum(found.probabilities.values()) == pytest.approx(1)
    assert all(0 <= p <= 1 for p in found.probabilities.values())
    assert {NONE, UNKNOWN, OUTLIERS} & set(found.probabilities)
    assert found.verdict not in found.indistinguishable
    return found


NAMED = {"backlash:q3": 0.0, "hardening:q3": -150.0, "hysteresis:q2": -180.0}


def test_a_cause_that_explains_it_all_is_named_alone() -> None:
    found = judged(search_of(NAMED))
    assert found.verdict == "backlash:q3"
    assert found.probabilities["backlash:q3"] > 0.8
    assert found.indistinguishable == ()
    assert found.also is None


def test_nothing_beyond_noise_is_none() -> None:
    found = judged(search_of(NAMED, none=20.0, unknown=5.0), single=USELESS)
    assert found.verdict == NONE
    assert found.probabilities[NONE] > 0.9
    assert found.indistinguishable == ()


def test_rows_that_nothing_explains_are_the_cause_where_nothing_else_is_left() -> None:
    found = judged(search_of(NAMED, none=20.0, unknown=5.0), outliers=WRONG, single=USELESS)
    assert found.verdict == OUTLIERS
    assert found.probabilities[NONE] == 0.0


def test_a_gap_that_the_best_cause_leaves_open_is_unknown() -> None:
    found = judged(search_of(NAMED, left=0.95), single=USELESS)
    assert found.verdict == UNKNOWN
    assert found.probabilities[UNKNOWN] > 0.8


def test_of_a_handful_of_values_nothing_is_sure() -> None:
    near = {"backlash:q3": -2.0, "hardening:q3": -2.5}
    for freedom in (1, 3, 12):
        found = judged(search_of(near, none=-4.0, unknown=-3.0, free=-3.0), freedom=freedom)
        assert max(found.probabilities.values()) < 0.7
    assert judged(search_of(NAMED, unmodelled=-190.0), freedom=800).probabilities["backlash:q3"] > 0.7


@pytest.mark.parametrize(("freedom", "most"), [(0, 0.65), (1, 0.65), (5, 0.75), (15, 0.85), (29, 0.96)])
def test_of_a_handful_of_values_not_even_nothing_is_sure(freedom: int, most: float) -> None:
    nothing = search_of({"backlash:q3": -2.0, "hardening:q3": -2.5}, none=0.0, unknown=-3.0)
    assert judged(nothing, freedom=freedom, single=USELESS).probabilities[NONE] < most
    assert judged(nothing, freedom=800, single=USELESS).probabilities[NONE] > 0.9


def test_causes_as_likely_as_the_verdict_are_its_equivalents() -> None:
    near = {"link-bending:link2": 0.0, "bearing-tilt:q2": -0.5, "backlash:q3": -400.0}
    found = judged(search_of(near))
    assert found.verdict == "link-bending:link2"
    assert found.indistinguishable == ("bearing-tilt:q2",)


def test_a_set_is_the_likeliest_few_in_their_order() -> None:
    many = {f"link-bending:link{k}": -0.1 * k for k in range(20)}
    found = judged(search_of(many))
    assert len(found.indistinguishable) <= MOST
    shares = [found.probabilities[key] for key in (found.verdict, *found.indistinguishable)]
    assert shares == sorted(shares, reverse=True)


def test_log_odds_are_divided_so_that_the_likeliest_stays_ahead() -> None:
    weights = {"a": 0.0, "b": -10.0}
    shares = [tempered(weights, divisor)["b"] for divisor in (1.0, 5.0, 50.0)]
    assert shares[0] == pytest.approx(np.exp(-10) / (1 + np.exp(-10)))
    assert shares[0] < shares[1] < shares[2] < 0.5
    assert sum(tempered(weights, 7.7).values()) == pytest.approx(1)


def test_evidence_is_believed_less_the_more_of_it_there_is() -> None:
    # shapes are never quite right: what speaks for the one against the other grows with the gap itself
    ahead = [
        judged(search_of({"hardening:q1": size, "backlash:q1": size - 10.0})).probabilities["backlash:q1"]
        for size in (0.0, 50.0, 500.0)
    ]
    assert ahead == sorted(ahead)
    assert ahead[0] < 0.6 * ahead[-1]


def test_a_law_of_its_own_that_explains_far_more_than_any_name_is_unknown() -> None:
    # a name that leaves little and is worth much, and yet its place does something else
    assert judged(search_of(NAMED, left=0.15)).verdict == "backlash:q3"
    assert judged(search_of(NAMED, left=0.15, free=160.0)).verdict == UNKNOWN
    assert judged(search_of(NAMED, left=0.15, unmodelled=40.0)).verdict == UNKNOWN


def test_a_name_that_is_doubted_says_so_in_its_set_and_the_unknown_says_what_it_could_be() -> None:
    named = judged(search_of(NAMED, left=0.15))
    assert named.probabilities[UNKNOWN] > SLIGHT
    assert (named.verdict, named.indistinguishable) == ("backlash:q3", (UNKNOWN,))
    unknown = judged(search_of(NAMED, left=0.5, free=0.0))
    assert (unknown.verdict, unknown.indistinguishable) == (UNKNOWN, ("backlash:q3",))


def test_rows_are_wrong_beside_a_cause_where_they_are_isolated() -> None:
    assert judged(search_of(NAMED), outliers=WRONG).also == OUTLIERS
    assert judged(search_of(NAMED), outliers=(30, 3.0, False)).also is None
    assert judged(search_of(NAMED), outliers=(2, 3.0, True)).also is None
    assert judged(search_of(NAMED), outliers=(1, 30.0, True)).also == OUTLIERS  # one that is grossly wrong


def test_rows_that_nothing_explains_are_unknown_where_they_may_not_be_called_wrong() -> None:
    log_odds_none = search_of(NAMED, none=20.0, unknown=5.0)
    more: dict[str, Any] = {"outliers": WRONG, "single": USELESS}
    found = judged(log_odds_none, may_be_outliers=False, **more)
    assert (found.verdict, found.probabilities[NONE]) == (UNKNOWN, 0.0)
    assert judged(log_odds_none, may_be_outliers=False, **(more | {"outliers": CLEAN})).verdict == NONE
    named = judged(search_of(NAMED), outliers=WRONG, may_be_outliers=False)
    assert (named.verdict, named.also, named.indistinguishable) == ("backlash:q3", None, (UNKNOWN,))


PAIR = pair_of("backlash:q3", "base-compliance:null", 60.0)


def test_a_second_cause_with_evidence_and_worth_of_its_own_is_named_beside_the_first() -> None:
    search = search_of(NAMED | {"base-compliance:null": -90.0}, left=0.4, pairs=(PAIR,))
    found = judged(search, single=HALF, both=GOOD)
    assert (found.verdict, found.also) == ("backlash:q3", "base-compliance:null")
    assert found.also_probability > 0.8
    assert "base-compliance:null" not in found.indistinguishable


def test_of_two_causes_the_likelier_alone_comes_first() -> None:
    search = search_of(
        {"base-compliance:null": 0.0, "backlash:q3": -20.0},
        left=0.4,
        pairs=(pair_of("backlash:q3", "base-compliance:null", 60.0),),
    )
    found = judged(search, single=HALF, both=GOOD)
    assert (found.verdict, found.also) == ("base-compliance:null", "backlash:q3")


def test_of_two_causes_the_one_that_closes_more_alone_is_the_main_one() -> None:
    search = search_of(NAMED | {"base-compliance:null": -90.0}, left=0.4, pairs=(PAIR,))
    found = judged(search, single=HALF, both=GOOD)
    assert larger_first(found, {"backlash:q3": 0.6, "base-compliance:null": 0.3}) == found
    turned = larger_first(found, {"backlash:q3": 0.3, "base-compliance:null": 0.6})
    assert (turned.verdict, turned.also) == ("base-compliance:null", "backlash:q3")
    assert turned.probabilities["base-compliance:null"] == found.probabilities["backlash:q3"]
    assert sum(turned.probabilities.values()) == pytest.approx(1.0)


def test_two_causes_of_which_none_is_clear_are_unknown_and_said() -> None:
    names = ("a:1", "b:2", "c:3", "d:4")
    pairs = tuple(pair_of(*two, 60.0 - 0.1 * at) for at, two in enumerate(combinations(names, 2)))
    found = judged(search_of(dict.fromkeys(names, 0.0), left=0.4, pairs=pairs), single=HALF, both=GOOD)
    assert (found.verdict, found.also) == (UNKNOWN, None)
    assert set(found.unclear) == set(names)
    assert found.probabilities[UNKNOWN] == max(found.probabilities.values())
    possible = [found.probabilities[key] for key in found.indistinguishable]
    assert possible == sorted(possible, reverse=True)
    assert possible
    assert min(possible) >= SLIGHT


def test_of_two_causes_the_clear_one_is_named_alone_where_the_other_is_not() -> None:
    seconds = ("b:2", "c:3", "d:4")
    pairs = tuple(pair_of("a:1", second, 60.0 - 0.1 * at) for at, second in enumerate(seconds))
    far = tuple(replace(one, residual_fraction=0.3) for one in pairs)
    weights = {"a:1": 0.0} | dict.fromkeys(seconds, -50.0)
    found = judged(search_of(weights, left=0.4, pairs=pairs), single=HALF, both=GOOD)
    assert (found.verdict, found.also) == ("a:1", None)
    assert found.unclear == seconds
    assert found.indistinguishable == ()
    doubted = judged(search_of(weights, left=0.4, free=-20.0, pairs=far), single=HALF, both=GOOD)
    assert (doubted.verdict, doubted.indistinguishable) == ("a:1", (UNKNOWN,))


def test_two_causes_that_are_doubted_say_so_too() -> None:
    left = pair_of("backlash:q3", "base-compliance:null", 60.0, left=0.3)
    search = search_of(NAMED | {"base-compliance:null": -90.0}, left=0.4, free=-20.0, pairs=(left,))
    found = judged(search, single=HALF, both=GOOD)
    assert found.also == "base-compliance:null"
    assert found.probabilities[UNKNOWN] > SLIGHT
    assert UNKNOWN in found.indistinguishable


def test_what_each_posture_has_to_itself_is_judged_by_its_other_loads() -> None:
    """Whoever hooks a load on anew for each posture leaves nothing of it to be told of the next."""
    pair = pair_of("backlash:q3", "tool-offset:null", 60.0, 0.05)
    search = search_of(NAMED | {pair.second: -90.0}, left=0.4, pairs=(pair,))
    assert judged(search, single=HALF, both=HALF).also is None
    for second, told in ((1.01, True), (3.0, False)):
        by_load = replace(HALF, misfit=3.0), replace(GOOD, misfit=second)
        assert (judged(search, single=HALF, both=HALF, by_load=by_load).also is not None) == told


def test_pairs_are_told_apart_the_better_the_less_they_leave() -> None:
    def second(left: float) -> float:
        pairs = tuple(
            pair_of("backlash:q3", name, 100.0 - 20.0 * at, left)
            for at, name in enumerate(("base-compliance:null", "bearing-tilt:q2"))
        )
        effects = NAMED | {pair.second: -90.0 for pair in pairs}
        return judged(search_of(effects, left=0.4, pairs=pairs), single=HALF, both=GOOD).also_probability

    shares = [second(left) for left in (0.01, 0.05, 0.1)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.9


@pytest.mark.parametrize(
    ("pair", "single", "both"),
    [
        (None, HALF, GOOD),
        (PAIR, HALF, None),
        (PAIR, HALF, HALF),  # worth nothing more
        (PAIR, GOOD, GOOD),  # nothing was left to close
    ],
    ids=["no pair", "not tried", "no worth", "nothing left"],
)
def test_a_second_cause_is_refused_without_evidence_and_worth(
    pair: Pair | None, single: HeldOutError, both: HeldOutError | None
) -> None:
    search = search_of(NAMED, left=0.1, pairs=() if pair is None else (pair,))
    assert judged(search, single=single, both=both).also is None
