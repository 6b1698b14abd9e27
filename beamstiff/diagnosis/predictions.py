"""What the model says of rows, without the causes and with them, and as the rows measure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamstiff.diagnosis.decomposition.solution import gap_with
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.torque_laws import DIRECTIONS
from beamstiff.diagnosis.held_out.score import shift
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

if TYPE_CHECKING:
    import pandas as pd

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


def residuals(result: Diagnosis) -> pd.DataFrame:
    """Return the rows and what the model leaves of them: see `Diagnosis.to_frame`."""
    baseline, rows = result.baseline, result.baseline.rows
    without, beside = predictions(result)
    left = {"": baseline.measured - without}
    if beside is not None:
        left["_with_causes"] = baseline.measured - beside
    columns = {
        f"residual_{axis}{behind}": np.where(baseline.used[:, at], values[:, at], np.nan)
        for behind, values in left.items()
        for at, axis in enumerate(DIRECTIONS)
        if baseline.used[:, at].any()
    }
    table = rows.to_frame()
    return table.dropna(axis="columns", how="all").assign(**columns)


def as_measured(baseline: Baseline, deviation: Array) -> Array:
    """Return deviations (N, 6) as the rows measure: for absolute ones, position and rotation vector."""
    if not baseline.absolute:
        return deviation
    positions, rotations = baseline.described
    turned = vector_from_rotation(rotation_from_vector(deviation[:, 3:]) @ rotations)
    return np.concatenate([positions + deviation[:, :3], turned], axis=1)


def columns_at(baseline: Baseline, hypothesis: Any) -> Array:
    """Return a hypothesis' columns (N, 6, c) at a baseline's rows.

    Raises BeamstiffError when its shape does not exist there, as that of a closed loop which a changed
    geometry opens.
    """
    name = hypothesis.shape.name
    shapes = EFFECTS[hypothesis.effect].shapes(baseline, hypothesis.component)
    found = next((shape.columns for shape in shapes if shape.name == name), None)
    if found is None:
        raise BeamstiffError(f"{hypothesis.key}: its shape {name!r} does not exist in these rows")
    return found
