"""`load-error`: the wrench that acts is not the one that was written down.

To first order the displacement is off by ``C dw``, C the compliance between tool and target, dw the error
of the wrench: a cable pulls askew (``theta x F``), or from another place than it was thought to, which is
another angle at another place of the tool, a cell has other gains by axis or side, reads forces
as moments, is not linear, has a tare, and the friction of a pulley adds to a rising load and takes from a
falling one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, stated_scale
from beamstiff.diagnosis.effects.external import each_by_each, tool_axes
from beamstiff.diagnosis.residual.baseline import Baseline, nominal_pose
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array

ANGLE = 0.03  # rad
GAIN = 0.03
TARE = 10.0  # N
ROTATION_LENGTH = 0.01  # m, of a moment that a cell reads of a force
SAME = 1e-9  # of a load, within which it stays
SPREAD = 4.0  # cells and cables are no better and no worse than the sources say by more than this


def _largest_force(baseline: Baseline) -> float:
    force = np.linalg.norm(baseline.fit.rows.wrench[:, :3], axis=1)
    return stated_scale(baseline, "force") or float(force.max(initial=0.0)) or 1.0


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    return {"force": _largest_force(baseline)}


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    wrench, axes = baseline.rows.wrench, tool_axes(baseline)
    largest = _largest_force(baseline)
    base = np.broadcast_to(np.eye(3), axes.shape)

    def moved(error: Array) -> Array:
        """Return what errors (N, 6, c) of the wrench displace."""
        result: Array = baseline.response @ error
        return result

    def turned(frame: Array) -> Array:
        return moved(
            np.concatenate([np.cross(frame, wrench[:, s, None], axis=1) for s in (slice(3), slice(3, 6))], 1)
        )

    def scaled(frame: Array) -> Array:
        parts = []
        for s in (slice(3), slice(3, 6)):
            own = np.einsum("nai,na->ni", frame, wrench[:, s])
            parts.append(frame * own[:, None, :])
        return moved(np.concatenate(parts, 1))

    def mixed(frame: Array) -> Array:
        """Return what a cell in some axes (N, 3, 3) misreads, each axis by each other: nine gains."""
        parts = [each_by_each(frame, wrench[:, s]) for s in (slice(3), slice(3, 6))]
        return moved(np.concatenate(parts, 1))

    def into_moments(frame: Array) -> Array:
        """Return what a cell reads of forces as moments, each axis by each: nine levers."""
        moment = each_by_each(frame, wrench[:, :3])
        return moved(np.concatenate([np.zeros_like(moment), moment], 1))

    def by_side(frame: Array) -> Array:
        """Return what another gain in push than in pull displaces, by axis."""
        own = np.abs(np.einsum("nai,na->ni", frame, wrench[:, :3]))
        return moved(np.concatenate([frame * own[:, None, :], np.zeros_like(frame)], 1))

    def constant(frame: Array) -> Array:
        acts = np.linalg.norm(wrench, axis=1) > 0
        return moved(np.concatenate([frame * acts[:, None, None], np.zeros_like(frame)], 1))

    force = np.linalg.norm(wrench[:, :3], axis=1)
    way = np.divide(wrench[:, :3], force[:, None], out=np.zeros_like(wrench[:, :3]), where=force[:, None] > 0)
    across = force[:, None, None] * (base - way[:, :, None] * way[:, None, :])
    aside = moved(np.concatenate([across, np.zeros_like(across)], 1))
    where = nominal_pose(baseline.nominal, replace(baseline.rows, point=baseline.rows.load_point))[0]
    pulled = np.concatenate([aside, *(aside * part[:, None, None] for part in where.T)], -1)
    askew = tuple(Quantity(f"aside_{a}", "rad", ANGLE) for a in "xyz")
    by_place = tuple(Quantity(f"aside_{a}_by_{b}", "rad/m", ANGLE) for b in "xyz" for a in "xyz")

    def named(what: str, unit: str, size: float, axis: str = "xyz") -> tuple[Quantity, ...]:
        return tuple(Quantity(f"{what}_{name}", unit, size) for name in axis)

    size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True) / largest
    along = np.divide(wrench, size * largest, out=np.zeros_like(wrench), where=size > 0)
    tare = (wrench, along)
    levers = tuple(Quantity(f"moment_tool_{a}_by_{b}", "m", ROTATION_LENGTH) for a in "xyz" for b in "xyz")
    bent = Quantity("nonlinearity_at_largest_load", "1", GAIN)
    result = [
        Shape("direction", turned(base), named("direction", "rad", ANGLE)),
        Shape("direction in the tool", turned(axes), named("direction_tool", "rad", ANGLE)),
        Shape("gain by axis", scaled(base), named("gain", "1", GAIN)),
        Shape("gain by axis of the tool", scaled(axes), named("gain_tool", "1", GAIN)),
        Shape(
            "direction and gain",
            np.concatenate([turned(base), scaled(base)], -1),
            (*named("direction", "rad", ANGLE), *named("gain", "1", GAIN)),
        ),
        Shape("pulled from elsewhere", pulled, (*askew, *by_place), weight=0.5),
        Shape(
            "cross-talk of the cell",
            mixed(axes),
            tuple(Quantity(f"gain_tool_{a}{b}", "1", GAIN) for a in "xyz" for b in "xyz"),
        ),
        Shape("cross-talk of the cell into moments", into_moments(axes), levers),
        Shape(
            "other gain in push than in pull",
            np.concatenate([scaled(base), by_side(base)], -1),
            (*named("gain", "1", GAIN), *named("gain_by_side", "1", GAIN)),
            weight=0.5,
        ),
        Shape(
            "other gain in push than in pull, axes of the tool",
            np.concatenate([scaled(axes), by_side(axes)], -1),
            (*named("gain_tool", "1", GAIN), *named("gain_tool_by_side", "1", GAIN)),
            weight=0.5,
        ),
        Shape(
            "gain, and a share that does not grow",
            moved(np.stack(tare, -1)),
            (Quantity("gain", "1", GAIN), Quantity("tare_along_the_load", "N", TARE)),
        ),
        Shape("nonlinear", moved((wrench * size)[..., None]), (bent,)),
        Shape("tare", constant(base), named("tare", "N", TARE)),
        Shape("tare of the tool", constant(axes), named("tare_tool", "N", TARE)),
    ]
    branch = rising(baseline.fit)
    if baseline.stated is not None or ((branch > 0).any() and (branch < 0).any()):
        branch = rising(baseline)
        friction = Quantity("pulley_friction", "1", GAIN)
        result.append(Shape("pulley friction", moved((wrench * branch[:, None])[..., None]), (friction,)))
    return [replace(one, prior_factor=SPREAD) for one in result]


def rising(baseline: Baseline) -> Array:
    """Return 1 where the load grew to reach a row, -1 where it fell, (N,); 0 where the rows have no steps.

    Where it stayed, for another reading or another reflector, it is as it was.
    """
    rows = baseline.rows
    result = np.zeros(len(rows))
    if not np.isfinite(rows.step).all():
        return result
    groups = rows.run if rows.continuous else rows.pose
    before: dict[int, tuple[Array, float]] = {}  # wrench and way of the row before
    for row in history_order(rows).tolist():
        wrench = rows.wrench[row]
        last, way = before.get(int(groups[row]), (np.zeros(6), 1.0))
        load, loaded = float(np.linalg.norm(wrench)), float(np.linalg.norm(last))
        if np.abs(wrench - last).max() > SAME * max(load, loaded):
            way = 1.0 if load >= loaded else -1.0
        result[row] = way
        before[int(groups[row])] = wrench, way
    return result


EFFECT = Effect(
    name="load-error",
    family="measurement",
    meaning="The load's magnitude or direction is misread: sensor gain, cable angle, pulley friction.",
    components=lambda baseline: [None] if np.abs(baseline.rows.wrench).any() or baseline.stated else [],
    shapes=_shapes,
    separation="check first that the load acts where the robot file says (TCP, or column load_point): a load "
    "that acts elsewhere looks like this; then hold a plumb line beside the cable; put a load cell at the "
    "tool; run a closed load cycle",
    look_alikes=("frame-misalignment", "tool-offset"),
    sources="0.5 to 5 deg, 1 to 10 %, engineering estimate",
    scales=_normalisation,
    place="load",
)
