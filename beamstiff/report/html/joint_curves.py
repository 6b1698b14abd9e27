"""The error of a joint over its angle, where a cause follows that."""

from collections.abc import Iterator

import numpy as np

from beamstiff.diagnosis.decomposition.causes import Cause
from beamstiff.diagnosis.decomposition.plain import parameters_of
from beamstiff.diagnosis.effects.angle_curve import EFFECT, joint_error
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
        read = np.unique(rows.q[:, rows.variables.index(joint)])
        along = np.linspace(read[0], read[-1], POINTS)
        hover = "%{y} mrad at %{x} deg"
        curve = scatter(*_drawn(cause, along), "curve", hover, line={"color": css("blue"), "width": 2})
        marks = scatter(*_drawn(cause, read), "angles that were read", hover, ("circle", "orange", 5))
        caption = (
            f"What {in_words([cause.key])} adds to the angle that the controller reads; a mark at each angle "
            "that was read. Believe the curve there; its single orders may stand in for one another."
        )
        x, y = axis(label(f"{joint}, deg")), axis("error of the joint, mrad")
        layout = chart_layout(320, BUTTONS, x, y, showlegend=False)
        yield Figure(f"curve-{joint}", f"Error of {joint} over its angle", caption, [curve, marks], layout)


def _drawn(cause: Cause, q: Array) -> tuple[list[float | None], list[float | None]]:
    """Return angles (n,), deg, and the errors there, mrad."""
    sizes = {name: value for name, _, value, *_ in parameters_of(cause)}
    return numbers(np.degrees(q), 4), numbers(1e3 * joint_error(sizes, q), 3)
