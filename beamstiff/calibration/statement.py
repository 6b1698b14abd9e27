"""A calibration stated before it is estimated: what is sought, what the poses tell, where to start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.calibration.elastic import (
    build_elastic,
    compliance_parameters,
    compliances_of,
    felt_names,
)
from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.observability import NOTICED, Observability, observability
from beamstiff.calibration.opening import opening_parameters, refuse_opening
from beamstiff.calibration.parameters import choose_parameters, known_parameters
from beamstiff.calibration.problem import Problem, build_problem
from beamstiff.calibration.registration import registered
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE
from beamstiff.robot.stiffness import stiffness_parameters
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class Statement:
    """A calibration ready to be estimated."""

    robot: Robot
    problem: Problem
    begin: Array  # (t,)
    observability: Observability
    notes: tuple[str, ...] = ()

    @property
    def identified(self) -> tuple[str, ...]:
        """What is sought: the minimal set that the readings, and what is known beforehand, hold."""
        return self.observability.identified


def build_calibration(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    last: Sequence[str] = (),
    compliances: Sequence[str] = (),
    priors: Mapping[str, float] | None = None,
    noticed: float = NOTICED,
    stations: bool = False,
) -> Statement:
    """State a calibration, arguments as of `calibrate`: what is sought and observable, where to start."""
    rows = measurements if isinstance(measurements, Measurements) else concatenate(measurements)
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
    chosen = choose_parameters(robot, known, parameters, fixed, last)
    opening = opening_parameters(build_geometry(robot, rows, chosen, places))
    refuse_opening(opening, [*(parameters or ()), *(priors or ())])
    chosen = tuple(item for item in chosen if item.name not in opening)
    geometry = build_geometry(robot, rows, chosen, places)
    felt = felt_names(robot, rows, compliances) if compliances else []
    elastic = build_elastic(robot, rows, felt)
    every = (*chosen, *compliance_parameters(robot, elastic))
    every = tuple(replace(item, size=(priors or {}).get(item.name, item.size)) for item in every)
    start = np.concatenate([np.zeros(len(chosen)), compliances_of(robot, elastic)])
    problem = build_problem(geometry, elastic, every, start, priors)
    begin = registered(problem, start)
    _, jacobian = problem.linearised(begin, deformed=False)
    seen = observability(jacobian, every, noticed)
    if not seen.identified:
        raise BeamstiffError(f"{rows.source}: the readings show none of {listed(seen.names)}")
    told = problem.count + int(np.isfinite(problem.prior).sum())
    poses = len(geometry.poses)
    if told <= len(seen.identified):
        raise BeamstiffError(
            f"{rows.source}: {problem.count} measured values in {poses} {'pose' if poses == 1 else 'poses'} "
            f"for {len(every)} parameters, of which they cannot tell apart more than {len(seen.identified)} "
            "and leave nothing to check the fit; measure more poses, or seek fewer parameters"
        )
    idle = [name for name in compliances if name not in felt]
    notes = [f"nothing loads {listed(idle)}: held as in the robot"] if idle else []
    if told < 2 * len(seen.identified):
        notes.append(
            f"{problem.count} measured values in {poses} poses for {len(seen.identified)} parameters: little "
            "is left to check the fit"
        )
    return Statement(robot, problem, begin, seen, tuple(notes))


def _check_readings(robot: Robot, rows: Measurements) -> None:
    """Refuse rows that are not absolute, or hold nothing."""
    if rows.kind != "absolute":
        raise BeamstiffError(
            f"{rows.source}: found displacements (dx dy dz), expected absolute positions (x y z) or poses: "
            "loaded minus unloaded hardly shows geometry"
        )
    used = rows.measured_mask
    if not used.any():
        raise BeamstiffError(f"{rows.source}: found no absolute reading, expected x y z (and a b c)")
    stated = np.isfinite(rows.sigma)[used]
    if stated.any() and not stated.all():
        raise BeamstiffError(
            f"{rows.source}: the noise of some values is stated (sigma_position, sigma_rotation), that of "
            "others is not; expected it for all, or for none"
        )
    if robot.effects:
        raise BeamstiffError(f"robot {robot.name!r} has effects, which a calibration does not count in")
