"""Geometric calibration, with compliances in the same estimate where they are asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from beamstiff.calibration.corrected import corrected, nominal_value
from beamstiff.calibration.elastic import build_elastic, is_compliant, is_rigid
from beamstiff.calibration.identifiability import NOTICED, Identifiability, identifiability
from beamstiff.calibration.instruments import settled, start_of
from beamstiff.calibration.least_squares import Estimate, covariance_of, estimate
from beamstiff.calibration.parameters import ANGLE, GEOMETRY, LENGTH, SOFTER, STANDS
from beamstiff.calibration.problem import Problem
from beamstiff.calibration.result import Calibration, Found, calibrated_parameters, errors_of
from beamstiff.calibration.statement import Statement, build_calibration, registered, rigid_gap
from beamstiff.calibration.validation import held_out
from beamstiff.calibration.variance_components import spread_over_noise
from beamstiff.errors import listed, optional
from beamstiff.measure.outlier_gap import far_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, transform, vector_from_rotation

ROUNDS = 5  # of calibrating and correcting the elastic displacement
SETTLED = 1e-2  # of the noise: change of the elastic displacement below which the rounds end
DEVIATION = {"m": LENGTH, "rad": ANGLE}
UNREALISTIC = 100.0  # of these, 6 deg or 0.1 m: a joint whose zero was lost is off by less
CHANCE = 0.05  # of so large a residual, below which the stated noise is not believed


def calibrate(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    last: Sequence[str] = (),
    compliances: Sequence[str] = (),
    priors: Mapping[str, float] | None = None,
    method: str = "levenberg-marquardt",
    noticed: float = NOTICED,
    folds: int = 5,
    stations: bool = False,
    encoders: bool = False,
    shrink: bool = True,
    balance: bool = True,
    near: Mapping[str, float] | None = None,
    spread: float = np.inf,
) -> Calibration:
    """Calibrate the geometry of a robot from measured absolute positions, or poses.

    Weighted least squares over the parameters that the poses can distinguish; the others stay as they are.
    Gravity, payload and loads act as the robot's stiffness says; the stiffness values called `compliances`
    are estimated along with the geometry.

    Arguments as of `beamstiff.calibrate`; `priors` are standard deviations about the robot's values, SI.
    `encoders`: those behind the gears count for the compliances. `shrink`: what is known beforehand counts
    beside what the readings scatter, where that is more than is stated. `balance`: rotations count for no
    more than positions by what both scatter, see `_balanced`. `near`: parameters of a like
    calibration by name, which the search starts from. `spread`: of lengths and angles about those described,
    in realistic deviations.
    """
    statement = build_calibration(
        robot,
        measurements,
        parameters,
        fixed=fixed,
        last=last,
        compliances=compliances,
        priors=priors,
        noticed=noticed,
        stations=stations,
        encoders=encoders,
        near=near,
    )
    if spread < np.inf:
        statement = replace(statement, problem=_within(statement.problem, spread))
    problem, found = _settled(statement, method)
    while len((seen := _seen(statement, problem, found, noticed)).identified) > len(statement.identified):
        statement = replace(statement, begin=found.theta, identifiability=seen)
        problem, found = _settled(statement, method)
    if balance and _beyond_noise(problem, found, statement):
        statement, problem, found = _balanced(statement, problem, found, method)
    shown = None
    if shrink and _beyond_noise(problem, found, statement):
        problem, found, shown = _shrunk(statement, problem, found, method)
    result = replace(_told(statement, problem, found, method, folds), spread=shown)
    untouched = {*compliances} - {*problem.elastic.names} | {*seen.silent}
    return replace(result, robot=result.robot.with_unmeasured(compliances, untouched))


def _within(problem: Problem, spread: float) -> Problem:
    """Return the problem with lengths and angles as described, but for so many realistic deviations."""
    geometry = np.array([item.group in GEOMETRY for item in problem.parameters])
    width = np.where(geometry, spread * problem.size, np.inf)
    return replace(problem, prior=np.minimum(problem.prior, width))


def _beyond_noise(problem: Problem, found: Estimate, statement: Statement) -> bool:
    """Return whether so large a residual is no chance under the noise as stated, or none is stated."""
    residual = problem.residuals(found.theta)
    freedom = max(_freedom(residual, statement), 1)
    return not problem.claimed or bool(stats.chi2.sf(float(residual @ residual), freedom) < CHANCE)


def _balanced(
    statement: Statement, problem: Problem, found: Estimate, method: str
) -> tuple[Statement, Problem, Estimate]:
    """Return the calibration in which rotations count for no more than positions, by what both scatter.

    What a camera or a body of markers reads of a turn is known less well than where it stands, and its noise
    is seldom stated as it is. Rotations that scatter more than stated, or usual, beyond what positions do,
    would pull these away from where they were read.
    """
    known = np.isin([item.name for item in problem.parameters], statement.identified)
    turned = np.tile(np.arange(6) >= 3, (len(problem.used), 1))[problem.used]
    if turned.all() or not turned.any():
        return statement, problem, found
    stated = problem.sigma
    for _ in range(ROUNDS):
        residual, jacobian = problem.linearised(found.theta)
        fitted = (np.linalg.qr(jacobian[:, known])[0] ** 2).sum(axis=1)[: problem.count]
        squares, free = residual[: problem.count] ** 2, 1.0 - fitted
        scatter = [squares[own].sum() / max(free[own].sum(), 1.0) for own in (~turned, turned)]
        ratio = np.sqrt(scatter[1] / max(scatter[0], 1e-300))
        sigma = problem.sigma * np.where(np.arange(6) < 3, 1.0, ratio)
        sigma = np.maximum(sigma, stated)
        if np.allclose(sigma, problem.sigma, rtol=0.05, atol=0.0):
            break
        problem = replace(problem, sigma=sigma)
        statement = replace(statement, problem=replace(statement.problem, sigma=sigma), begin=found.theta)
        problem, found = _settled(statement, method)
    more = float((problem.sigma / stated)[problem.used].max())
    if more > 1.0:
        note = (
            f"rotations scatter {more:.2g} times as much beside their noise as positions do: they count with "
            "what they scatter"
        )
        statement = replace(statement, notes=(*statement.notes, note))
    return statement, problem, found


def _shrunk(
    statement: Statement, problem: Problem, found: Estimate, method: str
) -> tuple[Problem, Estimate, float | None]:
    """Return the estimate in which what is known beforehand counts beside what the readings scatter.

    The noise that is left tells how much they say, not the stated one: many lengths and angles of few
    readings stay near the robot as described, by as much as the readings show it to be off. And that, in
    realistic deviations, if any is sought.
    """
    at = [number for number, item in enumerate(problem.parameters) if item.name in statement.identified]
    known = [
        number
        for number in at
        if problem.parameters[number].group in GEOMETRY and np.isinf(problem.prior[number])
    ]
    compliant = np.array([item.group == "compliance" for item in problem.parameters])
    stated = np.where(compliant & np.isinf(problem.prior), SOFTER * problem.size, problem.prior)
    spread = None
    for _ in range(ROUNDS):
        before = problem.prior
        noise = max(_noise_factor(problem.residuals(found.theta), statement), problem.claimed)
        prior = stated / noise
        if known:
            open_problem = replace(problem, prior=prior)
            residual, jacobian = open_problem.linearised(found.theta)
            left = residual - jacobian[:, known] @ (problem.expected - found.theta)[known]
            free = jacobian[:, sorted({*at} - {*known})]
            ratio = spread_over_noise(left, free, jacobian[:, known] * problem.size[known])
            prior[known] = ratio * problem.size[known]
            spread = ratio * noise
        problem = replace(problem, prior=prior)
        found = estimate(problem, found.theta, statement.identified, method)
        if np.allclose(prior, before, rtol=0.1):
            break
    return *_settled(replace(statement, problem=problem, begin=found.theta), method), spread


def _seen(statement: Statement, problem: Problem, found: Estimate, noticed: float) -> Identifiability:
    """Return what can be identified about an estimate.

    That may be more than before it: a reflector that was guessed on an axis hid its zero, or the robot is
    off by more than is realistic. Its own deviations over what is left of the readings then count in place of
    the realistic ones over the noise: the mean square of what was found, less what noise adds to it.
    """
    own = np.array(
        [
            item.group in ("offset", "frame") and item.name in statement.identified
            for item in problem.parameters
        ]
    )
    if own.any():
        noise = max(1.0, _noise_factor(problem.residuals(found.theta), statement))
        variance = noise**2 * np.diag(covariance_of(problem, found.theta, statement.identified))
        moved = ((found.theta - problem.expected) ** 2 - variance)[own] / problem.size[own] ** 2
        noticed *= noise / np.sqrt(max(moved.mean(), 1.0))
    _, jacobian = problem.linearised(found.theta, deformed=False)
    return identifiability(jacobian, problem.parameters, noticed)


def _noise_factor(residual: Array, statement: Statement) -> float:
    """Return the residual (n + p,) over the noise as stated; 1 where none is left."""
    freedom = _freedom(residual, statement)
    return float(np.sqrt(residual @ residual / freedom)) if freedom > 0 else 1.0


def _freedom(residual: Array, statement: Statement) -> int:
    """Return how many values of a residual (n + p,) are free; what is known of held parameters is none."""
    names = np.array([item.name for item in statement.problem.parameters])
    held = np.isfinite(statement.problem.prior) & ~np.isin(names, statement.identified)
    return residual.size - len(statement.identified) - int(held.sum())


def _settled(statement: Statement, method: str) -> tuple[Problem, Estimate]:
    """Return the estimate, the elastic displacement evaluated for the robot found."""
    problem, begin = statement.problem, statement.begin
    compliant = bool(problem.elastic.names) or is_compliant(statement.robot)
    changed = [at for at, item in enumerate(problem.parameters) if item.group not in STANDS]
    if compliant and (begin != problem.expected)[changed].any():
        problem = _deformed(statement, problem, begin)
    found = estimate(problem, begin, statement.identified, method)
    if not compliant:
        return problem, found
    for _ in range(ROUNDS):
        before, problem = problem, _deformed(statement, problem, found.theta)
        compliance = problem.split(found.theta)[1]
        moved = problem.elastic.displacement(compliance) - before.elastic.displacement(compliance)
        again = estimate(problem, found.theta, statement.identified, method)
        found = replace(again, costs=np.concatenate([found.costs, again.costs[1:]]))
        if (np.abs(moved) / problem.sigma)[problem.used].max(initial=0.0) < SETTLED:
            break
    return problem, found


def _deformed(statement: Statement, problem: Problem, theta: Array) -> Problem:
    """Return the problem with the elastic displacement of the robot with parameters (t,)."""
    robot = calibrated(statement.robot, problem, theta)
    before = problem.elastic  # sizes are scales of the search: they stay
    return replace(problem, elastic=build_elastic(robot, problem.rows, before.names, before.size))


def calibrated(robot: Robot, problem: Problem, theta: Array) -> Robot:
    """Return the robot with parameters theta (t,): geometry and compliances, what fell to zero as rigid."""
    changes: dict[str, float] = {}
    stiffness: dict[str, float] = {}
    for item, value in zip(problem.parameters, theta.tolist(), strict=True):
        if item.group == "compliance":
            stiffness[item.name] = np.inf if is_rigid(item, value) else 1.0 / value
        elif item.group not in ("base", "instrument"):
            changes[item.name] = value
    return corrected(robot, changes, problem.geometry.poses[:1]).with_parameters(stiffness)


def _told(statement: Statement, problem: Problem, found: Estimate, method: str, folds: int) -> Calibration:
    theta, seen = found.theta, statement.identifiability
    placed = problem.placed(theta)
    gap = problem.gap_from(placed, theta)
    residual = problem.residuals(theta)
    factor = _noise_factor(residual, statement)
    covariance = covariance_of(problem, theta, statement.identified)
    widened = _beyond_noise(problem, found, statement)
    if widened:
        covariance = covariance * factor**2
    std = np.sqrt(np.diag(covariance))
    sought = set(statement.identified)
    parameters = []
    for item, value, start, spread in zip(problem.parameters, theta, problem.expected, std, strict=True):
        instrument = item.group == "instrument"
        nominal = start_of(problem.rows, item.name) if instrument else nominal_value(statement.robot, item)
        found_value = 0.0 if is_rigid(item, value) else nominal + float(value - start)
        parameters.append(Found(item, nominal, found_value, float(spread) if item.name in sought else None))
    rotation, position = problem.geometry.bases(problem.split(theta)[0])
    held, worse, left_out = None, list[str](), list[str]()
    with optional("the error of poses held out", left_out.append):
        held = held_out(statement.identified, problem, theta, method, folds)
        worse += _worse(statement, held, folds)
    return Calibration(
        robot=calibrated(statement.robot, problem, theta).model_copy(
            update={"calibrated": calibrated_parameters(parameters, covariance, statement.robot.calibrated)}
        ),
        bases=transform(rotation, position),
        target=problem.geometry.target(problem.split(theta)[0]),
        parameters=tuple(parameters),
        covariance=covariance,
        identifiability=seen,
        after=errors_of(gap, problem.used),
        held_out=None if held is None else errors_of(held, problem.used),
        predicted=np.concatenate([placed.position, vector_from_rotation(placed.rotation)], axis=1),
        residual=np.where(problem.used, gap, np.nan),
        held_out_residual=None if held is None else np.where(problem.used, held, np.nan),
        sigma=problem.sigma,
        pose=problem.geometry.pose.astype(np.int64),
        noise=factor,
        claimed=problem.claimed,
        method=method,
        message="converged" if found.converged else "stopped before it converged",
        costs=found.costs,
        notes=(
            *statement.notes,
            *_notes(problem, found, factor, widened),
            *_unrealistic(parameters),
            *_far_rows(problem, gap),
            *worse,
            *left_out,
        ),
        statement=statement,
        targets=tuple(settled(one, problem.values(theta)) for one in problem.rows.targets),
    )


def _unrealistic(parameters: Sequence[Found]) -> Iterator[str]:
    """Yield which zeros, lengths and angles changed by more than any robot is off from its description."""
    own = [one for one in parameters if one.parameter.group in GEOMETRY and one.identified]
    far = [one for one in own if abs(one.change) > UNREALISTIC * DEVIATION[one.parameter.unit]]
    if far:
        shown = {"m": (1e3, "mm"), "rad": (180.0 / np.pi, "deg")}
        units = [(one, *shown[one.parameter.unit]) for one in far]
        told = [f"{one.name} by {factor * one.change:.3g} {unit}" for one, factor, unit in units]
        are = "are errors" if len(far) > 1 else "is an error"
        yield (
            f"{listed(told, 4)} {are} that no robot has: another zero or sense of the joint in the robot "
            "file, or readings that do not determine it; compare the zeros, or free less (parameters "
            "offsets, or a prior)"
        )


def _far_rows(problem: Problem, gap: Array) -> Iterator[str]:
    """Yield which rows are far off all others."""
    if not (problem.rows.targets or problem.rows.camera):
        sigma, used = problem.sigma[:, :3] * problem.claimed, problem.used[:, :3]
        yield from far_rows(problem.rows, gap[:, :3], sigma, used)


def _worse(statement: Statement, held: Array | None, folds: int) -> Iterator[str]:
    """Yield that poses which were held out are farther off than with the robot as described, if so.

    Of that, too, the base and the reflectors are fitted without them.
    """
    if held is None:
        return
    laid_over = rigid_gap(statement.problem)
    if _position_rms(held, statement) <= _position_rms(laid_over, statement):
        return
    problem = statement.problem
    placing = [item.name for item in problem.parameters if item.group in STANDS]
    placing = [name for name in placing if name in statement.identified]
    if set(placing) == set(statement.identified):  # nothing else is fitted that could be worse
        return
    if placing:
        start = registered(problem, problem.expected)
        left = held_out(placing, problem, start, "levenberg-marquardt", folds)
        laid_over = laid_over if left is None else left
    after, before = _position_rms(held, statement), _position_rms(laid_over, statement)
    if after > before:
        yield (
            f"poses that were held out are off by {1e3 * after:.3g} mm, with the robot as described by "
            f"{1e3 * before:.3g} mm: do not use this calibration; measure more poses, or free less "
            "(parameters base,target,offsets)"
        )


def _position_rms(gap: Array, statement: Statement) -> float:
    return errors_of(gap, statement.problem.used).position_rms or 0.0


def _notes(problem: Problem, found: Estimate, factor: float, widened: bool) -> tuple[str, ...]:
    notes = []
    if not found.converged:
        notes.append("the estimate stopped before it converged")
    if problem.claimed and widened:
        notes.append(
            f"the residual is {factor:.2g} times the stated noise: the model is incomplete; the standard "
            "deviations are scaled by this factor and do not cover the bias of an incomplete model"
        )
    if rigid := [
        item.name
        for item, value in zip(problem.parameters, found.theta, strict=True)
        if item.group == "compliance" and value <= 1e-3 * item.size
    ]:
        notes.append(f"{listed(rigid)}: no compliance shows, as good as rigid")
    return tuple(notes)
