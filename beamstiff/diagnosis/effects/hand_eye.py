"""`hand-eye`: the camera (or the tag that a fixed camera reads) sits elsewhere on the tool than described."""

from beamstiff.diagnosis.effects.effect import Effect, Shape, named
from beamstiff.diagnosis.effects.external import read_by_camera, shift_alone, tool_axes, turn_alone
from beamstiff.diagnosis.residual.baseline import Baseline


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axes = tool_axes(baseline) * bool(baseline.rows.camera)  # a tracker's reflector does not see it
    shift, turn = (
        (shift_alone(axes), named("shift", "m", 2e-3)),
        (turn_alone(axes), named("turn", "rad", 5e-3)),
    )
    return [
        Shape.of("shift and turn", shift, turn),
        Shape.of("shift", shift, weight=0.5),
        Shape.of("turn", turn, weight=0.5),
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
