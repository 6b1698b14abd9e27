"""`approach-direction`: a joint's error follows the direction in which it last moved, whatever its torque.

The joint stops short by half of its lost motion: ``dq = h sign(last motion)``, the play operator for motions
larger than the play. The last motion follows from the order of the poses; before the first it is
unknown, and counts as none.

Without a component: all joints at once, each by a lost motion of its own. Where all drives have some, each by
itself may show too little.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.rows import history_order
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

SIZE = 2e-4  # rad or m
LEAST = 1e-6  # rad or m: smaller changes of a reading are no motion


def last_direction(rows: Measurements, variable: str) -> Array:
    """Return the direction in which a joint last moved before each row, (N,): 1, -1, or 0 before any motion.

    Rows follow one another by time, else as they stand in the table; a table says nothing of how its first
    posture was reached.
    """
    at = rows.variables.index(variable)
    if rows.approached is not None:
        return rows.approached[:, at]
    order = history_order(rows)
    result = np.zeros(len(rows))
    for run in np.unique(rows.run):
        own = order[rows.run[order] == run]
        result[own] = approach_of(rows.q[own, at][:, None])[:, 0]
    return result


def approach_of(q: Array) -> Array:
    """Return the directions in which joints last moved, (N, A), from their values (N, A) in order."""
    motion = np.diff(q, axis=0, prepend=q[:1])
    way = np.where(np.abs(motion) > LEAST, np.sign(motion), 0.0)
    latest = np.maximum.accumulate(np.where(way != 0.0, np.arange(len(q))[:, None], 0), axis=0)
    return np.take_along_axis(way, latest, axis=0)


def without_unknown(
    rows: Measurements, components: Collection[str | None]
) -> tuple[Measurements, NDArray[np.bool_]]:
    """Return rows without readings where nobody knows from which side joints came, and which these are, (N,).

    Their joint values stay: they say how others were approached. `components`: joints that stop short; None:
    all, of which the first posture is left out.
    """
    unknown = {name: last_direction(rows, name) == 0.0 for name in rows.variables}
    if None in components:
        left_out = np.all(list(unknown.values()), axis=0)
    else:
        left_out = np.any([unknown[name] for name in components if name in unknown], axis=0)
    left_out = np.broadcast_to(left_out, len(rows))
    position, rotation = (np.where(left_out[:, None], np.nan, one) for one in (rows.position, rows.rotation))
    return replace(rows, position=position, rotation=rotation), left_out


def _reversed(baseline: Baseline) -> list[str]:
    return [
        item.name
        for item in baseline.nominal.actuated
        # a robot that has the effect has it in whatever order of poses
        if baseline.stated is not None or len(np.unique(last_direction(baseline.fit.rows, item.name))) > 1
    ]


def _components(baseline: Baseline) -> list[str | None]:
    found = _reversed(baseline) if baseline.absolute else []
    return [*found, *([None] if len(found) > 1 else [])]


def _of(baseline: Baseline, name: str, parameter: str) -> Term:
    kind = next(item.kind for item in baseline.nominal.actuated if item.name == name)
    half = Quantity(parameter, "rad" if kind == "angle" else "m", SIZE)
    return pose_change(baseline, name) * last_direction(baseline.rows, name)[:, None], (half,)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    if component is not None:
        one = _of(baseline, component, "half_lost_motion")
        return [Shape.of("direction of the last motion", one, prior_factor=30.0)]
    every = [_of(baseline, name, f"half_lost_motion_{name}") for name in _reversed(baseline)]
    return [Shape.of("all joints, direction of the last motion", *every, prior_factor=30.0)]


EFFECT = Effect(
    name="approach-direction",
    family="drive",
    meaning="The error of a joint follows the direction in which it last moved, whatever its torque.",
    components=_components,
    shapes=_shapes,
    separation="approach the same pose from either side, several times, each such joint by itself",
    look_alikes=("hysteresis", "backlash"),
    sources="public sets: IRB 120, 0.5 mrad to either side; Stäubli TX2-90L, 0.01 to 0.1 mrad at all joints",
    place="drives",
)
