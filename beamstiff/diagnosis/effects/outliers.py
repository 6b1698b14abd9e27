"""`outliers`: a few rows are wrong, no physical effect. `residual/outlier_screening.py` finds them."""

from beamstiff.diagnosis.effects.effect import Effect

EFFECT = Effect(
    name="outliers",
    family="measurement",
    meaning="A few rows are wrong: a typing error, a target that was hit, a laser beam that was interrupted.",
    components=lambda baseline: [None],
    shapes=lambda baseline, component: [],
    separation="measure these rows again",
    look_alikes=("thermal-drift", "hysteresis"),
    sources="engineering estimate",
)
