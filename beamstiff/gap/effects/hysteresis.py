"""`hysteresis`: friction in the drive: the answer depends on the load history.

Stop operators (Prandtl and Ishlinskii; Iwan, J. Appl. Mech. 33 (1966) 893): friction r holds the drive until
the torque has moved on by r, so that a part ``S_r`` of the torque, between -r and r, does not wind it up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, drive_compliance, drives, torque_scale, unit_of
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array

LIMITS = (0.04, 0.1, 0.2, 0.4, 0.8)  # friction over the largest torque


def held_torque(
    torque: Array,
    start: Array,
    fresh: NDArray[np.bool_],
    order: NDArray[np.intp],
    limit: float,
    wound: bool = False,
    arrived: float = 0.0,
) -> Array:
    """Return S_r (N,): the torque that friction holds, stepping through the rows in their order.

    Parameters
    ----------
    torque : (N,) array
    start : (N,) array
        Torque of the unloaded machine, from which a pose begins.
    fresh : (N,) bool array
        Whether a row is the first of its history.
    order : (N,) int array
    limit : float
        Friction r.
    wound : bool
        Whether the dead weight has wound the drive up against its friction when a history begins: what is
        held is then counted from there.
    arrived : float
        Share of the friction, -1 to 1, that is left from the way to the pose.

    Examples
    --------
    >>> cycle = np.array([1.0, 2.0, 1.0, 0.0])
    >>> held_torque(cycle, np.zeros(4), np.array([True, False, False, False]), np.arange(4), 0.5)
    array([ 0.5,  0.5, -0.5, -0.5])
    """
    result = [0.0] * len(torque)
    loads, unloaded, new = (
        torque.tolist(),
        start.tolist(),
        fresh.tolist(),
    )  # plain numbers are faster in a loop
    held = before = first = 0.0
    for row in order.tolist():
        if new[row]:
            before = unloaded[row]
            held = first = max(-limit, min(limit, before)) if wound else arrived * limit
        held = max(-limit, min(limit, held + loads[row] - before))
        before = loads[row]
        result[row] = held - first
    return np.array(result)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    rows = baseline.rows
    order = history_order(rows)
    fresh = np.zeros(len(rows), dtype=np.bool_)
    groups = rows.run if rows.continuous else rows.pose
    seen: set[int] = set()
    for row in order.tolist():
        fresh[row] = int(groups[row]) not in seen
        seen.add(int(groups[row]))
    largest, unit = axis.typical, unit_of(axis)
    give = drive_compliance(axis) * largest
    lag = Quantity("held_windup", unit, give)
    several = tuple(Quantity(f"held_windup_{limit:g}", unit, 0.5 * give) for limit in LIMITS)
    result = []
    for wound, start in ((False, ""), (True, ", wound up by the weight")):
        columns = []
        for limit in LIMITS:
            torque = axis.load + axis.dead
            held = held_torque(torque, axis.dead, fresh, order, limit * largest, wound) / largest
            columns.append(-axis.shift * held[:, None])
        result += [
            Shape(f"friction {limit:g}{start}", column[..., None], (lag,), spread=4.0)
            for limit, column in zip(LIMITS, columns, strict=True)
        ]
        result.append(Shape(f"distributed friction{start}", np.stack(columns, -1), several, spread=4.0))
    torque = axis.load + axis.dead
    every, names = [], []
    for limit in LIMITS:
        ways = [
            held_torque(torque, axis.dead, fresh, order, limit * largest, arrived=way) for way in (1.0, -1.0)
        ]
        columns = [-axis.shift * (held / largest)[:, None] for held in ways]
        both = tuple(Quantity(f"held_windup_from_{side}", unit, 0.7 * give) for side in ("above", "below"))
        result.append(
            Shape(f"friction {limit:g}, left from the move", np.stack(columns, -1), both, spread=4.0)
        )
        every += columns
        names += [replace(one, name=f"{one.name}_{limit:g}", size=0.5 * one.size) for one in both]
    result.append(
        Shape("distributed friction, left from the move", np.stack(every, -1), tuple(names), spread=4.0)
    )
    return result


EFFECT = Effect(
    name="hysteresis",
    family="drive",
    meaning="Friction in the drive makes the answer depend on the load history.",
    components=drives,
    shapes=_shapes,
    separation="a closed load cycle with a return to zero load",
    look_alikes=("load-error", "backlash"),
    sources="below 1 to 3 arcmin (Harmonic Drive CHA)",
    scales=torque_scale,
)
