"""What the model says of the rows that were diagnosed, without the causes and with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamstiff.diagnosis.decomposition.solution import gap_with
from beamstiff.diagnosis.held_out.score import shift
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.diagnosis.result import Diagnosis


def predictions(result: Diagnosis) -> tuple[Array, Array | None]:
    """Return what the model says without and with the causes, (N, 6) each; None where there are none."""
    found, baseline = result.decomposition, result.baseline
    if found is not None:
        forms = [form for cause in found.every for form in cause.forms]
        without, beside = (baseline.measured - gap_with(found.model, some) for some in ((), forms))
        return without, beside if forms else None
    if not result.fits:
        return baseline.predicted, None
    columns = [[one.hypothesis.shape.columns for one in fit.shapes] for fit in result.fits]
    return baseline.predicted, result.linear.predicted + shift(result.linear, result.fits, columns)
