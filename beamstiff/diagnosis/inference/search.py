"""Causes one by one and two by two, with their probabilities.

Every hypothesis is weighed alone; then, for the best few, the fit takes their columns along and everything is
weighed again on what they leave. The likeliest pairs that this finds are weighed anew at the end, both causes
together.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from scipy.special import logsumexp

from beamstiff.diagnosis.effects import Shape
from beamstiff.diagnosis.held_out.score import Weighted
from beamstiff.diagnosis.inference.component_subspaces import ComponentSubspace, modes_of
from beamstiff.diagnosis.inference.evidence import (
    COARSE,
    EXACT,
    Evidence,
    NoisePrior,
    Stack,
    evidence,
    log_weights,
    stacks_of,
)
from beamstiff.diagnosis.inference.library import Hypothesis, by_candidate
from beamstiff.diagnosis.inference.pair_evidence import Pair, alone, together
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

NONE, UNKNOWN, OUTLIERS = "none:null", "unknown:null", "outliers:null"
PRIOR = {NONE: 0.3, UNKNOWN: 0.1}  # of what is not an effect
PAIR = 0.15  # prior that there is a second effect, given one
FIRSTS = 6  # likeliest candidates that are tried as the first of two
MOST = 9  # firsts, with the members of the likeliest pairs; and pairs that are kept
UNLIKELY = 3.0  # log odds below which a second cause of the likeliest first ends the search
TRIED = 3  # pairs that are weighed together before there is held to be none
SHAPES = 6  # of a candidate, that are kept
Key = TypeVar("Key", bound=Hashable)
FREE_SIZE, FREE_SPREAD = 3.0, 30.0  # sigma a value that free laws make, and within which factor


@dataclass(frozen=True)
class Search:
    """What the evidence says.

    `log_weight`: of every candidate alone, of `NONE` and of `UNKNOWN`; log of prior times evidence.
    `pairs`: the likeliest first.
    `shapes`: of every candidate alone.
    `residual_fraction`: share of the gap's size that it leaves to the unknown.
    `free`: log evidence of what each place could do at most.
    `unmodelled`: of each place doing what is no effect of the library (`ComponentSubspace.unmodelled`): log
        of prior times evidence.
    """

    log_weight: dict[str, float]
    pairs: tuple[Pair, ...]
    shapes: dict[str, list[Weighted]]
    residual_fraction: dict[str, float]
    free: dict[str, float] = field(default_factory=dict)
    unmodelled: dict[tuple[str, str], float] = field(default_factory=dict)

    @property
    def single(self) -> dict[str, float]:
        """Probabilities without pairs."""
        total = logsumexp(list(self.log_weight.values()))
        return {key: float(np.exp(value - total)) for key, value in self.log_weight.items()}

    @property
    def named(self) -> list[str]:
        """Candidates that are effects, the likeliest first."""
        return sorted(
            (key for key in self.log_weight if key not in PRIOR),
            key=self.log_weight.__getitem__,
            reverse=True,
        )


def search(
    white: Whitened,
    hypotheses: Sequence[Hypothesis],
    scales: NoisePrior,
    laws: Sequence[ComponentSubspace] = (),
    pairs: bool = True,
) -> Search:
    """Weigh every candidate, the places' free laws, and the likeliest candidates with a second."""
    stacks = stacks_of(hypotheses)
    alone = evidence(white, hypotheses, scales, stacks=stacks)
    weights = _log_weights(hypotheses, alone)
    by_key = by_candidate(hypotheses)
    log_weight = {key: float(logsumexp(weights[places])) for key, places in by_key.items()}
    log_weight[NONE] = alone.none + np.log(PRIOR[NONE])
    log_weight[UNKNOWN] = alone.unknown + np.log(PRIOR[UNKNOWN])
    shapes, left = {}, {}
    for key, places in by_key.items():
        order = sorted(places, key=lambda at: -weights[at])[:SHAPES]
        share = np.exp(weights[order] - logsumexp(weights[order]))
        kept = [
            Weighted(hypotheses[at], float(p / share[share > 0.02].sum()), float(alone.magnitude[at]))
            for at, p in zip(order, share, strict=True)
            if p > 0.02
        ]
        shapes[key] = kept
        left[key] = float(alone.residual_fraction[order[0]])
    free, unmodelled = _freely(white, laws, scales), _unmodelled_by_place(white, laws, scales)
    result = Search(log_weight, (), shapes, left, free, unmodelled)
    if not pairs:
        return result
    found: dict[frozenset[str], Pair] = {}
    tried: set[str] = set()
    ahead = result.named[:1]
    while ahead and len(tried) < MOST:
        first = ahead.pop(0)
        tried.add(first)
        at = max(by_key[first], key=lambda k: weights[k])
        for pair in _beside(white, hypotheses, stacks, by_key, scales, laws, at, result):
            both = frozenset((pair.first, pair.second))
            if both not in found or pair.log_weight > found[both].log_weight:
                found[both] = pair
        best = max(found.values(), key=lambda pair: pair.log_weight, default=None)
        if best is None or (len(tried) == 1 and best.log_weight < log_weight[first] - UNLIKELY):
            break
        ahead = [key for key in (best.first, best.second, *result.named[:FIRSTS]) if key not in tried]
    ordered = sorted(found.values(), key=lambda pair: -pair.log_weight)[:MOST]
    return replace(result, pairs=tuple(ordered))


def weighed_together(
    white: Whitened,
    hypotheses: Sequence[Hypothesis],
    scales: NoisePrior,
    laws: Sequence[ComponentSubspace],
    found: Search,
) -> Search:
    """Return a search whose pairs are weighed anew, both causes together; parameters as for `search`."""
    best = found.log_weight[found.named[0]]
    if not found.pairs or found.log_weight[NONE] > best:
        return found
    shapes = {key: [hypotheses[at] for at in places] for key, places in by_candidate(hypotheses).items()}
    single = max(alone(white, shapes[key], scales, laws) for key in found.named[:FIRSTS])
    pairs: list[Pair] = []
    for one in found.pairs:
        if len(pairs) == TRIED and max(pair.log_weight for pair in pairs) < best:
            break  # there is no second cause
        start = max(one.shapes[0], key=lambda shape: shape.weight).hypothesis
        both = together(white, shapes[one.first], shapes[one.second], start, scales, laws)
        weight = best + both.log_weight + np.log(PAIR) - single
        pairs.append(replace(both, log_weight=float(weight)))
    return replace(found, pairs=tuple(sorted(pairs, key=lambda pair: -pair.log_weight)))


def _beside(
    white: Whitened,
    hypotheses: Sequence[Hypothesis],
    stacks: Sequence[Stack],
    by_key: Mapping[str, Sequence[int]],
    scales: NoisePrior,
    laws: Sequence[ComponentSubspace],
    at: int,
    alone: Search,
) -> Iterator[Pair]:
    """Yield every second cause beside a first, whose place may do more than its shape says."""
    first = hypotheses[at]
    nuisance = modes_of(laws, first.places, white.gap.size)
    alike = evidence(white.with_fitted(first.columns[:, :0], nuisance), [first], scales, COARSE)
    beside = white.with_fitted(first.columns, nuisance)
    second = evidence(beside, hypotheses, scales, COARSE, stacks)
    whole = float(np.linalg.norm(white.project_out(white.gap[:, None]))) or 1.0
    part = float(np.linalg.norm(beside.project_out(white.gap[:, None]))) / whole
    base = float(_log_weights([first], alike)[0])
    nothing = np.logaddexp(np.log(EXACT) + second.none, np.log(1.0 - EXACT) + second.unknown)
    rest = _log_weights(hypotheses, second) - nothing + np.log(PAIR)
    for key, some in by_key.items():
        if not rivals(first.key, key):
            best = max(some, key=rest.__getitem__)
            shapes = [Weighted(hypotheses[best], 1.0, float(second.magnitude[best]))]
            weight = base + float(logsumexp(rest[some]))
            yield Pair(
                first.key,
                key,
                weight,
                part * float(second.residual_fraction[best]),
                (alone.shapes[first.key], shapes),
            )


def _freely(white: Whitened, laws: Sequence[ComponentSubspace], scales: NoisePrior) -> dict[str, float]:
    """Return the log evidence of each place's free law, the better of its structure's and its drive's."""
    return _weighed(white, [(law.place, law.modes) for law in laws if law.inside], scales)


def _unmodelled_by_place(
    white: Whitened, laws: Sequence[ComponentSubspace], scales: NoisePrior
) -> dict[tuple[str, str], float]:
    """Return log prior times evidence of what each place could do that no effect of the library does."""
    every = [((law.place, does), modes) for law in laws for does, modes in law.unmodelled.items()]
    prior = float(np.log(PRIOR[UNKNOWN] / max(len(every), 1)))
    return {key: prior + value for key, value in _weighed(white, every, scales).items()}


def _weighed(white: Whitened, laws: Sequence[tuple[Key, Array]], scales: NoisePrior) -> dict[Key, float]:
    """Return the log evidence of laws by their keys, the better where two have one key."""
    shape = Shape("free", np.zeros((0, 6, 0)), (), prior_factor=FREE_SPREAD)
    some = [(key, modes) for key, modes in laws if modes.shape[1]]
    free = [Hypothesis("unknown", None, shape, 1.0, FREE_SIZE * modes) for _, modes in some]
    found: dict[Key, float] = {}
    values = evidence(white, free, scales).hypotheses.tolist() if free else []
    for (key, _), value in zip(some, values, strict=True):
        found[key] = max(value, found.get(key, -np.inf))
    return found


def rivals(one: str, other: str) -> bool:
    """Return whether two candidates sit at one place: the one is then no second cause beside the other."""
    a, b = one.partition(":")[2], other.partition(":")[2]
    return one == other or (a == b and a != "null")


def _log_weights(hypotheses: Sequence[Hypothesis], found: Evidence) -> Array:
    result: Array = log_weights(hypotheses, found) + np.log(1 - sum(PRIOR.values()))
    return result
