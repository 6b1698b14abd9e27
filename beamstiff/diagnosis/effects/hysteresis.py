"""`hysteresis`: friction in the drive: the answer depends on the load history.

Stop operators (Prandtl and Ishlinskii; Iwan, J. Appl. Mech. 33 (1966) 893): friction r holds the drive until
the torque has moved on by r, so that a part ``S_r`` of the torque, between -r and r, does not wind it up.
Teeth and screws rub the more the more they carry: r is then ``r_0 + mu |torque|``. What is held may creep and
be let go with the time, ``S' = -S / tau``.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, Term, stated_scale
from beamstiff.diagnosis.effects.torque_laws import (
    Axis,
    axis_at,
    by_slips,
    drive_compliance,
    drives_and_rigid_ones,
    torque_scale,
    unit_of,
)
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.arrays import places_of_each
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array

# how a history begins: its name, shares of the friction that may be left from the way to the pose, and
# whether the dead weight acts after that
BEGINNINGS = (
    ("", (0.0,), False),
    (", wound up by the weight", (0.0,), True),
    (", left from the move", (1.0, -1.0), False),
    (", left from the move, then wound up by the weight", (1.0, 0.5, -0.5, -1.0), True),
)
# the same where the readings say which way the joint came, and all of its friction is left from there
LAST_MOTION = (", left from the last motion", (1.0,), False)
LET_GO = ", let go with the time"
FEW = 2  # ways to begin, beyond which distributed friction could be anything that remembers
LIMITS = (0.04, 0.1, 0.2, 0.4, 0.8)  # friction over the largest torque
STEADY = tuple((one, 0.0) for one in LIMITS)
# the same where it grows: without torque, and by which share of the torque
GROWING = ((0.0, 0.05), (0.05, 0.1, 0.2, 0.4, 0.8))


def held_torque(
    torque: Array,
    start: Array,
    fresh: NDArray[np.bool_],
    order: NDArray[np.intp],
    limit: ArrayLike,
    *,
    grows: ArrayLike = 0.0,
    wound: bool = False,
    arrived: ArrayLike = 0.0,
    whole: bool = False,
    kept: Array | None = None,
    came: Array | None = None,
) -> Array:
    """Return S_r (N, ...): the torque that friction holds, stepping through the rows in their order.

    `torque`: (N,) array.
    `start`: (N,) array; torque of the unloaded machine, from which a pose begins.
    `fresh`: (N,) bool array; whether a row is the first of its history.
    `order`: (N,) int array.
    `limit`: float or array; friction r, that without torque if it grows; of several at once, as `grows` and
        `arrived`, broadcast.
    `grows`: float or array; by which share of the torque it grows.
    `wound`: whether the dead weight winds the drive up against its friction when a history begins.
    `arrived`: float or array; share of the friction, -1 to 1, that is left from the way to the pose.
    `whole`: whether what is held when a history begins counts too, as where positions are absolute;
        displacements are counted from there.
    `kept`: (N,) array; share of what is held that is still held when a row is read, since the row before; all
        by default.
    `came`: (N,) array; direction in which the joint came to the pose, which `arrived` is multiplied by.

    >>> cycle = np.array([1.0, 2.0, 1.0, 0.0])
    >>> held_torque(cycle, np.zeros(4), np.array([True, False, False, False]), np.arange(4), 0.5)
    array([ 0.5,  0.5, -0.5, -0.5])
    """
    limit, grows, arrived = np.broadcast_arrays(limit, grows, arrived)
    each = (-1, *(1,) * limit.ndim)
    most = limit + grows * np.abs(torque).reshape(each)
    unwound = limit + grows * np.abs(start).reshape(each)
    begun = arrived * (limit if wound else unwound)
    if came is not None:
        begun = begun * came.reshape(each)
    if wound:
        begun = np.clip(begun + start.reshape(each), -unwound, unwound)
    begun = np.broadcast_to(begun, most.shape)
    result = np.zeros(most.shape)
    still = np.ones(len(torque)) if kept is None else kept
    held, before, first = np.zeros(limit.shape), 0.0, np.zeros(limit.shape)
    for row in order.tolist():
        if fresh[row]:
            held, before = begun[row], start[row]
            first = np.zeros(limit.shape) if whole else held
        held = np.minimum(np.maximum(still[row] * held + (torque[row] - before), -most[row]), most[row])
        before = torque[row]
        result[row] = held - first
    return result


def held_shares(
    baseline: Baseline,
    axis: Axis,
    ways: Sequence[float],
    wound: bool,
    limits: Sequence[tuple[float, float]] = STEADY,
    kept: Array | None = None,
    came: Array | None = None,
) -> Array:
    """Return what friction holds, over the largest torque, (N, limits, ways); see `BEGINNINGS`.

    The limits are friction without torque over the largest, and by which share of the torque it grows;
    `kept` is what is still held from row to row, (N,), `came` the direction in which the joint came, (N,).
    Nothing where no torque acts: friction that never slips is the zero of an encoder.
    """
    if not (np.abs(axis.load) + np.abs(axis.dead)).any():
        return np.zeros((len(baseline.rows), len(limits), len(ways)))
    order, fresh = history(baseline)
    least, by = np.array(limits).T[:, :, None]  # (limits, 1) each
    held = held_torque(
        axis.load + axis.dead,
        axis.dead,
        fresh,
        order,
        least * axis.typical,
        grows=by,
        wound=wound,
        arrived=np.array(ways),
        whole=baseline.absolute,
        kept=kept,
        came=came,
    )
    return held / axis.typical


def history(
    baseline: Baseline, some: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the order in which the rows were loaded, and which of them (N,) begin a history.

    `some`: (N,) bool array; rows that have a history of their own; else all.
    """
    rows = baseline.rows
    order = history_order(rows)
    if some is not None:
        order = order[some[order]]
    fresh = np.zeros(len(rows), dtype=np.bool_)
    groups = rows.run if rows.continuous else rows.pose
    seen: set[int] = set()
    for row in order.tolist():
        fresh[row] = int(groups[row]) not in seen
        seen.add(int(groups[row]))
    return order, fresh


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    give, growing = drive_compliance(axis) * axis.typical, tuple(product(*GROWING))
    kept = _kept(baseline)
    result = []
    came = _came(baseline, axis)
    for begin, ways, wound in (*BEGINNINGS, *([] if came is None else [LAST_MOTION])):
        way = came if begin == LAST_MOTION[0] else None
        size = give if len(ways) == 1 else 0.7 * give
        lags = [Quantity(_name(one), unit_of(axis), size, positive=True) for one in ways]

        def every(limits: Sequence[tuple[float, float]], then: str = "", of: Array | None = None) -> Term:
            held = held_shares(baseline, axis, ways, wound, limits, of, way)  # noqa: B023 (called in this turn)
            return by_slips(-axis.shift, held.reshape(len(held), -1)), tuple(
                replace(one, name=f"{one.name}_{_limit(limit)}{then}", size=0.5 * one.size)
                for limit in limits
                for one in lags  # noqa: B023 (called in this turn)
            )

        steady = every(STEADY)
        for at, limit in enumerate(LIMITS):
            one = steady[0][:, :, at * len(ways) : (at + 1) * len(ways)]
            result.append(Shape(f"friction {limit:g}{begin}", one, tuple(lags), prior_factor=4.0))
        if len(ways) > FEW:
            continue
        kinds = {"distributed friction": (STEADY, steady, 1.0)}
        kinds["friction that grows with the torque"] = (growing, every(growing), 0.5)
        for kind, (limits, term, weight) in kinds.items():
            result.append(Shape.of(f"{kind}{begin}", term, prior_factor=4.0, weight=weight))
            if kept is not None and len(ways) == 1:
                name, let_go = f"{kind}{begin}{LET_GO}", every(limits, "_let_go", kept)
                result.append(Shape.of(name, term, let_go, prior_factor=4.0, weight=0.5 * weight))
    return [one if one.name.endswith(LET_GO) else replace(one, against=("torque",)) for one in result]


def _came(baseline: Baseline, axis: Axis) -> Array | None:
    """Return the direction in which the joint came to each row, (N,); None: not known, or always the same."""
    name = axis.joint.variable
    if not baseline.absolute or name not in baseline.rows.variables:
        return None
    came = last_direction(baseline.rows, name)
    return came if baseline.stated is not None or len(np.unique(came)) > 1 else None


def _limit(limit: tuple[float, float]) -> str:
    least, by = limit
    return f"{least:g}_and_{by:g}" if by else f"{least:g}"


def _kept(baseline: Baseline) -> Array | None:
    """Return the share (N,) of what friction held a row before that it still holds; None if nobody can know.

    Rows without times, of a machine that is known to let go, let go of nothing.
    """
    lasts = _lasts(baseline)
    if lasts is None:
        return None
    result = np.ones(len(baseline.rows))
    if np.isfinite(baseline.rows.time).all():
        order, fresh = history(baseline)
        waited = np.maximum(np.diff(baseline.rows.time[order]), 0.0)
        result[order[1:]] = np.exp(-waited / lasts)
        result[fresh] = 1.0
    return result


def _lasts(baseline: Baseline) -> float | None:
    """Return the time by which friction lets go, s: as stated, or as long as a history usually takes."""
    if baseline.stated is not None:
        return stated_scale(baseline, "lasts") or 1.0
    fit = baseline.fit.rows
    if not np.isfinite(fit.time).all():
        return None
    groups = fit.run if fit.continuous else fit.pose
    taken = np.array([np.ptp(fit.time[at]) for at in places_of_each(groups)])
    return float(np.median(taken[taken > 0])) if (taken > 0).any() else None


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    lasts = _lasts(baseline)
    return torque_scale(baseline, component) | ({} if lasts is None else {"lasts": lasts})


def _name(way: float) -> str:
    if way == 0.0:
        return "held_windup"
    return f"held_windup_from_{'above' if way > 0.0 else 'below'}" + ("" if abs(way) == 1.0 else "_half")


EFFECT = Effect(
    name="hysteresis",
    family="drive",
    meaning="Friction in the drive makes the displacement depend on the load history.",
    components=drives_and_rigid_ones,
    shapes=_shapes,
    separation="load and unload step by step, and return to zero load",
    look_alikes=("load-error", "backlash"),
    sources="below 1 to 3 arcmin (Harmonic Drive CHA)",
    scales=_normalisation,
)
