"""An identification told to people: a table of stiffness with its uncertainty, and what the gap means."""

from __future__ import annotations

from math import sqrt

from rich.table import Table

from beamstiff.identify.result import Identification, Parameter
from beamstiff.measure.table import Measurements
from beamstiff.report.tables import number, table

# a residual this much above the noise is no chance any more, from a dozen rows on
BEYOND_NOISE = 1.5


def identification_table(found: Identification, title: str = "Identified stiffness") -> Table:
    """Return a table: value, standard deviation, and what cannot be bounded."""
    result = table(title, "parameter", "value", "std", "std/value", "unit", "")
    for column in (4, 5):
        result.columns[column].justify = "left"
    for item in found.parameters:
        result.add_row(item.name, *_cells(item))
    return result


def _cells(item: Parameter) -> tuple[str, ...]:
    if item.value is None or item.std is None:
        bound = "" if item.lower_bound is None else f": at least {number(item.lower_bound)} (95 %)"
        return "-", "-", "-", item.unit, f"not bounded from above by these data{bound}"
    note = "" if item.identifiable else "not identifiable"
    return number(item.value), number(item.std), f"{100 * item.std / item.value:.1f} %", item.unit, note


def identification_text(found: Identification, measured: Measurements) -> str:
    """Return the gap that remains, and how it compares with the stated noise."""
    gap = f"Gap that remains in position: RMS {1e3 * found.rms:.3f} mm over the {len(measured)} rows fitted"
    if found.rms_held_out is None:
        held_out = "; too few poses to leave some out and test on them."
    else:
        held_out = f", {1e3 * found.rms_held_out:.3f} mm on poses left out of the fit."
    return f"{gap}{held_out}\n{_against_noise(sqrt(found.chi_square), measured.sigma_position)}"


def _against_noise(ratio: float, sigma: float | None) -> str:
    if sigma is None:
        return "The table states no sigma_position: the uncertainty is estimated from the gap itself."
    noise = f"the stated noise ({1e3 * sigma:.3g} mm)"
    if ratio > BEYOND_NOISE:
        return (
            f"That is {ratio:.1f} times what {noise} would leave: the model lacks something. The standard "
            "deviations are widened by this factor; they do not cover what a wrong model does."
        )
    return f"That is {ratio:.2f} times what {noise} would leave: noise explains it."
