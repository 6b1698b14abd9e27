"""Scores of answered cases, each counted as its docstring says.

A diagnosis that failed counts as wrong wherever it is asked: as a false alarm on a null, as a miss on an
effect, as a name given on an effect outside the library.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.names import FAILED, NONE, UNKNOWN, effect_of, family, is_named, place_of
from beamstiff.exam.rates import Figure, mean, median, rate
from beamstiff.exam.record import Kind, Record

Records = Sequence[Record]
Score = Callable[[Records], Figure]

CLEAR = 1.0  # gap over noise from which a cause has to be named
PROMISING = 1.5  # and from which promises are compared
HARDLY = 0.3  # below this, `none` is a right answer too
BANDS = ((0.0, HARDLY), (HARDLY, 1.0), (1.0, 3.0), (3.0, np.inf))


def of_kind(records: Records, *kinds: Kind) -> list[Record]:
    """Return the cases of some kinds."""
    return [record for record in records if record.label.kind in kinds]


def between(records: Records, low: float, high: float = np.inf) -> list[Record]:
    """Return the cases whose gap over noise is at least `low` and less than `high`."""
    return [record for record in records if low <= record.gap < high]


def clear_singles(records: Records) -> list[Record]:
    """Return the cases of one effect in the library whose gap is at least the noise: the headline's."""
    return between(of_kind(records, "single"), CLEAR)


def clear_pairs(records: Records) -> list[Record]:
    """Return the pairs of which each effect by itself leaves a gap of at least the noise."""
    return [r for r in of_kind(records, "pair") if r.gaps and all(gap >= CLEAR for gap in r.gaps)]


# --- what a case is


def is_unknown(record: Record) -> bool:
    """Tell whether the verdict is ``unknown``."""
    return effect_of(record.answer.verdict) == UNKNOWN


def is_exact(record: Record) -> bool:
    """Tell whether effect and component are right and nothing else is named besides."""
    return record.named == (record.truth,)


def is_family(record: Record) -> bool:
    """Tell whether the effect named first is of the right family, whatever its component."""
    named, truth = effect_of(record.answer.verdict), effect_of(record.truth)
    return is_named(record.answer.verdict) and family(named) == family(truth)


def is_place(record: Record) -> bool:
    """Tell whether the component named first is the right one, whatever the effect."""
    return is_named(record.answer.verdict) and place_of(record.answer.verdict) == place_of(record.truth)


def is_covered(record: Record) -> bool:
    """Tell whether the verdict or one of its declared equivalents is the truth."""
    return record.truth in record.verdict_set


def is_flagged(record: Record) -> bool:
    """Tell whether the answer to a withheld effect warns: ``unknown``, or a name with equivalents."""
    return is_unknown(record) or (is_named(record.answer.verdict) and len(record.verdict_set) > 1)


def is_nameless(record: Record) -> bool:
    """Tell whether no effect was named: ``unknown`` or ``none``."""
    return effect_of(record.answer.verdict) in (NONE, UNKNOWN)


def is_right(record: Record) -> bool:
    """Tell whether the verdict is right, for calibration: the truth; below 0.3 of the noise ``none``, too."""
    if record.gap < HARDLY and effect_of(record.answer.verdict) == NONE:
        return True
    return record.answer.verdict == record.truth


# --- rates over cases


def _rate(hit: Callable[[Record], bool], among: Callable[[Records], Records] = list) -> Score:
    """Return the score that is the share of hits among some of the cases."""
    return lambda records: rate(map(hit, among(records)))


def _named(records: Records) -> Records:
    return [record for record in records if is_named(record.answer.verdict)]


def _clear(kind: Kind) -> Callable[[Records], Records]:
    return lambda records: between(of_kind(records, kind), CLEAR)


# nulls whose verdict is anything but ``none``; ``unknown`` is an alarm too
false_alarms = _rate(
    lambda record: effect_of(record.answer.verdict) != NONE, lambda records: of_kind(records, "null")
)
# cases that were said to have a gap: by a name, or ``unknown``
detection = _rate(lambda record: is_named(record.answer.verdict) or is_unknown(record))
exact = _rate(is_exact)
right_family = _rate(is_family)
right_place = _rate(is_place)
coverage = _rate(is_covered)  # ``none`` and ``unknown`` alone do not hold the truth
coverage_of_names = _rate(is_covered, _named)  # the same among the verdicts that name an effect
unknowns = _rate(is_unknown)
false_seconds = _rate(lambda record: len(record.named) > 1)
# of effects outside the library, and of those withheld from it; gap at least the noise
not_named = _rate(is_nameless, _clear("outside"))
flagged = _rate(is_flagged, _clear("removed"))
# strictly: ``unknown``, or the withheld effect is in the set by name
truly_flagged = _rate(
    lambda record: (
        is_unknown(record) or effect_of(record.label.truths[0]) in map(effect_of, record.verdict_set)
    ),
    _clear("removed"),
)
# of clear pairs: both named, each with its component; no effect named that is not at work: none is not false
both = _rate(lambda record: set(record.label.truths) <= set(record.named), clear_pairs)
nothing_false = _rate(
    lambda record: (
        set(record.named) <= set(record.label.truths) and effect_of(record.answer.verdict) != FAILED
    ),
    clear_pairs,
)


def set_size(records: Records) -> Figure:
    """Return the mean number of members of the verdict set, among the verdicts that name an effect."""
    return mean(len(record.verdict_set) for record in _named(records))


def shrink_difference(records: Records) -> Figure:
    """Return the median of |promised - true shrink| over named singles whose gap is 1.5 of the noise or more.

    Cases of which one of the two is missing are left out.
    """
    return median(
        abs(record.answer.promised - record.shrink)
        for record in between(of_kind(records, "single"), PROMISING)
        if record.answer.promised is not None and record.shrink is not None
    )


# --- tables of cases


def by_effect(records: Iterable[Record]) -> dict[str, list[Record]]:
    """Return singles by the effect that is true, in the order in which they come."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(effect_of(record.truth), []).append(record)
    return groups


def worst_first(records: Records) -> list[tuple[str, list[Record]]]:
    """Return the clear singles by effect: fewest exact first, of equals the fewest in the family."""
    return sorted(
        by_effect(clear_singles(records)).items(),
        key=lambda item: (exact(item[1]).value or 0.0, right_family(item[1]).value or 0.0, item[0]),
    )


def confusion(records: Records) -> dict[str, Counter[str]]:
    """Return how often each effect (rows, the truth) got each verdict; clear cases, and all nulls.

    Effects outside the library stand under ``outside``, withheld ones under ``removed``; no pairs.
    """
    rows: dict[str, Counter[str]] = {}
    for record in records:
        kind = record.label.kind
        if kind == "pair" or (kind != "null" and not record.gap >= CLEAR):
            continue
        row = effect_of(record.truth) if kind in ("null", "single") else kind
        rows.setdefault(row, Counter())[effect_of(record.answer.verdict)] += 1
    return rows


# --- controls


def control_exact(records: Records, name: str) -> Figure:
    """Return the share of cases that a plain control, by its name, gets exactly right."""
    return rate(record.controls[name] == record.truth for record in records if name in record.controls)


def shuffled(records: Records) -> Figure:
    """Return the share of exact verdicts with the labels dealt anew 200 times, and 95 % of the deals."""
    truths = np.array([record.truth for record in records])
    verdicts = np.array([record.named[0] if len(record.named) == 1 else "" for record in records])
    if not truths.size:
        return Figure(None, None, None, 0)
    rng = np.random.default_rng(0)
    rates = [float((rng.permutation(truths) == verdicts).mean()) for _ in range(200)]
    low, high = np.quantile(rates, [0.025, 0.975])
    return Figure(float(np.mean(rates)), float(low), float(high), truths.size)


def chance(records: Records) -> float | None:
    """Return the share of exact verdicts that labels dealt at random leave: sum of ``t_k v_k / n^2``."""
    n = len(records)
    truths = Counter(record.truth for record in records)
    verdicts = Counter(record.named[0] for record in records if len(record.named) == 1)
    return sum(count * verdicts[key] for key, count in truths.items()) / n**2 if n else None


BINS = 10


@dataclass(frozen=True)
class Bin:
    """Verdicts of about the same probability, from `low` to below `high`; the last bin holds 1 too."""

    low: float
    high: float
    said: float  # their mean probability
    right: Figure  # the share of them that is right


def judged(records: Sequence[Record]) -> list[Record]:
    """Return the cases whose probabilities are judged: all but pairs, which have two right answers."""
    return [r for r in records if r.label.kind != "pair" and effect_of(r.answer.verdict) != FAILED]


def reliability(records: Records) -> list[Bin]:
    """Return how many verdicts are right, in filled bins of equal width by their probability."""
    cases = judged(records)
    said = np.array([record.answer.probability for record in cases])
    at = np.clip((said * BINS).astype(int), 0, BINS - 1)
    return [
        Bin(
            low=k / BINS,
            high=(k + 1) / BINS,
            said=float(said[at == k].mean()),
            right=rate(is_right(record) for record, b in zip(cases, at, strict=True) if b == k),
        )
        for k in range(BINS)
        if (at == k).any()
    ]


def calibration_error(records: Records) -> Figure:
    """Return the expected calibration error: mean over verdicts of |share right - mean probability| by bin.

    Naeini, Cooper, Hauskrecht (2015), "Obtaining well calibrated probabilities using Bayesian binning".
    """
    filled = reliability(records)
    count = sum(item.right.count for item in filled)
    if not count:
        return Figure(None, None, None, 0)
    error = sum(item.right.count * abs((item.right.value or 0.0) - item.said) for item in filled) / count
    return Figure(error, None, None, count)


def brier(records: Sequence[Record]) -> Figure:
    """Return the Brier score, the mean over cases of ``sum_k (p_k - y_k)^2`` over all candidates: 0 to 2.

    y is 1 at what is right, as `is_right` has it. Probabilities that the records leave out count as 0.
    """
    return mean(map(_brier, judged(records)))


def _brier(record: Record) -> float:
    truth = record.answer.verdict if is_right(record) else record.truth
    probabilities = dict(record.answer.probabilities or {})
    right = probabilities.pop(truth, 0.0)
    return (1.0 - right) ** 2 + sum(p * p for p in probabilities.values())
