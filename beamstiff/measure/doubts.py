"""What in a table is allowed but hardly meant: degrees read as radians, millimetres as metres."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot

LARGE_DISPLACEMENT = 0.1  # m; a loaded robot gives way by millimetres
LARGE_ROTATION = 0.1  # rad
LARGE_SIGMA = (5e-3, 5e-3)  # m, rad; a tape measure
LARGE_FORCE = 1e6  # N, N m


def doubts(measurements: Measurements, robot: Robot) -> tuple[str, ...]:
    """Return, one sentence each, what in a table looks like a mistake of unit or frame; mostly nothing.

    These are no errors: a plain number is SI, and a strange machine may be measured. They are for people to
    read.
    """
    return tuple(_doubts(measurements, robot))


def _doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    for variable, q in zip(robot.actuated, table.q.T, strict=True):
        row = int(np.abs(q).argmax())
        if variable.kind == "angle" and abs(q[row]) > 4 * np.pi:
            yield (
                f"{table.place(row)}: {variable.name}: {q[row]:.6g} rad is more than two turns; if the "
                f"column is in degrees, write {variable.name} [deg]"
            )
        elif variable.limits is not None:
            low, high = variable.limits
            slack = 1e-6 * (high - low)
            outside = (q < low - slack) | (q > high + slack)
            if outside.any():
                row = int(outside.argmax())
                unit = "rad" if variable.kind == "angle" else "m"
                yield (
                    f"{table.place(row)}: {variable.name}: {q[row]:.6g} {unit} lies outside the limits "
                    f"{low:.6g} to {high:.6g} {unit} of robot {robot.name}"
                )
    if table.kind == "displacement":
        parts = (
            ("displacement", slice(0, 3), LARGE_DISPLACEMENT, "m", "dx [mm]"),
            ("rotation", slice(3, 6), LARGE_ROTATION, "rad", "rx [deg]"),
        )
        for what, part, limit, unit, header in parts:
            size = np.sqrt(np.nansum(table.displacement[:, part] ** 2, axis=1))
            row = int(size.argmax())
            if size[row] > limit:
                yield (
                    f"{table.place(row)}: a {what} of {size[row]:.3g} {unit} is large for a loaded "
                    f"robot; a column without a unit is in {unit}, write for instance {header}"
                )
    for key, sigma, limit, unit in (
        ("sigma_position", table.sigma_position, LARGE_SIGMA[0], "m"),
        ("sigma_rotation", table.sigma_rotation, LARGE_SIGMA[1], "rad"),
    ):
        if sigma is not None and sigma > limit:
            yield f"{table.source}: {key}: {sigma:.3g} {unit} is large; a number without a unit is in {unit}"
    load = np.abs(table.wrench).max(axis=1)
    row = int(load.argmax())
    if load[row] > LARGE_FORCE:
        yield f"{table.place(row)}: a load of {load[row]:.3g} N or N m is large for a robot"
