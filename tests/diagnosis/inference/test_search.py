"""Causes one by one and two by two, on gaps made of bare columns."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import beamstiff.diagnosis.inference.search as searching
from beamstiff.diagnosis.effects import Quantity, Shape
from beamstiff.diagnosis.inference.evidence import NoisePrior
from beamstiff.diagnosis.inference.library import Hypothesis, whitened
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, PRIOR, UNKNOWN, Search, rivals, search
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, at_random, elbow, nominal

SIGMA = np.repeat([POSITION, ROTATION], 3)
SCALES = NoisePrior(np.exp([-0.2, 0.0, 0.2]), np.log([0.25, 0.5, 0.25]))
NAMES = ("a:q1", "b:q1", "c:q2", "d:q2", "e:null", "f:null")


@pytest.fixture(scope="module")
def there() -> Baseline:
    return nominal(elbow(), at_random(elbow(), 40, seed=1, sigma_position=POSITION, sigma_rotation=ROTATION))


@pytest.fixture(scope="module")
def columns() -> dict[str, Array]:
    rng = np.random.default_rng(2)
    return {name: rng.standard_normal((40, 6)) * SIGMA for name in NAMES}


def found(there: Baseline, columns: dict[str, Array], gap: Array, more: Sequence[Hypothesis] = ()) -> Search:
    noise = np.random.default_rng(3).standard_normal((40, 6)) * SIGMA
    there = replace(there, measured=there.predicted + gap + noise)
    hypotheses = [hypothesis(*name.split(":"), one[..., None]) for name, one in columns.items()]
    white = whiten(there)
    return search(white, whitened([*hypotheses, *more], white), SCALES)


def hypothesis(
    effect: str, component: str, columns: Array, name: str = "only", prior: float = 1 / 6
) -> Hypothesis:
    sizes = tuple(Quantity(f"p{k}", "1", 1.0) for k in range(columns.shape[-1]))
    shape = Shape(name, columns, sizes)
    place = None if component == "null" else component
    return Hypothesis(effect, place, shape, prior, np.zeros((columns.size, columns.shape[-1])))


@pytest.mark.parametrize("name", NAMES)
def test_the_cause_that_is_there_is_likeliest(name: str, there: Baseline, columns: dict[str, Array]) -> None:
    result = found(there, columns, 5 * columns[name])
    assert result.named[0] == name
    assert result.single[name] > 0.99
    assert result.residual_fraction[name] < 0.2
    assert all(result.residual_fraction[other] > 0.5 for other in NAMES if other != name)


def test_probabilities_sum_to_1_with_none_and_unknown(there: Baseline, columns: dict[str, Array]) -> None:
    result = found(there, columns, columns["a:q1"])
    assert set(result.single) == {*NAMES, NONE, UNKNOWN}
    assert sum(result.single.values()) == pytest.approx(1)
    assert set(result.named) == set(NAMES)


def test_without_a_gap_none_is_the_likeliest(there: Baseline, columns: dict[str, Array]) -> None:
    result = found(there, columns, 0 * columns["a:q1"])
    assert max(result.single, key=result.single.__getitem__) == NONE
    assert result.single[NONE] > 0.5


def test_a_gap_of_a_kind_nobody_thought_of_is_unknown(there: Baseline, columns: dict[str, Array]) -> None:
    # it grows with the load, differently in every posture
    rng = np.random.default_rng(4)
    other = np.einsum("nab,nb->na", rng.standard_normal((40, 6, 6)), there.rows.wrench)
    other *= 10 * SIGMA / np.sqrt((other**2).mean(axis=0))
    result = found(there, columns, other)
    assert max(result.single, key=result.single.__getitem__) == UNKNOWN


def test_two_causes_are_found_together(there: Baseline, columns: dict[str, Array]) -> None:
    result = found(there, columns, 6 * columns["a:q1"] + 4 * columns["e:null"])
    pair = result.pairs[0]
    assert {pair.first, pair.second} == {"a:q1", "e:null"}
    assert pair.log_weight - max(result.log_weight.values()) > 20
    assert pair.residual_fraction < 0.2
    first, second = pair.shapes
    assert {first[0].hypothesis.key, second[0].hypothesis.key} == {"a:q1", "e:null"}


def test_one_cause_is_not_made_two(there: Baseline, columns: dict[str, Array]) -> None:
    result = found(there, columns, 6 * columns["a:q1"])
    assert max(pair.log_weight for pair in result.pairs) < result.log_weight["a:q1"]


def test_two_causes_at_one_place_are_rivals_and_no_pair(there: Baseline, columns: dict[str, Array]) -> None:
    assert rivals("a:q1", "b:q1")
    assert rivals("a:q1", "a:q1")
    assert not rivals("a:q1", "a:q2")
    assert not rivals("e:null", "f:null")
    result = found(there, columns, 6 * columns["a:q1"] + 4 * columns["b:q1"])
    assert all(not rivals(pair.first, pair.second) for pair in result.pairs)


def test_shapes_of_a_cause_add_up_and_the_right_one_leads(there: Baseline, columns: dict[str, Array]) -> None:
    rng = np.random.default_rng(5)
    other = hypothesis("a", "q1", rng.standard_normal((40, 6, 1)) * SIGMA[:, None], "another", prior=1 / 6)
    result = found(there, columns, 5 * columns["a:q1"], [other])
    assert set(result.single) == {*NAMES, NONE, UNKNOWN}
    shapes = result.shapes["a:q1"]
    assert shapes[0].hypothesis.shape.name == "only"
    assert shapes[0].weight > 0.99
    assert sum(one.weight for one in shapes) == pytest.approx(1)


def test_what_is_no_effect_has_a_prior_of_its_own() -> None:
    assert sum(PRIOR.values()) < 1
    assert PRIOR[NONE] > PRIOR[UNKNOWN] > 0


def test_no_more_firsts_are_tried_than_there_are_to_be(
    there: Baseline, columns: dict[str, Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[str] = []

    def beside(*given: Any) -> Iterator[Pair]:
        """Yield a pair that is the likelier the later it comes, of causes that were not tried."""
        _, hypotheses, *_, at, alone = given
        first = hypotheses[at].key
        tried.append(first)
        other = alone.named[(alone.named.index(first) + 3) % len(alone.named)]
        yield Pair(first, other, alone.log_weight[alone.named[0]] + len(tried), 0.1, ([], []))

    monkeypatch.setattr(searching, "_beside", beside)
    monkeypatch.setattr(searching, "MOST", 4)
    found(there, columns, 5 * columns["a:q1"])
    assert len(tried) == len(set(tried)) == 4
