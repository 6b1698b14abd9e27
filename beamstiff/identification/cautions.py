"""What is amiss with the rows of an identification as a whole: conflicting units, one pose, no noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.parameters import SPAN, Parameters
from beamstiff.identification.problem import Problem
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

# between the files of one machine; poses and directions of load alone do not differ by as much
CONTRADICTION = 300.0  # times; millimetres read as metres make 1000
AT_BOUND = 1e-6  # of the logarithm
NO_RESIDUAL = 1e-9  # of the displacements, below which a residual is rounding


def check_units(table: Measurements, size: float) -> None:
    """Refuse files whose displacements, rotations or noise contradict each other by hundreds of times.

    `table`: rows of several files. `size`, m: of the machine: moments compare with forces by it.
    """
    if len(table.sources) < 2:
        return
    load = np.hypot(
        np.linalg.norm(table.wrench[:, :3], axis=1), np.linalg.norm(table.wrench[:, 3:], axis=1) / size
    )
    moved, turned = (
        np.linalg.norm(np.nan_to_num(table.displacement[:, part]), axis=1)
        for part in (slice(0, 3), slice(3, 6))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        quantities = (
            ("displacement over load", "m/N", moved / load, "dx [mm], fx [kN]"),
            ("rotation over load", "rad/N", turned / load, "rx [deg], fx [kN]"),
            (
                "noise of positions",
                "m",
                np.nanmin(_known(table.sigma[:, :3]), axis=1),
                "sigma_position: 0.03 mm",
            ),
            (
                "noise of rotations",
                "rad",
                np.nanmin(_known(table.sigma[:, 3:]), axis=1),
                "sigma_rotation: 0.01 deg",
            ),
        )
    for what, unit, values, header in quantities:
        medians = []
        for number in range(len(table.sources)):
            own = values[(table.run == number) & np.isfinite(values) & (values > 0)]
            medians.append(float(np.median(own)) if own.size else np.nan)
        if np.isfinite(medians).sum() < 2:
            continue
        least, most = int(np.nanargmin(medians)), int(np.nanargmax(medians))
        ratio = medians[most] / medians[least]
        if ratio > CONTRADICTION:
            raise BeamstiffError(
                f"{table.sources[most]} and {table.sources[least]}: conflicting units? {what} is "
                f"{medians[most]:.2g} {unit} in the first and {medians[least]:.2g} {unit} in the second, "
                f"{ratio:.0f} times less, expected of one machine; a number without a unit is SI, write for "
                f"instance {header}"
            )


def _known(sigma: Array) -> Array:
    """Return standard deviations with infinity where none is known."""
    return np.where(np.isfinite(sigma), sigma, np.inf)


def cautions(problem: Problem, parameters: Parameters, theta: Array, rms: float) -> Iterator[str]:
    """Yield, in sentences, what limits the result of an identification.

    `theta` (t,): the optimum. `rms`, m: of the position residual.
    """
    poses, rows = np.unique(problem.pose).size, len(problem.pose)
    if poses == 1 and rows > 1:
        yield f"all {rows} rows are of one pose: how the model does at others is not known"
    for ends, what in ((parameters.lower, "least"), (parameters.upper, "largest")):
        for at in np.flatnonzero(np.abs(theta - ends) < AT_BOUND):
            leader = parameters.first[at]
            if abs(theta[at] - np.log(parameters.start[leader])) < np.log(SPAN) * 0.999:  # the user's
                name = parameters.names[leader]
                value = float(np.exp(theta[at]))
                yield f"{name} lies at the {what} value allowed, {value:.4g}: the data ask for another"
    size = float(np.abs(problem.measured[:, :3]).max(initial=0.0))
    if not problem.sigma_known and rms <= NO_RESIDUAL * size:
        yield (
            "no noise is stated and no residual is left: the standard deviations say nothing; state "
            "sigma_position in the table"
        )
