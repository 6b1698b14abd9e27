"""Scores of crowded cases, each counted as its docstring says, of the diagnosis and of each control alike.

Who broke off has named nothing and has no `unknown`: that is wrong wherever something is asked.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np

from beamstiff.exam.crowded.record import EXAMINED, OF_GEOMETRY, CrowdedLabel, CrowdedRecord, Kind, Reply
from beamstiff.exam.names import FAILED, NONE, UNKNOWN, effect_of
from beamstiff.exam.rates import Figure, mean, median, rate
from beamstiff.exam.table import Row, row_dict

Pairs = Sequence[tuple[CrowdedLabel, Reply]]
Score = Callable[[Pairs], Figure]
MAIN = 0.5  # share of the gap from which the largest cause is asked by name
SIMILAR = 0.8  # of the largest share, from which either may come first
WITHIN = 0.2  # of the true remainder, in which the said one has to lie
NINETY = 0.9


def pairs_of(records: Sequence[CrowdedRecord], who: str) -> list[tuple[CrowdedLabel, Reply]]:
    """Return the labels with what one of those who reply said of them."""
    return [(record.label, record.replies[who]) for record in records if who in record.replies]


def has_main(label: CrowdedLabel) -> bool:
    """Tell whether a case is crowded and its largest cause closes at least half of the gap."""
    return label.kind == "crowded" and label.causes[0].closes >= MAIN


def with_main(pairs: Pairs) -> Pairs:
    """Return the cases with such a cause."""
    return [pair for pair in pairs if has_main(pair[0])]


def is_main_exact(label: CrowdedLabel, reply: Reply) -> bool:
    """Tell whether the cause named first is the largest one, or one of all but the same size."""
    found = label.named_by(reply.named[0]) if reply.named else None
    return found is not None and found.closes >= SIMILAR * label.causes[0].closes


def remainder_off(reply: Reply) -> float:
    """Return by which share the said remainder is off, hidden causes part of it or not; 1: none was said."""
    if reply.said_mm is None or reply.least_mm is None or reply.left_mm is None:
        return 1.0
    true = float(np.clip(reply.said_mm, reply.least_mm, reply.left_mm))
    return abs(reply.said_mm - true) / true


def _is_false(label: CrowdedLabel, reply: Reply) -> bool:
    """Tell whether the verdict is an effect that is not at work, or broke off."""
    effect = effect_of(reply.verdict)
    return effect == FAILED or not (effect in (NONE, UNKNOWN) or label.is_real(reply.verdict))


def _rate(
    hit: Callable[[CrowdedLabel, Reply], bool], among: Callable[[CrowdedLabel], bool] = lambda _: True
) -> Score:
    """Return the score that is the share of hits among some of the cases."""
    return lambda pairs: rate(hit(label, reply) for label, reply in pairs if among(label))


def _of_kind(kind: Kind) -> Callable[[CrowdedLabel], bool]:
    return lambda label: label.kind == kind


def nothing_named(pairs: Pairs, kind: Literal["clean", "geometry"]) -> Figure:
    """Return the share of cases where neither cause nor ``unknown`` is said, but the geometry that is off."""
    mine = OF_GEOMETRY if kind == "geometry" else ()
    return rate(
        effect_of(reply.verdict) in (NONE, *mine) and all(effect_of(key) in mine for key in reply.named)
        for label, reply in pairs
        if label.kind == kind
    )


def named_real(pairs: Pairs) -> Figure:
    """Return the share of the causes named that are at work; hidden ones and geometry that is off are."""
    return rate(label.is_real(key) for label, reply in pairs for key in reply.named)


def found(pairs: Pairs) -> Figure:
    """Return the share of the library's causes at work, each a tenth of the gap or more, that are named."""
    return rate(
        any(label.named_by(key) is cause for key in reply.named)
        for label, reply in pairs
        for cause in label.asked
    )


def _promise_off(pairs: Pairs) -> list[float]:
    return [abs(reply.promised - reply.closing) for _, reply in pairs if reply.closing is not None]


def promise_median(pairs: Pairs) -> Figure:
    """Return the median of |promised - true closing on fresh poses|, of all cases with a named cause."""
    return median(_promise_off(pairs))


def promise_ninety(pairs: Pairs) -> Figure:
    """Return what 90 % of these differences do not exceed."""
    off = _promise_off(pairs)
    return Figure(float(np.quantile(off, NINETY)) if off else None, None, None, len(off))


main_exact = _rate(is_main_exact, has_main)
main_in_set = _rate(
    lambda label, reply: is_main_exact(label, reply) or label.causes[0].key in reply.alike, has_main
)
called_unknown = _rate(lambda _, reply: effect_of(reply.verdict) == UNKNOWN, _of_kind("outside"))
false_main = _rate(_is_false, _of_kind("outside"))
broke_off = _rate(lambda _, reply: effect_of(reply.verdict) == FAILED)
remainder_right = _rate(lambda _, reply: remainder_off(reply) <= WITHIN)
# name, figure, what is required, which way is good, whether it is a share
FIGURES: tuple[tuple[str, Score, float | None, Literal["high", "low"], bool], ...] = (
    ("largest cause named first", main_exact, 0.85, "high", True),
    ("largest cause in the set", main_in_set, 0.95, "high", True),
    ("named causes that are real", named_real, 0.95, "high", True),
    # names that stand in for an effect outside are not counted
    ("the same, all effects in the library",
     lambda pairs: named_real([pair for pair in pairs if pair[0].kind != "outside"]), None, "high", True),
    ("causes of a tenth or more that are named", found, None, "high", True),
    ("clean: nothing named", lambda pairs: nothing_named(pairs, "clean"), None, "high", True),
    ("geometry only: nothing named", lambda pairs: nothing_named(pairs, "geometry"), None, "high", True),
    ("largest outside the library: unknown", called_unknown, None, "high", True),
    ("largest outside the library: false verdict", false_main, None, "low", True),
    ("promised - true closing, median", promise_median, 0.05, "low", False),
    ("promised - true closing, 90 %", promise_ninety, 0.15, "low", False),
    ("true closing on fresh poses, median",
     lambda pairs: median(r.closing for _, r in pairs if r.closing is not None), None, "high", False),
    ("remainder off by, median",
     lambda pairs: median(remainder_off(reply) for _, reply in pairs), WITHIN, "low", False),
    ("remainder within 20 %", remainder_right, None, "high", True),
    ("broke off", broke_off, None, "low", True),
    ("seconds a case", lambda pairs: mean(reply.seconds for _, reply in pairs), None, "low", False),
)  # fmt: skip


def names_of(records: Sequence[CrowdedRecord]) -> list[str]:
    """Return who replied, the examined diagnosis first."""
    return list(dict.fromkeys([EXAMINED, *(name for one in records for name in one.replies)]))


def figures(records: Sequence[CrowdedRecord]) -> Iterator[dict[str, Row]]:
    """Yield each figure by who replied; what is required is required of the examined diagnosis."""
    who = names_of(records)
    for name, score, required, better, share in FIGURES:
        reached = {one: score(pairs_of(records, one)) for one in who}
        asked = {EXAMINED: required}
        yield {one: Row(name, reached[one], asked.get(one), None, better, share) for one in who}


def crowded_dict(records: Sequence[CrowdedRecord]) -> dict[str, object]:
    """Return all figures as plain data, for JSON."""
    kinds = [record.label.kind for record in records]
    return {
        "cases": len(records),
        "kinds": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        "figures": {
            group: {
                next(iter(row.values())).name: {who: row_dict(one) for who, one in row.items()}
                for row in figures(some)
            }
            for group, some in by_data(records).items()
        },
    }


def by_data(records: Sequence[CrowdedRecord]) -> dict[str, list[CrowdedRecord]]:
    """Return all records, and those of absolute positions and of displacements."""
    groups = {"all": list(records)}
    for record in records:
        groups.setdefault(record.label.data, []).append(record)
    return groups
