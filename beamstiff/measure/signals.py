"""Sampled signals of a running machine: joints, points, poses, wrenches, each with times of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from beamstiff.se3 import Array

SignalKind = Literal["joints", "torques", "point", "pose", "wrench"]
# Below this a standard deviation counts as this: finer than encoders, trackers and load cells resolve.
LEAST_NOISE: Mapping[SignalKind, float] = {
    "joints": 2e-6,
    "torques": 1e-3,
    "point": 1e-6,
    "pose": 1e-6,
    "wrench": 1e-2,
}
CHUNK = 1.0  # s: over which the noise is read
USUAL = 2.0  # times the median variance, up to which a chunk counts
LIKELIER = 0.1  # in log likelihood of a chunk: slow noise
SLOW = tuple((share, lasts) for share in (0.2, 0.5, 0.8) for lasts in (0.03, 0.06, 0.12, 0.25, 0.5))  # 1, s


@dataclass(frozen=True, eq=False)
class Signal:
    """Readings of one source."""

    name: str  # topic, or column group of a file
    kind: SignalKind  # of a pose the values are x y z and the unit quaternion x y z w, signs continuous
    columns: tuple[str, ...]  # names of the values: joints by their names
    time: Array  # (N,), s; not decreasing
    values: Array  # (N, D), SI
    frame: str = ""  # that the source names, if it names one

    def __len__(self) -> int:
        return len(self.time)

    @property
    def interval(self) -> float:
        """Median time between readings, s."""
        return float(np.median(np.diff(self.time))) if len(self) > 1 else np.inf

    def shifted(self, time: Array) -> Self:
        """Return the signal at other times, in their order."""
        order = np.argsort(time, kind="stable")
        return replace(self, time=time[order], values=self.values[order])


def white_noise(signal: Signal) -> Array:
    """Return the standard deviation of one reading (D,), from where the signal stands still.

    Second differences do not see a uniform motion; the tenth of all stretches in which they are smallest is
    taken, so that a tenth of the record has to stand still.
    """
    least = LEAST_NOISE[signal.kind]
    if len(signal) < 8:
        return np.full(signal.values.shape[1], least)
    second = np.diff(signal.values, n=2, axis=0) / np.sqrt(6.0)
    length = int(np.clip(round(0.5 / max(signal.interval, 1e-4)), 6, len(second)))
    stretches = second[: len(second) // length * length].reshape(-1, length, second.shape[1])
    spread = np.sqrt((stretches**2).mean(axis=1))
    steps = np.abs(np.diff(signal.values, axis=0))
    # half a count: readings may stand still at one count, and toggle between two in the next posture
    count = 0.5 * np.min(np.where(steps > 0, steps, np.inf), axis=0, initial=np.inf)
    count = np.where(np.isfinite(count), count, 0.0)
    return np.asarray(np.maximum(np.maximum(np.quantile(spread, 0.1, axis=0), count), least))


def slow_noise(signal: Signal, noise: Array, stretches: Sequence[tuple[float, float]]) -> tuple[Array, float]:
    """Return the noise of a signal (D,) over a second, and how many alike readings count for one.

    From the seconds of what does not move quickly, a line taken off each; those that vary much more than
    the median creep along a curve, and do not count. The noise is white, a part of it correlated over a
    time, both by maximum likelihood of what a line leaves (its own share would hide slow noise else).
    """
    length = max(round(CHUNK / signal.interval), 12)
    away: list[Array] = []
    for low, high in stretches:
        inside = slice(*np.searchsorted(signal.time, [low, high]))
        values = signal.values[inside]
        away += [values[at : at + length] for at in range(0, len(values) - length + 1, length)]
    if len(away) < 3:
        return noise, 1.0
    time = np.arange(length) - 0.5 * (length - 1)
    lines = np.stack([np.full(length, length**-0.5), time / np.linalg.norm(time)], axis=1)
    beside = np.linalg.qr(np.concatenate([lines, np.eye(length)], axis=1))[0][:, 2:]  # (n, n - 2)
    left = np.einsum("nk,cnd->cdk", beside, np.array(away))
    variance = (left**2).mean(axis=2)
    median = np.median(variance, axis=0)
    sigma = np.maximum(np.sqrt(median), noise)
    usual = left[(variance > 0) & (variance < USUAL * median) & (median > 0.25 * noise**2)]
    if len(usual) < 3 or signal.kind == "joints":  # encoders stand at a count
        return sigma, 1.0
    apart = np.abs(np.subtract.outer(time, time)) * signal.interval

    def likelihood(share: float, lasts: float) -> Array:
        covariance = beside.T @ ((1.0 - share) * np.eye(length) + share * np.exp(-apart / lasts)) @ beside
        factor = np.linalg.cholesky(covariance)
        square = (np.linalg.solve(factor, usual.T) ** 2).mean(axis=0)
        # of the best size of the noise in each chunk
        return np.asarray(-np.log(np.diag(factor)).sum() - 0.5 * (length - 2) * np.log(square))

    white = likelihood(0.0, 1.0)  # medians: what rings or creeps in a chunk looks like slow noise
    better, share, lasts = max((float(np.median(likelihood(*one) - white)), *one) for one in SLOW)
    if better < LIKELIER:
        return sigma, 1.0
    kept = float(np.exp(-signal.interval / lasts))
    return sigma, 1.0 + 2.0 * share * kept / (1.0 - kept)
