"""An identification told to people: a table of stiffness with its uncertainty, and what the gap means."""

from __future__ import annotations

from math import sqrt

from rich.table import Table

from beamstiff.errors import listed
from beamstiff.identify.result import Identification, Parameter
from beamstiff.measure.table import Measurements
from beamstiff.report.tables import number, table
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import stiffness_text

# a residual this much above the noise is no chance any more, from a dozen rows on
BEYOND_NOISE = 1.5


def identification_table(found: Identification, robot: Robot, title: str = "Identified stiffness") -> Table:
    """Return a table: value before, identified value with its standard deviation, or a lower bound.

    Parameters
    ----------
    found : Identification
    robot : Robot
        As it was before: the start.
    title : str
    """
    result = table(title, "parameter", "start", "identified", "std", "std/value", "unit")
    result.columns[-1].justify = "left"
    for item in found.parameters:
        start = stiffness_text(robot.parameter(item.name))
        shown = start if isinstance(start, str) else number(start)
        result.add_row(item.name, shown, *_cells(item), item.unit)
    return result


def _cells(item: Parameter) -> tuple[str, str, str]:
    if item.value is None or item.std is None:
        return "?" if item.lower_bound is None else f"> {number(item.lower_bound)}", "-", "-"
    return number(item.value), number(item.std), f"{100 * item.std / item.value:.1f} %"


def identification_text(found: Identification, measured: Measurements) -> str:
    """Return sentences: what is not bounded, the gap that remains, how it compares with the stated noise."""
    unbounded = [item.name for item in found.parameters if item.value is None]
    gap = f"Gap that remains in position: RMS {1e3 * found.rms:.3f} mm over the {len(measured)} rows fitted"
    if found.rms_held_out is None:
        held_out = "; too few poses to leave some out and test on them."
    else:
        held_out = f", {1e3 * found.rms_held_out:.3f} mm on poses left out of the fit."
    lines = [f"{gap}{held_out} {_against_noise(sqrt(found.chi_square), measured.sigma_position)}"]
    if unbounded:
        lines.insert(
            0,
            f"These data do not bound {listed(unbounded)} from above: rigid would fit nearly as well. "
            "> is the lower bound that holds with 97.5 %.",
        )
    return "\n".join(lines)


def _against_noise(ratio: float, sigma: float | None) -> str:
    if sigma is None:
        return "The table states no sigma_position: the uncertainty is estimated from the gap itself."
    noise = f"the stated noise ({1e3 * sigma:.3g} mm)"
    if ratio > BEYOND_NOISE:
        return (
            f"The fit leaves {ratio:.1f} times what {noise} would: the model lacks something. The standard "
            "deviations are widened by this factor; they do not cover what a wrong model does."
        )
    return f"The fit leaves {ratio:.2f} times what {noise} would: noise explains it."
