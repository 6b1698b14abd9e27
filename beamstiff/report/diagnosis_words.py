"""Names, shares and conditions that the texts, tables and pages of a diagnosis have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.decomposed import cause_candidate
from beamstiff.diagnosis.decomposition.folds import FOLDS
from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import counted
from beamstiff.report.tables import number
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.diagnosis.decomposition.causes import Cause


LEVER = 0.9  # share of the squares of nine levers that is a force's from another place; by chance a third
DIFFERS = "it differs much between the postures, as its interval shows"
FAR = 2.0  # times the largest realistic size, from which the verdict says that a size is unrealistic


def postures(result: Diagnosis) -> int:
    """Return how many postures were measured."""
    return len(np.unique(result.baseline.rows.q, axis=0))


def hardly_checked(result: Diagnosis) -> str:
    """Return, in words, why what the causes close is uncertain; empty where it is not.

    There are fewer postures than folds, or with a fold left out they have fewer readings than the open
    parameters and the causes have values; or the 90 % interval begins below half of the share.
    """
    close, found = result.verdict.shrink, result.decomposition
    if one_posture(result):
        return ""  # then no share is promised
    count = postures(result)
    few_postures = f"it was checked on {counted(count, 'posture')} only"
    if count < FOLDS:
        return few_postures
    if found is not None and found.causes:
        fitted = found.model.determined + sum(part.size for one in found.causes for part in one.theta)
        # a posture tells of the geometry once, however often it is loaded
        read = sum(
            int(found.model.used[found.model.baseline.rows.pose == pose].any(axis=0).sum())
            for pose in np.unique(found.model.baseline.rows.pose)
        )
        first = found.causes[0]
        if found.model.problem is not None and read * (FOLDS - 1) / FOLDS < fitted:
            return few_postures
        return DIFFERS if first.closes_interval[0] < 0.5 * first.closes else ""
    return DIFFERS if close is not None and close.interval[0] < 0.5 * close.shrink else ""


def stiffness_in_words(value: float) -> str:
    """Return a stiffness as it is read: a number, ``rigid`` or ``free``."""
    return "rigid" if value == np.inf else number(value)


def percent(share: float) -> str:
    """Return a share in whole percent, at most all."""
    return f"{round(100 * min(share, 1.0))} %"


def sure(result: Diagnosis) -> str:
    """Return how probable the verdict is, in percent: of a cause, that it is there."""
    also = second(result)
    return chance(probability(result)) + ("" if also is None else f" and {chance(also.probability)}")


def probability(result: Diagnosis) -> float:
    """Return how probable the verdict is: of a cause among several, that it is there."""
    found = result.decomposition
    return result.verdict.probability if found is None or not found.verdict else found.verdict.probability


def chance(probability: float) -> str:
    """Return a probability in percent; what is short of certain is never rounded to it.

    >>> chance(0.811), chance(0.9999), chance(0.0004), chance(0.0)
    ('81 %', 'over 99 %', 'under 1 %', '0 %')
    """
    if 0.0 < probability < 0.005:
        return "under 1 %"
    return "over 99 %" if probability > 0.995 else f"{100 * probability:.0f} %"


def oversized(one: Estimate) -> float:
    """Return how many times larger than the largest realistic size a parameter is; 0 where it is not."""
    return 0.0 if one.plausible else abs(one.value) / one.realistic[1]


def load_lever(one: Candidate) -> Array | None:
    """Return where the load acts from where the file says, (3,), m, tool axes; None where it is no lever.

    A cell that reads forces as moments has any nine levers; those of a misplaced force ``r x F`` are
    antisymmetric.
    """
    names = [f"moment_tool_{a}_by_{b}" for a in "xyz" for b in "xyz"]
    found = {item.name: item.value for item in one.estimates}
    if not set(names) <= set(found):
        return None
    lever = np.array([found[name] for name in names]).reshape(3, 3)
    turning = 0.5 * (lever - lever.T)
    if not (turning**2).sum() >= LEVER * (lever**2).sum() > 0.0:
        return None
    return np.array([turning[2, 1], turning[0, 2], turning[1, 0]])


def _whole(cause: Candidate, one: Estimate) -> float:
    """Return a parameter, or the sum of the terms that it is one of: ``half_width_0.005``, ``_0.03``."""
    stem, _, term = one.name.rpartition("_")
    if not term.replace(".", "", 1).isdigit():
        return one.value
    return sum(other.value for other in cause.estimates if other.name.rpartition("_")[0] == stem)


def unrealistic(result: Diagnosis) -> list[tuple[Candidate, Estimate]]:
    """Return the causes with a size far from realistic, or wrongly negative, each with the farthest."""
    found = []
    keys = {result.verdict.key, *(one.key for one in several(result))}
    if result.also is not None:
        keys.add(result.also.key)
    for cause in told(result):
        if cause.key in keys:
            worst = max(cause.estimates, key=oversized, default=None)
            negative = worst is not None and worst.positive and _whole(cause, worst) < 0.0
            if worst is not None and (oversized(worst) >= FAR or (negative and not worst.plausible)):
                found.append((cause, worst))
    return found


def percents(ends: Sequence[float]) -> str:
    """Return the ends of an interval in whole percent; one above all is no end.

    >>> percents((0.81, 1.02)), percents((0.631, 0.634)), percents((0.81, 0.93)), percents((0.0, 1.0))
    ('at least 81 %', '63 %', '81 to 93 %', '0 to 100 %')
    """
    low, high = (percent(end) for end in ends)
    if low == high:
        return high
    return f"at least {low}" if ends[1] >= 1.0 and ends[0] >= 0.005 else f"{low.removesuffix(' %')} to {high}"


def several(result: Diagnosis) -> tuple[Cause, ...]:
    """Return the causes of a gap that has more than one, or none that makes most of it; else none."""
    found = result.decomposition
    return () if found is None or (found.verdict and len(found.causes) == 1) else found.causes


def law_in_words(law: Cause) -> str:
    """Return what a law outside the library does, and of a base that opens on which side."""
    side = law.lifted_side
    if side is None:
        return law.looks_like
    return f"{law.looks_like}, and lifts most at {np.degrees(side):.0f} deg from the base frame's x axis"


def closed(found: Sequence[Cause]) -> str:
    """Return what several causes close together, in whole percent."""
    return percent(sum(one.closes for one in found))


def causes(result: Diagnosis) -> str:
    """Return the verdict, and the second cause that it closes with, in words."""
    also = second(result)
    return named(result.verdict) + ("" if also is None else f" and {named(also)}")


def second(result: Diagnosis) -> Candidate | None:
    """Return the second cause, fitted together with the first; wrong rows are none."""
    return None if result.also is None or result.also.effect == "outliers" else result.also


def one_posture(result: Diagnosis) -> bool:
    """Return whether all rows are of one posture, so that none can be held out."""
    return postures(result) < 2


def tested(result: Diagnosis) -> str:
    """Return, in words, what the gap is of."""
    return "in one posture" if one_posture(result) else "on held-out data"


def named(one: Candidate) -> str:
    """Return a candidate in words."""
    return in_words([one.key])


def told(result: Diagnosis) -> list[Candidate]:
    """Return the verdict, its look-alikes and the second cause; of several all; and what else is written."""
    laws = () if result.decomposition is None else result.decomposition.unmodelled
    outside = [cause_candidate(law) for law in laws if not law.nameless]
    if listed := several(result):
        return [*(cause_candidate(one) for one in listed), *outside]
    keys = {result.verdict.key, *result.indistinguishable}
    found = [one for one in result.candidates if one.key in keys]
    return [*found, *([result.also] if result.also is not None else []), *outside]
