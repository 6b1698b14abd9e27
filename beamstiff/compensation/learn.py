"""Learning from a measured run: process parameters from where the tool really went.

Gauss-Newton of ``measured - landed(commands; parameters)``, with what is expected of each parameter as its
prior (A. Tarantola, Inverse problem theory, 2005, section 3.2.3). The spread of the readings is what the
header of the run says, or what remains, whichever is larger: the machine's model is not exact either.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.compensation.follow import follow_path
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.path_correction import settled
from beamstiff.compensation.process.load import Process, Together
from beamstiff.compensation.process.parameters import Parameter, parameters_of, with_values
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.effects import EFFECTS, Shape
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import Integers
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array

STEP = 0.02  # of what is expected of a parameter
# of the same: a step after which the derivatives still hold, one that ends the search
NEAR, ITERATIONS, SETTLED = 0.2, 12, 1e-3
SEEN = 0.5  # of what was expected: as far as a parameter has to be narrowed to count as identifiable
LEAST_SIGMA = 1e-6  # m
PAYS = 1.2  # times what remains unexplained: a run that is no worse is left as it is
MOST_PARAMETERS = 3  # of a shape: a run is one path
WIDE = 3.0  # times its realistic size: what is expected of a parameter


@dataclass(frozen=True, eq=False)
class Run:
    """What a run of a path was sent and where its tool was seen; R of the N targets."""

    rows: Integers  # (R,): targets
    commands: Array  # (R, 4, 4), m: base frame, as the controller was sent
    measured: Array  # (R, 3), m: where the tool was, base frame
    wrench: Array | None = None  # (R, 6): loads that a cell read in it; None: those of the path


@dataclass(frozen=True)
class Fitted:
    """One parameter after the run."""

    name: str
    unit: str
    value: float
    std: float
    expected: float  # standard deviation before
    identifiable: bool


@dataclass(frozen=True, eq=False)
class Learned:
    """A process with the parameters that explain the runs best."""

    process: Process  # without the loads beside it
    machine: Machine  # with the effects that were added
    parameters: tuple[Fitted, ...]
    effects: tuple[AddedEffect, ...]  # that the library has for what was missing
    before: float  # m: RMS distance of the last run from its targets
    unexplained: float  # m: RMS distance of the runs from what the fitted model says of them
    pays: bool  # to correct once more: what can be explained is more than what cannot

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: parameters in SI, distances in mm."""
        return {
            "parameters": {
                one.name: {
                    "value": one.value,
                    "std": one.std,
                    "unit": one.unit,
                    "expected_std": one.expected,
                    "identifiable": one.identifiable,
                }
                for one in self.parameters
            },
            "effects": [one.model_dump(exclude_defaults=True) for one in self.effects],
            "rms_run_mm": 1e3 * self.before,
            "rms_unexplained_mm": 1e3 * self.unexplained,
            "pays": self.pays,
        }


def learn(
    machine: Machine,
    path: ToolPath,
    process: Process,
    runs: Sequence[Run],
    sigma: float | None = None,
    start: Array | None = None,
    effects: int = 0,
    beside: Process | None = None,
) -> Learned:
    """Return the process that explains measured runs of a path, base frame, and effects that it lacks.

    `sigma`: standard deviation of a measured coordinate, m; None: what remains says it. `start` (A,): a
    posture near the first target, as of `correct_path`. `effects`: how many of the library may be added to
    the real robot, one after the other, where they explain what the process leaves. `beside`: a load that
    acts too, and is known.
    """
    fitted = parameters_of(process)

    def load(values: Array) -> Process:
        own = with_values(process, fitted, values.tolist())
        return own if beside is None else Together((beside, own))

    if not fitted:
        raise BeamstiffError(
            f"{path.source}: the process has no parameters to learn, expected a beam, a table of forces, or "
            "loads measured in the run"
        )
    states = [_state(machine, path, run, start) for run in runs]
    added: list[AddedEffect] = []
    while True:
        fit = _fit(machine, load, [one for _, one in fitted], runs, states, sigma)
        if len(added) >= effects:
            break
        made = load(fit.values)
        at = [_settled(machine, state, made) for state in states]
        loads = [made.wrench(poses, state.path) for poses, state in zip(at, states, strict=True)]
        q = np.concatenate([state.q for state in states])
        targets = len(np.unique(np.concatenate([run.rows for run in runs])))
        state = q, np.concatenate(loads), np.concatenate(at)
        one = missing_effect(machine, *state, fit.residual, fit.jacobian, targets)
        if one is None:
            break
        added.append(one)
        real = machine.actual or machine.controller
        grown = real.model_copy(update={"effects": (*real.effects, one)})
        machine = replace(machine, actual=grown)
    last = runs[-1]
    before = _rms(last.measured - path.poses[last.rows, :3, 3])
    unexplained = _rms(fit.residual)
    return Learned(
        process=with_values(process, fitted, fit.values.tolist()),
        machine=machine,
        parameters=tuple(
            Fitted(one.name, one.unit, value, after, one.expected, after < SEEN * one.expected)
            for (_, one), value, after in zip(fitted, fit.values.tolist(), fit.std.tolist(), strict=True)
        ),
        effects=tuple(added),
        before=before,
        unexplained=unexplained,
        pays=before > PAYS * unexplained,
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    values: Array  # (c,)
    std: Array
    residual: Array  # (R, 3) of all runs
    jacobian: Array  # (R, 3, c): by what is expected of each parameter


def _fit(
    machine: Machine,
    load: Callable[[Array], Process],
    parameters: Sequence[Parameter],
    runs: Sequence[Run],
    states: Sequence[_State],
    sigma: float | None,
) -> _Fit:
    """Fit the parameters of a load by Gauss-Newton."""
    nominal = np.array([parameter.nominal for parameter in parameters])
    prior = np.array([parameter.expected for parameter in parameters])
    bounds = np.array([(parameter.least, parameter.most) for parameter in parameters]).T

    def off(values: Array) -> Array:
        made = load(values)
        return np.concatenate(
            [
                run.measured - _settled(machine, state, made)[:, :3, 3]
                for run, state in zip(runs, states, strict=True)
            ]
        )

    def derived() -> Array:
        """Return how what is predicted follows the parameters, (R, 3, c)."""
        columns = []
        for at, parameter in enumerate(parameters):
            stepped = values.copy()
            step = STEP * prior[at]
            stepped[at] += step if values[at] + step <= parameter.most else -step
            columns.append((residual - off(stepped)) / (stepped[at] - values[at]))
        return np.stack(columns, axis=-1)

    values = nominal.copy()
    residual = off(values)
    moved = np.full(len(values), np.inf)
    for _ in range(ITERATIONS):
        if moved.max() > NEAR:
            jacobian = derived() * prior
        spread = _spread(residual, sigma, len(values))
        weighted = jacobian.reshape(-1, len(values)) / spread
        information = weighted.T @ weighted + np.eye(len(values))
        gradient = weighted.T @ (residual.ravel() / spread) - (values - nominal) / prior
        new = np.clip(values + prior * np.linalg.solve(information, gradient), *bounds)
        moved = np.abs(new - values) / prior
        values, residual = new, off(new)
        if moved.max() < SETTLED:
            break
    std = prior * np.sqrt(np.diag(np.linalg.inv(information)))
    return _Fit(values, std, residual, jacobian)


@dataclass(frozen=True, eq=False)
class _State:
    path: ToolPath  # the targets of the run
    q: Array
    near: Array


def _state(machine: Machine, path: ToolPath, run: Run, start: Array | None) -> _State:
    """Return the joint values of a run's commands."""
    own = path.at(run.rows)
    found = follow_path(machine, replace(own, joints=None), run.commands, start)
    if found.reasons:
        row, reason = next(iter(found.reasons.items()))
        raise BeamstiffError(f"{path.place(int(run.rows[row]))}: the command that ran is {reason}")
    return _State(own if run.wrench is None else replace(own, wrench=run.wrench), found.q, run.commands)


def _settled(machine: Machine, state: _State, process: Process) -> Array:
    """Return where the model says the tool of a run was, (R, 4, 4)."""
    return settled(machine, state.q, lambda at: process.wrench(at, state.path), state.near)


def _spread(residual: Array, sigma: float | None, count: int) -> float:
    """Return the standard deviation of a coordinate: as stated, or what remains where that is more."""
    free = max(residual.size - count, 1)
    remains = float(np.sqrt((residual**2).sum() / free))
    return max(remains, sigma or 0.0, LEAST_SIGMA)


def _rms(vectors: Array) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


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
