"""Scores of answered cases, each counted as its docstring says.

A diagnosis that failed counts as wrong wherever it is asked: as a false alarm on a null, as a miss on an
effect, as a name given on an effect outside the library.
"""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from beamstiff.exam.names import FAILED, NONE, UNKNOWN, effect_of, family, is_named, place_of
from beamstiff.exam.rates import Figure, mean, median, rate
from beamstiff.exam.record import Kind, Record

Records = Sequence[Record]

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


# --- what a case is


def is_unknown(record: Record) -> bool:
    """Tell whether the verdict is ``unknown``."""
    return effect_of(record.answer.verdict) == UNKNOWN


def is_exact(record: Record) -> bool:
    """Tell whether effect and component are right and nothing else is named besides."""
    return record.named == (record.truth,)


def is_family(record: Record) -> bool:
    """Tell whether the effect named first is of the right family, whatever its component."""
    named = is_named(record.answer.verdict)
    return named and family(effect_of(record.answer.verdict)) == family(effect_of(record.truth))


def is_place(record: Record) -> bool:
    """Tell whether the component named first is the right one, whatever the effect."""
    return is_named(record.answer.verdict) and place_of(record.answer.verdict) == place_of(record.truth)


def is_covered(record: Record) -> bool:
    """Tell whether the verdict or one of its declared equivalents is the truth."""
    return record.truth in record.verdict_set


def is_flagged(record: Record) -> bool:
    """Tell whether the answer to an effect whose class was withheld warns of it.

    The verdict is ``unknown``, or it comes with declared equivalents: a set, not a single name. ``none`` is
    no warning.
    """
    return is_unknown(record) or (is_named(record.answer.verdict) and len(record.verdict_set) > 1)


def is_nameless(record: Record) -> bool:
    """Tell whether no effect was named: ``unknown`` or ``none``."""
    return effect_of(record.answer.verdict) in (NONE, UNKNOWN)


def is_right(record: Record) -> bool:
    """Tell whether the verdict is right, as calibration asks.

    It is the effect and component of a single, ``none`` of a null, ``unknown`` of an effect outside the
    library. Below 0.3 of the noise ``none`` is right of anything.
    """
    if record.gap < HARDLY and effect_of(record.answer.verdict) == NONE:
        return True
    return record.answer.verdict == record.truth


# --- rates over cases


def false_alarms(records: Records) -> Figure:
    """Return the share of nulls whose verdict is anything but ``none``; ``unknown`` is an alarm too."""
    return rate(effect_of(record.answer.verdict) != NONE for record in of_kind(records, "null"))


def detection(records: Records) -> Figure:
    """Return the share of cases that were said to have a gap: by a name, or ``unknown``."""
    return rate(is_named(record.answer.verdict) or is_unknown(record) for record in records)


def exact(records: Records) -> Figure:
    """Return the share of cases with the right effect and component, and nothing else named."""
    return rate(map(is_exact, records))


def right_family(records: Records) -> Figure:
    """Return the share of cases whose first named effect is of the right family."""
    return rate(map(is_family, records))


def right_place(records: Records) -> Figure:
    """Return the share of cases whose first named component is right."""
    return rate(map(is_place, records))


def coverage(records: Records) -> Figure:
    """Return the share of cases whose verdict set holds the truth; ``none`` and ``unknown`` alone do not."""
    return rate(map(is_covered, records))


def coverage_of_names(records: Records) -> Figure:
    """Return the same among the verdicts that name an effect."""
    return rate(is_covered(record) for record in records if is_named(record.answer.verdict))


def set_size(records: Records) -> Figure:
    """Return the mean number of members of the verdict set, among the verdicts that name an effect."""
    return mean(len(record.verdict_set) for record in records if is_named(record.answer.verdict))


def unknowns(records: Records) -> Figure:
    """Return the share of ``unknown``."""
    return rate(map(is_unknown, records))


def false_seconds(records: Records) -> Figure:
    """Return the share of cases whose verdict names more than one effect."""
    return rate(len(record.named) > 1 for record in records)


def not_named(records: Records) -> Figure:
    """Return the share of effects outside the library, gap at least the noise, that got no name."""
    return rate(map(is_nameless, between(of_kind(records, "outside"), CLEAR)))


def flagged(records: Records) -> Figure:
    """Return the share of effects withheld from the library, gap at least the noise, that were flagged."""
    return rate(map(is_flagged, between(of_kind(records, "removed"), CLEAR)))


def truly_flagged(records: Records) -> Figure:
    """Return the same, strictly: ``unknown``, or the withheld effect is in the set by name."""
    return rate(
        is_unknown(record)
        or effect_of(record.label.truths[0]) in {effect_of(key) for key in record.verdict_set}
        for record in between(of_kind(records, "removed"), CLEAR)
    )


def clear_pairs(records: Records) -> list[Record]:
    """Return the pairs of which each effect by itself leaves a gap of at least the noise."""
    return [
        record
        for record in of_kind(records, "pair")
        if record.gaps and all(gap >= CLEAR for gap in record.gaps)
    ]


def both(records: Records) -> Figure:
    """Return the share of clear pairs whose two effects are both named, each with its component."""
    return rate(set(record.label.truths) <= set(record.named) for record in clear_pairs(records))


def nothing_false(records: Records) -> Figure:
    """Return the share of clear pairs in which every effect named is at work; naming none is not false."""
    return rate(
        set(record.named) <= set(record.label.truths) and effect_of(record.answer.verdict) != FAILED
        for record in clear_pairs(records)
    )


def shrink_difference(records: Records) -> Figure:
    """Return the median of |promised - true shrink| over named singles whose gap is 1.5 of the noise or more.

    The true shrink is that on new poses and new loads without noise. Cases of which one of the two is missing
    (a verdict that names nothing, outliers, which new rows do not have) are left out.
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

    def badness(item: tuple[str, list[Record]]) -> tuple[float, float, str]:
        return (exact(item[1]).value or 0.0, right_family(item[1]).value or 0.0, item[0])

    return sorted(by_effect(clear_singles(records)).items(), key=badness)


def confusion(records: Records) -> dict[str, Counter[str]]:
    """Return how often each effect (rows, the truth) got each verdict, components left aside.

    Nulls stand under ``none``, effects outside the library under ``outside``, withheld ones under
    ``removed``; all but the nulls with a gap of at least the noise. Pairs are left out.
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


def shuffled(records: Records, seed: int = 0, times: int = 200) -> Figure:
    """Return the share of exact verdicts once the labels are dealt anew at random, over `times` deals.

    The interval holds 95 % of the deals.
    """
    truths = np.array([record.truth for record in records])
    verdicts = np.array([record.named[0] if len(record.named) == 1 else "" for record in records])
    if not truths.size:
        return Figure(None, None, None, 0)
    rng = np.random.default_rng(seed)
    rates = [float((rng.permutation(truths) == verdicts).mean()) for _ in range(times)]
    low, high = np.quantile(rates, [0.025, 0.975])
    return Figure(float(np.mean(rates)), float(low), float(high), truths.size)


def chance(records: Records) -> float | None:
    """Return the share of exact verdicts that labels dealt at random leave: sum of ``t_k v_k / n^2``."""
    n = len(records)
    truths = Counter(record.truth for record in records)
    verdicts = Counter(record.named[0] for record in records if len(record.named) == 1)
    return sum(count * verdicts[key] for key, count in truths.items()) / n**2 if n else None
