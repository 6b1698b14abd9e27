"""`identify`: stiffness values from measured displacements, how sure they are, and what cannot be known."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.identify.degeneracy import Degeneracy, Mixed, find_degeneracy
from beamstiff.identify.information import Uncertainty, stiffness_interval, uncertainty
from beamstiff.identify.minimise import Effort, Progress, minimise
from beamstiff.identify.objective import LOSSES, Loss, Objective
from beamstiff.identify.parameters import Parameters, state_parameters
from beamstiff.identify.problem import Components, state_problem
from beamstiff.identify.relations import Joined
from beamstiff.identify.result import Combination, Identification, Parameter
from beamstiff.identify.validation import held_out_rms, position_rms
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness import parameter_unit
from beamstiff.se3 import Array


def identify(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    method: str = "trust-region",
    *,
    fixed: Sequence[str] = (),
    ties: Sequence[Sequence[str]] = (),
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: Loss = "linear",
    components: Components = "both",
    folds: int = 5,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify stiffness values from measured displacements.

    Parameters
    ----------
    robot : Robot
        Its present stiffness values are the start; all that is not among the parameters stays as it is.
    measurements : Measurements, or several
        Displacements, loaded minus unloaded.
    parameters : sequence of str, optional
        Stiffness values to identify: a joint's ``"J12.torsional"``, a strut ``"screw2"``, a beam's modulus
        ``"arm.E"``; default ``robot.identify``.
    method : str
        One of `minimise.METHODS`: "trust-region" (default), "levenberg-marquardt", "linear" (in compliances),
        "slsqp", "mma", "lbfgs", "bobyqa"; and the global "isres", "crs2", "esch", "mlsl", "genetic".
    fixed : sequence of str
        Parameters that stay as they are in the robot.
    ties : sequence of sequences of str
        Parameters that keep the ratio of their starts.
    bounds : mapping of str to (low, high), optional
        SI; None for no bound.
    priors : mapping of str to (value, factor), optional
        Known beforehand: value, and the factor by which one standard deviation is off.
    loss : "linear", "soft_l1", "huber" or "cauchy"
        How residuals count: squared, or less where they are beyond two standard deviations.
    components : "position", "rotation" or "both"
        Which readings count; each by its noise.
    folds : int
        Folds of the held-out errors; 0 for none.
    effort : Effort, optional
        Limits, seed and population of the method.
    progress : callable, optional
        Called with the number of evaluations and the least cost.

    Returns
    -------
    Identification

    Raises
    ------
    BeamstiffError
        When the data cannot carry the identification; the message says what is missing.

    Examples
    --------
    >>> from beamstiff import load_robot, tcp_compliance
    >>> from beamstiff.measure import make_measurements
    >>> robot = load_robot("kr240-2")
    >>> names = [variable.name for variable in robot.actuated]
    >>> poses = np.random.default_rng(0).uniform(-1, 1, (8, 6))
    >>> loads = np.tile([300.0, 400.0, -500.0, 0, 0, 0], (8, 1))
    >>> from beamstiff.model.linear import predict_displacements
    >>> table = make_measurements(names, poses, tcp=robot.tcp, wrench=loads, sigma_position=3e-5)
    >>> seen = predict_displacements(robot, table)
    >>> seen[:, 3:] = np.nan
    >>> table = make_measurements(
    ...     names, poses, tcp=robot.tcp, wrench=loads, displacement=seen, sigma_position=3e-5
    ... )
    >>> start = robot.with_parameters({"J2.torsional": 2 * robot.parameter("J2.torsional")})
    >>> found = identify(start, table)
    >>> round(found["J2.torsional"].value / robot.parameter("J2.torsional"), 6)
    1.0
    """
    if loss not in LOSSES:
        raise BeamstiffError(f"there is no loss {loss!r}; known: {listed(LOSSES)}")
    problem = state_problem(robot, measurements, _free_names(robot, parameters, fixed), components)
    names = problem.model.parameters
    degeneracy = find_degeneracy(problem)
    plan = _plan(degeneracy, ties, priors or {})
    if len(plan.silent) == len(names):
        raise BeamstiffError(f"{problem.source}: {'; '.join(plan.silent.values())}")
    stated = state_parameters(names, problem.model.start, plan.ties, bounds, priors, plan.held)
    objective = Objective(problem, stated, loss)
    found = minimise(objective, method, effort=effort, progress=progress)
    stiffness = stated.stiffness(found.theta)
    spread = uncertainty(objective, found.theta)
    by_pose = by_load = None
    if not found.interrupted:
        by_pose = held_out_rms(objective, problem.pose, folds, found.theta)
        by_load = held_out_rms(objective, problem.load, folds, found.theta)
    combinations = tuple(
        combination
        for group in plan.groups
        for combination in _combinations(robot, group, stated, stiffness, spread)
    )
    covariance = stated.sums @ spread.covariance @ stated.sums.T
    lost = [at for at, name in enumerate(names) if name in plan.grouped or name in plan.held]
    covariance[lost, lost] = np.inf
    return Identification(
        parameters=tuple(
            _parameter(name, parameter_unit(robot, name), value, variance, spread, plan, combinations)
            for name, value, variance in zip(
                names, stiffness.tolist(), np.diagonal(covariance).tolist(), strict=True
            )
        ),
        degenerate=combinations,
        covariance=covariance,
        stiffness=stiffness,
        robot=robot.with_parameters(dict(zip(names, stiffness.tolist(), strict=True))),
        rms=position_rms(problem, stiffness),
        rms_held_out=by_pose,
        rms_held_out_load=by_load,
        chi_square=spread.chi_square,
        method=method,
        evaluations=found.evaluations,
        message=found.message,
        interrupted=found.interrupted,
        predicted=problem.model.predict(stiffness),
        notes=(*problem.notes, *plan.silent.values()),
    )


@dataclass(frozen=True)
class _Plan:
    """What is fitted: by name, which parameters stay, which move together, which only groups are known of."""

    silent: dict[str, str]
    groups: tuple[Joined | Mixed, ...]
    ties: tuple[Sequence[str], ...]
    held: frozenset[str]

    @property
    def grouped(self) -> frozenset[str]:
        return frozenset(name for group in self.groups for name in group.members)


def _plan(found: Degeneracy, ties: Sequence[Sequence[str]], priors: Collection[str]) -> _Plan:
    silent = {item.name: item.reason for item in found.silent if item.name not in priors}

    def apart(group: Joined | Mixed) -> bool:
        """Whether what the user knows tells the members of a group apart."""
        one = any(set(group.members) <= set(tie) for tie in ties)
        return one or sum(name in priors for name in group.members) >= len(group.members) - 1

    every: list[Joined | Mixed] = [*found.joined, *found.mixed]
    groups = tuple(group for group in every if not apart(group))
    tied = {name for tie in ties for name in tie}
    own = [group.members for group in groups if isinstance(group, Joined) and not tied & set(group.members)]
    held = {name for group in groups if isinstance(group, Mixed) for name in group.held}
    return _Plan(silent, groups, (*ties, *own), frozenset((held | set(silent)) - set(priors)))


def _free_names(robot: Robot, parameters: Sequence[str] | None, fixed: Sequence[str]) -> list[str] | None:
    if not fixed:
        return None if parameters is None else list(parameters)
    names = list(robot.identify if parameters is None else parameters)
    for name in fixed:
        if name not in names:
            raise BeamstiffError(f"fixed: {name!r} is not among the parameters{suggest(name, names)}")
    left = [name for name in names if name not in fixed]
    if not left:
        raise BeamstiffError(f"all parameters ({listed(names)}) are fixed: nothing is left to identify")
    return left


def _combinations(
    robot: Robot, group: Joined | Mixed, stated: Parameters, stiffness: Array, spread: Uncertainty
) -> list[Combination]:
    """Return the sums of a group that are known, with the standard deviations of their values."""
    values = dict(zip(stated.names, stiffness.tolist(), strict=True))
    unit = parameter_unit(robot, group.members[0])
    if isinstance(group, Mixed) and not group.sums:
        return [Combination(group.members, "", None, None, "mixed", unit)]
    result = []
    for sum_ in [group] if isinstance(group, Joined) else group.sums:
        slopes = sum_.value_slopes(values)
        by_log = np.array([slopes.get(name, 0.0) * values[name] for name in stated.names])
        by_theta = by_log @ stated.sums
        felt = by_theta != 0
        covariance = spread.covariance[np.ix_(felt, felt)]
        std = float(np.sqrt(by_theta[felt] @ covariance @ by_theta[felt]))
        kind = sum_.kind if isinstance(sum_, Joined) else "sum"
        inverse = {"N/m": "m/N", "N*m/rad": "rad/(N*m)", "Pa": "1/Pa"}[unit]
        result.append(
            Combination(
                sum_.members,
                sum_.text(),
                sum_.value(values),
                std if np.isfinite(std) else None,
                kind,
                unit if kind == "parallel" else inverse,
            )
        )
    return result


def _parameter(
    name: str,
    unit: str,
    value: float,
    variance: float,
    spread: Uncertainty,
    plan: _Plan,
    combinations: Sequence[Combination],
) -> Parameter:
    if name in plan.silent:
        return Parameter(name, unit, None, None, False, lower_bound=0.0, reason=plan.silent[name])
    if name in plan.grouped:
        group = next(group.members for group in plan.groups if name in group.members)
        others = listed([other for other in group if other != name])
        # in a sum of compliances each is at most the sum (coefficient 1 only: else the unit may differ)
        bounds = [
            1.0 / (item.value + spread.quantile * item.std)
            for item in combinations
            if item.kind == "series" and f"1/{name}" in item.relation.split(" + ")
            if item.value is not None and item.std is not None
        ]
        reason = f"acts only together with {others}"
        return Parameter(name, unit, None, None, False, lower_bound=max(bounds, default=0.0), reason=reason)
    relative = float(np.sqrt(variance))
    if not np.isfinite(relative):
        return Parameter(name, unit, None, None, False, lower_bound=0.0, reason="these data do not tell it")
    low, high = stiffness_interval(value, relative, spread.quantile)
    if np.isinf(high):
        reason = "these data do not bound it from above: rigid would fit nearly as well"
        return Parameter(name, unit, None, None, False, (low, high), low, reason)
    return Parameter(name, unit, value, value * relative, True, (low, high))
