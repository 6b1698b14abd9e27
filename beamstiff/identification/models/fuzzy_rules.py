"""Conclusions of fuzzy compliance rules from displacements: linear, so by least squares.

With firing strengths alpha_r(q) and compliance terms b_rk of the rules, ``d = sum_r alpha_r sum_k T_k b_rk``,
T_k the displacement by each term under the row's load (seed 003, eqs 36 and 38): linear in the conclusions.
Rules that readings hardly reach follow their neighbours: differences between conclusions count a little.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy_inference import Partition
from beamstiff.se3 import Array

# weight of differences between conclusions, in readings of usual noise and load; data soon outweigh it
SMOOTH = 1e-4
LEAST = 1e-3  # share of the mean compliance below which no direction of a positive definite one may fall
STEPS, CLOSE = 20_000, 1e-10  # of the gradient's descent, and the share of the conclusions it ends at


@dataclass(frozen=True, eq=False)
class Readings:
    """What rules are fitted to: displacements as linear functions of compliance terms, K of them."""

    # (K, 2): measured component i and load direction j of each term, ``i <= j``: it stands for C_ji as well
    terms: NDArray[np.int64]
    gram: Array  # (N, K, K): ``T^T T`` of every row, T its whitened displacement by each term
    moment: Array  # (N, K): ``T^T d`` of the whitened displacement
    squares: Array  # (N,): ``d^T d``
    count: NDArray[np.int64]  # (N,): measured components of each row
    scale: Array  # (6, 6): unit of each term: with it compliances of forces and moments compare

    def rows(self, chosen: NDArray[np.bool_]) -> Self:
        """Return the readings of some rows."""
        return replace(
            self,
            gram=self.gram[chosen],
            moment=self.moment[chosen],
            squares=self.squares[chosen],
            count=self.count[chosen],
        )

    def term(self, at: int) -> Self:
        """Return the readings of one term, where the load of every row lies along one axis."""
        others = np.arange(len(self.terms)) != at
        if (np.abs(self.gram[:, at, others]) > 1e-9 * np.abs(self.gram[:, at, at, None])).any():
            raise BeamstiffError(
                "found rows with loads along several axes, expected one axis a row for a partition a term"
            )
        own = self.gram[:, at, at]
        squares = np.divide(self.moment[:, at] ** 2, own, out=np.zeros_like(own), where=own > 0)
        return replace(
            self,
            terms=self.terms[at : at + 1],
            gram=self.gram[:, at : at + 1, at : at + 1],
            moment=self.moment[:, at : at + 1],
            squares=squares,
            count=(own > 0).astype(np.int64),
        )

    def cost(self, firing: Array, conclusions: Array) -> float:
        """Return the mean square of the whitened residuals for conclusions (R, K)."""
        own = firing @ conclusions
        fitted = np.einsum("nk,nkl,nl->n", own, self.gram, own) - 2 * (own * self.moment).sum(axis=1)
        return max(float((fitted + self.squares).sum() / max(self.count.sum(), 1)), 0.0)

    def matrices(self, conclusions: Array) -> Array:
        """Return the compliance matrices (R, 6, 6) of conclusions (R, K), NaN for terms not fitted."""
        result = np.full((len(conclusions), 6, 6), np.nan)
        i, j = self.terms.T
        values = conclusions * self.scale[i, j]
        result[:, i, j] = result[:, j, i] = values
        return result


def build_readings(table: Measurements, length: float, tcp: str) -> Readings:
    """Return what a table says of compliance terms; the compliance is symmetric (Maxwell and Betti).

    `table`: displacements of the TCP under loads there. `length`, m: of the machine: makes moments compare
    with forces and rotations with displacements.
    """
    require_tcp(table, tcp, "a fuzzy compliance", "for a fuzzy compliance")
    used, whitened = _used(table, length)
    unit = np.array([1.0] * 3 + [length] * 3)
    loaded = (table.wrench != 0).any(axis=0)
    # of a pair that is felt both ways, or one way only, one term is left
    felt = ((i, j) for i in range(6) for j in range(6) if used[:, i].any() and loaded[j])
    terms = sorted({(min(i, j), max(i, j)) for i, j in felt})
    if not terms:
        raise BeamstiffError(f"{table.source}: found no loaded row with a measured displacement")
    force = float(np.linalg.norm(table.wrench / unit, axis=1).max())
    size = float(np.nanmax(np.abs(np.where(used, table.displacement, 0.0) * unit))) or 1.0
    scale = size / force / np.outer(unit, unit)
    slopes = np.zeros((len(table), 6, len(terms)))
    for at, (i, j) in enumerate(terms):
        slopes[:, i, at] += table.wrench[:, j] * scale[i, j]
        if i != j:
            slopes[:, j, at] += table.wrench[:, i] * scale[i, j]
    slopes *= whitened[:, :, None]
    seen = np.where(used, table.displacement, 0.0) * whitened
    return Readings(
        terms=np.array(terms, dtype=np.int64),
        gram=slopes.swapaxes(1, 2) @ slopes,
        moment=(slopes.swapaxes(1, 2) @ seen[..., None])[..., 0],
        squares=(seen**2).sum(axis=1),
        count=used.sum(axis=1),
        scale=scale,
    )


def require_tcp(table: Measurements, tcp: str, who: str, why: str) -> None:
    """Refuse rows that are not displacements of the TCP under loads there."""
    if table.kind != "displacement":
        raise BeamstiffError(
            f"{table.source}: holds absolute positions; {who} needs displacements dx dy dz (loaded minus "
            "unloaded)"
        )
    elsewhere = (table.point != tcp) | (table.load_point != tcp)
    if elsewhere.any():
        row = int(np.argmax(elsewhere))
        raise BeamstiffError(
            f"{table.place(row)}: measured at {str(table.point[row])!r} under a load at "
            f"{str(table.load_point[row])!r}, expected the TCP {tcp!r} {why}"
        )


def _used(table: Measurements, length: float) -> tuple[NDArray[np.bool_], Array]:
    """Return which components count, and their weights (N, 6): one over the noise, or over a guess of it."""
    guess = np.array([1e-5] * 3 + [1e-5 / length] * 3)
    used = table.measured_mask
    sigma = np.where(np.isfinite(table.sigma), table.sigma, guess)
    return used, np.where(used, 1.0 / sigma, 0.0)


def fit_conclusions(readings: Readings, premises: Partition, firing: Array, positive: bool = False) -> Array:
    """Return the conclusions (R, K) that explain the readings best, of rules that fire (N, R).

    `positive`: every rule's compliance is positive definite, hence that of every mean of them.
    """
    hessian, slope = _normal_equations(readings, premises, firing)
    found = np.asarray(np.linalg.solve(hessian, slope).reshape(firing.shape[1], -1), dtype=np.float64)
    if not positive or _definite(readings, found):
        return found
    return _descend(readings, hessian, slope, _made_definite(readings, found))


def _normal_equations(readings: Readings, premises: Partition, firing: Array) -> tuple[Array, Array]:
    rules, terms = firing.shape[1], readings.moment.shape[1]
    flat = readings.gram.reshape(len(firing), -1)
    blocks = np.stack([firing.T @ (strength[:, None] * flat) for strength in firing.T])
    hessian = blocks.reshape(rules, rules, terms, terms).swapaxes(1, 2)
    slope = (firing.T @ readings.moment).reshape(-1)
    smooth = premises.differences()
    each = np.diagonal(readings.gram.mean(axis=0))
    each = np.maximum(each, 1e-6 * each.max())
    both = SMOOTH * (smooth.T @ smooth) + 1e-9 * np.eye(rules)
    square = hessian.reshape(rules * terms, rules * terms)
    return square + np.kron(both, np.diag(each)), slope


def _descend(readings: Readings, hessian: Array, slope: Array, begin: Array) -> Array:
    """Accelerated gradient descent with restarts (Nesterov 1983; O'Donoghue and Candes 2015)."""
    # the metric in which `_made_definite` is a projection
    i, j = readings.terms.T
    size: Array = np.tile(np.where(i == j, 1.0, np.sqrt(0.5)), len(begin))
    scaled = size[:, None] * hessian * size
    step = 1.0 / float(np.linalg.eigvalsh(scaled)[-1])
    right, at = size * slope, begin.reshape(-1) / size
    ahead, momentum = at, 1.0
    for _ in range(STEPS):
        new = ahead - step * (scaled @ ahead - right)
        new = _made_definite(readings, (new * size).reshape(begin.shape)).reshape(-1) / size
        moved = new - at
        if (ahead - new) @ moved > 0:  # the momentum points uphill
            momentum = 1.0
        following = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum**2))
        ahead = new + (momentum - 1.0) / following * moved
        at, momentum = new, following
        if np.abs(moved).max() <= CLOSE * np.abs(at).max():
            break
    return np.asarray((at * size).reshape(begin.shape))


def _square(readings: Readings) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the directions that are felt by themselves, and the terms among these with their places."""
    i, j = readings.terms.T
    own = i[i == j]
    inside = np.flatnonzero(np.isin(i, own) & np.isin(j, own))
    places = np.searchsorted(own, readings.terms[inside])
    return own, inside, places


def _as_matrices(readings: Readings, conclusions: Array) -> tuple[Array, float]:
    """Return the square part of conclusions (R, K) in their own units, and the least eigenvalue allowed."""
    own, inside, places = _square(readings)
    result = np.zeros((len(conclusions), len(own), len(own)))
    result[:, places[:, 0], places[:, 1]] = conclusions[:, inside]
    result[:, places[:, 1], places[:, 0]] = conclusions[:, inside]
    mean = float(np.abs(np.diagonal(result, axis1=1, axis2=2)).mean()) if own.size else 0.0
    return result, LEAST * mean


def _definite(readings: Readings, conclusions: Array) -> bool:
    matrices, least = _as_matrices(readings, conclusions)
    return matrices.shape[1] == 0 or bool((np.linalg.eigvalsh(matrices)[:, 0] >= 0.5 * least).all())


def _made_definite(readings: Readings, conclusions: Array) -> Array:
    """Return the closest conclusions (R, K) with a positive definite square part, in the Frobenius norm."""
    matrices, least = _as_matrices(readings, conclusions)
    if matrices.shape[1] == 0:
        return conclusions
    values, vectors = np.linalg.eigh(matrices)
    lifted = (vectors * np.maximum(values, least)[:, None, :]) @ vectors.swapaxes(1, 2)
    _, inside, places = _square(readings)
    result = conclusions.copy()
    result[:, inside] = lifted[:, places[:, 0], places[:, 1]]
    return result
