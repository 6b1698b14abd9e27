"""`identify`: stiffness values from measured displacements, how sure they are, and what cannot be known."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.identification.degeneracy import Mixed, find_ill_determined
from beamstiff.identification.information import Uncertainty, spread_over, uncertainty
from beamstiff.identification.minimise import Effort, Minimum, Progress, minimise
from beamstiff.identification.parameters import SPAN, Parameters, build_parameters
from beamstiff.identification.problem import Problem
from beamstiff.identification.result import Combination, Identification, Parameter
from beamstiff.identification.series_parallel import INVERSE_UNITS, Joined
from beamstiff.identification.statement import Options, Plan, Statement, build_identification
from beamstiff.identification.validation import held_out, position_rms
from beamstiff.measure.plausibility import require_usable
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import parameter_unit
from beamstiff.se3 import Array

ROUNDS = 2  # of fitting again with the errors of the inputs as they are at the values found

# between the files of one machine; poses and directions of load alone do not differ by as much
CONTRADICTION = 300.0  # times; millimetres read as metres make 1000
AT_BOUND = 1e-6  # of the logarithm
NO_RESIDUAL = 1e-9  # of the displacements, below which a residual is rounding


def identify(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    method: str = "trust-region",
    *,
    folds: int = 5,
    effort: Effort | None = None,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> Identification:
    """Identify stiffness values from measured displacements.

    `robot`: its present stiffness values are the start; all that is not among the parameters stays as it is.
    Arguments as of `beamstiff.identify`. `effort`: limits, seed and population of the method.
    """
    statement = build_identification(robot, measurements, parameters, **options)
    table = concatenate(measurements)
    require_usable(table)
    check_units(table, float(statement.problem.model.lever.max(initial=1.0)))
    first = None
    if statement.plan.held - set(statement.plan.silent):
        loose = _loose(statement, options)
        first = minimise(loose.objective, effort=effort, progress=progress)
        stiffness = loose.parameters.stiffness(first.theta)
        statement = statement.holding(stiffness)
        first = replace(first, theta=np.log(stiffness)[statement.parameters.first])
    if first is not None and first.interrupted:
        return conclude(statement, first, method, folds)
    begin = None if first is None else first.theta
    found = minimise(statement.objective, method, begin, effort, progress)
    spent = found.evaluations + (0 if first is None else first.evaluations)
    rounds = ROUNDS if statement.response is not None else 0
    for _ in range(rounds):  # the errors of the inputs weigh as they do at the values found
        if found.interrupted:
            break
        statement = statement.weighed(statement.parameters.stiffness(found.theta))
        found = minimise(statement.objective, begin=found.theta, effort=effort)
        spent += found.evaluations
    return conclude(statement, replace(found, evaluations=spent), method, folds)


def _loose(statement: Statement, options: Options) -> Statement:
    """Return the statement with nothing held that is felt.

    Where the others of a group can make up for one of them, they must stay positive: a start that is too soft
    for that would spoil the fit. Its optimum says where to hold it.
    """
    stated, plan = statement.parameters, statement.plan
    bounds, priors = options.get("bounds"), options.get("priors")
    loose = build_parameters(stated.names, stated.start, plan.ties, bounds, priors, plan.silent)
    return replace(statement, parameters=loose)


def conclude(statement: Statement, found: Minimum, method: str, folds: int = 5) -> Identification:
    """Return what a minimum that a method found says, with errors held out in so many folds (0: none)."""
    problem, objective = statement.problem, statement.objective
    stiffness = statement.parameters.stiffness(found.theta)
    told, rms = estimate(statement, found.theta), position_rms(problem, stiffness)
    by_pose = by_load = None
    if not found.interrupted:
        by_pose = held_out(objective, problem.pose, folds, found.theta)
        by_load = held_out(objective, problem.load, folds, found.theta)
    names = problem.model.parameters
    fitted = {
        name: value
        for name, value in zip(names, stiffness.tolist(), strict=True)
        if name not in statement.plan.silent  # stays in the robot as it was: rigid, say
    }
    return Identification(
        parameters=told.parameters,
        degenerate=told.combinations,
        ill_determined=find_ill_determined(statement.robot, names, stiffness, told.covariance),
        covariance=told.covariance,
        stiffness=stiffness,
        robot=statement.robot.with_parameters(fitted).with_unmeasured(names, statement.plan.silent),
        rms=rms,
        rms_held_out=None if by_pose is None else by_pose.rms,
        rms_held_out_load=None if by_load is None else by_load.rms,
        chi_square=told.chi_square,
        method=method,
        evaluations=found.evaluations,
        message=found.message,
        interrupted=found.interrupted,
        predicted=problem.model.predict(stiffness)[: problem.readings],
        held_out=by_pose,
        held_out_load=by_load,
        notes=(
            *problem.notes,
            *statement.plan.silent.values(),
            *cautions(problem, statement.parameters, found.theta, rms),
        ),
    )


@dataclass(frozen=True)
class Estimates:
    """Values with their uncertainty."""

    parameters: tuple[Parameter, ...]  # (m)
    combinations: tuple[Combination, ...]
    covariance: Array  # (m, m): of the logarithms; infinite variance of what is not identifiable by itself
    chi_square: float


def estimate(statement: Statement, theta: Array) -> Estimates:
    """Return the values at an optimum theta (t,) with their uncertainty, and the sums that are known."""
    robot, stated, plan = statement.robot, statement.parameters, statement.plan
    stiffness = stated.stiffness(theta)
    spread = uncertainty(statement.objective, theta)
    combinations = tuple(
        combination
        for group in plan.groups
        for combination in _combinations(robot, group, stated, stiffness, spread)
    )
    covariance = spread_over(spread.covariance, stated.tied)
    lost = [at for at, name in enumerate(stated.names) if name in plan.grouped or name in plan.held]
    covariance[lost, lost] = np.inf
    parameters = tuple(
        _parameter(name, parameter_unit(robot, name), value, variance, moved, spread, plan, combinations)
        for name, value, variance, moved in zip(
            stated.names, stiffness.tolist(), np.diagonal(covariance).tolist(), stated.sums, strict=True
        )
    )
    return Estimates(parameters, combinations, covariance, spread.chi_square)


def _combinations(
    robot: Robot, group: Joined | Mixed, stated: Parameters, stiffness: Array, spread: Uncertainty
) -> list[Combination]:
    """Return the sums of a group that are known, with the standard deviations of their values."""
    values = dict(zip(stated.names, stiffness.tolist(), strict=True))
    unit = parameter_unit(robot, group.members[0])
    if isinstance(group, Mixed) and not group.sums:
        return [Combination(group.members, "", None, None, "mixed", unit)]
    result = []
    for sum_ in group.sums:
        slopes = sum_.value_slopes(values)
        by_log = np.array([slopes.get(name, 0.0) * values[name] for name in stated.names])
        by_theta = by_log @ stated.sums
        felt = by_theta != 0
        covariance = spread.covariance[np.ix_(felt, felt)]
        std = float(np.sqrt(by_theta[felt] @ covariance @ by_theta[felt]))
        value, known = sum_.value(values), bool(np.isfinite(std))
        interval = None
        if known and sum_.kind == "parallel":
            interval = spread.stiffness_interval(value, by_theta / value, std / value)
        elif known:
            low, high = spread.compliance_interval(value, by_theta, std)
            interval = (low if min(sum_.ratios) < 0 else max(low, 0.0), high)
        own = unit if sum_.kind == "parallel" else INVERSE_UNITS[unit]
        told = (value, std) if known else (None, None)
        result.append(Combination(sum_.members, sum_.text(), told[0], told[1], sum_.kind, own, "", interval))
    return result


def _parameter(
    name: str,
    unit: str,
    value: float,
    variance: float,
    direction: Array,
    spread: Uncertainty,
    plan: Plan,
    combinations: Sequence[Combination],
) -> Parameter:
    if name in plan.silent:
        return Parameter(
            name, unit, None, None, False, lower_bound=0.0, reason=plan.silent[name], silent=True
        )
    if name in plan.grouped:
        group = next(group.members for group in plan.groups if name in group.members)
        others = listed([other for other in group if other != name])
        # in a sum of compliances each is at most the sum (coefficient 1 only: else the unit may differ)
        bounds = [
            1.0 / item.interval[1]
            for item in combinations
            if item.kind == "series" and f"1/{name}" in item.relation.split(" + ")
            if item.interval is not None
        ]
        reason = f"acts only together with {others}"
        return Parameter(name, unit, None, None, False, lower_bound=max(bounds, default=0.0), reason=reason)
    relative = float(np.sqrt(variance))
    if not np.isfinite(relative):
        return Parameter(
            name, unit, None, None, False, lower_bound=0.0, reason="these data do not determine it"
        )
    low, high = spread.stiffness_interval(value, direction, relative)
    if np.isinf(high):
        reason = "these data do not bound it from above: rigid would fit nearly as well"
        return Parameter(name, unit, None, None, False, (low, high), low, reason)
    return Parameter(name, unit, value, value * relative, True, (low, high))


def check_units(table: Measurements, size: float) -> None:
    """Refuse files whose displacements, rotations or noise contradict each other by hundreds of times.

    `table`: rows of several files. `size`, m: of the machine: moments compare with forces by it.
    """
    if len(table.sources) < 2:
        return
    load = np.hypot(
        np.linalg.norm(table.wrench[:, :3], axis=1), np.linalg.norm(table.wrench[:, 3:], axis=1) / size
    )
    moved, turned = (
        np.linalg.norm(np.nan_to_num(table.displacement[:, part]), axis=1)
        for part in (slice(0, 3), slice(3, 6))
    )
    known = np.where(np.isfinite(table.sigma), table.sigma, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        quantities = (
            ("displacement over load", "m/N", moved / load, "dx [mm], fx [kN]"),
            ("rotation over load", "rad/N", turned / load, "rx [deg], fx [kN]"),
            ("noise of positions", "m", known[:, :3].min(axis=1), "sigma_position: 0.03 mm"),
            ("noise of rotations", "rad", known[:, 3:].min(axis=1), "sigma_rotation: 0.01 deg"),
        )
    for what, unit, values, header in quantities:
        medians = []
        for number in range(len(table.sources)):
            own = values[(table.run == number) & np.isfinite(values) & (values > 0)]
            medians.append(float(np.median(own)) if own.size else np.nan)
        if np.isfinite(medians).sum() < 2:
            continue
        least, most = int(np.nanargmin(medians)), int(np.nanargmax(medians))
        ratio = medians[most] / medians[least]
        if ratio > CONTRADICTION:
            raise BeamstiffError(
                f"{table.sources[most]} and {table.sources[least]}: conflicting units? {what} is "
                f"{medians[most]:.2g} {unit} in the first and {medians[least]:.2g} {unit} in the second, "
                f"{ratio:.0f} times less, expected of one machine; a number without a unit is SI, write for "
                f"instance {header}"
            )


def cautions(problem: Problem, parameters: Parameters, theta: Array, rms: float) -> Iterator[str]:
    """Yield, in sentences, what limits an identification with the optimum theta (t,) and its RMS, m."""
    poses, rows = np.unique(problem.pose).size, problem.readings
    if poses == 1 and rows > 1:
        yield f"all {rows} rows are of one pose: how the model does at others is not known"
    for ends, what in ((parameters.lower, "least"), (parameters.upper, "largest")):
        for at in np.flatnonzero(np.abs(theta - ends) < AT_BOUND):
            leader = parameters.first[at]
            if abs(theta[at] - np.log(parameters.start[leader])) < np.log(SPAN) * 0.999:  # the user's
                name = parameters.names[leader]
                value = float(np.exp(theta[at]))
                yield f"{name} lies at the {what} value allowed, {value:.4g}: the data ask for another"
    size = float(np.abs(problem.measured[:, :3]).max(initial=0.0))
    if not problem.sigma_known and rms <= NO_RESIDUAL * size:
        yield (
            "no noise is stated and no residual is left: the standard deviations say nothing; state "
            "sigma_position in the table"
        )
