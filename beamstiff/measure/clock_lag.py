"""How far the clock of one instrument is behind another's: two recordings of one motion.

Speeds tell the lag to a few hundredths of a second, by their correlation. Then every motion tells it by
itself: where the point is must be a smooth function of where the joints are, which fails by the speed times
the lag. A straight line through these gives lag and drift of the clock. Where motions follow each other in
one rhythm, each of them fits at several lags; then the places between them, which must follow the joints as
well, tell the lag.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import correlate, correlation_lags

from beamstiff.errors import BeamstiffError
from beamstiff.measure.signals import Signal
from beamstiff.se3 import Array

STEP = 0.02  # s: grid of speeds
APART = 0.25  # s, by which candidates differ, and within which each is refined
CANDIDATES = 5
RHYTHMIC = 60  # candidates where motions do not tell which: all of one rhythm within the largest lag
STANDING = 0.01  # rad/s (m/s), below which a joint stands
STANDS_FOR = 0.15  # s; shorter rests do not end a motion
DEGREE = 5  # of the curve that a point follows in one motion
EXPLAINED = 0.99  # share of a point's motion that the joints must explain
AS_MANY = 0.9  # of the motions that tell the best lag: what so many others tell as well is a doubt too
ALIKE = 2.0  # a second lag that fits nearly as well (residuals within this factor) leaves a doubt
FREE = 0.2  # of each place's own value that the other places leave: fewer places tell nothing
ROUNDING = 1e-12  # of the places' squared spread, left by a fit of them: what is less says nothing of a lag
MODEL = 2e-3  # s: error of one motion's lag beside noise, of curves that are no polynomial
MOST_FREE = 30  # readings that count in one motion: what a polynomial leaves is no white noise
USUAL_DRIFT = 1e-4  # s/s: quartz clocks drift by less


class LagError(BeamstiffError):
    """The two recordings do not show how far their clocks are apart."""


@dataclass(frozen=True)
class ClockLag:
    """A clock that shows `lag + drift (t - at)` more than another, t the other's time."""

    lag: float  # s
    drift: float  # s/s
    at: float  # s
    std: float  # s, of `lag`
    motions: int  # that told it

    def corrected(self, time: Array) -> Array:
        """Return times of the other clock (N,) for times of this one."""
        return np.asarray((time - self.lag + self.drift * self.at) / (1.0 + self.drift))


def clock_lag(joints: Signal, point: Signal, most: float = 30.0) -> ClockLag:
    """Return the lag of a point's clock behind that of the joints.

    `joints`: joint values. `point`: position (of a pose: its first three values) of something that they
    move. `most`, s: largest lag that is looked for.

    Raises LagError where there is no motion in common, or the lag is not unique.

    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> q = np.interp(t, [3, 5, 9, 10, 14, 17], [0, 1, 1, 0.3, 0.3, 2])[:, None]
    >>> x = np.hstack([np.cos(q), np.sin(q), 0 * q])
    >>> found = clock_lag(
    ...     Signal("j", "joints", ("q1",), t, q), Signal("p", "point", ("x", "y", "z"), t + 1.234, x)
    ... )
    >>> round(found.lag, 3)
    1.234
    """
    position = point.values[:, :3]
    motions = _motions(joints)
    if not motions or len(point) < 8:
        raise LagError(
            f"{joints.name} shows no motion, from which the lag of {point.name} would follow"
            if not motions
            else f"{point.name}: found {len(point)} readings, expected more"
        )

    def tried_at(lag: float) -> Tried:
        each = (_one_motion(joints, point.time, position, span, lag) for span in motions)
        told = [one for one in each if one is not None]
        return Tried(lag, np.array(told).reshape(-1, 4), len(motions) - len(told))

    candidates = _coarse(joints, point.time, position, most, CANDIDATES)
    tried = sorted((one for one in map(tried_at, candidates) if one.told.size), key=lambda one: one.misfit)
    if not tried:
        raise LagError(f"{joints.name} and {point.name} have no motion in common")
    best = tried[0]
    if best.misfit > 1.0 - EXPLAINED:
        raise LagError(
            f"{point.name} does not move as {joints.name} do at any lag within {most:g} s "
            f"({100 * (1 - best.misfit):.0f} % of its motion is explained)"
        )
    rivals = [one for one in tried[1:] if abs(one.lag - best.lag) > 2 * APART and one.like(best)]
    if rivals:
        among = _coarse(joints, point.time, position, most, RHYTHMIC)
        resting = _by_rests(joints, point.time, position, motions, among)
        if resting is None or (best := tried_at(resting)).misfit > 1.0 - EXPLAINED:
            raise LagError(
                f"{point.name} fits {joints.name} at a lag of {best.lag:.2f} s and of {rivals[0].lag:.2f} s "
                "alike: the motion repeats itself"
            )
    return _straight(best.told[:, :3])


@dataclass(frozen=True, eq=False)
class Tried:
    """A lag, s; of each motion that tells it time, lag and its std, s, and the share left unexplained."""

    lag: float
    told: Array
    silent: int  # motions that say nothing

    @property
    def left(self) -> float:
        """Share of a point's motion that is not explained."""
        return float(np.median(self.told[:, 3])) if self.told.size else np.inf

    @property
    def misfit(self) -> float:
        """The same, and more where few motions tell it."""
        return self.left + 1e-4 * self.silent

    def like(self, best: Tried) -> bool:
        """Return whether the lag fits nearly as well as the best."""
        as_many = len(self.told) >= AS_MANY * len(best.told)
        return self.misfit < ALIKE**2 * best.misfit or (as_many and self.left < ALIKE**2 * best.left)


def _motions(joints: Signal) -> list[tuple[float, float]]:
    """Return begin and end of every motion of the joints, s."""
    grid, speed = _speed(joints.time, joints.values)
    moving = speed > STANDING
    rest = max(int(STANDS_FOR / STEP), 1)
    spans: list[list[float]] = []
    for at in np.flatnonzero(moving):
        if spans and grid[at] - spans[-1][1] <= rest * STEP:
            spans[-1][1] = float(grid[at])
        else:
            spans.append([float(grid[at]), float(grid[at])])
    return [(low - STEP, high + STEP) for low, high in spans if high - low > 5 * STEP]


def _speed(time: Array, values: Array, least: float = 0.1) -> tuple[Array, Array]:
    """Return a grid of times and the speed on it, read over `least` s so that noise counts little."""
    grid = np.arange(time[0], time[-1] + STEP, STEP)
    half = 0.5 * max(least, 1.5 * float(np.median(np.diff(time))))
    moved = [np.interp(grid + half, time, one) - np.interp(grid - half, time, one) for one in values.T]
    return grid, np.asarray(np.sqrt(np.sum(np.square(moved), axis=0)) / (2 * half))


def _by_rests(
    joints: Signal, time: Array, position: Array, motions: list[tuple[float, float]], lags: list[float]
) -> float | None:
    """Return the lag at which the places between motions follow the joints; None where none stands out.

    Each place is predicted by the others, from sine and cosine of every joint: the largest part of what
    links do, which a place of another time does not follow.
    """
    gaps = [(end, begin) for (_, end), (begin, _) in pairwise(motions) if begin - end > 2 * STANDS_FOR]
    errors = []
    for lag in lags:
        kept = [(time - lag > low + STEP) & (time - lag < high - STEP) for low, high in gaps]
        own = [(joints.time > low) & (joints.time < high) for low, high in gaps]
        both = [(q, x) for q, x in zip(own, kept, strict=True) if q.any() and x.any()]
        if not both:
            continue
        q = np.stack([joints.values[rows].mean(axis=0) for rows, _ in both])
        x = np.stack([position[rows].mean(axis=0) for _, rows in both])
        columns = np.hstack([np.ones((len(q), 1)), np.cos(q), np.sin(q)])
        projected = columns @ np.linalg.pinv(columns)
        free = 1.0 - np.diag(projected)
        if free.min() < FREE:
            continue
        left = (x - projected @ x) / free[:, None]
        share = float((left**2).sum() / ((x - x.mean(axis=0)) ** 2).sum())
        errors.append((max(share, ROUNDING), lag))
    if not errors:
        return None
    best, lag = min(errors)
    rhythm = float(
        np.median(np.diff([begin for begin, _ in motions]))
    )  # s; a lag nearby meets the same rests
    rivals = [error for error, other in errors if abs(other - lag) > 0.5 * rhythm]
    if ALIKE**2 * best >= min([1.0, *rivals]):
        return None
    return next(other for other in lags if abs(other - lag) <= 0.5 * rhythm)  # where speeds are most alike


def _coarse(joints: Signal, time: Array, position: Array, most: float, count: int) -> list[float]:
    """Return lags at which the speeds are most alike."""
    grid_a, a = _speed(joints.time, joints.values)
    grid_b, b = _speed(time, position)
    # square roots: that something moves counts, more than how fast
    a, b = (np.sqrt(one / max(float(one.max()), 1e-12)) for one in (a, b))
    ones_a, ones_b = np.ones_like(a), np.ones_like(b)
    shifts = correlation_lags(len(b), len(a))
    common = np.maximum(correlate(ones_b, ones_a), 1.0)
    sums = [correlate(x, y) for x, y in ((b, ones_a), (ones_b, a), (b**2, ones_a), (ones_b, a**2), (b, a))]
    of_b, of_a, bb, aa, ab = (one / common for one in sums)
    spread = np.sqrt(np.maximum(bb - of_b**2, 1e-9) * np.maximum(aa - of_a**2, 1e-9))
    likeness = (ab - of_b * of_a) / spread
    lags = shifts * STEP + grid_b[0] - grid_a[0]
    enough = common > 0.3 * min(len(a), len(b))
    likeness = np.where((np.abs(lags) <= most) & enough, likeness, -np.inf)
    found: list[float] = []
    while len(found) < count and np.isfinite(likeness.max()):
        lag = float(lags[int(np.argmax(likeness))])
        found.append(lag)
        likeness = np.where(np.abs(lags - lag) < 2 * APART, -np.inf, likeness)
    return found


def _one_motion(
    joints: Signal, time: Array, position: Array, span: tuple[float, float], lag: float
) -> tuple[float, float, float, float] | None:
    """Return when a motion was, its lag and standard deviation, s, and the share that is not explained."""
    low, high = span[0] - 0.3, span[1] + 0.3
    inside = (time - lag >= low) & (time - lag <= high)
    if low + 0.3 < joints.time[0] or high - 0.3 > joints.time[-1] or inside.sum() < 12:
        return None
    at, x = time[inside], position[inside]
    x = x - x.mean(axis=0)
    moved = float((x**2).sum())
    own = (joints.time >= low) & (joints.time <= high)
    q = joints.values[own]
    middle = q.mean(axis=0)
    _, size, axes = np.linalg.svd(q - middle, full_matrices=False)
    axes = axes[: int((size > 1e-3 * size[0]).sum())][:3]
    along = (q - middle) @ axes.T
    scale = np.abs(along).max(axis=0)
    degree = int(min(DEGREE, len(x) // 4))

    def residual(shift: float) -> float:
        u = np.stack([np.interp(at - shift, joints.time[own], one) for one in along.T], axis=1) / scale
        columns = [np.ones(len(u)), *(u[:, 0] ** power for power in range(1, degree + 1))]
        if u.shape[1] > 1 and degree == DEGREE:
            columns += [u[:, 1], u[:, 0] * u[:, 1], u[:, 1] ** 2, *(u[:, k] for k in range(2, u.shape[1]))]
        basis = np.linalg.qr(np.stack(columns, axis=1))[0]
        return float((x**2).sum() - ((basis.T @ x) ** 2).sum())

    begin, step = lag, APART / 5
    for _ in range(3):  # each grid about the best of the one before, a fifth as wide
        shifts = begin + step * np.arange(-6, 7)
        left = np.array([residual(shift) for shift in shifts])
        best = int(np.argmin(left))
        begin, step = float(shifts[best]), step / 5
    step *= 5
    if best in (0, len(shifts) - 1):
        return None
    below, least, above = left[best - 1 : best + 2]
    bend = below - 2 * least + above
    if bend <= 0 or moved <= 0:
        return None
    told = begin + 0.5 * step * (below - above) / bend
    freedom = max(min(3 * len(x) - 3 * (degree + 1), MOST_FREE), 1)
    std = float(np.sqrt(max(least, 0.0) / freedom / (0.5 * bend / step**2)))
    return 0.5 * (span[0] + span[1]), told, std, max(least, 0.0) / moved


def _straight(told: Array) -> ClockLag:
    """Return the line through the lags of motions: rows time, lag, standard deviation."""
    time, lag, std = told.T
    at = float(time.mean())
    variance = std**2 + MODEL**2
    columns = np.stack([np.ones_like(time), time - at], axis=1)
    prior = np.diag([0.0, 1.0 / USUAL_DRIFT**2])
    weight = 1.0 / variance
    for _ in range(20):  # Huber's weights: a motion of a hidden or shaken reflector counts little
        covariance = np.linalg.inv(columns.T @ (weight[:, None] * columns) + prior)
        found = covariance @ (columns.T @ (weight * lag))
        away = np.abs(lag - columns @ found) / np.sqrt(variance)
        size = max(float(np.median(away)) / 0.6745, 1.0)
        weight = np.minimum(1.0, 1.5 * size / np.maximum(away, 1e-9)) / variance
    return ClockLag(float(found[0]), float(found[1]), at, float(np.sqrt(covariance[0, 0])) * size, len(time))
