"""Windows in which a running machine stands still, and why others are no such windows.

First what moves quickly is cut out. What is left of each stretch is cut where the readings bend or leap,
into pieces along each of which every signal is a straight line (optimal partitioning, Jackson et al. 2005,
IEEE Signal Processing Letters 12, 105, of the squared residuals over the noise). A piece whose lines have a
slope beyond the noise moves: it creeps, settles or is being loaded. The rest stands still.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beamstiff.measure.signals import Signal, SignalKind, slow_noise, white_noise
from beamstiff.se3 import Array

CELL = 0.05  # s: pieces begin and end on such a grid
MOST_CELLS = 600  # in a stretch; longer ones have longer cells
SHORTEST = 0.3  # s of a window that is kept
# Faster than this is a motion, whatever the noise: rad/s, m/s; forces alone do not tell one.
FAST: Mapping[SignalKind, float] = {"joints": 0.01, "point": 5e-3, "pose": 5e-3}
OVER = 0.1  # s, in which the speed is read
# Slower than this is the warming of an instrument, not a motion: per s.
DRIFT: Mapping[SignalKind, float] = {"joints": 1e-6, "point": 1e-6, "pose": 1e-6, "wrench": 1e-2}
SHAKES = 2.0  # times the variance of the noise
RINGS = 2.5  # standard deviations of the squared residuals of a block, beyond which it rings
GOES_ON = 4.0  # standard deviations of a slope along that of a neighbour that creeps
GUARD, MOST_GUARD = 5.0, 0.25  # intervals of the slowest signal behind a motion, between which it rings; s
SURE = 5.0  # standard deviations of a slope beyond which it is one
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Window:
    """A stretch of time: kept, or cut for a reason."""

    start: float  # s
    end: float  # s
    reason: str = ""  # empty: the machine stands still

    @property
    def kept(self) -> bool:
        """Whether the machine stands still."""
        return not self.reason


@dataclass(frozen=True, eq=False)
class _Sums:
    """Running sums of a signal over the borders of cells, values over their noise."""

    name: str
    kind: SignalKind
    noise: Array  # (D,)
    alike: float  # how many readings count for one in means and slopes
    count: Array  # (C + 1,)
    time: Array  # (C + 1,): of t
    squared_time: Array  # (C + 1,)
    value: Array  # (C + 1, D)
    product: Array  # (C + 1, D): of t y
    squared: Array  # (C + 1,): of y^2, all components


def still_windows(signals: Sequence[Signal], shortest: float = SHORTEST) -> list[Window]:
    """Return all windows of a record in order: kept ones, and those cut for a reason.

    `signals`: joints, points, poses and wrenches on one clock. `shortest`, s: of a window that is kept.

    >>> t = np.arange(0.0, 6.0, 0.01)
    >>> q = np.interp(t, [2.0, 4.0], [0.0, 1.0])[:, None]
    >>> windows = still_windows([Signal("j", "joints", ("q1",), t, q)])
    >>> [(round(window.start, 2), round(window.end, 2)) for window in windows if window.kept]
    [(0.05, 1.85), (4.15, 5.95)]
    """
    signals = [signal for signal in signals if signal.kind != "torques" and len(signal) > 2]
    begin = max(signal.time[0] for signal in signals if signal.kind in FAST)
    end = min(signal.time[-1] for signal in signals if signal.kind in FAST)
    count = max(int(np.ceil((end - begin) / CELL)), 1)
    edges = begin + CELL * np.arange(count + 1)
    noise = [white_noise(signal) for signal in signals]
    moving = np.zeros(count, dtype=np.bool_)
    for signal, sigma in zip(signals, noise, strict=True):
        if signal.kind in FAST:
            moving |= _moving_cells(signal, sigma, edges)
    stretches = [(low, high) for low, high in _runs(~moving) if CELL * (high - low) >= shortest - CELL / 2]
    spans = [(float(edges[low]), float(edges[high])) for low, high in stretches]
    slow = [slow_noise(signal, sigma, spans) for signal, sigma in zip(signals, noise, strict=True)]
    guard = min(GUARD * max(signal.interval for signal in signals if signal.kind in FAST), MOST_GUARD)
    windows: list[Window] = []
    for low, high in spans:
        windows += _judged(_pieces(signals, slow, low, high), shortest, guard)
    return _with_motions(windows, float(edges[0]), float(min(edges[-1], end)))


def _moving_cells(signal: Signal, noise: Array, edges: Array) -> Flags:
    """Return which cells (C,) see a quick motion of a signal."""
    values, sigma = signal.values, noise
    if signal.kind == "pose":
        values, sigma = values[:, :3], noise[:3]
    other = np.searchsorted(signal.time, signal.time + OVER).clip(max=len(signal) - 1)
    first = np.flatnonzero(other > np.arange(len(signal)))
    other = other[first]
    spent = np.maximum(signal.time[other] - signal.time[first], 1e-3)
    moved = np.linalg.norm(values[other] - values[first], axis=1)
    least = np.maximum(FAST[signal.kind] * spent, 8.0 * np.linalg.norm(sigma))
    fast = moved > least
    # counts up at the cell of the first reading, down behind that of the second
    low = np.searchsorted(edges, signal.time[first][fast], side="right") - 1
    high = np.searchsorted(edges, signal.time[other][fast], side="left")
    change = np.zeros(len(edges) + 1)
    np.add.at(change, low.clip(0, len(edges) - 1), 1)
    np.add.at(change, high.clip(0, len(edges) - 1), -1)
    return np.cumsum(change)[: len(edges) - 1] > 0


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the runs of true, each from its first to behind its last."""
    padded = np.concatenate([[False], flags, [False]]).astype(np.int8)
    change = np.flatnonzero(np.diff(padded))
    return list(zip(change[::2].tolist(), change[1::2].tolist(), strict=True))


def _pieces(
    signals: Sequence[Signal], noise: Sequence[tuple[Array, float]], low: float, high: float
) -> tuple[list[_Sums], Array, list[int]]:
    """Return the running sums of a stretch, the borders of its cells, and where it is cut."""
    cells = int(min(max(round((high - low) / CELL), 1), MOST_CELLS))
    edges = np.linspace(low, high, cells + 1)
    sums = [_sums(signal, *own, edges) for signal, own in zip(signals, noise, strict=True)]
    unknowns = 2.0 * sum(one.value.shape[1] for one in sums)
    # of a cut: what a piece's unknowns gain by chance, at the best of all places; cuts too many are undone
    price = unknowns + 4.0 * np.log(cells + 1.0)
    least = np.full(cells + 1, np.inf)
    least[0] = -price
    before = np.zeros(cells + 1, dtype=np.intp)
    for at in range(1, cells + 1):
        total = least[:at] + price + sum(_misfit(one, at) for one in sums)
        before[at] = int(np.argmin(total))
        least[at] = total[before[at]]
    cuts = [cells]
    while cuts[-1]:
        cuts.append(int(before[cuts[-1]]))
    return sums, edges, cuts[::-1]


def _sums(signal: Signal, noise: Array, alike: float, edges: Array) -> _Sums:
    inside = slice(*np.searchsorted(signal.time, edges[[0, -1]]))
    time, values = signal.time[inside] - edges[0], signal.values[inside]
    if len(values):
        values = (values - values.mean(axis=0)) / noise
    border = np.searchsorted(time, edges - edges[0])

    def running(terms: Array) -> Array:
        total: Array = np.concatenate([np.zeros((1, *terms.shape[1:])), np.cumsum(terms, axis=0)])
        return np.asarray(total[border])

    return _Sums(
        signal.name,
        signal.kind,
        noise,
        alike,
        running(np.ones(len(time))),
        running(time),
        running(time**2),
        running(values),
        running(time[:, None] * values),
        running((values**2).sum(axis=1)),
    )


def _line(one: _Sums, low: NDArray[np.intp] | int, high: int) -> tuple[Array, Array, Array, Array]:
    """Return count, spread of t (sum of squares), slopes and residual of lines from `low` to `high`."""
    count = one.count[high] - one.count[low]
    some = np.maximum(count, 1.0)
    time, value = one.time[high] - one.time[low], one.value[high] - one.value[low]
    spread = one.squared_time[high] - one.squared_time[low] - time**2 / some
    product = one.product[high] - one.product[low] - np.asarray(time / some)[..., None] * value
    slope = np.where(np.asarray(spread > 1e-9)[..., None], product / np.maximum(spread, 1e-9)[..., None], 0.0)
    squares = one.squared[high] - one.squared[low] - (value**2).sum(axis=-1) / some
    residual = np.maximum(squares - (slope**2).sum(axis=-1) * np.maximum(spread, 0.0), 0.0)
    return count, spread, slope, residual


def _misfit(one: _Sums, high: int) -> Array:
    """Return -2 log likelihood of pieces that end at `high`, their noise at least the known one."""
    count, _, slope, residual = _line(one, np.arange(high), high)
    values = np.maximum(count * slope.shape[-1], 1.0)
    excess = np.maximum(residual / values, 1.0)
    # as of white noise: cuts that slow noise makes are undone when pieces are judged
    return np.asarray(residual / excess + values * np.log(excess))


def _judged(piece: tuple[list[_Sums], Array, list[int]], shortest: float, guard: float) -> list[Window]:
    """Return the windows of a stretch: its pieces, joined where nothing happens between them."""
    sums, edges, cuts = piece
    borders = list(cuts)
    at = 1
    while at < len(borders) - 1:  # a cut between two pieces that one line fits as well is none
        low, middle, high = borders[at - 1 : at + 2]
        whole = _why(sums, edges, low, high)
        apart = _leap(sums, low, middle, high)
        if (not whole and not apart) or _one_line(sums, low, middle, high):
            del borders[at]
            at = max(at - 1, 1)
        else:
            at += 1
    reasons = [_why(sums, edges, low, high) for low, high in pairwise(borders)]
    step = float(edges[1] - edges[0])
    windows: list[Window] = []
    for at, (low, high) in enumerate(pairwise(borders)):
        reason = reasons[at]
        if not reason or "shakes" in reason:
            low, high = _calm(sums, step, low, high)
            reason = _why(sums, edges, low, high)
        beside = [
            (borders[k], borders[k + 1]) for k in (at - 1, at + 1) if 0 <= k < len(reasons) and reasons[k]
        ]
        if not reason:
            reason = next((why for one in beside if (why := _goes_on(sums, edges, (low, high), one))), "")
        # the cells at its ends may hold the end of a motion, and ringing between two readings
        start = max(float(edges[low]) + CELL * (2 if low > cuts[0] else 1), float(edges[borders[at]]) + guard)
        end = float(edges[high]) - CELL * (2 if high < cuts[-1] else 1)
        if not reason and end - start < shortest:
            reason = f"stands still for {max(end - start, 0.0):.2f} s, expected {shortest:g} s at least"
        cut = Window(float(edges[low]), float(edges[high]), reason) if reason else Window(start, end)
        if reason and windows and windows[-1].reason:  # pieces of one curve
            before = windows.pop()
            longer = max(before, cut, key=lambda one: one.end - one.start)
            cut = Window(before.start, cut.end, longer.reason)
        windows.append(cut)
    return windows


def _goes_on(sums: Sequence[_Sums], edges: Array, piece: tuple[int, int], beside: tuple[int, int]) -> str:
    """Return why a piece beside one that creeps creeps on, slower, the same way; empty where it does not."""
    for one in sums:
        _, before_spread, before, _ = _line(one, *beside)
        count, spread, slope, _ = _line(one, *piece)
        size = float(np.linalg.norm(before))
        if count < 3 or spread <= 0 or not size * np.sqrt(max(float(before_spread), 0.0) / one.alike) >= SURE:
            continue
        along = float(slope @ before) / size
        if along * np.sqrt(spread / one.alike) > GOES_ON:
            spent = float(edges[piece[1]] - edges[piece[0]])
            return _said(one, "creeps", float(np.linalg.norm((slope * one.noise)[:3])) * spent, spent)
    return ""


def _calm(sums: Sequence[_Sums], step: float, low: int, high: int) -> tuple[int, int]:
    """Return where a piece begins and ends without readings at its ends that are far from the others.

    They ring after a motion, or belong to the next one; the half of the piece in the middle says what is
    noise.
    """
    begin, end = low, high
    most, last = low + (high - low) // 2, high - (high - low) // 4
    before = None
    while before != (begin, end):  # a short block may lie where the ringing passes through zero
        before = begin, end
        for block in (0.8, 0.4, 0.2, 0.1, 0.05):
            cells = max(round(block / step), 1)
            while begin + cells <= most and any(
                _rings(one, begin, begin + cells, (begin + cells, end)) for one in sums
            ):
                begin += max(cells // 2, 1)
            while end - cells >= last and any(
                _rings(one, end - cells, end, (begin, end - cells)) for one in sums
            ):
                end -= max(cells // 2, 1)
    return min(begin + (2 if begin > low else 0), most), end  # it dies away below the noise


def _rings(one: _Sums, low: int, high: int, others: tuple[int, int]) -> bool:
    """Tell whether readings from `low` to `high` are farther from the mean of others than the noise."""
    count, rest = one.count[high] - one.count[low], one.count[others[1]] - one.count[others[0]]
    if count < 1 or rest < 3:
        return False
    mean = (one.value[others[1]] - one.value[others[0]]) / rest
    total = one.value[high] - one.value[low]
    away = one.squared[high] - one.squared[low] - 2.0 * total @ mean + count * (mean @ mean)
    freedom = mean.size * float(count)
    return bool(away > freedom * (1.0 + one.alike / rest) + RINGS * np.sqrt(2.0 * freedom * one.alike))


def _why(sums: Sequence[_Sums], edges: Array, low: int, high: int) -> str:
    """Return why a piece is no plateau, empty where it is one."""
    spent = float(edges[high] - edges[low])
    for one in sums:
        count, spread, slope, residual = _line(one, low, high)
        if count < 3 or spread <= 0:
            continue
        excess = max(float(residual) / (slope.size * max(float(count) - 2.0, 1.0)), 1.0)
        if excess > SHAKES:
            return _said(one, "shakes", float(np.sqrt(excess) * np.linalg.norm(one.noise[:3])), spent)
        sigmas = float((slope**2).sum() * spread / excess / one.alike)  # chi-squared of the components
        change = slope * one.noise * spent
        one_by_one = one.kind == "joints"
        moved = float(np.abs(change).max() if one_by_one else np.linalg.norm(change[:3]))
        own = float(one.noise.max() if one_by_one else np.linalg.norm(one.noise[:3]))
        if sigmas > slope.size + SURE * np.sqrt(2.0 * slope.size) + SURE**2 and moved > max(
            own, DRIFT[one.kind] * spent
        ):
            return _said(one, "creeps", moved, spent)
    return ""


def _leap(sums: Sequence[_Sums], low: int, middle: int, high: int) -> bool:
    """Tell whether any signal stands elsewhere after a cut than before."""
    for one in sums:
        counts = one.count[middle] - one.count[low], one.count[high] - one.count[middle]
        if min(counts) < 1:
            continue
        means = [
            (one.value[b] - one.value[a]) / n
            for (a, b), n in zip(((low, middle), (middle, high)), counts, strict=True)
        ]
        apart = means[1] - means[0]
        sigmas = float((apart**2).sum() / (1 / counts[0] + 1 / counts[1]) / one.alike)
        if sigmas > len(apart) + SURE * np.sqrt(2.0 * len(apart)) + SURE**2 and np.abs(apart).max() > 1.0:
            return True
    return False


def _one_line(sums: Sequence[_Sums], low: int, middle: int, high: int) -> bool:
    """Tell whether slow noise alone may be why two lines fit better than one."""
    gain, unknowns = 0.0, 0.0
    for one in sums:
        whole, after = _misfit(one, high)[[low, middle]]
        gain += float(whole - after - _misfit(one, middle)[low]) / np.sqrt(one.alike)
        unknowns += 2.0 * one.value.shape[1]
    return bool(gain < unknowns + 4.0 * np.log(len(sums[0].count)))


def _said(one: _Sums, does: str, moved: float, spent: float) -> str:
    how = f"by {np.degrees(moved):.3g} deg" if one.kind == "joints" else f"by {1e3 * moved:.3g} mm"
    if one.kind == "wrench":
        does, how = "changes", f"by {moved:.3g} N"
    return f"{one.name} {does} {how} in {spent:.2g} s"


def _with_motions(windows: Sequence[Window], begin: float, end: float) -> list[Window]:
    """Return the windows with the motions between them."""
    found: list[Window] = []
    last = begin
    for window in windows:
        if window.start - last > 1.5 * CELL:
            found.append(Window(last, window.start, "moves"))
        found.append(window)
        last = window.end
    if end - last > 1.5 * CELL:
        found.append(Window(last, end, "moves"))
    return found
