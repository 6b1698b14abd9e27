"""Measured torques of the drives: which readings can be used, with which sign, less what statics says."""

from dataclasses import dataclass

import numpy as np

from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

LEAST, MOST = 10, 200  # readings of a joint: fewer say nothing; of more some, evenly spread
FACTOR = 3.0  # times what statics says, from which a reading has another unit or is of the motor's side
FOLLOWS = 0.9  # correlation with what statics says, from which the sign of a joint's readings is sure
STILL = 1e-3  # of the largest torque, below which what a joint holds does not change


@dataclass(frozen=True)
class Readings:
    """M readings, each of a row (of N) and a joint (of A).

    `value`: what it reads more than `statics` (N, A), which weights and loads as stated make.
    """

    row: Integers
    joint: Integers
    value: Array
    statics: Array
    notes: tuple[str, ...]

    def of(self, columns: Array) -> Array:
        """Return the readings (M, ...) of columns (N, A, ...)."""
        return np.asarray(columns[self.row, self.joint])

    def rms(self, values: Array) -> Array:
        """Return the RMS (A,) of values (M,) at each joint; 0 where nothing is read."""
        count = np.bincount(self.joint, minlength=self.statics.shape[1])
        return np.asarray(np.sqrt(np.bincount(self.joint, values**2, len(count)) / np.maximum(count, 1)))


def readings_of(rows: Measurements, statics: Array) -> Readings:
    """Return the readings that can be used, and why others cannot."""
    used, alike, reasons = dict[int, Integers](), dict[int, tuple[float, float]](), dict[int, str]()
    largest = float(np.ptp(statics, axis=0).max())
    for at in np.flatnonzero(np.isfinite(rows.torque).any(axis=0)).tolist():
        some = np.flatnonzero(np.isfinite(rows.torque[:, at]))
        states = np.column_stack([rows.run, rows.q, rows.wrench, rows.torque[:, at]])[some]
        some = some[np.sort(np.unique(states, axis=0, return_index=True)[1])]  # what several points saw
        some = some[np.unique(np.linspace(0, len(some) - 1, MOST).astype(np.intp))]
        value, should = (one[some, at] - one[some, at].mean() for one in (rows.torque, statics))
        size, expected = float(np.linalg.norm(value)), float(np.linalg.norm(should))
        used[at] = some
        if len(some) < LEAST:
            reasons[at] = f"found {len(some)} readings at rest, expected {LEAST} or more"
        elif size <= 1e-9 * float(np.linalg.norm(rows.torque[some, at])):
            reasons[at] = "all readings are equal"
        elif expected <= STILL * largest * np.sqrt(len(some)):
            reasons[at] = (
                "weight and loads make it hold the same everywhere, so that its sign cannot be found"
            )
        else:
            alike[at] = float(value @ should / (size * expected)), size / expected
    sign = {at: np.sign(r) for at, (r, n) in alike.items() if abs(r) > FOLLOWS and 1 / FACTOR < n < FACTOR}
    common = set(sign.values())
    for at, (follows, ratio) in alike.items():
        if at not in sign and ratio < FACTOR and len(common) == 1:  # a balancer may carry most of it
            sign[at] = next(iter(common))
        elif at not in sign and abs(follows) > FOLLOWS:
            reasons[at] = (
                f"it changes {ratio:.2g} times as much as weight and loads make it: check its unit, and that "
                "a motor's own torque is taken times the gear ratio"
            )
        elif at not in sign:
            reasons[at] = (
                f"its sign cannot be found: correlation {follows:.2f} with what weight and loads make"
            )
    names, joints = rows.drive_columns[1], sorted(sign)
    row = np.concatenate([np.zeros(0, dtype=np.int64), *(used[at] for at in joints)])
    joint = np.repeat(np.array(joints, dtype=np.int64), [len(used[at]) for at in joints])
    turned = np.array([sign.get(at, 0.0) for at in range(len(names))])
    value = turned[joint] * rows.torque[row, joint] - statics[row, joint]
    notes = tuple(f"{names[at]} is not used: {why}" for at, why in reasons.items())
    return Readings(row, joint, value, statics, notes)
