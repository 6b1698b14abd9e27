"""`outliers`: a few rows are wrong, no physical effect. `residual/screening.py` finds them."""

from __future__ import annotations

from beamstiff.diagnosis.effects.effect import Effect

EFFECT = Effect(
    name="outliers",
    family="measurement",
    meaning="A few rows are wrong: a slip of the pen, a target that was hit, a beam that was cut.",
    components=lambda baseline: [None],
    shapes=lambda baseline, component: [],
    separation="measure the rows named again",
    look_alikes=("thermal-drift", "hysteresis"),
    sources="engineering estimate",
)
