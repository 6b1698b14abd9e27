"""Rates and medians with the uncertainty that the number of cases leaves."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt

import numpy as np

NINETY_FIVE = 1.959963984540054  # two-sided 95 % point of the normal distribution


@dataclass(frozen=True)
class Figure:
    """A figure of the exam: its value, a 95 % interval, none where there is none, and its number of cases."""

    value: float | None
    low: float | None
    high: float | None
    count: int


def rate(hits: Iterable[bool]) -> Figure:
    """Return the share of hits with Wilson's interval.

    Wilson (1927): ``(p + z^2/2n +- z sqrt(p(1-p)/n + z^2/4n^2)) / (1 + z^2/n)``, which stays within [0, 1]
    and keeps its coverage near 0 and 1.

    >>> figure = rate([True] * 9 + [False])
    >>> figure.value, round(figure.low, 4), round(figure.high, 4), figure.count
    (0.9, 0.5958, 0.9821, 10)
    """
    found = [bool(hit) for hit in hits]
    n = len(found)
    if not n:
        return Figure(None, None, None, 0)
    p, z2 = sum(found) / n, NINETY_FIVE**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = NINETY_FIVE * sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    return Figure(p, max(0.0, middle - half), min(1.0, middle + half), n)


def mean(values: Iterable[float]) -> Figure:
    """Return the mean, and 1.96 standard errors to either side.

    >>> mean([1, 1, 2, 4])
    Figure(value=2.0, low=0.6, high=3.4, count=4)
    """
    found = np.array(list(values), dtype=np.float64)
    if not found.size:
        return Figure(None, None, None, 0)
    value = float(found.mean())
    if found.size == 1:
        return Figure(value, None, None, 1)
    half = NINETY_FIVE * float(found.std(ddof=1)) / sqrt(found.size)
    return Figure(value, value - half, value + half, found.size)


def median(values: Iterable[float]) -> Figure:
    """Return the median; the interval is between the order statistics at ``(n -+ 1.96 sqrt(n)) / 2``.

    >>> median([0.3, 0.1, 0.2]).value
    0.2
    """
    found = np.sort(np.array(list(values), dtype=np.float64))
    n = found.size
    if not n:
        return Figure(None, None, None, 0)
    half = NINETY_FIVE * sqrt(n) / 2
    at = int(np.floor(n / 2 - half)), int(np.ceil(n / 2 + half))
    inside = at[0] >= 0 and at[1] < n
    low, high = (float(found[k]) if inside else None for k in at)
    return Figure(float(np.median(found)), low, high, n)
