"""`hand-eye`: the camera (or the tag that a fixed camera reads) sits elsewhere on the tool than described."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.external import read_by_camera, tool_axes
from beamstiff.diagnosis.residual.baseline import Baseline


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axes = tool_axes(baseline) * bool(baseline.rows.camera)  # a tracker's reflector does not see it
    shift, turn = (np.concatenate(parts, 1) for parts in ((axes, 0 * axes), (0 * axes, axes)))
    shifts = tuple(Quantity(f"shift_{axis}", "m", 2e-3) for axis in "xyz")
    turns = tuple(Quantity(f"turn_{axis}", "rad", 5e-3) for axis in "xyz")
    return [
        Shape("shift and turn", np.concatenate([shift, turn], -1), (*shifts, *turns)),
        Shape("shift", shift, shifts, weight=0.5),
        Shape("turn", turn, turns, weight=0.5),
    ]


EFFECT = Effect(
    name="hand-eye",
    family="measurement",
    meaning="The camera, or the tag that a fixed camera reads, sits elsewhere on the tool than described.",
    components=read_by_camera,
    shapes=_shapes,
    separation="postures that turn the tool about every axis, from near and from far",
    look_alikes=("geometry-error", "camera-scale"),
    sources="2 mm and 0.3 deg, engineering estimate",
    place="tool",
)
