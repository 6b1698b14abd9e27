"""Which effect of the library explains what a measured run and its fitted process leave, if any does."""

import numpy as np

from beamstiff.compensation.machine import Machine
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.effects import EFFECTS, Shape
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.errors import BeamstiffError
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array

MOST_PARAMETERS = 3  # of a shape: a run is one path
WIDE = 3.0  # times its realistic size: what is expected of a parameter


def missing_effect(
    machine: Machine, q: Array, wrench: Array, tip: Array, residual: Array, process: Array, targets: int
) -> AddedEffect | None:
    """Return the effect that explains a residual best beside the process, or None.

    `q` (R, A), `wrench` (R, 6), `tip` (R, 4, 4): as of `Machine.moved`. `residual` (R, 3), m. `process`
    (R, 3, c): how the tool moves with what is expected of each parameter of the process. `targets`: how many
    the rows are of. An effect has to win by the Bayesian information criterion, ``n log(S0/S1) - c log n``,
    against none and for having been chosen from many. n counts a target once, in however many runs: what the
    model misses there is the same in each.
    """
    rows = machine.rows(q, wrench, tip)
    bare = fit_baseline(machine.real.model_copy(update={"effects": ()}), rows, keep=())
    taken = {(one.effect, one.component) for one in machine.real.effects}
    y, count = residual.ravel(), 3 * targets
    beside = process.reshape(y.size, -1)
    none, _, _ = _explained(y, beside)
    best, score, candidates = None, 0.0, 0
    for name, component, shape in _shapes(bare):
        if (name, component) in taken:
            continue
        expected = WIDE * np.array([item.size for item in shape.parameters])
        columns = shape.columns[:, :3].reshape(y.size, -1) * expected
        candidates += 1
        rest, values, std = _explained(y, np.hstack([beside, columns]))
        own, sure = values[beside.shape[1] :] * expected, std[beside.shape[1] :] * expected
        if any(item.positive and value < 0 for item, value in zip(shape.parameters, own, strict=True)):
            continue
        gained = count * np.log(none / rest) - len(own) * np.log(count)
        if gained > score:
            best, score = added_effect(bare, name, component, [(shape, 1.0, own, sure)]), gained
    return best if candidates and score > 2 * np.log(candidates) + np.log(count) else None


def _shapes(bare: Baseline) -> list[tuple[str, str | None, Shape]]:
    """Return the simplest shapes of all effects that move the machine."""
    found = []
    for law in EFFECTS.values():
        if law.family == "measurement":
            continue
        for component in law.components(bare):
            try:
                shapes = law.shapes(bare, component)
            except BeamstiffError:  # these rows do not show it
                continue
            found += [
                (law.name, component, shape)
                for shape in shapes
                if len(shape.parameters) <= MOST_PARAMETERS
                and not shape.data_selected
                and not any(item.posture_specific for item in shape.parameters)
                and np.isfinite(shape.columns).all()
            ][:2]
    return found


def _explained(y: Array, columns: Array) -> tuple[float, Array, Array]:
    """Return the sum of squares that unit-size unknowns leave, these, and their standard deviations."""
    count = columns.shape[1]
    spread, rest = max(float(np.sqrt((y**2).mean())), 1e-12), 0.0
    values: Array = np.zeros(count)
    for _ in range(3):  # the residual's own size weighs the unit priors
        normal = columns.T @ columns / spread**2 + np.eye(count)
        values = np.asarray(np.linalg.solve(normal, columns.T @ y / spread**2))
        rest = float(((y - columns @ values) ** 2).sum() + spread**2 * (values**2).sum())
        spread = max(float(np.sqrt(rest / len(y))), 1e-12)
    return max(rest, 1e-30), values, np.sqrt(np.diag(np.linalg.inv(normal)))
