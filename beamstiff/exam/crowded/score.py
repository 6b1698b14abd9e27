"""Scores of crowded cases, each counted as its docstring says, of the diagnosis and of each control alike.

Who broke off has named nothing and has no `unknown`: that is wrong wherever something is asked.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np

from beamstiff.exam.crowded.record import EXAMINED, OF_GEOMETRY, SIMILAR, CrowdedLabel, CrowdedRecord, Reply
from beamstiff.exam.names import FAILED, NONE, UNKNOWN, effect_of
from beamstiff.exam.rates import Figure, mean, median, rate
from beamstiff.exam.table import Row, row_dict

Pairs = Sequence[tuple[CrowdedLabel, Reply]]
MAIN = 0.5  # share of the gap from which the largest cause is asked by name
WITHIN = 0.2  # of the true remainder, in which the said one has to lie
NINETY = 0.9


def pairs_of(records: Sequence[CrowdedRecord], who: str) -> list[tuple[CrowdedLabel, Reply]]:
    """Return the labels with what one of those who reply said of them."""
    return [(record.label, record.replies[who]) for record in records if who in record.replies]


def with_main(pairs: Pairs) -> Pairs:
    """Return the crowded cases whose largest cause closes at least half of the gap."""
    return [(a, b) for a, b in pairs if a.kind == "crowded" and a.causes[0].closes >= MAIN]


def is_main_exact(label: CrowdedLabel, reply: Reply) -> bool:
    """Tell whether the cause named first is the largest one, or one of all but the same size."""
    found = label.named_by(reply.named[0]) if reply.named else None
    return found is not None and found.closes >= SIMILAR * label.causes[0].closes


def main_exact(pairs: Pairs) -> Figure:
    """Return the share of crowded cases, largest cause half of the gap or more, where it is named first."""
    return rate(is_main_exact(label, reply) for label, reply in with_main(pairs))


def main_in_set(pairs: Pairs) -> Figure:
    """Return the share of the same whose largest cause is named first or is said to look like the first."""
    return rate(
        is_main_exact(label, reply) or label.causes[0].key in reply.alike for label, reply in with_main(pairs)
    )


def named_real(pairs: Pairs) -> Figure:
    """Return the share of the causes named, in all cases, that are at work, hidden ones included.

    Geometry is real where it is off: everywhere but in displacements and on clean machines.
    """
    return rate(label.is_real(key) for label, reply in pairs for key in reply.named)


def real_in_library(pairs: Pairs) -> Figure:
    """Return the same without the cases whose largest effect is outside: names that stand in for it."""
    return named_real([(label, reply) for label, reply in pairs if label.kind != "outside"])


def found(pairs: Pairs) -> Figure:
    """Return the share of the library's causes at work, each a tenth of the gap or more, that are named."""
    return rate(
        any(label.named_by(key) is cause for key in reply.named)
        for label, reply in pairs
        for cause in label.asked
    )


def nothing_named(pairs: Pairs, kind: Literal["clean", "geometry"]) -> Figure:
    """Return the share of clean, or geometry-only, cases where neither cause nor ``unknown`` is said.

    Where the geometry is off, its own names are no alarm.
    """
    mine = OF_GEOMETRY if kind == "geometry" else ()
    return rate(
        effect_of(reply.verdict) in (NONE, *mine) and all(effect_of(key) in mine for key in reply.named)
        for label, reply in pairs
        if label.kind == kind
    )


def called_unknown(pairs: Pairs) -> Figure:
    """Return the share of cases whose largest effect is outside the library that are called ``unknown``."""
    return rate(effect_of(reply.verdict) == UNKNOWN for label, reply in pairs if label.kind == "outside")


def false_main(pairs: Pairs) -> Figure:
    """Return the share of the same whose verdict is an effect that is not at work, or that broke off."""
    return rate(
        effect_of(reply.verdict) == FAILED
        or not (effect_of(reply.verdict) in (NONE, UNKNOWN) or label.is_real(reply.verdict))
        for label, reply in pairs
        if label.kind == "outside"
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


def closing(pairs: Pairs) -> Figure:
    """Return the median of the true closing on fresh poses, of all cases with a named cause."""
    return median(reply.closing for _, reply in pairs if reply.closing is not None)


def remainder_off(reply: Reply) -> float:
    """Return by which share the said remainder is off; 1 where none was said.

    The true one is what the named causes that are real leave, noise included; hidden causes may be part of it
    or not.
    """
    if reply.said_mm is None or reply.least_mm is None or reply.left_mm is None:
        return 1.0
    true = float(np.clip(reply.said_mm, reply.least_mm, reply.left_mm))
    return abs(reply.said_mm - true) / true


def remainder_right(pairs: Pairs) -> Figure:
    """Return the share of cases whose said remainder is within 20 % of the true one."""
    return rate(remainder_off(reply) <= WITHIN for _, reply in pairs)


def remainder_median(pairs: Pairs) -> Figure:
    """Return the median of the share by which the remainder is off."""
    return median(remainder_off(reply) for _, reply in pairs)


def broke_off(pairs: Pairs) -> Figure:
    """Return the share of cases in which it broke off."""
    return rate(effect_of(reply.verdict) == FAILED for _, reply in pairs)


Score = Callable[[Pairs], Figure]
# name, figure, what is required, which way is good, whether it is a share
FIGURES: tuple[tuple[str, Score, float | None, Literal["high", "low"], bool], ...] = (
    ("largest cause named first", main_exact, 0.85, "high", True),
    ("largest cause in the set", main_in_set, 0.95, "high", True),
    ("named causes that are real", named_real, 0.95, "high", True),
    ("the same, all effects in the library", real_in_library, None, "high", True),
    ("causes of a tenth or more that are named", found, None, "high", True),
    ("clean: nothing named", lambda pairs: nothing_named(pairs, "clean"), None, "high", True),
    ("geometry only: nothing named", lambda pairs: nothing_named(pairs, "geometry"), None, "high", True),
    ("largest outside the library: unknown", called_unknown, None, "high", True),
    ("largest outside the library: false verdict", false_main, None, "low", True),
    ("promised - true closing, median", promise_median, 0.05, "low", False),
    ("promised - true closing, 90 %", promise_ninety, 0.15, "low", False),
    ("true closing on fresh poses, median", closing, None, "high", False),
    ("remainder off by, median", remainder_median, WITHIN, "low", False),
    ("remainder within 20 %", remainder_right, None, "high", True),
    ("broke off", broke_off, None, "low", True),
    ("seconds a case", lambda pairs: mean(reply.seconds for _, reply in pairs), None, "low", False),
)


def names_of(records: Sequence[CrowdedRecord]) -> list[str]:
    """Return who replied, the examined diagnosis first."""
    return list(dict.fromkeys([EXAMINED, *(name for one in records for name in one.replies)]))


def figures(records: Sequence[CrowdedRecord]) -> Iterator[dict[str, Row]]:
    """Yield each figure by who replied; what is required is required of the examined diagnosis."""
    who = names_of(records)
    for name, score, required, better, share in FIGURES:
        yield {
            one: Row(
                name,
                score(pairs_of(records, one)),
                required if one == EXAMINED else None,
                better=better,
                share=share,
            )
            for one in who
        }


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
