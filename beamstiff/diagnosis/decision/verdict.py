"""From evidence to a verdict: honest probabilities, what is indistinguishable, a second cause.

Evidence takes its shapes for true, and no real drive or link has exactly the shape of a library: a truth
that is off by a share of its own size shifts log odds by an amount that grows with the evidence itself. Log
odds between effects are therefore divided by ``1 + E / TEMPERING``, E the log odds of the best against the
unknown, and more where values are few; those between pairs, which are free enough to show by what they leave
how far off they are, by ``1 + sqrt(E residual_fraction)``. The residual that a cause leaves to the
unknown, the fraction it explains on held-out postures, and how far the subspaces of the components explain
more than it does, decide between it and `unknown`.

The constants are those of simulated campaigns (`beamstiff exam`) on seeds of their own, which are not
reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.decision.tempering import divisor_of, tempered
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.component_subspaces import OF_POSTURES
from beamstiff.diagnosis.inference.evidence import logsumexp
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, OUTLIERS, UNKNOWN, Search

# log odds that a cause is real: of its share left to the unknown, of the share of its evidence that free laws
# of the places have, and of its worth on held-out postures
REAL, LEFT, FREE, WORTH = 2.2, 1.25, 6.8, 2.6
BEHIND = 20.0  # log odds that are added to both evidences
APART = 0.7  # share below which free laws do not speak for a cause any more
FEW = 60  # values less fitted ones, below which nothing can be called unknown
SCARCE, OPEN = 30, -0.7  # and below which the unknown keeps at least these log odds: nothing is sure
LEAST_LOG_ODDS_NONE, PER_ODDS = 0.2, 10.0  # log odds of none that so few values allow: one for so many more
FAINT, BARE = 15.0, 0.3  # log odds against none below which a cause has to be worth this share as well
CAUTION = 2.0  # log odds that any effect needs before it is as likely as none
CHANCE = 0.01  # share of simulated campaigns without an effect that look as if they had one
SURE = 0.92  # probability of the verdict with what cannot be told from it
SLIGHT = 0.1  # share of the verdict's own from which a cause cannot be told from it
BY_FAR = 5.0  # log odds, by which what is another in every posture has to be better than a cause
BESIDE = 0.05  # probability from which a cause may be one of two instead of those that are named
DOUBTED = 0.06  # probability of the unknown from which a set holds it
SECOND = 8.0  # log odds of a second cause
STILL_OPEN = 1.03  # of the noise, which the first must leave on held-out postures for a second to close
SECOND_WORTH = 0.75  # share of that which both must close
SECOND_LEFT = 0.33  # share of the gap that both leave to the unknown
LITTLE = 0.1  # share that leaves nothing to it
INSTEAD = 25.0  # log odds of two causes instead of the likeliest by itself, where they leave nothing
EVIDENT, KNOWN = 50.0, 0.9  # log odds and worth of a second cause that leaves nothing, of what is known
HALVED = 0.5  # share of what the first leaves of that, which both may leave
CLEAR = 0.72  # probability that a second cause needs among those that could be it
FIRST_CLEAR = 0.85  # and the first of two, to be named alone
DISTINCT, SEVERAL = 1.3, 3  # outliers: strength to be named, and number beside a cause
GROSS = 10.0  # strength from which fewer are named beside it
SEEN = 0.9  # probability of outliers beside a cause
MOST = 5  # effects in a set, beyond which the data tell nothing apart


@dataclass(frozen=True)
class Judged:
    """A verdict.

    Attributes
    ----------
    probabilities : dict of str to float
        Of all candidates; their sum is 1.
    verdict : str
    indistinguishable : tuple of str
    also : str or None
    also_probability : float
    unclear : tuple of str
        What a second cause could be, where there is one and it is not clear which; of a verdict that is
        unknown, what two causes could be.
    """

    probabilities: dict[str, float]
    verdict: str
    indistinguishable: tuple[str, ...]
    also: str | None = None
    also_probability: float = 0.0
    unclear: tuple[str, ...] = ()


def doubt(residual_fraction: float, free: float, explained_fraction: float) -> float:
    """Return the log odds of the unknown against a cause.

    Parameters
    ----------
    residual_fraction : float
        Share of the gap's size that it leaves to the unknown.
    free : float
        Share of its evidence that the best free law of a place has.
    explained_fraction : float
        The share of the gap that it closes on held-out postures.
    """
    left = min(residual_fraction, 1.0)  # of a gap that is rounding it can be anything
    return LEFT * float(np.log(left + 0.01)) + FREE * free - WORTH * explained_fraction - REAL


def share_of_subspaces(search: Search, log_weight: float) -> float:
    """Return the share of a cause's evidence that the best free law of a place has."""
    nothing = search.log_weight[NONE]
    free = max(search.free.values(), default=-np.inf) - nothing + BEHIND
    return float(np.clip(free / (max(log_weight - nothing, 0.0) + BEHIND), APART, 2.0))


def odds_of_unmodelled(search: Search, log_weight: float) -> float:
    """Return the log odds that some place follows a law outside the library, against a cause.

    Divided as those between causes are. Play of the structure looks like a soft place that stiffens, a drive
    that creeps like one with friction, and each is another repair. What is another in every posture holds
    every law that follows the posture, and so counts only where it is the better one by far.
    """
    unmodelled = max(
        (
            weight
            for (_, does), weight in search.unmodelled.items()
            if does not in OF_POSTURES or weight > log_weight + BY_FAR
        ),
        default=-np.inf,
    )
    evidence = log_weight - search.log_weight[NONE]
    return float((unmodelled - log_weight) / divisor_of(evidence))


def accepted(
    pair: Pair | None,
    search: Search,
    single: HeldOutError,
    both: HeldOutError | None,
    by_load: tuple[HeldOutError, HeldOutError] | None = None,
) -> bool:
    """Return whether there are two causes.

    Beside the likeliest a second one has evidence, and closes what the first leaves on unseen postures. Where
    each posture has something to itself it closes what is known of them, or what the first leaves of unseen
    loads there. Two others instead of it, a flexible one that stood in for both, leave nothing and are worth
    no less.
    """
    if pair is None or both is None:
        return False
    best = search.named[0]
    ahead = pair.log_weight - search.log_weight[best]
    whole = pair.residual_fraction <= LITTLE and both.misfit <= single.misfit
    if whole and ahead >= INSTEAD and best not in (pair.first, pair.second):
        return True
    if single.misfit < STILL_OPEN or pair.residual_fraction > SECOND_LEFT or ahead < SECOND:
        return False
    known = both.explained_fraction >= KNOWN and 1.0 - both.explained_fraction <= HALVED * (
        1.0 - single.explained_fraction
    )
    if whole and ahead >= EVIDENT and known:
        return True
    of_loads = (
        by_load is not None and pair.residual_fraction <= LITTLE and ahead >= EVIDENT and _closes(*by_load)
    )
    return of_loads or _closes(single, both)


def _closes(single: HeldOutError, both: HeldOutError) -> bool:
    """Return whether a second cause closes most of what the first leaves."""
    return both.misfit**2 - 1.0 <= (1.0 - SECOND_WORTH) * (single.misfit**2 - 1.0)


def judge(
    search: Search,
    freedom: int,
    chance: float,
    outliers: tuple[int, float, bool],
    single: HeldOutError,
    both: HeldOutError | None,
    may_be_outliers: bool = True,
    by_load: tuple[HeldOutError, HeldOutError] | None = None,
) -> Judged:
    """Return the verdict.

    Parameters
    ----------
    search : Search
    freedom : int
        Values less fitted parameters.
    chance : float
        Share of simulated campaigns without an effect that look as much as if they had one.
    outliers : (int, float, bool)
        How many rows were left out that nothing explains, their strength, and whether they are isolated
        (`Screened`).
    single, both : HeldOutError
        Held-out worth of the best cause, and of the best pair.
    may_be_outliers : bool
        Whether rows that nothing explains may be called wrong; else they are what is unknown.
    by_load : (HeldOutError, HeldOutError), optional
        The worth of both on held-out loads, where the pair has something to itself in each posture.
    """
    named = search.named
    odd_rows = outliers[0] > 0 and outliers[1] >= DISTINCT
    nothing = OUTLIERS if odd_rows and may_be_outliers else NONE
    best = named[0]
    evidence = search.log_weight[best] - search.log_weight[UNKNOWN]
    effects = tempered({key: search.log_weight[key] for key in named}, divisor_of(evidence, freedom))
    total = float(logsumexp(np.array([search.log_weight[key] for key in named])))
    log_odds_none = search.log_weight[NONE] - total  # log odds of nothing against any effect
    evidence_of_any = -log_odds_none
    log_odds_none += CAUTION
    if evidence_of_any < FAINT:
        log_odds_none += 3.0 * max(0.0, 1.0 - single.explained_fraction / BARE)
    if chance > CHANCE:
        log_odds_none = max(log_odds_none, np.log(chance / CHANCE))
    pair = search.pairs[0] if search.pairs else None
    two = accepted(pair, search, single, both, by_load)
    left, explained_fraction, weight = (
        search.residual_fraction[best],
        single.explained_fraction,
        search.log_weight[best],
    )
    if two and pair is not None and both is not None:
        explained_fraction = (
            max(both.explained_fraction, by_load[1].explained_fraction)
            if by_load is not None
            else both.explained_fraction
        )
        left, weight = pair.residual_fraction, pair.log_weight
    log_odds_unknown = doubt(left, share_of_subspaces(search, weight), explained_fraction)
    log_odds_unknown = float(np.logaddexp(log_odds_unknown, odds_of_unmodelled(search, weight)))
    if freedom < FEW:
        log_odds_unknown = min(log_odds_unknown, search.log_weight[UNKNOWN] - total, -1.0)
    if freedom < SCARCE:  # nothing may show because nothing could
        log_odds_unknown, log_odds_none = (
            max(log_odds_unknown, OPEN),
            min(log_odds_none, LEAST_LOG_ODDS_NONE + freedom / PER_ODDS),
        )
    logs = {
        NONE: -np.inf,
        nothing: log_odds_none,
        UNKNOWN: min(
            log_odds_unknown, log_odds_unknown - log_odds_none if log_odds_none > 0 else log_odds_unknown
        ),
    }
    if odd_rows and not may_be_outliers:
        logs = {NONE: -np.inf, UNKNOWN: float(np.logaddexp(logs[UNKNOWN], log_odds_none))}
    whole = logsumexp(np.array([0.0, *logs.values()]))
    shares = {key: float(np.exp(value - whole)) for key, value in logs.items()}
    real = float(np.exp(-whole))
    if two and pair is not None:
        return _two(search, pair, effects, shares, real)
    probabilities = {key: real * share for key, share in effects.items()} | shares
    if real >= max(shares.values()):
        verdict = max(effects, key=effects.__getitem__)
        wrong = odd_rows and (outliers[0] >= SEVERAL or outliers[1] >= GROSS) and outliers[2]
        also = (OUTLIERS, SEEN) if wrong and may_be_outliers else (None, 0.0)
        doubted = (UNKNOWN,) if shares[UNKNOWN] >= DOUBTED or (wrong and not may_be_outliers) else ()
        return Judged(probabilities, verdict, _set(effects, verdict) + doubted, *also)
    rivals = tuple(key for key in named if probabilities[key] >= DOUBTED)
    return Judged(probabilities, max(shares, key=shares.__getitem__), rivals)


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


def _two(
    search: Search, pair: Pair, effects: Mapping[str, float], shares: dict[str, float], real: float
) -> Judged:
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
    kept = tuple(key for key in others if member[key] > BESIDE)[:MOST]
    unsure = member[second] < CLEAR and member[first] < FIRST_CLEAR
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
        rivals = tuple(key for key in possible if probabilities[key] >= DOUBTED)
        return Judged(probabilities, max(shares, key=shares.__getitem__), rivals, unclear=unclear)
    doubted = (UNKNOWN,) if shares[UNKNOWN] >= DOUBTED else ()
    if member[second] < CLEAR:
        return Judged(probabilities, first, doubted, unclear=(second, *kept)[:MOST])
    return Judged(probabilities, first, kept + doubted, second, real * min(member[second], 1.0))
