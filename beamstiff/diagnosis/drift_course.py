"""The course of a drift that was found: what it adds to the readings over time, or over the temperature."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.decomposition.forms import shift_of
from beamstiff.diagnosis.effects.external import clock
from beamstiff.diagnosis.held_out.score import parts_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

if TYPE_CHECKING:
    from beamstiff.diagnosis.result import Diagnosis

DRIFT, PARTS = "thermal-drift", 5


@dataclass(frozen=True, eq=False)
class DriftCourse:
    """What a drift adds to the readings, part by part of a campaign; p parts.

    Attributes
    ----------
    shape : str
        The fitted form, in words.
    unit : str
        Of what the parts are ordered by: ``s`` or ``degC``.
    absolute : bool
        Whether positions were read: their course is told against the first part, whose mean the base frame
        takes up.
    ends : (p, 2) array of int
        First and last row of each part.
    at : (N,) array
        Time or temperature of every row.
    means : (p, 3) array
        Means, m, along the axes of the base frame.
    """

    shape: str
    unit: str
    absolute: bool
    ends: NDArray[np.intp]
    at: Array
    means: Array

    @property
    def travel(self) -> float:
        """The largest distance between the means of two parts, m."""
        return float(np.linalg.norm(self.means[:, None] - self.means, axis=-1).max())

    def to_list(self) -> list[dict[str, Any]]:
        """Return a row for each part, for the diagnosis's JSON."""
        return [
            {"from": float(self.at[a]), "to": float(self.at[b]), "unit": self.unit, "mean_mm": mean}
            for (a, b), mean in zip(self.ends.tolist(), (1e3 * self.means).tolist(), strict=True)
        ]


def course_of(baseline: Baseline, shape: str, moved: Array, parts: int = PARTS) -> DriftCourse:
    """Return the course of a drift that adds `moved` (N, 6) to the rows, in so many parts at most."""
    rows = baseline.rows
    timed = bool(np.isfinite(rows.time).all())
    at, unit = (rows.time, "s") if timed else (rows.temperature, "degC")
    order = clock(baseline) if timed else at  # each table starts its clock again
    split = np.array_split(np.argsort(order, kind="stable"), min(parts, len(rows)))
    means = np.array([moved[part, :3].mean(axis=0) for part in split])
    if baseline.absolute:
        means -= means[0]
    ends = np.array([[part[0], part[-1]] for part in split])
    return DriftCourse(shape, unit, baseline.absolute, ends, at, means)


def drift_courses(result: Diagnosis, parts: int = PARTS) -> Iterator[DriftCourse]:
    """Yield the course of each drift among the causes of a diagnosis, in their order."""
    baseline, found = result.baseline, result.decomposition
    if found is not None:
        for cause in found.causes:
            if cause.forms[0].effect == DRIFT:
                moved = shift_of(cause.forms, cause.theta, len(baseline.rows))
                yield course_of(baseline, cause.shape, moved, parts)
    elif result.fits:
        named = [one for one in (result.verdict, result.also) if one is not None and one.effect != "outliers"]
        for one, moved in zip(named, parts_of(result.linear, result.fits), strict=False):
            if one.effect == DRIFT:
                yield course_of(baseline, one.shape, moved, parts)
