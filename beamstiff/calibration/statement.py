"""A calibration stated before it is estimated: what is sought, what the poses tell, where to start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.calibration.elastic import build_elastic, compliance_parameters, compliances_of, felt_names
from beamstiff.calibration.error_jacobian import Geometry, build_geometry
from beamstiff.calibration.identifiability import NOTICED, Identifiability, identifiability
from beamstiff.calibration.instruments import begun, camera_parameters, instrument_parameters, knows_a_frame
from beamstiff.calibration.least_squares import estimate
from beamstiff.calibration.parameters import (
    AXES,
    STANDS,
    TURNS,
    base_names,
    choose_parameters,
    known_parameters,
)
from beamstiff.calibration.problem import Problem, build_problem, with_encoders
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.measure.registration import check_spread, fit_rigid_motion, lay_over
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import HELD, free_of
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE
from beamstiff.robot.frames import widened
from beamstiff.robot.loops import loop_equations, loop_system
from beamstiff.robot.newton import least_squares
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

ROWS = 100  # that say where base and reflectors are, to begin with
ROUNDS = 100  # of base and reflectors in turn
FAR_OFF = 1 / 3  # of what reflectors leave where the file has them, that is left where they fit best


@dataclass(frozen=True, eq=False)
class Statement:
    """A calibration ready to be estimated."""

    robot: Robot
    problem: Problem
    begin: Array  # (t,)
    identifiability: Identifiability
    notes: tuple[str, ...] = ()

    @property
    def identified(self) -> tuple[str, ...]:
        """What is sought: the minimal set that the readings, and what is known beforehand, hold."""
        return self.identifiability.identified


class Stated(TypedDict, total=False):
    """What a problem is stated with, arguments of `state_problem`."""

    fixed: Sequence[str]
    last: Sequence[str]
    compliances: Sequence[str]
    priors: Mapping[str, float] | None
    stations: bool
    encoders: bool


def build_calibration(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    *,
    noticed: float = NOTICED,
    near: Mapping[str, float] | None = None,
    **stated: Unpack[Stated],
) -> Statement:
    """State a calibration: what is observable, where to start; arguments as of `state_problem`.

    `near`: parameters of a like calibration by name, which the search starts from.
    """
    problem, of_problem = state_problem(robot, measurements, parameters, **stated)
    rows, every, poses = problem.rows, problem.parameters, len(problem.geometry.poses)
    start = registered(problem, problem.expected)
    problem = with_set_ups(problem, start)
    held = consistent(problem, start) if rows.targets else start
    _, jacobian = problem.linearised(held, deformed=False)
    seen = identifiability(jacobian, every, noticed)
    known = np.isin(seen.names, seen.identified)
    start = np.where(known, held, start)
    if near is not None:  # what can be seen is judged of the robot as described all the same
        ended = [near.get(item.name, value) for item, value in zip(every, problem.expected, strict=True)]
        start = np.where(known, ended, start)
    if not seen.identified:
        raise BeamstiffError(f"{rows.source}: the readings show none of {listed(seen.names)}")
    told = problem.count + int(np.isfinite(problem.prior).sum())
    if told <= len(seen.identified):
        raise BeamstiffError(
            f"{rows.source}: {problem.count} measured values in {poses} {'pose' if poses == 1 else 'poses'} "
            f"for {len(every)} parameters, of which they cannot distinguish more than {len(seen.identified)} "
            "and leave nothing to check the fit; measure more poses, or seek fewer parameters"
        )
    notes = list(of_problem)
    if told < 2 * len(seen.identified):
        notes.append(
            f"{problem.count} measured values in {poses} poses for {len(seen.identified)} parameters: little "
            "is left to check the fit"
        )
    return Statement(robot, problem, start, seen, tuple(notes))


def state_problem(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    last: Sequence[str] = (),
    compliances: Sequence[str] = (),
    priors: Mapping[str, float] | None = None,
    stations: bool = False,
    encoders: bool = False,
) -> tuple[Problem, tuple[str, ...]]:
    """Return the problem of a calibration, arguments as of `calibrate`, and notes on it.

    `encoders`: those behind the gears count for the compliances.
    """
    rows = concatenate(measurements)
    _check_readings(robot, rows)
    stiffness = stiffness_parameters(robot)
    for name in compliances:
        if name not in stiffness:
            raise BeamstiffError(
                f"robot {robot.name!r} has no stiffness {name!r}{suggest(name, stiffness)}; expected for "
                "instance J2.torsional"
            )
        if stiffness[name] == FREE:
            raise BeamstiffError(f"robot {robot.name!r}: {name} is free: there is no compliance to estimate")
    turned = bool(rows.measured_mask[:, 3:].any())
    places = len(rows.sources) if stations else 1
    known = known_parameters(robot, list(dict.fromkeys(rows.point.tolist())), turned, places)
    known = (*known, *camera_parameters(rows))
    if not knows_a_frame(rows):  # every frame that the set-ups are in is as good as the robot's own
        fixed = (*fixed, *base_names(places))
    if rows.targets and stations:
        raise BeamstiffError(
            f"{rows.source}: found a {rows.targets[0].instrument} beside stations, which only trackers have"
        )
    set_ups = instrument_parameters(rows)
    alone = set_ups and parameters is not None and not parameters
    chosen = set_ups if alone else (*choose_parameters(robot, known, parameters, fixed, last), *set_ups)
    opening = opening_parameters(build_geometry(robot, rows, chosen, places))
    refuse_opening(opening, [*(parameters or ()), *(priors or ())])
    chosen = tuple(item for item in chosen if item.name not in opening)
    geometry = build_geometry(robot, rows, chosen, places)
    felt = felt_names(robot, rows, compliances) if compliances else []
    if compliances and not felt:
        raise BeamstiffError(
            f"{rows.source}: nothing loads {listed(compliances)}: neither gravity on what they carry "
            "(`masses`, `density`) nor any row's wrench"
        )
    elastic = build_elastic(robot, rows, felt)
    every = (*chosen, *compliance_parameters(robot, elastic))
    every = tuple(replace(item, size=(priors or {}).get(item.name, item.size)) for item in every)
    start = np.concatenate([np.zeros(len(chosen)), compliances_of(robot, elastic)])
    problem = build_problem(geometry, elastic, every, start, priors)
    problem, notes = with_encoders(problem, robot) if encoders else (problem, ())
    if opening:
        notes += (
            f"not sought: {listed(opening)}: loop {listed(dict.fromkeys(opening.values()))} would not close",
        )
    idle = [name for name in compliances if name not in felt]
    return problem, (*notes, *([f"nothing loads {listed(idle)}: held as in the robot"] if idle else ()))


def with_set_ups(problem: Problem, theta: Array) -> Problem:
    """Return the problem with set-ups of instruments where they fit the points of parameters (t,) best."""
    if not problem.rows.targets:
        return problem
    rows = begun(problem.rows, problem.placed(theta).position)
    return replace(problem, geometry=replace(problem.geometry, rows=rows))


def consistent(problem: Problem, begin: Array) -> Array:
    """Return parameters (t,) near what the robot says, at which points sit where the instruments have them.

    Off them a turn of the whole robot, or its scale, would seem to show in readings that it leaves alone.
    """
    near = replace(problem, prior=np.minimum(problem.prior, problem.size))
    return estimate(near, begin, [item.name for item in problem.parameters]).theta


def _check_readings(robot: Robot, rows: Measurements) -> None:
    """Refuse rows that are not absolute, or hold nothing."""
    if rows.kind != "absolute":
        raise BeamstiffError(
            f"{rows.source}: found displacements (dx dy dz), expected absolute positions (x y z) or poses: "
            "loaded minus unloaded hardly shows geometry"
        )
    used = rows.measured_mask
    if not used.any():
        raise BeamstiffError(
            f"{rows.source}: no row holds a whole position, expected all of x y z (and a b c)"
        )
    stated = np.isfinite(rows.sigma)[used]
    if stated.any() and not stated.all():
        raise BeamstiffError(
            f"{rows.source}: the noise of some values is stated (sigma_position, sigma_rotation), that of "
            "others is not; expected it for all, or for none"
        )
    if robot.effects:
        raise BeamstiffError(
            f"robot {robot.name!r} has effects, which are not part of this fit; take them off the readings "
            "first: robot, rows = beamstiff.diagnosis.without_effects.without_effects(robot, rows)"
        )


def opening_parameters(geometry: Geometry) -> dict[str, str]:
    """Return the parameters that no passive motion makes up for, each with the loop that they open.

    A planar loop that is closed as a point (``constrain: position``) closes for its nominal geometry only;
    ``constrain: plane`` leaves the third direction to the bearings' play.
    """
    kinematics = geometry.kinematics
    if not kinematics.loops or not geometry.frame_columns:
        return {}
    posture = geometry.postures(np.zeros(len(geometry.parameters)))
    wide = widened(kinematics, [(frame, motion) for _, frame, motion in geometry.frame_columns])
    system = loop_system(wide)
    joined = kinematics.coupling
    free = free_of(kinematics, posture.values)
    few = free[np.unique(np.linspace(0, len(free) - 1, 8).astype(np.intp))]
    nothing = np.zeros((len(few), len(geometry.frame_columns)))
    few = np.concatenate([few[:, : joined.actuated], nothing, few[:, joined.actuated :]], axis=1)
    _, jacobian = loop_equations(system, few)
    passive = jacobian[:, :, system.actuated :]
    found = {}
    for at, (number, _, _) in enumerate(geometry.frame_columns):
        column = jacobian[:, :, joined.actuated + at]
        left = np.abs(column - (passive @ least_squares(passive, column)[:, :, None])[:, :, 0])
        if left.max() > HELD:
            row = int(left.max(axis=0).argmax())
            ends = zip(kinematics.loops, system.rows, strict=True)
            loop = next(loop.name for loop, part in ends if row < part.stop)
            found[geometry.parameters[number].name] = loop
    return found


def refuse_opening(opening: Mapping[str, str], names: Sequence[str]) -> None:
    """Refuse parameters that were asked for by name and open a loop."""
    if asked := [name for name in names if name in opening]:
        loop = opening[asked[0]]
        raise BeamstiffError(
            f"{listed(asked)}: loop {loop!r} closes with the present value only (constrain: position or "
            "pose); with constrain: plane it closes in its plane"
        )


def registered(problem: Problem, theta: Array) -> Array:
    """Return parameters (t,) with base, reflectors and the target's turn where the readings have them.

    Each only where all of it is sought; a start, not an estimate.
    """
    result = theta.copy()
    at = {item.name: number for number, item in enumerate(problem.parameters)}
    rows = problem.rows
    geometry, compliance = problem.split(theta)
    placed, jacobian = problem.geometry.jacobian(geometry, problem.elastic.displacement(compliance))
    places = [
        number
        for number, item in enumerate(problem.parameters)
        if item.group == "target" and item.unit == "m" and np.isinf(problem.prior[number])
    ]
    turn = np.tile(np.eye(3), (len(rows), 1, 1))
    for station, base in enumerate(base_names(problem.geometry.stations)):
        sought = [at[f"{base}.{name}"] for name in (*AXES, *TURNS) if f"{base}.{name}" in at]
        own = (problem.geometry.station == station) & rows.by_tracker
        seen = np.flatnonzero(own & problem.used[:, :3].all(axis=1))
        if len(sought) < 6:
            continue
        try:
            check_spread(placed.position[seen], rows.source)
        except BeamstiffError:
            continue  # too few points: the base stays, and identifiability will say so
        own_places = places if station == 0 and not rows.camera else []
        some = seen[np.unique(np.linspace(0, len(seen) - 1, ROWS).astype(np.intp))]
        columns = jacobian[some, :3][:, :, own_places]
        described = fit_rigid_motion(placed.position[some], rows.position[some]).rms
        laid, moved = lay_over(placed.position[some], columns, rows.position[some], ROUNDS)
        if laid.rms < FAR_OFF * described:  # else the geometry is off as well: the places tell nothing of it
            result[own_places] += moved
        offset = (jacobian[:, :3][:, :, places] @ (result - theta)[places])[seen]
        motion = fit_rigid_motion(placed.position[seen] + offset, rows.position[seen])
        turn[own] = motion.rotation
        result[sought] = [*motion.translation, *vector_from_rotation(motion.rotation)]
    target = [at[f"target.{name}"] for name in TURNS if f"target.{name}" in at]
    turned = problem.used[:, 3:].all(axis=1)
    if len(target) == 3 and turned.any():
        measured = rotation_from_vector(rows.rotation[turned])
        relative = (turn[turned] @ placed.rotation[turned]).swapaxes(-1, -2) @ measured
        result[target] = Rotation.from_matrix(relative).mean().as_rotvec()
    return result


def rigid_gap(problem: Problem) -> Array:
    """Return the residuals (N, 6) of the robot as described, laid over the readings as a rigid body.

    Base and target are fitted where they are sought, so that what is left is the robot's.
    """
    start = registered(problem, problem.expected)
    placing = [item.name for item in problem.parameters if item.group in STANDS]
    if not placing:
        return problem.gap(start)
    free = replace(problem, prior=np.full(len(start), np.inf))
    _, jacobian = free.linearised(start, deformed=False)
    seen = identifiability(jacobian, problem.parameters)
    return problem.gap(estimate(free, start, [name for name in placing if name in seen.identified]).theta)
