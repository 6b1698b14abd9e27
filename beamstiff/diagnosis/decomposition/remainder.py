"""What no cause explains: its size, what it follows and where it could come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.folds import unweighed
from beamstiff.diagnosis.decomposition.forms import Form, stacked
from beamstiff.diagnosis.decomposition.open_model import OpenModel, orthonormal
from beamstiff.diagnosis.effects.angle_curve import longest_wave, phase
from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.diagnosis.effects.external import clock, tool_axes
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

TOLD = 0.1  # share of the remainder from which something is said to be followed
ORDERS = 5  # of a joint's angle
POWERS = 4  # of the time, or of the order of the rows


@dataclass(frozen=True)
class Remainder:
    """What the causes leave.

    Attributes
    ----------
    rms : float, m
        Root mean square position error, noise included, of a fit that has as many parameters as it needs.
    share : float
        Of the explainable gap.
    follows : tuple of (str, float)
        What it follows, and the share of its variance, corrected for the number of parameters.
    where : tuple of (str, float)
        Joints, and the share of its variance that a slip about their axes could make.
    """

    rms: float
    share: float
    follows: tuple[tuple[str, float], ...]
    where: tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class _Left:
    """What a fit leaves of the residual, (n + p,), and a basis (n + p, k) of all that was fitted."""

    left: Array
    basis: Array


def remainder_of(
    model: OpenModel, chosen: Sequence[Form], theta: Array, noise2: float, total: float, rows: int
) -> Remainder:
    """Return what a fit (t + c,) leaves; `noise2`, `total` are squares, m^2, of noise and held-out gap."""
    matrix, right = stacked(model, chosen)
    step = _Left(right - matrix @ theta, orthonormal(matrix))
    left = step.left[: model.count]
    position = np.nonzero(model.used)[1] < 3
    error = unweighed(model, left)[position]
    # what is known beforehand takes up a part of the parameters, and none of what was measured
    free = max(model.count - float((step.basis[: model.count] ** 2).sum()), 1.0) / model.count
    squares = float(error @ error) / free
    share = max(squares - noise2, 0.0) / (total - noise2) if total > noise2 else 0.0
    follows, where = [], []
    if squares > 2.0 * noise2:
        follows = _most((name, _explained(model, step, columns)) for name, columns in _covariates(model))
        where = _most((name, _explained(model, step, columns)) for name, columns in _slips(model.baseline))
    return Remainder(float(np.sqrt(squares / rows)), float(min(share, 1.0)), tuple(follows), tuple(where))


def _most(shares: Iterator[tuple[str, float]]) -> list[tuple[str, float]]:
    found = [(name, share) for name, share in shares if share >= TOLD]
    return sorted(found, key=lambda item: -item[1])


def _explained(model: OpenModel, step: _Left, columns: Array) -> float:
    """Return the share of what is left that columns (N, 6, c) explain, corrected for their number."""
    seen = model.weighed(model.baseline.rows.along(columns))
    seen = np.concatenate([seen, np.zeros((len(step.left) - len(seen), seen.shape[1]))])
    own = orthonormal(seen, step.basis, 1e-3)
    k, n = own.shape[1], len(step.left) - step.basis.shape[1]
    if not k or n <= k + 1:
        return 0.0
    share = float(np.square(own.T @ step.left).sum()) / max(float(step.left @ step.left), 1e-300)
    return float(max(0.0, 1.0 - (1.0 - share) * (n - 1) / (n - k - 1)))


def _covariates(model: OpenModel) -> Iterator[tuple[str, Array]]:
    """Yield what a remainder could follow, as columns (N, 6, c)."""
    baseline, rows = model.baseline, model.baseline.rows
    for name, shift in _turns(baseline):
        if name in rows.variables:
            angle = phase(baseline, name)[:, None]
            waves = np.concatenate(
                [f(k * angle) for k in range(1, ORDERS + 1) for f in (np.sin, np.cos)], axis=1
            )
            slides = longest_wave(baseline, name) is not None
            yield f"{'position' if slides else 'angle'} of {name}", shift[:, :, None] * waves[:, None]
            yield (
                f"direction of approach of {name}",
                (shift * last_direction(rows, name)[:, None])[..., None],
            )
    still = np.zeros((len(rows), 6, 3))
    still[:, :3] = np.eye(3)
    turning = np.concatenate([tool_axes(baseline), np.zeros((len(rows), 3, 3))], axis=1)
    time = clock(baseline)
    drift = np.stack([time**power for power in range(1, POWERS + 1)], axis=1)
    when = "time" if np.isfinite(rows.time).all() else "order of the rows"
    yield when, np.concatenate([still * t[:, None, None] for t in drift.T], axis=-1)
    if np.abs(rows.wrench).any():
        load = rows.wrench / np.maximum(np.abs(rows.wrench).max(axis=0), 1e-300)
        acts = np.abs(load).max(axis=0) > 0
        yield "load", np.concatenate([still * one[:, None, None] for one in load[:, acts].T], axis=-1)
    points = list(dict.fromkeys(rows.point.tolist()))
    if len(points) > 1:
        marks = [(rows.point == name).astype(float)[:, None, None] for name in points]
        yield "reflector", np.concatenate([turning * mark for mark in marks], axis=-1)


def _slips(baseline: Baseline) -> Iterator[tuple[str, Array]]:
    """Yield for every joint what a slip about its axis could make, by its torque and its angle."""
    for name, shift in _turns(baseline):
        axis = axis_at(baseline, name)
        torque = (axis.load + (axis.dead if baseline.absolute else 0.0)) / axis.typical
        parts = [torque, torque * np.abs(torque), np.sign(torque)]
        variable = axis.joint.variable
        if axis.turns and variable is not None and baseline.absolute:
            angle = baseline.joint_values[variable]
            parts += [f(k * angle) for k in (1, 2, 3) for f in (np.sin, np.cos)]
        yield name, shift[:, :, None] * np.stack(parts, axis=1)[:, None]


def _turns(baseline: Baseline) -> Iterator[tuple[str, Array]]:
    robot = baseline.nominal
    for joint in robot.joints:
        name = component_of(robot, joint)
        yield name, axis_at(baseline, name).shift
