"""Whether probabilities mean what they say: Brier score, reliability, expected calibration error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.names import FAILED, effect_of
from beamstiff.exam.rates import Figure, mean, rate
from beamstiff.exam.record import Record
from beamstiff.exam.score import is_right

BINS = 10


@dataclass(frozen=True)
class Bin:
    """Verdicts of about the same probability.

    `low`, `high`: probabilities from `low` to below `high`; the last bin holds 1 too.
    """

    low: float
    high: float
    said: float  # their mean probability
    right: Figure  # the share of them that is right


def judged(records: Sequence[Record]) -> list[Record]:
    """Return the cases whose probabilities are judged: all but pairs, which have two right answers."""
    return [r for r in records if r.label.kind != "pair" and effect_of(r.answer.verdict) != FAILED]


def reliability(records: Sequence[Record], bins: int = BINS) -> list[Bin]:
    """Return how many verdicts are right, in bins of equal width by their probability; empty ones left out.

    What is right is said in `score.is_right`.
    """
    cases = judged(records)
    said = np.array([record.answer.probability for record in cases])
    at = np.clip((said * bins).astype(int), 0, bins - 1)
    return [
        Bin(
            low=k / bins,
            high=(k + 1) / bins,
            said=float(said[at == k].mean()),
            right=rate(is_right(record) for record, b in zip(cases, at, strict=True) if b == k),
        )
        for k in range(bins)
        if (at == k).any()
    ]


def calibration_error(records: Sequence[Record], bins: int = BINS) -> Figure:
    """Return the expected calibration error: |share right - mean probability| by bin, its mean over verdicts.

    Naeini, Cooper, Hauskrecht (2015), "Obtaining well calibrated probabilities using Bayesian binning"; of
    the verdict's probability, with ten bins of equal width.
    """
    filled = reliability(records, bins)
    count = sum(item.right.count for item in filled)
    if not count:
        return Figure(None, None, None, 0)
    error = sum(item.right.count * abs((item.right.value or 0.0) - item.said) for item in filled) / count
    return Figure(error, None, None, count)


def brier(records: Sequence[Record]) -> Figure:
    """Return the Brier score, the mean over cases of ``sum_k (p_k - y_k)^2`` over all candidates: 0 to 2.

    y is 1 at what is right, as `score.is_right` has it, and 0 elsewhere. Probabilities below 1e-6, which the
    records leave out, count as 0.
    """
    return mean(map(_brier, judged(records)))


def _brier(record: Record) -> float:
    truth = record.answer.verdict if is_right(record) else record.truth
    probabilities = dict(record.answer.probabilities or {})
    right = probabilities.pop(truth, 0.0)
    return (1.0 - right) ** 2 + sum(p * p for p in probabilities.values())
