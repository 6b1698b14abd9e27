"""A compliant pedestal or floor under the machine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, slender
from beamstiff.exam.pedestal import on_pedestal, seen_from_foot
from beamstiff.exam.reality import Reality

TILT = (8e-9, 2.5e-7)  # rad/(N m)


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the compliance about x, rad/(N m), and the shape of the base."""
    found = {"tilt": request.sized(*TILT) * slender(request.robot)}
    if request.form == "block":
        return found | {
            "about_y": request.uniform(0.4, 1.2),
            "about_z": request.uniform(0.1, 0.6),
            "shift": request.uniform(0.1, 0.5),  # m: of the translations, as a lever
            "x": request.uniform(-0.2, 0.2),
            "y": request.uniform(-0.2, 0.2),
            "z": request.uniform(-0.6, 0.0),
        }
    return (
        found
        | {f"bolt{i}": request.uniform(0.3, 1.0) for i in range(4)}
        | {"span": request.uniform(0.5, 0.9), "across": request.uniform(0.3, 0.8)}
    )


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft base."""
    p = truth.parameters
    K = _block(p) if truth.form == "block" else _bolts(p)
    return reality.with_machine(on_pedestal(reality.machine, K))


def _block(p: Mapping[str, float]) -> Array:
    """Springs at an elastic centre beside the machine's foot."""
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    along = p["tilt"] * p["shift"] ** 2 * np.array([1.0, 0.8, 0.5])
    k = np.concatenate([1.0 / along, 1.0 / about])
    return seen_from_foot(np.array([p["x"], p["y"], p["z"]]), np.diag(k))


def _bolts(p: Mapping[str, float]) -> Array:
    """Four bolted feet, none as stiff as the other."""
    half = 0.5 * p["span"]
    corners = half * np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    shares = np.array([p[f"bolt{i}"] for i in range(4)])
    k = 1.0 / (p["tilt"] * np.sum(shares * corners[:, 1] ** 2))
    feet = [
        seen_from_foot(corner, np.diag(k * share * np.array([p["across"], p["across"], 1.0, 0.0, 0.0, 0.0])))
        for corner, share in zip(corners, shares, strict=True)
    ]
    return np.asarray(np.sum(feet, axis=0))


EFFECT = Effect("base-compliance", ("block", "bolts"), nowhere, draw, impose)
