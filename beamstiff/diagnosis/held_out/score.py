"""What effects are worth on postures that did not see them: gap before, gap after, the share that closes.

Every fold is fitted anew; all folds from one fit are in `diagnosis.decomposition.folds`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.identification.whitening import whitening
from beamstiff.measure.arrays import places_of_each
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

RESAMPLED = 400
FOLDS = 10
SEEN = 1.05  # of the noise, what values have to leave without effects for a share of it to be told
KNOWN = 0.5  # mean weight below which too little is predicted surely for a share of it to be told
SURELY = 3.0  # standard deviations by which a compliance has to be negative for its bound to be kept


@dataclass(frozen=True)
class Weighted:
    """A shape with its weight among those of a candidate, and the size u its parameters are drawn with."""

    hypothesis: Hypothesis
    weight: float
    magnitude: float


@dataclass(frozen=True)
class Fitted:
    """One way to take the shapes, fitted.

    `compliance`: (t,) array; change of the model's own compliances.
    `theta`: (c,) array; parameters of all shapes, in realistic sizes.
    `covariance`: (t + c, t + c) array; of both.
    """

    weight: float
    shapes: tuple[Weighted, ...]
    compliance: Array
    theta: Array
    covariance: Array


@dataclass(frozen=True)
class HeldOutError:
    """Position gap on held-out postures, RMS of the norm, m.

    `before`, `after`: m; without and with the effects.
    `shrink`: share of the explainable gap that closes.
    `interval`: 90 %, over the postures.
    `noise`: m; noise floor.
    `misfit`: what is left with the effects, RMS over all values, rotations too, each over its noise.
    `open`: the same without the effects.
    `surely`: the share that closes of all values, each counted by how surely the effects, fitted without its
        posture, predict it: at the end of a joint's range little is known of what follows the angle.
    """

    before: float
    after: float
    shrink: float
    interval: tuple[float, float]
    postures: int
    noise: float = 0.0
    misfit: float = 1.0
    open: float = 1.0
    surely: float = 0.0

    @property
    def explained_fraction(self) -> float:
        """Share of the explainable gap that closes, of positions, of all values or of those that are sure."""
        if self.open < SEEN:
            return self.shrink
        share = 1.0 - (self.misfit**2 - 1.0) / (self.open**2 - 1.0)
        return max(self.shrink, self.surely, float(np.clip(share, 0.0, 1.0)))


@dataclass(frozen=True, eq=False)
class Stated:
    """Effects stated as least squares, whitened: n values, each way to take their shapes with its columns."""

    gap: Array  # (n,)
    row: NDArray[np.intp]  # (n,) of the table; postures do not mix
    least: Array  # (t,) change of the model's own compliances that leaves none
    ways: tuple[tuple[float, tuple[Weighted, ...], Array, Array], ...]  # weight, shapes, columns, ridge

    def solved(self, train: NDArray[np.bool_] | None = None) -> list[Fitted]:
        """Return the fit of each way, to whole postures (N,) or to all of them."""
        chosen = slice(None) if train is None else train[self.row]
        result = []
        for weight, shapes, columns, ridge in self.ways:
            theta, covariance = solve(columns[chosen], ridge, self.gap[chosen])
            count = self.least.size
            doubt = SURELY * np.sqrt(np.maximum(np.diag(covariance)[:count], 0.0))
            if not shapes and (theta + doubt < self.least).any():  # the model alone has no negative stiffness
                theta = bounded(columns[chosen], self.gap[chosen], self.least)
            result.append(Fitted(weight, shapes, theta[:count], theta[count:], covariance))
        return result


def stated(
    baseline: Baseline, used: NDArray[np.bool_], models: Sequence[Sequence[Weighted]], scale: float
) -> Stated:
    """Return effects stated together with the model's own values; parameters as for `fitted`."""
    white = whitening(baseline.sigma * scale, used, baseline.sharing)
    tangent = white @ baseline.tangent[used]
    ways = []
    for weight, shapes in combinations_of(models):
        parts = [tangent]
        parts += [white @ (one.hypothesis.shape.columns[used] * one.hypothesis.sizes) for one in shapes]
        ridge = [np.zeros(tangent.shape[1])]
        ridge += [
            np.full(part.shape[1], one.magnitude**-2.0) for part, one in zip(parts[1:], shapes, strict=True)
        ]
        ways.append((weight, tuple(shapes), np.concatenate(parts, axis=1), np.concatenate(ridge)))
    known = stiffness_parameters(baseline.robot)
    least = np.array([-1.0 / known[name] for name in baseline.fitted])
    return Stated(white @ baseline.gap[used], np.nonzero(used)[0], least, tuple(ways))


def fitted(
    baseline: Baseline, used: NDArray[np.bool_], models: Sequence[Sequence[Weighted]], scale: float
) -> list[Fitted]:
    """Return effects fitted together with the model's own values, a fit for each way to take their shapes.

    `used`: (N, 6) bool array; values that count.
    `models`: the shapes of each effect; all effects act at once.
    `scale`: of the noise, against the sigma the baseline counts with.
    """
    return stated(baseline, used, models, scale).solved()


def shift(baseline: Baseline, fits: Sequence[Fitted], columns: Sequence[Sequence[Array]]) -> Array:
    """Return what the fits add to a baseline's prediction (N, 6), for columns (N, 6, c) of each shape."""
    total = np.zeros_like(baseline.predicted)
    for fit, own in zip(fits, columns, strict=True):
        sizes = np.concatenate([one.hypothesis.sizes for one in fit.shapes]) if fit.shapes else np.zeros(0)
        total += fit.weight * (baseline.tangent @ fit.compliance)
        if fit.shapes:
            total += fit.weight * (np.concatenate(own, axis=-1) @ (fit.theta * sizes))
    return total


def parts_of(baseline: Baseline, fits: Sequence[Fitted]) -> list[Array]:
    """Return what each effect of the fits adds to a baseline's prediction, (N, 6) each."""
    count = max(len(fit.shapes) for fit in fits)
    parts = [np.zeros_like(baseline.predicted) for _ in range(count)]
    for fit in fits:
        theta = np.split(fit.theta, np.cumsum([one.hypothesis.sizes.size for one in fit.shapes])[:-1])
        for part, one, own in zip(parts, fit.shapes, theta, strict=True):
            part += fit.weight * (one.hypothesis.shape.columns @ (own * one.hypothesis.sizes))
    return parts


def stacked(baseline: Baseline, fit: Fitted, columns: Sequence[Array]) -> Array:
    """Return the columns (N, 6, t + c) of all that a fit holds, for those (N, 6, c) of each of its shapes."""
    sized = (part * one.hypothesis.sizes for part, one in zip(columns, fit.shapes, strict=True))
    return np.concatenate([baseline.tangent, *sized], axis=-1)


def combinations_of(models: Sequence[Sequence[Weighted]]) -> list[tuple[float, list[Weighted]]]:
    """Return the ways to take one shape of each effect, with their weights; the first effect varies only."""
    if not models:
        return [(1.0, [])]
    best = [max(shapes, key=lambda one: one.weight) for shapes in models[1:]]
    return [(one.weight, [one, *best]) for one in models[0]]


def solve(columns: Array, ridge: Array, gap: Array) -> tuple[Array, Array]:
    """Return the coefficients (c,) of ridge regression and their covariance (c, c)."""
    gram = columns.T @ columns + np.diag(ridge)
    size = np.sqrt(np.diag(gram))
    size = np.where(size > 0, size, np.inf)  # of what shows nowhere nothing is known, and nothing told
    inverse = np.linalg.pinv(gram / np.outer(size, size), rcond=1e-11, hermitian=True) / np.outer(size, size)
    return inverse @ (columns.T @ gap), inverse


def bounded(columns: Array, gap: Array, least: Array) -> Array:
    """Return the least-squares coefficients (t,) that are at least `least`."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-150)
    found: Array = lsq_linear(columns / size, gap, (least * size, np.inf)).x / size
    return found


def folds(
    baseline: Baseline, used: NDArray[np.bool_], rng: np.random.Generator, by_load: bool = False
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the fold of each row (N,), -1 where no position counts, and the postures that are folded.

    By load, those of a posture are divided among the folds.
    """
    seen = np.flatnonzero(used[:, :3].any(axis=1))
    poses = np.unique(baseline.rows.pose[seen])
    unit = baseline.rows.pose
    if by_load:
        states = np.column_stack([baseline.rows.pose, baseline.rows.wrench])
        unit = np.unique(states, axis=0, return_inverse=True)[1].reshape(-1)
    units = np.unique(unit[seen])
    fold_of = dict(
        zip(rng.permutation(units).tolist(), (np.arange(units.size) % FOLDS).tolist(), strict=True)
    )
    fold = np.array([fold_of.get(one, -1) for one in unit.tolist()], dtype=np.intp)
    return fold, poses


def held_out(
    baseline: Baseline,
    used: NDArray[np.bool_],
    models: Sequence[Sequence[Weighted]],
    scale: float,
    seed: int,
    by_load: bool = False,
) -> HeldOutError:
    """Return what effects are worth on held-out postures, or loads; parameters as for `fitted`."""
    rng = np.random.default_rng(seed)
    fold, poses = folds(baseline, used, rng, by_load)
    left = [np.zeros_like(baseline.gap) for _ in range(2)]
    unsure = np.zeros_like(baseline.gap)
    causes: tuple[Sequence[Sequence[Weighted]], ...] = ((), models)
    whole = [] if by_load else [stated(baseline, used, effects, scale) for effects in causes]
    for k in range(int(fold.max(initial=-1)) + 1):
        train = fold != k
        for which, (target, effects) in enumerate(zip(left, causes, strict=True)):
            if by_load:  # rows of a posture may share an unloaded reading: none may tell of those left out
                fits = stated(baseline, used & train[:, None], effects, scale).solved()
            else:
                fits = whole[which].solved(train)
            columns = [[one.hypothesis.shape.columns for one in fit.shapes] for fit in fits]
            target[~train] = (baseline.gap - shift(baseline, fits, columns))[~train]
            if which == 1:
                unsure[~train] = _variance(baseline, fits, columns, ~train)
    counted = used & (fold >= 0)[:, None]
    without, misfit = (
        float(np.sqrt(((target / (scale * baseline.sigma))[counted] ** 2).mean())) for target in left
    )
    noise = (scale * baseline.sigma[counted]) ** 2
    sure = noise / (noise + unsure[counted])
    before, after = (float(sure @ (target[counted] ** 2 / noise - 1.0)) for target in left)
    seen = sure.mean() > KNOWN and before > (SEEN**2 - 1.0) * sure.sum()
    position = np.where(used[:, :3], 1.0, 0.0)
    known = set(poses.tolist())
    rows_of = [at for at in places_of_each(baseline.rows.pose) if baseline.rows.pose[at[0]] in known]
    squares = [(target[:, :3] ** 2 * position).sum(axis=1) for target in left]
    squares.append(((scale * baseline.sigma[:, :3]) ** 2 * position).sum(axis=1))
    squares.append(position.any(axis=1).astype(np.float64))
    by_pose = np.array([[s[at].sum() for s in squares] for at in rows_of])
    drawn = rng.integers(0, len(poses), (RESAMPLED, len(poses)))
    samples = np.array([_shrink(by_pose[some].sum(axis=0)) for some in drawn])
    total = by_pose.sum(axis=0)
    shrink = _shrink(total)
    # few postures carry most of some gaps: the estimate of all may lie beyond those of their samples
    low, high = np.quantile(samples, [0.05, 0.95])
    interval = (min(float(low), shrink), max(float(high), shrink))
    return HeldOutError(
        before=float(np.sqrt(total[0] / total[3])),
        after=float(np.sqrt(total[1] / total[3])),
        shrink=shrink,
        interval=interval,
        postures=len(poses),
        noise=float(np.sqrt(total[2] / total[3])),
        misfit=misfit,
        open=without,
        surely=float(np.clip(1.0 - after / before, 0.0, 1.0)) if seen else 0.0,
    )


def _variance(
    baseline: Baseline, fits: Sequence[Fitted], columns: Sequence[Sequence[Array]], rows: NDArray[np.bool_]
) -> Array:
    """Return the variance (n, 6) of what fits say of some rows (N,), for columns (N, 6, c) of each shape."""
    result = np.zeros((int(rows.sum()), 6))
    for fit, own in zip(fits, columns, strict=True):
        every = stacked(baseline, fit, own)[rows]
        result += fit.weight * ((every @ fit.covariance) * every).sum(axis=-1)
    return result


def _shrink(sums: Array) -> float:
    """Return ``1 - (after^2 - noise^2) / (before^2 - noise^2)``, RMS, of sums of squares; within 0 and 1."""
    before, after, noise = sums[:3]
    if before <= noise:
        return 0.0
    return float(np.clip(1.0 - (after - noise) / (before - noise), 0.0, 1.0))
