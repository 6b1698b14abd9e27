"""How a drift goes over time, or temperature: what it adds to the readings, whatever its shape."""

import re
from collections.abc import Iterator

import numpy as np

from beamstiff.diagnosis.decomposition.forms import shift_of
from beamstiff.diagnosis.effects.external import clock
from beamstiff.diagnosis.held_out.score import parts_of
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.report.tables import Table, number, table
from beamstiff.se3 import Array

DRIFT, PARTS = "thermal-drift", 5


def drift_tables(result: Diagnosis) -> Iterator[Table]:
    """Yield the course of each drift that was found: its mean over each part of the campaign."""
    rows = result.baseline.rows
    timed = bool(np.isfinite(rows.time).all())
    along, unit = (rows.time, "s") if timed else (rows.temperature, "degC")
    order = clock(result.baseline) if timed else along  # each table starts its clock again
    parts = np.array_split(np.argsort(order, kind="stable"), min(PARTS, len(rows)))
    named = timed and len(rows.sources) > 1
    for shape, moved in _drifts(result):
        means = np.array([1e3 * moved[part, :3].mean(axis=0) for part in parts])
        if absolute := result.baseline.absolute:  # the base frame takes up what all rows have
            means -= means[0]
        what = "positions, against the first" if absolute else "displacements"
        how = re.sub(r"(within|lagging by) ([\d.]+)", r"\1 \2 of the campaign", shape)
        title = f"Course of {DRIFT} ({how}): what it adds to the {what}, mm, base frame"
        made = table(title, "from", "to", "x", "y", "z")
        for part, mean in zip(parts, means, strict=True):
            ends = (
                f"{f'{rows.sources[rows.run[at]]}: ' if named else ''}{number(float(along[at]))} {unit}"
                for at in (part[0], part[-1])
            )
            made.add_row(*ends, *(f"{value + 0.0:.3f}" for value in mean.tolist()))
        yield made


def _drifts(result: Diagnosis) -> Iterator[tuple[str, Array]]:
    """Yield the likeliest shape of each drift that was found, and what it adds to the rows, (N, 6)."""
    found = result.decomposition
    if found is not None:
        for cause in found.causes:
            if cause.forms[0].effect == DRIFT:
                yield cause.shape, shift_of(cause.forms, cause.theta, len(result.baseline.rows))
    elif result.fits:
        named = [one for one in (result.verdict, result.also) if one is not None and one.effect != "outliers"]
        for one, moved in zip(named, parts_of(result.linear, result.fits), strict=False):
            if one.effect == DRIFT:
                yield one.shape, moved
