"""Rows that stand apart from all others: gross errors of reading, which least squares spread over all.

A row's error is that of its prediction from all others (Cook and Weisberg, Residuals and Influence, 1982,
eq. 2.2.7). What effects leave has tails, but no gap: no effect moves one row or two so much farther than the
farthest of all others. Of more rows, which hide one another, each must say what went wrong: the name of its
reflector, or one coordinate.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of, open_stiffness, orthonormal
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import listed
from beamstiff.measure.arrays import Integers
from beamstiff.measure.outlier_gap import APART, farthest, most_far, stands_apart
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.measure.table import Measurements
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array

MANY = 0.15  # share of the rows that may be gross errors that show what went wrong: more hide one another
RARE = 0.1  # share of the rows that are left out although they show nothing of what went wrong
ROUNDS, CAUCHY = 20, 2.4  # of a robust fit; its width in middle errors, usual for one that loses 5 % by it
TRIED = 3  # gaps between the errors of such a fit
ALONE = 1e-6  # variance of a reading over that of its prediction, below which no other row tells it
NEAREST = 0.01  # m, of two reflectors: no play moves one so far
LISTED = 6  # rows that are named


@dataclass(frozen=True)
class Apart:
    """Rows that stand apart from all others, as places ``file:line``.

    `left_out`: gross errors. `said`: likewise, with what went wrong. `doubtful`: in words, those that stand
    apart and show nothing of what went wrong, more than gross errors mostly are; empty where there are none.
    They are left out too while they are rare, so that they do not hide all else.
    """

    left_out: tuple[str, ...] = ()
    said: tuple[str, ...] = ()
    doubtful: str = ""


def rows_apart(model: OpenModel, rows: Measurements) -> Apart:
    """Return the rows of a model that stand apart from all others; mostly none.

    `rows`: as they were measured, those of the model in another frame.
    """
    errors = _Errors(model, rows)
    few = errors.few()
    beyond = errors.many(few)
    found, doubtful = np.concatenate([few, beyond]), ""
    if not found.size:
        return Apart(doubtful=next(errors.two_under_one_name(), ""))
    change = errors.change(found)
    said = {row: errors.said(row, change) for row in found.tolist()}
    unsaid = [row for row in beyond.tolist() if not said[row][1]]
    if len(unsaid) > errors.most_few:
        doubtful = errors.doubt(found, change)
        if len(found) > RARE * len(errors.every):
            found = few
    ordered = sorted(found.tolist())
    return Apart(tuple(map(rows.place, ordered)), tuple(said[row][0] for row in ordered), doubtful)


def places_apart(baseline: Baseline) -> Apart:
    """Return the rows of displacements that stand apart.

    A reading that several rows share tells of none of them: each counts by itself.
    """
    alone = replace(baseline, sharing=np.full_like(baseline.sharing, -1))
    return rows_apart(open_stiffness(alone), baseline.rows)


class _Errors:
    """Errors of the rows of a model, each predicted by others."""

    def __init__(self, model: OpenModel, rows: Measurements) -> None:
        self.model, self.rows = model, rows
        self.of_value, self.component = np.nonzero(model.used)
        self.every = np.unique(self.of_value)
        self.by_set_ups = bool(rows.targets) or rows.camera  # no row has a place of its own
        self.most_few = most_far(len(self.every))

    def few(self) -> Integers:
        """Return the few rows that stand apart, whatever they look like."""
        found = np.zeros(0, dtype=np.intp)
        while (more := self._farthest(found)).size:
            found = np.concatenate([found, more])
        return found if len(found) <= self.most_few else found[:0]

    def _farthest(self, without: Integers) -> Integers:
        """Return the farthest rows, behind which all others follow at a distance."""
        rows, error = self._of_others(without)
        return rows[farthest(error, self.most_few, len(self.every))]

    def many(self, without: Integers) -> Integers:
        """Return rows beside some others that stand apart once all of them are left out."""
        kept = ~np.isin(self.every, without)
        error, every = self._beside_robust_fit(without)[kept], self.every[kept]
        order = np.argsort(-error)
        ratio = error[order[:-1]] / np.maximum(error[order[1:]], 1.0)
        for count in 1 + np.argsort(-ratio[: int(MANY * len(order))])[:TRIED]:
            found = every[order[:count]]
            rows, others = self._of_others(np.concatenate([without, found]))
            change = self.change(np.concatenate([without, found]))
            nearest = min(float(np.linalg.norm(self._predicted(row, change))) for row in found.tolist())
            if len(rows) > 1 and stands_apart(nearest, float(others.max()), others, len(self.every)):
                return found
        return self.every[:0]

    def _beside_robust_fit(self, without: Integers) -> Array:
        """Return how far every row is from a fit to most of them, in noise; 0 for those that are left out.

        Least squares with weights that fall with the square of the error (Cauchy's), beside the middle one.
        """
        model, place = self.model, np.searchsorted(self.every, self.of_value)
        basis, value = orthonormal(model.tangent), np.ones(len(model.residual))
        value[: model.count] = ~np.isin(self.of_value, without)
        weight, error = np.ones(len(self.every)), np.zeros(len(self.every))
        for _ in range(ROUNDS):
            of_value = value.copy()
            of_value[: model.count] *= weight[place]
            weighed = basis.T * of_value
            left = model.residual - basis @ np.linalg.lstsq(weighed @ basis, weighed @ model.residual)[0]
            squares = (value * left**2)[: model.count]
            error = np.sqrt(np.bincount(place, squares, len(self.every)))
            middle = max(float(np.median(error)), 1.0)
            weight = 1.0 / (1.0 + (error / (CAUCHY * middle)) ** 2)
        return error

    def _of_others(self, without: Integers) -> tuple[Integers, Array]:
        """Return the rows but some, and how far each is from what all others say of it, in noise."""
        model = self.model.part(~np.isin(self.of_value, without))
        of_value = np.nonzero(model.used)[0]
        basis = orthonormal(model.tangent)
        left = model.residual - basis @ (basis.T @ model.residual)
        rows = np.unique(of_value)
        error = np.zeros(len(rows))
        for at, row in enumerate(rows.tolist()):
            out = np.flatnonzero(of_value == row)
            values, vectors = np.linalg.eigh(np.eye(len(out)) - basis[out] @ basis[out].T)
            told = values > ALONE
            error[at] = np.linalg.norm((vectors.T @ left[out])[told] / values[told])
        return rows, error

    def change(self, without: Integers) -> Array:
        """Return how the open parameters change (t,) by all rows but some."""
        kept = self.model.part(~np.isin(self.of_value, without))
        return np.asarray(inverse_of(kept.tangent) @ kept.residual)

    def _predicted(self, row: int, change: Array) -> Array:
        """Return the error of a row beside a change of the open parameters (t,), in noise."""
        own = np.flatnonzero(self.of_value == row)
        return np.asarray(self.model.residual[own] - self.model.tangent[own] @ change)

    def off(self, row: int, change: Array) -> Array:
        """Return how far a row reads from where such a change has it, (3,), m, along its table's axes."""
        own = np.flatnonzero(self.of_value == row)
        there = self.component[own] < 3
        component = self.component[own][there]
        result = np.zeros(3)
        result[component] = self._predicted(row, change)[there] * self.model.baseline.sigma[row, component]
        return np.asarray(self._turn(row) @ result)

    def _turn(self, row: int) -> Array:
        """Return the rotation (3, 3) from the frame of the model's rows into that of the table."""
        same_run = self.rows.run == self.rows.run[row]
        pairs = self.model.baseline.rows.position, self.rows.position
        whole = same_run & np.isfinite(pairs[0] + pairs[1]).all(axis=1)
        if self.model.problem is None or self.by_set_ups or whole.sum() < 3:
            return np.eye(3)
        return fit_rigid_motion(pairs[0][whole], pairs[1][whole]).rotation

    def said(self, row: int, change: Array) -> tuple[str, bool]:
        """Return where a row is and what went wrong, in words, and whether anything is said of that."""
        off = self.off(row, change)
        size = float(np.linalg.norm(off))
        place = f"{self.rows.place(row)} ({_in_mm(size)} mm off"
        if self.by_set_ups:
            return f"{place})", False
        if name := next(self._other_names(row, change, off), ""):
            return f"{place}: reads as {name}, not {self.rows.point[row]})", True
        read = self.rows.position[row] if self.rows.kind == "absolute" else self.rows.displacement[row, :3]
        for order in ((1, 0, 2), (2, 1, 0), (0, 2, 1)):
            if np.linalg.norm(off + read[list(order)] - read) * APART <= size:
                one, other = (axis for axis, place in zip("xyz", order, strict=True) if "xyz"[place] != axis)
                return f"{place}, {one} and {other} exchanged)", True
        axis = int(np.abs(off).argmax())
        if np.linalg.norm(np.delete(off, axis)) * APART <= size:
            name = f"{'d' * (self.rows.kind != 'absolute')}{'xyz'[axis]}"
            return f"{place}, along {name} alone)", True
        return f"{place})", False

    def _other_names(self, row: int, change: Array, off: Array) -> Iterator[str]:
        """Yield the points that a row reads as, by an error (3,) along the axes of its table."""
        names = [str(name) for name in np.unique(self.rows.point) if name != self.rows.point[row]]
        if self.model.problem is None or not names:
            return
        kinematics = compile_kinematics(self.model.robot(change))
        where = posture(kinematics, self.rows.q[row : row + 1])
        own = pose_of(kinematics, where, str(self.rows.point[row]))[0, :3, 3]
        for name in names:
            way = self._turn(row) @ (pose_of(kinematics, where, name)[0, :3, 3] - own)
            if np.linalg.norm(off - way) * APART <= np.linalg.norm(off):
                yield name

    def two_under_one_name(self) -> Iterator[str]:
        """Yield, in words, points whose rows read two places of their link, in turn."""
        if self.model.problem is None or self.by_set_ups:
            return
        kinematics = compile_kinematics(self.model.baseline.robot)
        where = posture(kinematics, self.rows.q)
        left = np.where(self.model.used, self.model.baseline.gap, np.nan)[:, :3, None]
        for name in np.unique(self.rows.point[self.every]).tolist():
            turn = pose_of(kinematics, where, name)[:, :3, :3]
            own = (turn.swapaxes(-1, -2) @ left)[:, :, 0][self.rows.point == name]
            own = own[np.isfinite(own).all(axis=1)]
            if not len(own):
                continue
            own = own - own.mean(axis=0)
            first = own @ np.linalg.svd(own, full_matrices=False)[2][0] > 0.0
            if min(first.sum(), (~first).sum()) < MANY * len(own):
                continue
            places = np.where(first[:, None], own[first].mean(axis=0), own[~first].mean(axis=0))
            way = float(np.linalg.norm(own[first].mean(axis=0) - own[~first].mean(axis=0)))
            within = float(np.sqrt(((own - places) ** 2).sum(axis=1).mean()))
            if way > max(NEAREST, APART * 2 * within):
                yield (
                    f"The {len(own)} rows of {name} read two places of its link, {_in_mm(way)} mm apart: "
                    "one name for two reflectors"
                )

    def doubt(self, rows: Integers, change: Array) -> str:
        """Return, in words, that some rows stand apart from all others."""
        off = {row: float(np.linalg.norm(self.off(row, change))) for row in rows.tolist()}
        places = [self.rows.place(row) for row in sorted(off, key=lambda row: -off[row])]
        return (
            f"{len(off)} of {len(self.every)} rows are {_in_mm(min(off.values()))} to "
            f"{_in_mm(max(off.values()))} mm from where all others have them: {listed(places, LISTED)}"
        )


def _in_mm(size: float) -> str:
    return np.format_float_positional(1e3 * size, precision=3, fractional=False, trim="-")
