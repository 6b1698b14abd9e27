"""From evidence to a verdict: honest probabilities, what is indistinguishable, a second cause.

How probable it is that there is no cause, one, two or an unknown one is said by `classifier`. Log odds
between effects are divided by ``1 + E / TEMPERING``, E the log odds of the best against the unknown, and more
where values are few (`tempering`); those between pairs, which are free enough to show by what they leave how
far off they are, by ``1 + sqrt(E residual_fraction)``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from beamstiff.diagnosis.decision.classifier import Coefficients, Features, features_of, shares_of
from beamstiff.diagnosis.decision.tempering import divisor_of, tempered
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.search import NONE, OUTLIERS, UNKNOWN, Search

SECOND = 8.0  # log odds of a second cause, from which it is weighed on held-out postures
SURE = 0.92  # probability of the verdict with what cannot be told from it
# share of the verdict's own from which a cause cannot be told from it, and probability from which the
# unknown, or another cause of two, is one of a set
SLIGHT = (
    0.15  # at 0.1 a set has 1.9 members in the mean of the study, at 0.15 1.7, and holds the truth as often
)
CLEAR = 0.72  # probability that each of two causes needs among those that could be it
DISTINCT, SEVERAL = 1.3, 3  # outliers: strength to be named, and number beside a cause
GROSS = 10.0  # strength from which fewer are named beside it
SEEN = 0.9  # probability of outliers beside a cause
MOST = 5  # effects in a set, beyond which the data tell nothing apart


@dataclass(frozen=True)
class Judged:
    """A verdict.

    `probabilities`: of all candidates; their sum is 1.
    `unclear`: what a second cause could be, where there is one and it is not clear which; of a verdict that
        is unknown, what two causes could be.
    `features`: what the probabilities rest on.
    """

    probabilities: dict[str, float]
    verdict: str
    indistinguishable: tuple[str, ...]
    also: str | None = None
    also_probability: float = 0.0
    unclear: tuple[str, ...] = ()
    features: Features = field(default=Features({}, {}, {}, {}))


def judge(
    search: Search,
    freedom: int,
    outliers: tuple[int, float, bool],
    single: HeldOutError,
    both: HeldOutError | None,
    may_be_outliers: bool = True,
    by_load: tuple[HeldOutError, HeldOutError] | None = None,
    coefficients: Coefficients | None = None,
) -> Judged:
    """Return the verdict.

    `freedom`: values less fitted parameters.
    `outliers`: how many rows were left out that nothing explains, their strength, and whether they are
        isolated (`Screened`).
    `single`, `both`: held-out worth of the best cause, and of the best pair.
    `may_be_outliers`: whether rows that nothing explains may be called wrong; else they are what is unknown.
    `by_load`: the worth of both on held-out loads, where the pair has something to itself in each posture.
    `coefficients`: of the classifier; default those of its file.
    """
    features = features_of(search, freedom, single, both, by_load)
    found = shares_of(features, coefficients)
    best = search.named[0]
    evidence = search.log_weight[best] - search.log_weight[UNKNOWN]
    effects = tempered({key: search.log_weight[key] for key in search.named}, divisor_of(evidence, freedom))
    odd_rows = outliers[0] > 0 and outliers[1] >= DISTINCT
    shares = {NONE: found.none, UNKNOWN: found.unknown}
    if odd_rows:  # rows that nothing explains are what there is, where there is nothing else
        shares[NONE] = 0.0
        what = OUTLIERS if may_be_outliers else UNKNOWN
        shares[what] = shares.get(what, 0.0) + found.none
    real = found.one + found.two
    if found.two > found.one:
        return replace(_two(search, effects, shares, real), features=features)
    probabilities = {key: real * share for key, share in effects.items()} | shares
    likeliest = max(effects, key=effects.__getitem__)
    alike = _set(effects, likeliest)
    likely = sum(probabilities[key] for key in (likeliest, *alike))
    if freedom > 0 and likely >= max(shares.values()):  # of no more values than are fitted nothing has a name
        wrong = odd_rows and (outliers[0] >= SEVERAL or outliers[1] >= GROSS) and outliers[2]
        also, seen = (OUTLIERS, SEEN) if wrong and may_be_outliers else (None, 0.0)
        doubted = (UNKNOWN,) if shares[UNKNOWN] >= SLIGHT or (wrong and not may_be_outliers) else ()
        return Judged(probabilities, likeliest, alike + doubted, also, seen, features=features)
    rivals = tuple(key for key in search.named if probabilities[key] >= SLIGHT)
    return Judged(probabilities, max(shares, key=shares.__getitem__), rivals, features=features)


def larger_first(judged: Judged, closes: Mapping[str, float]) -> Judged:
    """Return a judgement of two causes with that first which alone closes more, be the other clearer."""
    first, second = judged.verdict, judged.also
    if second is None or closes[second] <= closes[first]:
        return judged
    swapped = {first: judged.probabilities.get(second, 0.0), second: judged.probabilities[first]}
    return replace(judged, verdict=second, also=first, probabilities={**judged.probabilities, **swapped})


def _set(effects: Mapping[str, float], verdict: str) -> tuple[str, ...]:
    """Return what cannot be told from a verdict: the likeliest others, until all are sure together."""
    mass = effects[verdict]
    rest: list[str] = []
    for key in sorted(effects, key=effects.__getitem__, reverse=True):
        if mass >= SURE or len(rest) == MOST:
            break
        if key != verdict and effects[key] >= SLIGHT * effects[verdict]:
            mass += effects[key]
            rest.append(key)
    return tuple(rest)


def _two(search: Search, effects: Mapping[str, float], shares: dict[str, float], real: float) -> Judged:
    pair = search.pairs[0]
    names = {f"{k}": one for k, one in enumerate(search.pairs)}
    evidence = pair.log_weight - search.log_weight[UNKNOWN]
    divisor = 1.0 + float(np.sqrt(max(evidence, 0.0) * pair.residual_fraction))
    among = tempered({k: one.log_weight for k, one in names.items()}, divisor)
    member: dict[str, float] = {}
    for k, share in among.items():
        for key in (names[k].first, names[k].second):
            member[key] = member.get(key, 0.0) + share
    first, second = pair.first, pair.second
    if (member[second], search.log_weight[second]) > (member[first], search.log_weight[first]):
        first, second = second, first  # the one that is clearer comes first
    others = [
        key for key in sorted(member, key=member.__getitem__, reverse=True) if key not in (first, second)
    ]
    kept = tuple(key for key in others if member[key] >= SLIGHT)[:MOST]
    unsure = max(member[first], member[second]) < CLEAR
    doubtful = real < max(shares.values())
    if unsure:  # what is sure of neither is no cause that has a name
        shares = shares | {UNKNOWN: shares[UNKNOWN] + real * (1.0 - member[first])}
        real *= member[first]
    # of the candidates one is listed as the cause: the first, or what could be it instead
    instead = {key: value for key, value in member.items() if key != second}
    total = sum(instead.values())
    probabilities = dict.fromkeys(effects, 0.0) | {k: real * v / total for k, v in instead.items()} | shares
    if doubtful or unsure:
        unclear = (first, second, *kept)[:MOST] if not doubtful else ()
        possible = sorted(effects, key=probabilities.__getitem__, reverse=True)
        rivals = tuple(key for key in possible if probabilities[key] >= SLIGHT)
        return Judged(probabilities, max(shares, key=shares.__getitem__), rivals, unclear=unclear)
    doubted = (UNKNOWN,) if shares[UNKNOWN] >= SLIGHT else ()
    if member[second] < CLEAR:
        return Judged(probabilities, first, doubted, unclear=(second, *kept)[:MOST])
    return Judged(probabilities, first, kept + doubted, second, real * min(member[second], 1.0))
