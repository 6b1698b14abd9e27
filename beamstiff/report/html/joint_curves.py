"""The error of a joint over its angle, where a cause follows that."""

from collections.abc import Iterator, Mapping

import numpy as np

from beamstiff.diagnosis.decomposition.plain_data import parameters_of
from beamstiff.diagnosis.effects.angle_curve import EFFECT, angle_of, joint_error, longest_wave
from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.report.html.parts import Figure, axis, chart_layout, css, label, numbers, scatter
from beamstiff.report.html.places import BUTTONS
from beamstiff.se3 import Array

POINTS = 400  # of a curve


def joint_curves(result: Diagnosis) -> Iterator[Figure]:
    """Yield the fitted curve of every joint whose error follows its angle, with the angles that were read."""
    found = result.decomposition
    rows = result.baseline.rows
    for cause in () if found is None else found.causes:
        if cause.forms[0].effect != EFFECT.name:
            continue
        joint = str(cause.forms[0].component)
        wave = longest_wave(result.baseline, joint)
        what, unit, error = ("angle", "deg", "mrad") if wave is None else ("position", "mm", "mm")
        sizes = {name: value for name, _, value, *_ in parameters_of(cause)}
        read = np.unique(rows.q[:, rows.variables.index(joint)])
        hover = f"%{{y}} {error} at %{{x}} {unit}"
        along = np.linspace(read[0], read[-1], POINTS)
        curve = scatter(*_drawn(sizes, wave, along), "curve", hover, line={"color": css("blue"), "width": 2})
        marks = scatter(*_drawn(sizes, wave, read), f"{what}s that were read", hover, ("circle", "orange", 5))
        caption = (
            f"What {in_words([cause.key])} adds to the {what} that the controller reads; a mark at each "
            f"{what} that was read. Believe the curve at the marks; its single orders may stand in for one "
            "another."
        )
        x, y = axis(label(f"{joint}, {unit}")), axis(f"error of the joint, {error}")
        layout = chart_layout(320, BUTTONS, x, y, showlegend=False)
        yield Figure(f"curve-{joint}", f"Error of {joint} over its {what}", caption, [curve, marks], layout)


def _drawn(
    sizes: Mapping[str, float], wave: float | None, q: Array
) -> tuple[list[float | None], list[float | None]]:
    """Return values (n,) of a joint, deg or mm, and its errors there, mrad or mm; `wave`: of a slide."""
    shown = np.degrees(q) if wave is None else 1e3 * q
    return numbers(shown, 4), numbers(1e3 * joint_error(sizes, angle_of(q, wave)), 3)
