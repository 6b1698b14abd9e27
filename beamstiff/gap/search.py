"""Causes one by one and two by two, with their probabilities.

Every hypothesis is weighed alone; then, for the best few, the fit takes their columns along and everything is
weighed again on what they leave, so that two causes are found together.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from beamstiff.gap.evidence import Evidence, Scales, evidence
from beamstiff.gap.heldout import Weighted
from beamstiff.gap.library import Hypothesis
from beamstiff.gap.whitened import Whitened

NONE, UNKNOWN, OUTLIERS = "none:null", "unknown:null", "outliers:null"
PRIOR = {NONE: 0.3, UNKNOWN: 0.1}  # of what is not an effect
PAIR = 0.15  # prior that there is a second effect, given one
FIRSTS = 6
SECOND_SHARES = np.array([0.0, 0.06, 0.25, 1.0, 4.0])
UNLIKELY = 3.0  # log odds below which a second cause of the likeliest first ends the search
SHAPES = 6  # of a candidate, that are kept


@dataclass(frozen=True)
class Pair:
    """Two candidates and the log probability of both, not normalised.

    Attributes
    ----------
    first, second : str
    log_weight : float
    left : float
        Share of the gap's size that both leave to the unknown.
    shapes : (list of Weighted, list of Weighted)
        Of the first, and of the second beside it.
    """

    first: str
    second: str
    log_weight: float
    left: float
    shapes: tuple[list[Weighted], list[Weighted]]


@dataclass(frozen=True)
class Search:
    """What the evidence says.

    Attributes
    ----------
    log_weight : dict of str to float
        Of every candidate alone, of `NONE` and of `UNKNOWN`; log of prior times evidence.
    pairs : tuple of Pair
        The likeliest first.
    shapes : dict of str to list of Weighted
        Of every candidate alone.
    amiss : dict of str to float
        What the best shape of a candidate is off by, of its own size.
    left : dict of str to float
        Share of the gap's size that it leaves to the unknown.
    """

    log_weight: dict[str, float]
    pairs: tuple[Pair, ...]
    shapes: dict[str, list[Weighted]]
    amiss: dict[str, float]
    left: dict[str, float]

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


def search(white: Whitened, hypotheses: Sequence[Hypothesis], scales: Scales, pairs: bool = True) -> Search:
    """Weigh every candidate, and the likeliest ones with a second."""
    alone = evidence(white, hypotheses, scales)
    weights = _log_weights(hypotheses, alone)
    by_key: dict[str, list[int]] = defaultdict(list)
    for at, one in enumerate(hypotheses):
        by_key[one.key].append(at)
    log_weight = {key: float(logsumexp(weights[places])) for key, places in by_key.items()}
    log_weight[NONE] = alone.none + np.log(PRIOR[NONE])
    log_weight[UNKNOWN] = alone.unknown + np.log(PRIOR[UNKNOWN])
    shapes, amiss, left = {}, {}, {}
    for key, places in by_key.items():
        order = sorted(places, key=lambda at: -weights[at])[:SHAPES]
        share = np.exp(weights[order] - logsumexp(weights[order]))
        kept = [
            Weighted(hypotheses[at], float(p / share[share > 0.02].sum()), float(alone.magnitude[at]))
            for at, p in zip(order, share, strict=True)
            if p > 0.02
        ]
        shapes[key] = kept
        amiss[key] = float(alone.amiss[order[0]])
        left[key] = float(alone.left[order[0]])
    result = Search(log_weight, (), shapes, amiss, left)
    if not pairs:
        return result
    found: dict[frozenset[str], Pair] = {}
    whole = float(np.linalg.norm(white.leave(white.gap[:, None]))) or 1.0
    for first in result.named[:FIRSTS]:
        at = max(by_key[first], key=lambda k: weights[k])
        beside = white.beside(hypotheses[at].columns)
        second = evidence(beside, hypotheses, scales, SECOND_SHARES)
        part = float(np.linalg.norm(beside.leave(white.gap[:, None])) / whole)
        base = float(np.log(hypotheses[at].prior) + alone.exact[at] + np.log(1 - sum(PRIOR.values())))
        rest = _log_weights(hypotheses, second) - second.none + np.log(PAIR)
        for key, places in by_key.items():
            if not rivals(first, key):
                weight = base + float(logsumexp(rest[places]))
                pair = frozenset((first, key))
                if pair not in found or weight > found[pair].log_weight:
                    best = max(places, key=rest.__getitem__)
                    own = [Weighted(hypotheses[best], 1.0, float(second.magnitude[best]))]
                    left_over = part * float(second.left[best])
                    found[pair] = Pair(first, key, weight, left_over, (shapes[first], own))
        if (
            first == result.named[0]
            and max((pair.log_weight for pair in found.values()), default=-np.inf)
            < log_weight[first] - UNLIKELY
        ):
            break
    ordered = sorted(found.values(), key=lambda pair: -pair.log_weight)[:20]
    return Search(log_weight, tuple(ordered), shapes, amiss, left)


def rivals(one: str, other: str) -> bool:
    """Return whether two candidates sit at one place: the one is then no second cause beside the other."""
    a, b = one.partition(":")[2], other.partition(":")[2]
    return one == other or (a == b and a != "null")


def _log_weights(hypotheses: Sequence[Hypothesis], found: Evidence) -> np.ndarray:
    prior = np.log([one.prior for one in hypotheses]) + np.log(1 - sum(PRIOR.values()))
    return np.asarray(prior + found.hypotheses)
