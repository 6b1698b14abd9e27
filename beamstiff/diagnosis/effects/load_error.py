"""`load-error`: the wrench that acts is not the one that was written down.

To first order the displacement is off by ``C dw``, C the compliance between tool and target, dw the error
of the wrench: a cable pulls askew (``theta x F``), or from another place than it was thought to, which is
another angle at another place of the tool, a cell has other gains by axis or side, reads forces
as moments, is not linear, has a tare, and the friction of a pulley adds to a rising load and takes from a
falling one.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, named, stated_scale
from beamstiff.diagnosis.effects.external import each_by_each, shift_alone, tool_axes, turn_alone
from beamstiff.diagnosis.effects.torque_laws import by_power
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
    force, size = wrench[:, :3], np.linalg.norm(wrench[:, :3], axis=1)
    base = np.broadcast_to(np.eye(3), axes.shape)

    def misread(error: Callable[[Array], Array]) -> Array:
        """Return the same errors (N, 3, c) of a force and of a moment (N, 3), (N, 6, c)."""
        return np.concatenate([error(force), error(wrench[:, 3:])], 1)

    def turned(frame: Array) -> Array:
        return misread(lambda acts: np.cross(frame, acts[:, :, None], axis=1))

    def scaled(frame: Array) -> Array:
        return misread(lambda acts: frame * np.einsum("nai,na->ni", frame, acts)[:, None])

    def by_side(frame: Array) -> Array:
        """Return another gain in push than in pull, by axis."""
        return shift_alone(frame * np.abs(np.einsum("nai,na->ni", frame, force))[:, None])

    def constant(frame: Array) -> Array:
        acts = np.linalg.norm(wrench, axis=1) > 0
        return shift_alone(frame * acts[:, None, None])

    way = np.divide(force, size[:, None], out=np.zeros_like(force), where=size[:, None] > 0)
    aside = shift_alone(size[:, None, None] * (base - way[:, :, None] * way[:, None, :]))
    where = nominal_pose(baseline.nominal, replace(baseline.rows, point=baseline.rows.load_point))[0]
    pulled = np.concatenate([aside, *(aside * part[:, None, None] for part in where.T)], -1)
    by_place = tuple(Quantity(f"aside_{a}_by_{b}", "rad/m", ANGLE) for b in "xyz" for a in "xyz")
    largest = _largest_force(baseline)
    share = size[:, None] / largest
    along = np.divide(wrench, share * largest, out=np.zeros_like(wrench), where=share > 0)
    # a cell reads each axis by each other, and forces as moments
    gains = tuple(Quantity(f"gain_tool_{a}{b}", "1", GAIN) for a in "xyz" for b in "xyz")
    levers = tuple(Quantity(f"moment_tool_{a}_by_{b}", "m", ROTATION_LENGTH) for a in "xyz" for b in "xyz")
    shares = (Quantity("gain", "1", GAIN), Quantity("tare_along_the_load", "N", TARE))
    bent = Quantity("nonlinearity_at_largest_load", "1", GAIN)
    direction = turned(base), named("direction", "rad", ANGLE)
    gain, gain_tool = (scaled(base), named("gain", "1", GAIN)), (scaled(axes), named("gain_tool", "1", GAIN))
    by_side_tool = by_side(axes), named("gain_tool_by_side", "1", GAIN)
    sided = "other gain in push than in pull"
    result = [
        Shape.of("direction", direction),
        Shape("direction in the tool", turned(axes), named("direction_tool", "rad", ANGLE)),
        Shape.of("gain by axis", gain),
        Shape.of("gain by axis of the tool", gain_tool),
        Shape.of("direction and gain", direction, gain),
        Shape("pulled from elsewhere", pulled, (*named("aside", "rad", ANGLE), *by_place), weight=0.5),
        Shape("cross-talk of the cell", misread(lambda acts: each_by_each(axes, acts)), gains),
        Shape("cross-talk of the cell into moments", turn_alone(each_by_each(axes, force)), levers),
        Shape.of(sided, gain, (by_side(base), named("gain_by_side", "1", GAIN)), weight=0.5),
        Shape.of(f"{sided}, axes of the tool", gain_tool, by_side_tool, weight=0.5),
        Shape("gain, and a share that does not grow", np.stack([wrench, along], -1), shares),
        Shape("nonlinear", (largest * along * by_power(share, 2.0))[..., None], (bent,)),
        Shape("tare", constant(base), named("tare", "N", TARE)),
        Shape("tare of the tool", constant(axes), named("tare_tool", "N", TARE)),
    ]
    branch = rising(baseline.fit)
    if baseline.stated is not None or ((branch > 0).any() and (branch < 0).any()):
        branch = rising(baseline)
        friction = Quantity("pulley_friction", "1", GAIN)
        result.append(Shape("pulley friction", (wrench * branch[:, None])[..., None], (friction,)))
    return [replace(one.displacing(baseline.response), prior_factor=SPREAD) for one in result]


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
    meaning="The load is not as stated, in size or direction (weight, sensor, cable, pulley); or the masses "
    "of the robot file, with which positions compare it, are off.",
    components=lambda baseline: [None] if np.abs(baseline.rows.wrench).any() or baseline.stated else [],
    shapes=_shapes,
    separation="check that the load acts where the robot file says (TCP, or column load_point), weigh it, "
    "and check the masses of the robot file: positions show only how loads compare with weights. Of a load "
    "that is pulled, hold a plumb line beside the cable and run a closed load cycle",
    look_alikes=("frame-misalignment", "tool-offset"),
    sources="0.5 to 5 deg, 1 to 10 %, engineering estimate",
    scales=_normalisation,
    place="load",
)
