"""`camera-scale`: distances that a camera reads are too long: focal length, or size of the tag."""

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.external import read_by_camera
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.camera import scale_column


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    every, axis = (np.nan_to_num(one) for one in (scale_column(baseline.rows), baseline.rows.direction))
    depth = np.zeros_like(every)
    depth[:, :3] = axis * (axis * every[:, :3]).sum(axis=1, keepdims=True)
    scale = (Quantity("scale", "1", 3e-3),)
    return [
        Shape("size of the tag", every[..., None], scale),
        Shape("focal length", depth[..., None], scale),  # across the axis it makes up for itself
    ]


EFFECT = Effect(
    name="camera-scale",
    family="measurement",
    meaning="The camera reads all distances too long: its focal length or the size of the tag is wrong.",
    components=read_by_camera,
    shapes=_shapes,
    separation="the same tag from near and from far; measure the printed tag",
    look_alikes=("hand-eye", "geometry-error"),
    sources="a printed tag is right to 0.1 to 0.5 %, engineering estimate",
    place="readings",
)
