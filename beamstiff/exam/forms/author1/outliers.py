"""A few bad rows."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality

SIZE = (1e-4, 3e-3)  # m


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the size of the errors, m, the share of bad rows and the seed that says which they are."""
    return {
        "size": request.sized(*SIZE),
        "share": request.uniform(0.01, 0.05),
        "seed": request.integer(0, 2**31),
    }


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with bad rows."""
    p = truth.parameters

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:  # noqa: ARG001
        rng = np.random.default_rng(int(p["seed"]))
        count = max(1, round(p["share"] * len(values)))
        rows = rng.choice(len(values), size=count, replace=False)
        values = values.copy()
        if truth.form == "spikes":  # one component each
            values[rows, rng.integers(3, size=count)] += p["size"] * rng.choice([-1.0, 1.0], size=count)
        else:  # the reflector was touched, or the beam broken
            jump = rng.standard_normal((count, 6)) * np.repeat([p["size"], 2.0 * p["size"]], 3) / np.sqrt(3.0)
            values[rows] += jump * rng.uniform(0.5, 1.5, size=(count, 1))
        return values

    return reality.with_reading(read)


EFFECT = Effect("outliers", ("spikes", "jumps"), nowhere, draw, impose)
